"""Changes every library crate in small ways, one at a time, and checks that something notices.

All mutants that cargo-mutants names are compiled at once, each behind a condition. A mutant is tried with the tests of its crate that reach
it, the fastest first; then with the reference's data and the machines with a rule removed; then with all other tests that reach it: the
model, the contract, the vectors, the stories, those of other crates. What only the compiler evaluates is tried by cargo-mutants itself.
Results are kept: what was noticed is not tried again unless its line has changed.
"""

import argparse
import json
import os
import random
import re
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from itertools import count, islice
from pathlib import Path
from threading import Lock

from programs import PLACE, ROOT, Check, Workspace, execute, exemptions
from source import Mutant

LINKS = {path.stem for path in (ROOT / "reference" / "sessions").glob("*.json")}
AT_ONCE = 0.3  # seconds of tests that run in one process


@cache
def lines(file: str) -> list[str]:
    return (ROOT / file).read_text().splitlines()


def keys(mutants: list[Mutant]) -> dict[int, str]:
    """What a mutant is called as long as its line is the same."""
    taken: set[str] = set()
    names = {}
    for mutant in mutants:
        what = re.sub(r"^\S+: ", "", mutant.name)
        line = lines(mutant.file)[mutant.span["start"]["line"] - 1].strip()
        name = next(name for number in count() if (name := f"{mutant.file}: {what}: {line}: {number}") not in taken)
        taken.add(name)
        names[mutant.id] = name
    return names


def stale(crates: list[str]) -> list[str]:
    """The exemptions that name no mutant of these crates."""
    packages = [word for crate in crates for word in ("--package", crate)]
    command = ["cargo", "mutants", "--no-config", "--list", *packages]
    names = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout
    return [pattern for pattern in exemptions() if not re.search(pattern, names, re.MULTILINE)]


def reaching(mutant: Mutant, levels: list[list[Check]]) -> list[list[Check]]:
    """The checks that reach a mutant, the fastest of each level first."""

    def rank(check: Check) -> tuple[int, list[str]]:
        return int(4 * check.seconds), check.command

    return [sorted((check for check in level if mutant.id in check.reached), key=rank) for level in levels]


def notices(mutant: Mutant, levels: list[list[Check]]) -> Iterator[tuple[Check, str]]:
    """One check of each file that notices a mutant, and how."""
    link = {"LINK": mutant.package} if mutant.package in LINKS else {}
    for checks in reaching(mutant, levels):
        while checks:
            group = [checks.pop(0)]
            while checks and group[0].root and checks[0].command == group[0].command:
                if sum(check.seconds for check in group) + checks[0].seconds > AT_ONCE:
                    break
                group.append(checks.pop(0))
            limit = 3 + 10 * sum(check.seconds for check in group)
            if noticed := execute(group, limit, {"MUTANT": str(mutant.id), **link}):
                yield noticed
                # The process ended there: the others of its group may not have run.
                checks = [check for check in group + checks if check.file != noticed[0].file]


def by_itself(mutants: list[Mutant]) -> dict[int, str | None]:
    """Mutants of what the compiler evaluates, compiled one at a time, against the tests of their crate."""
    found: dict[int, str | None] = {}
    for package in sorted({mutant.package for mutant in mutants}):
        chosen = [mutant for mutant in mutants if mutant.package == package]
        output = PLACE / "alone" / package
        output.mkdir(parents=True, exist_ok=True)
        names = [word for mutant in chosen for word in ("--re", f"^{re.escape(mutant.name)}$")]
        command = ["cargo", "mutants", "--package", package, "--output", str(output), *names]
        subprocess.run([*command, "--colors", "never"], cwd=ROOT, check=False)
        outcomes = json.loads((output / "mutants.out" / "outcomes.json").read_text())["outcomes"]
        summaries = {each["scenario"]["Mutant"]["name"]: each["summary"] for each in outcomes if each["scenario"] != "Baseline"}
        for mutant in chosen:
            summary = summaries.get(mutant.name, "MissedMutant")
            found[mutant.id] = None if summary == "MissedMutant" else summary
    return found


