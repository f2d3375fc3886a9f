"""Changes a port in small ways, one at a time, and counts how many the vectors, streams and stories notice.

Usage: python3 reference/checks/mutants.py [--link LINK]… [--sample N] [--seed S] [--least PERCENT] PORT

A change of a file is run against all cases of the file's link, as testee.py makes them; where a file serves several links, against all
of theirs. Those that change nothing that can be seen stand in equivalent/PORT.txt with the reason. Prints those that nothing notices,
a table, `link: noticed of all`, and which of the clauses that comments at the changed lines name are noticed when broken; exit status 1
if a link is below 96 %, all together below 98 %, or the list is wrong; with `--least`, if all together is below that, or the list names what
is no longer there.
"""

import argparse
import random
import re
import sys
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import mutant_runs
import mutation
import testee

CHECKS = Path(__file__).resolve().parent
PORTS = CHECKS.parent / "ports"
TARGET = CHECKS.parent.parent / "target/reference"
GOAL, GOAL_OF_LINK = 98, 96
SHARED = "shared"
# A word in a file's path to its link.
WORDS = {
    "modbus": "fanuc-hmi-modbus",
    "fanuc_ls": "fanuc-ls",
    "ball": "isra-ball",
    "kawasaki": "kawasaki-msg",
    "laser": "laser-eb90",
    "mmacell": "mmacell-proto",
    "alter": "val2-alter",
    "viewer": "val2-viewer",
    "workstation": "val2-viewer",
}


@dataclass
class Port:
    """A port, by its folder."""

    folder: Path
    suffixes: tuple[str, ...]
    runs: mutant_runs.Python | mutant_runs.Command

    def files(self) -> list[Path]:
        paths = [path for path in sorted(self.folder.rglob("*")) if path.suffix in self.suffixes]
        return [path for path in paths if not re.search("testee|tests|cortex-m|examples", path.relative_to(self.folder).as_posix())]

    def link_of(self, path: Path) -> str:
        name = path.relative_to(self.folder).as_posix()
        return next((link for word, link in WORDS.items() if word in name), SHARED)


def python() -> Port:
    folder = PORTS / "python"
    return Port(folder, (".py",), mutant_runs.Python(folder, next(folder.rglob("testee.py"))))


def c() -> Port:
    folder = PORTS / "c"
    return Port(folder, (".c", ".h"), mutant_runs.Command(folder, TARGET / "mutants/c", mutant_runs.C))


def equivalent(port: str) -> dict[tuple[str, str, str, str], str]:
    """The changes of equivalent/PORT.txt, with the reason why nothing can notice them.

    FILE: FUNCTION, then lines `- before` and `+ after`, and `= reason` for all of the paragraph.
    """
    found = {}
    path = CHECKS / "equivalent" / f"{port}.txt"
    for paragraph in path.read_text().split("\n\n") if path.exists() else []:
        lines = [line for line in paragraph.splitlines() if line and not line.startswith("#")]
        reason = next((line[2:] for line in lines if line.startswith("= ")), "")
        file, function, before = "", "", ""
        for line in lines:
            if line.startswith("- "):
                before = line[2:]
            elif line.startswith("+ "):
                found[file, function, before, line[2:]] = reason
            elif not line.startswith("= "):
                file, _, function = (part.strip() for part in line.partition(":"))
    return found


def show(mutant: mutation.Mutant) -> str:
    return f"{mutant.file}: {mutant.function}\n- {mutant.before}\n+ {mutant.after}\n"


def run(port: Port, links: list[str], chosen: list[tuple[Path, mutation.Mutant]], listed: dict, traced: bool):
    """The results of each link and of each clause: how many are `noticed`, `equivalent`, `unnoticed`."""
    counts: dict[str, Counter] = {}
    clauses: dict[str, Counter] = {}
    by_link: dict[str, list[tuple[Path, mutation.Mutant]]] = {}
    for path, mutant in chosen:
        by_link.setdefault(port.link_of(path), []).append((path, mutant))
    wrong = False
    for name, mutants in sorted(by_link.items()):
        cases = [case for link in (links if name == SHARED else [name]) for _, group in testee.cases(link) for case in group]
        link = mutant_runs.Link(cases)
        loaded = port.runs.prepare(link, traced)
        count = counts[name] = Counter()
        taken = port.runs.valid([(path, mutant.changed(path.read_bytes())) for path, mutant in mutants])
        mutants = [each for each, is_taken in zip(mutants, taken) if is_taken]
        for path, mutant in mutants:
            if str(path) not in loaded:
                continue
            running = link.running(str(path), mutant.lines, mutant.nested)
            # Those that are known to run the line, then all others.
            source = mutant.changed(path.read_bytes())
            noticed = port.runs.is_noticed(link, path, source, running)
            if noticed is False and len(running) < len(link.order):
                noticed = port.runs.is_noticed(link, path, source, [case for case in link.order if case not in set(running)])
            if noticed is None:
                continue
            is_listed = mutant.name in listed
            result = "noticed" if noticed else "equivalent" if is_listed else "unnoticed"
            count[result] += 1
            for clause in mutant.clauses:
                clauses.setdefault(clause, Counter())[result] += 1
            if noticed and is_listed:
                wrong = True
                print(f"is listed as equivalent, and noticed:\n{show(mutant)}", flush=True)
            if not noticed and not is_listed:
                print(f"{show(mutant)}", flush=True)
    return counts, clauses, wrong


