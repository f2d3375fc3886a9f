"""The workspace with its mutants compiled in, and the programs that may notice them."""

import json
import os
import re
import resource
import shutil
import signal
import struct
import subprocess
import tempfile
import time
import tomllib
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from threading import Event, Timer

from source import Mutant, Placed, Source

ROOT = Path(__file__).resolve().parents[2]
PLACE = ROOT / "target" / "mutants"
TREE = PLACE / "tree"
MEMORY = 3 << 30
# A failing case that proptest writes down would be tried with every mutant behind it.
SETTINGS = {"PROPTEST_CASES": "64", "PROPTEST_DISABLE_FAILURE_PERSISTENCE": "1", "RUST_BACKTRACE": "0"}


@dataclass
class Check:
    """Something that fails if it notices a mutant: a test, or another program."""

    name: str
    command: list[str]
    folder: Path
    root: Path | None = None  # of the tests' program; another program has none
    reached: set[int] = field(default_factory=set)
    seconds: float = 0.0

    @property
    def file(self) -> str:
        """The file of the test; for another program its name and the link that it checks."""
        if not self.root:
            return " ".join([self.name, self.command[-1]])
        *modules, _ = self.name.split("::")
        while modules:
            path = self.root.parent.joinpath(*modules)
            for found in (path.with_suffix(".rs"), path / "mod.rs"):
                if found.is_file():
                    return str(found.relative_to(TREE))
            modules.pop()
        return str(self.root.relative_to(TREE))


def execute(checks: list[Check], limit: float, settings: dict[str, str]) -> tuple[Check, str] | None:
    """The first of the checks, which are of one program, that fails, and how it does."""
    command = [*checks[0].command, *([check.name for check in checks] if checks[0].root else [])]
    process = subprocess.Popen(
        command,
        cwd=checks[0].folder,
        env=os.environ | SETTINGS | {"CARGO_MANIFEST_DIR": str(checks[0].folder)} | settings,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY)),
        start_new_session=True,
    )
    late = Event()

    def kill() -> None:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)

    timer = Timer(limit, lambda: (late.set(), kill()))
    timer.start()
    failed = None
    for line in process.stdout:
        if line.rstrip().endswith(b"... FAILED"):
            failed = line.decode(errors="replace").split()[1]
            kill()
            break
    process.stdout.close()
    code = process.wait()
    timer.cancel()
    if failed:
        return next(check for check in checks if check.name == failed), failed
    how = "no end" if late.is_set() else f"exit {code}"
    return (checks[0], f"{checks[0].name}: {how}") if code else None


def exemptions() -> list[str]:
    """The patterns of what is not tried."""
    return tomllib.loads((ROOT / ".cargo" / "mutants.toml").read_text())["exclude_re"]