def main() -> None:
    parser = argparse.ArgumentParser(prog=".ci/mutants", description=__doc__.split("\n")[0])
    parser.add_argument("crates", nargs="*", help="library crates; all of .ci/crates if none is named")
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    parser.add_argument("--sample", type=int, help="only so many of each crate, drawn at random")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--reached", action="store_true", help="leave out, and name, what no test reaches: most of it only the compiler evaluates")
    parser.add_argument("--matrix", action="store_true", help="look for two files of tests that notice each mutant, and name those that do alone")
    args = parser.parse_args()
    listed = subprocess.run([ROOT / ".ci/crates"], check=True, capture_output=True, text=True).stdout.splitlines()
    crates = [line.split()[0] for line in listed]
    if unknown := set(args.crates) - set(crates):
        parser.error(f"no library crate: {', '.join(sorted(unknown))}; they are {', '.join(crates)}")
    unused = stale(crates)
    for pattern in unused:
        print(f"an exemption that names no mutant: {pattern}")
    crates = args.crates or crates
    workspace = Workspace(crates)
    own, data, common = workspace.checks(args.jobs)
    names = keys(workspace.mutants)
    compiled = {id for placed in workspace.placed.values() for _, _, id in placed.own}
    path = PLACE / ("matrix.json" if args.matrix else "results.json")
    results: dict[str, str] = json.loads(path.read_text()) if path.exists() else {}
    lock = Lock()
    rows, failed = [], bool(unused)
    for crate in crates:
        mutants = [mutant for mutant in workspace.mutants if mutant.package == crate and mutant.id in compiled]
        if args.sample is not None and args.sample < len(mutants):
            mutants = random.Random(args.seed).sample(mutants, args.sample)
        others = [check for other in crates if other != crate for check in own[other]]
        levels = [own[crate], data, common + others]
        alone: list[Mutant] = []
        missed: list[Mutant] = []
        begin, done = time.monotonic(), count(1)

        def attempt(mutant: Mutant) -> None:
            found = list(islice(notices(mutant, levels), 2 if args.matrix else 1))
            with lock:
                if found:
                    results[names[mutant.id]] = [check.file for check, _ in found] if args.matrix else found[0][1]
                else:
                    (missed if any(reaching(mutant, levels)) else alone).append(mutant)
                if (number := next(done)) % 100 == 0:
                    print(f"{crate}: {number} in {time.monotonic() - begin:.0f} s", flush=True)
                    path.write_text(json.dumps(results, indent=1))

        with ThreadPoolExecutor(args.jobs) as pool:
            list(pool.map(attempt, [mutant for mutant in mutants if names[mutant.id] not in results]))
        if args.reached:
            left_out = {mutant.id for mutant in alone}
            mutants = [mutant for mutant in mutants if mutant.id not in left_out]
            for mutant in alone:
                print(f"not reached: {mutant.name}", flush=True)
        elif alone:
            for id, noticed in by_itself(alone).items():
                if noticed:
                    results[names[id]] = [noticed] if args.matrix else noticed
            missed += [mutant for mutant in alone if names[mutant.id] not in results]
        path.write_text(json.dumps(results, indent=1))
        for mutant in sorted(missed, key=lambda mutant: mutant.id):
            print(f"missed: {mutant.name}", flush=True)
        rows.append((crate, len(mutants), len(mutants) - len(missed), len(missed)))
        failed |= bool(missed)
    print(f"{'':20}{'mutants':>9}{'noticed':>9}{'missed':>9}")
    for crate, *numbers in rows:
        print(f"{crate:20}{''.join(f'{number:9}' for number in numbers)}")
    if args.matrix:
        every = {check.file for check in [*data, *common, *(check for checks in own.values() for check in checks)]}
        alone_by = Counter(found[0] for name in names.values() if len(found := results.get(name, [])) == 1)
        print(f"{'mutants noticed by no other file':>34}")
        for file in sorted(every, key=lambda file: (-alone_by[file], file)):
            print(f"{alone_by[file]:9} {file}")
    sys.exit(failed)


if __name__ == "__main__":
    main()