def required(link: str) -> tuple[set[int], list[set[int]]]:
    """The stories that are the first to reach a cell, and of each rule and of each clause that no vector and no stream names those that have it."""
    documents = [testee.load(kind, link) for kind in ("vectors", "streams")]
    named = {clause for document in documents for name in ("vectors", "refused", "streams", "values") for entry in document.get(name, []) for clause in entry.get("clauses", [])}
    having: dict[tuple[str, str], set[int]] = {}
    stories = testee.load("sessions", link)["stories"]
    for story in stories:
        rules = [(story["end"], rule) for rule in story["needs"]]
        for each in rules + [("", clause) for clause in story["clauses"] if clause not in named]:
            having.setdefault(each, set()).add(story["id"])
    return {story["id"] for story in stories if story["covers"]}, list(having.values())


def cover(port: Port, link_name: str) -> list[int]:
    """Stories that are enough: what `required` says, and one of those that notice each change that no vector and no stream does."""
    named = [(case.name.split(), request) for case, group in testee.cases(link_name) for request in group]
    story = {number: int(name[1]) for number, (name, _) in enumerate(named) if name[0] == "story"}
    link = mutant_runs.Link([request for _, request in named])
    loaded = port.runs.prepare(link, True)
    kept, choices = required(link_name)
    mutants = [(path, mutant) for path in port.files() if str(path) in loaded for mutant in mutation.mutants(path, port.folder)]
    for path, mutant in mutants:
        if port.link_of(path) not in (link_name, SHARED):
            continue
        running, source = link.running(str(path), mutant.lines, mutant.nested), mutant.changed(path.read_bytes())
        first = [case for case in running if case not in story or story[case] in kept]
        if port.runs.is_noticed(link, path, source, first) is not False:
            continue
        rest, noticing = [case for case in running if case not in set(first)], set()
        while port.runs.is_noticed(link, path, source, rest) and link.last in rest:
            noticing.add(story[link.last])
            rest = rest[rest.index(link.last) + 1 :]
        choices.append(noticing)
    while choices := [choice for choice in choices if choice and not choice & kept]:
        kept.add(Counter(number for choice in choices for number in sorted(choice)).most_common(1)[0][0])
    return sorted(kept)


def percent(count: Counter) -> float:
    return 100 * count["noticed"] / max(1, count["noticed"] + count["unnoticed"])


def table(counts: dict[str, Counter]) -> None:
    total = sum(counts.values(), Counter())
    print(f"{'':18}{'mutants':>9}{'noticed':>9}{'equivalent':>12}{'unnoticed':>11}{'percent':>9}")
    for name, count in [*counts.items(), ("all", total)]:
        cells = f"{count.total():9}{count['noticed']:9}{count['equivalent']:12}{count['unnoticed']:11}{percent(count):9.1f}"
        print(f"{name:18}{cells}")
    for name, count in counts.items():
        print(f"{name}: {count['noticed']} of {count['noticed'] + count['unnoticed']}")


def clause_table(clauses: dict[str, Counter]) -> None:
    """Those of the clauses that comments name: a change near the name is one of its rule, or of something beside it."""
    broken = {clause for clause, count in clauses.items() if count["noticed"]}
    for name in sorted(clauses.keys() - broken, key=lambda name: (name[:2], int(name[3:]))):
        if clauses[name]["unnoticed"]:
            print(f"{name}: {clauses[name]['unnoticed']} changes, none of them noticed")
    print(f"clauses that the code names, broken and noticed: {len(broken)} of {len(clauses)}")


def main() -> None:
    ports = {"python": python, "c": c}
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--link", action="append", help=f"only this link, or `{SHARED}`: files of several links")
    parser.add_argument("--sample", type=int, help="only so many, drawn at random")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--least", type=float, help="percent of all that have to be noticed, in the place of the goals")
    parser.add_argument("--cover", help="prints the stories that this link needs, as a list of their numbers")
    parser.add_argument("port", choices=ports)
    args = parser.parse_args()
    port, listed = ports[args.port](), equivalent(args.port)
    if args.cover:
        print(cover(port, args.cover))
        return
    links = sorted(path.stem for path in (CHECKS.parent / "vectors").glob("*.json"))
    found = [(path, mutant) for path in port.files() for mutant in mutation.mutants(path, port.folder)]
    gone = listed.keys() - {mutant.name for _, mutant in found}
    for name in sorted(gone):
        print("is listed as equivalent, and there is no such change: {}: {}\n- {}\n+ {}\n".format(*name))
    chosen = [(path, mutant) for path, mutant in found if not args.link or port.link_of(path) in args.link]
    if args.sample is not None and args.sample < len(chosen):
        drawn = set(random.Random(args.seed).sample(range(len(chosen)), args.sample))
        chosen = [each for number, each in enumerate(chosen) if number in drawn]
    counts, clauses, wrong = run(port, links, chosen, listed, args.sample is None)
    table(counts)
    clause_table(clauses)
    total = percent(sum(counts.values(), Counter()))
    below = total < (GOAL if args.least is None else args.least)
    below |= args.least is None and any(percent(count) < GOAL_OF_LINK for count in counts.values())
    sys.exit((wrong and args.least is None) or below or bool(gone))


if __name__ == "__main__":
    main()