class Workspace:
    """A copy of the workspace in which every mutant is compiled."""

    def __init__(self, crates: list[str]):
        self.crates = crates
        self.mutants: list[Mutant] = []
        exempt = exemptions()
        for crate in crates:
            for found in json.loads(self.run(["cargo", "mutants", "--package", crate, "--list", "--json"], ROOT)[1]):
                # cargo-mutants exempts no field of a struct.
                if any(re.search(pattern, found["name"]) for pattern in exempt):
                    continue
                names = ("name", "package", "file", "genre", "replacement", "function", "span")
                self.mutants.append(Mutant(len(self.mutants) + 1, **{name: found[name] for name in names}))
        self.left_out = {mutant.id for mutant in self.mutants if mutant.is_opaque}
        self.settings = {
            "RUSTC_BOOTSTRAP": ",".join(crate.replace("-", "_") for crate in crates),
            "RUSTFLAGS": "--cap-lints=allow",
            "CARGO_TARGET_DIR": str(PLACE / "target"),
            "CARGO_INCREMENTAL": "0",
            "CARGO_PROFILE_DEV_DEBUG": "0",
            "CARGO_PROFILE_DEV_OPT_LEVEL": "1",
        }
        self.placed: dict[str, Placed] = {}

    def run(self, command: list[str], folder: Path, **settings: str) -> tuple[int, bytes, bytes]:
        done = subprocess.run(command, cwd=folder, env=os.environ | settings, capture_output=True, check=False)
        return done.returncode, done.stdout, done.stderr

    def write(self) -> None:
        """The files of the workspace, those with mutants as they are compiled."""
        paths = self.run(["git", "ls-files", "-co", "--exclude-standard"], ROOT)[1].decode().splitlines()
        by_file: dict[str, list[Mutant]] = {mutant.file: [] for mutant in self.mutants}
        for mutant in self.mutants:
            if mutant.id not in self.left_out:
                by_file[mutant.file].append(mutant)
        roots = {file.split("/src/")[0] + "/src/lib.rs" for file in by_file}
        for path in paths:
            if not (ROOT / path).is_file():
                continue
            text = (ROOT / path).read_bytes()
            if path in by_file or path in roots:
                self.placed[path] = Source(text, by_file.get(path, [])).place(path in roots)
                text = self.placed[path].text
            to = TREE / path
            if not to.is_file() or to.read_bytes() != text:
                to.parent.mkdir(parents=True, exist_ok=True)
                to.write_bytes(text)
                shutil.copymode(ROOT / path, to)
        kept = {TREE / path for path in paths}
        for path in [path for path in TREE.rglob("*") if path.is_file() and path not in kept]:
            path.unlink()

    def cargo(self, *arguments: str) -> list[dict]:
        """Cargo's messages. A mutant that does not compile is left out, and all is compiled again."""
        while True:
            self.write()
            command = ["cargo", *arguments, "--message-format=json"]
            code, output, errors = self.run(command, TREE, **self.settings)
            messages = [json.loads(line) for line in output.splitlines() if line.startswith(b"{")]
            if code == 0:
                return messages
            wrong = [message["message"] for message in messages if message.get("message", {}).get("level") == "error"]
            found = set().union(*map(self.blamed, wrong)) - self.left_out
            if not found:
                texts = "\n".join(message["rendered"] for message in wrong)
                raise SystemExit(f"does not compile, and no mutant is why:\n{texts}\n{errors.decode()}")
            print(f"{len(found)} mutants do not compile", flush=True)
            self.left_out |= found

    def blamed(self, error: dict) -> set[int]:
        """The mutants that a compiler's error is about."""
        spans = sorted(error["spans"], key=lambda span: not span["is_primary"])
        spans += [span for child in error["children"] for span in child["spans"]]
        for span in spans:
            placed = self.placed.get(span["file_name"])
            if placed and (found := placed.find(span["byte_start"], span["byte_end"])):
                return found
        found = {int(number) for number in re.findall(r"__mutant\((\d+)\)", error["rendered"])}
        if (error.get("code") or {}).get("code") == "E0004":
            # A match without its arm: all arms of that function that were given up.
            for span in error["spans"]:
                own = self.placed[span["file_name"]].own if span["file_name"] in self.placed else []
                arms = [id for at, _, id in own if span["byte_start"] <= at and self.mutants[id - 1].genre == "MatchArm"]
                found |= {id for id in arms if self.mutants[id - 1].function == self.mutants[arms[0] - 1].function}
        return found

    def checks(self, jobs: int) -> tuple[dict[str, list[Check]], list[Check], list[Check]]:
        """The tests of each crate; what looks at the links' data and rules; the tests of the testkit. Each has been run once."""
        packages = [word for crate in self.crates for word in ("-p", crate)]
        self.cargo("check", "--keep-going", "--lib", *packages)
        built = self.cargo("test", "--no-run", "--no-fail-fast", "--lib", "--tests", *packages, "-p", "testkit", "-p", "cellwire-links")
        programs = self.cargo("build", "-p", "testkit", "--features", "testkit/programs", "--bin", "model", "-p", "reference", "--bin", "reference")
        programs = {message["target"]["name"]: message.get("executable") for message in programs if message.get("executable")}
        own: dict[str, list[Check]] = {crate: [] for crate in self.crates}
        data: list[Check] = []
        common: list[Check] = []
        links = [path.stem for path in sorted((ROOT / "reference" / "sessions").glob("*.json"))]
        for link in links:
            data.append(Check("reference", [programs["reference"], "check", link], TREE))
        for pair in (*links, "cellwire-motion"):
            data.append(Check("must-fail", [programs["model"], "must-fail", "--link", pair], TREE))
        for message in built:
            if not message.get("executable") or not message["profile"]["test"]:
                continue
            folder = Path(message["manifest_path"]).parent
            crate = re.search(r'^name = "(.*)"', (folder / "Cargo.toml").read_text(), re.M)[1]
            listed = self.run([message["executable"], "--list", "--format", "terse"], folder)[1].decode().splitlines()
            command = [message["executable"], "--test-threads=1", "--exact"]
            root = Path(message["target"]["src_path"])
            tests = [Check(line.removesuffix(": test"), command, folder, root) for line in listed if line.endswith(": test")]
            own.get(crate, common).extend(tests)
        every = [*data, *common, *(check for checks in own.values() for check in checks)]
        with ThreadPoolExecutor(jobs) as pool:
            working = set(map(id, (check for check, works in zip(every, pool.map(trace, every)) if works)))
        kept = {crate: [check for check in checks if id(check) in working] for crate, checks in own.items()}
        return kept, *([check for check in checks if id(check) in working] for checks in (data, common))


def trace(check: Check) -> bool:
    """Which mutants a check reaches, and how long it takes."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "trace"
        begin = time.monotonic()
        failed = execute([check], 900, {"MUTANT_TRACE": str(path)})
        check.seconds = time.monotonic() - begin
        data = path.read_bytes() if path.exists() else b""
    check.reached = {number for (number,) in struct.iter_unpack("<I", data)}
    if failed:
        print(f"left out, it fails where mutants are counted: {check.folder.name} {failed[1]}", flush=True)
    return not failed
