"""How mutants.py runs a port with a change: Python in the memory of a process, C built and run as a command.

A run answers whether the change is noticed: an answer is wrong, the testee fails, or it does not come to an end.
"""

import ast
import contextlib
import gc
import importlib.machinery
import json
import math
import os
import resource
import shutil
import signal
import subprocess
import sys
import time
import types
from collections import Counter
from collections.abc import Callable
from functools import cache
from pathlib import Path

Case = tuple[dict, Callable[[dict], bool]]  # a request, and whether its answer is right
MEMORY = 2 << 30
LOOP = 0.5  # seconds of a processor that one answer of Python may take
COMMAND_LOOP = 2  # … and all answers of a command
LINES = 2000  # of a function for one case, that are noted
OUTPUT = 64 << 20
FIRST = 40  # requests that are asked first, those that have noticed the most


class Link:
    """The cases of a link: the cheap ones first, and of those that cost alike the one that noticed something last."""

    def __init__(self, cases: list[Case]) -> None:
        self.cases = cases
        self.order = list(range(len(cases)))
        self.costs = dict.fromkeys(self.order, 0.0)  # seconds
        self.last = 0  # the case that noticed something last
        # The lines of a file to the cases that run them; None: not known.
        self.runs: dict[str, dict[int, set[int]]] | None = None

    def noticed_by(self, number: int) -> None:
        self.last = number
        self.order.remove(number)
        self.order.insert(next((at for at, other in enumerate(self.order) if self.rank(other) >= self.rank(number)), len(self.order)), number)

    def keep(self, costs: dict[int, float]) -> None:
        """Only these cases."""
        self.costs = costs
        self.order = sorted((number for number in self.order if number in costs), key=self.rank)

    def rank(self, number: int) -> int:
        """The order of magnitude of what a case costs."""
        return math.floor(math.log10(max(self.costs[number], 1e-6)))

    def running(self, file: str, lines: range, nested: bool) -> list[int]:
        """The cases that run these lines; what is run when a module is loaded concerns all."""
        if self.runs is None or not nested:
            return self.order
        cases = set().union(*(self.runs.get(file, {}).get(line, set()) for line in lines))
        return [number for number in self.order if number in cases]


def stem(file: str) -> str:
    """What a module is imported as: a package by its folder."""
    path = Path(file)
    return path.parent.name if path.stem == "__init__" else path.stem


class Python:
    """The testee's main program in a forked process, with the modules of the port from memory."""

    def __init__(self, folder: Path, testee: Path) -> None:
        self.testee = testee
        self.modules: dict[str, str] = {}
        self.code = {str(path): compile(path.read_bytes(), str(path), "exec") for path in folder.rglob("*.py")}
        sys.path.insert(0, str(testee.parent))
        sys.dont_write_bytecode = True
        original = importlib.machinery.SourceFileLoader.get_code
        code = self.code
        importlib.machinery.SourceFileLoader.get_code = lambda self, name: code.get(self.path) or original(self, name)

    def prepare(self, link: Link, traced: bool) -> set[str]:
        """Leaves the cases that the testee does not skip, and notes what each runs; the files that it loads."""
        found = self.forked(link, link.order, None, traced)
        if not isinstance(found, dict):
            sys.exit(f"the port itself fails at {json.dumps(link.cases[found][0])[:300] if isinstance(found, int) and found >= 0 else found}")
        link.keep({int(number): cost for number, cost in found["answered"].items()})
        if traced:
            link.runs = {file: {int(line): set(cases) for line, cases in lines.items()} for file, lines in found["lines"].items()}
        for name in found["modules"]:
            with contextlib.suppress(ImportError):
                importlib.import_module(name)
        self.modules = {name: module.__file__ for name, module in sys.modules.items() if getattr(module, "__file__", None) in self.code}
        gc.freeze()
        return set(self.modules.values())

    @cache
    def concerned(self, file: str) -> set[str]:
        """The modules that a changed file is in, or that import it, themselves or through others."""
        stems = {stem(file)}
        while True:
            more = {stem(each) for each in self.modules.values() if stems & self.imports(each)}
            if more <= stems:
                return {name for name, each in self.modules.items() if stem(each) in stems}
            stems |= more

    @cache
    def imports(self, file: str) -> set[str]:
        """The last words of what a file imports: files of one name are taken for one."""
        nodes = [node for node in ast.walk(ast.parse(Path(file).read_bytes())) if isinstance(node, ast.Import | ast.ImportFrom)]
        names = {alias.name for node in nodes for alias in node.names} | {node.module or "" for node in nodes if isinstance(node, ast.ImportFrom)}
        return {name.split(".")[-1] for name in names}

    def valid(self, changes: list[tuple[Path, bytes]]) -> list[bool]:
        """Whether each of these files can be run; is_noticed says it of one."""
        return [True] * len(changes)

    def is_noticed(self, link: Link, path: Path, source: bytes, cases: list[int]) -> bool | None:
        """Whether a case notices the change; None: it is none."""
        found = self.forked(link, cases, (path, source, self.concerned(str(path))), False)
        if isinstance(found, int) and found >= 0:
            link.noticed_by(found)
        return not isinstance(found, dict)

    def forked(self, link: Link, cases: list[int], change, traced: bool):
        """The number of the case that has failed, −1 where another thing has, or what is known if none has."""
        reading, writing = os.pipe()
        child = os.fork()
        if child == 0:
            os.close(reading)
            out = os.fdopen(writing, "w")
            try:
                Asked(self, link, cases, change, traced).ask(out)
            finally:
                os._exit(1)
        os.close(writing)
        with os.fdopen(reading) as report:
            answer = report.read()
        os.waitpid(child, 0)
        return json.loads(answer) if answer else -1


class Asked:
    """The standard input and output of a testee in this process."""

    def __init__(self, port: Python, link: Link, cases: list[int], change, traced: bool) -> None:
        self.port, self.link, self.cases, self.change, self.traced = port, link, iter(cases), change, traced
        self.now: int | None = None
        self.answered: dict[int, float] = {}  # and what it cost in seconds
        self.lines: dict[str, dict[int, set[int]]] = {}
        self.counts: Counter[types.CodeType] = Counter()  # lines of a function that were run for this case
        self.text = ""

    def ask(self, out) -> None:
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
        self.out = out
        code = self.port.code
        self.before = set(sys.modules)
        main = types.ModuleType("__main__")
        main.__file__ = str(self.port.testee)
        sys.modules["__main__"], sys.argv = main, [str(self.port.testee)]
        sys.stdin, sys.stdout, sys.stderr = self, self, open(os.devnull, "w")
        try:
            if self.change:
                path, source, concerned = self.change
                signal.setitimer(signal.ITIMER_PROF, LOOP)
                gc.disable()
                for name in concerned:
                    package, _, last = name.rpartition(".")
                    del sys.modules[name]
                    if package in sys.modules and hasattr(sys.modules[package], last):
                        delattr(sys.modules[package], last)
                code[str(path)] = compile(source, str(path), "exec")
            if self.traced:
                sys.settrace(self.trace)
            exec(code[str(self.port.testee)], main.__dict__)
        except BaseException:
            self.report(-1 if self.now is None else self.now)
        sys.settrace(None)
        lines = {file: {line: list(cases) for line, cases in lines.items()} for file, lines in self.lines.items()}
        self.report({"answered": self.answered, "modules": list(set(sys.modules) - self.before), "lines": lines})

    def report(self, what) -> None:
        signal.setitimer(signal.ITIMER_PROF, 0)
        self.out.write(json.dumps(what))
        self.out.flush()
        os._exit(0)

    def trace(self, frame, event, _):
        """Notes the lines of a function of the port, but for those of a long loop that come late."""
        file = frame.f_code.co_filename
        if file not in self.port.code or self.now is None or self.counts[frame.f_code] > LINES:
            return None
        lines, code, counts = self.lines.setdefault(file, {}), frame.f_code, self.counts

        def line(frame, event, _):
            lines.setdefault(frame.f_lineno, set()).add(self.now)
            counts[code] += 1
            if counts[code] > LINES:
                frame.f_trace = None
            return line

        return line(frame, event, None)

    def __iter__(self):
        return self

    def __next__(self) -> str:
        self.check()
        self.now = next(self.cases)
        self.counts = Counter()
        self.begun = time.process_time()
        if self.change:
            signal.setitimer(signal.ITIMER_PROF, LOOP + 3 * self.link.costs[self.now])
        return json.dumps(self.link.cases[self.now][0]) + "\n"

    def readline(self) -> str:
        return next(self, "")

    def write(self, text: str) -> None:
        self.text += text

    def flush(self) -> None:
        pass

    def check(self) -> None:
        """Looks at the answer to the last request."""
        if self.now is None:
            return
        answer = json.loads(self.text or "{}")
        self.text = ""
        if not self.change and "skipped" in answer:
            return
        self.answered[self.now] = time.process_time() - self.begun
        if not self.link.cases[self.now][1](answer):
            self.report(self.now)


class C:
    """Compiles the files of a copy of the C port that a change concerns, and links them."""

    def __init__(self, copy: Path) -> None:
        self.copy = copy
        self.compiler = ["cc", "-std=c11", "-O0", "-w", f"-I{copy}/include"]
        self.command = [str(copy / "mutants/testee")]

    def build(self, changed: Path | None) -> bool:
        """Builds what a changed file concerns, all for None."""
        paths = [path for pattern in ("src/*.c", "testee/*.c", "testee/ends/*.c") for path in sorted(self.copy.glob(pattern))]
        concerned = [changed] if changed in paths else [path for path in paths if changed is None or self.includes(path, changed.name)]
        objects = {path: self.copy / "mutants" / (path.relative_to(self.copy).as_posix().replace("/", "_") + ".o") for path in paths}
        return all(self.compiles("-c", "-o", objects[path], path) for path in concerned) and self.compiles(
            "-o", self.command[0], *objects.values(), "-lm"
        )

    def compiles(self, *arguments: str | Path) -> bool:
        return subprocess.run([*self.compiler, *arguments], capture_output=True, check=False).returncode == 0

    def includes(self, path: Path, name: str, seen: frozenset[str] = frozenset()) -> bool:
        """Whether a file includes another, itself or through others."""
        included = [part.split('"')[1] for part in path.read_text().splitlines() if part.startswith('#include "')]
        folders = [path.parent, self.copy / "include"]
        inner = [(folder / each).resolve() for folder in folders for each in included if each not in seen]
        return any(each.name == name or self.includes(each, name, seen | set(included)) for each in inner if each.exists())


class Command:
    """A copy of the port's folder in which a file changes; it is built, and run as a command."""

    def __init__(self, folder: Path, copy: Path, builder: Callable[[Path], C]) -> None:
        shutil.rmtree(copy, ignore_errors=True)
        shutil.copytree(folder, copy, ignore=shutil.ignore_patterns("node_modules", "dist"))
        self.folder, self.copy = folder, copy
        self.changed: Path | None = None  # the file that was built with a change last
        (copy / "mutants").mkdir()
        self.builder = builder(copy)
        if not self.builder.build(None):
            sys.exit("the port itself does not build")

    def prepare(self, link: Link, traced: bool) -> set[str]:
        if self.changed is not None:
            self.builder.build(self.changed)  # without the last change of another link
        answers = self.answers(link, link.order)
        if answers is None or len(answers) != len(link.order):
            sys.exit("the port itself fails")
        asked = [number for number, answer in zip(link.order, answers) if "skipped" not in answer]
        wrong = [number for number, answer in zip(link.order, answers) if "skipped" not in answer and not link.cases[number][1](answer)]
        if wrong:
            sys.exit(f"the port itself fails at {json.dumps(link.cases[wrong[0]][0])[:300]}")
        link.keep(dict.fromkeys(asked, 0.0))
        return {str(path) for path in self.folder.rglob("*")}

    def valid(self, changes: list[tuple[Path, bytes]]) -> list[bool]:
        """Whether each of these files can be built; is_noticed says it of one."""
        return [True] * len(changes)

    def is_noticed(self, link: Link, path: Path, source: bytes, cases: list[int]) -> bool | None:
        copied = self.copy / path.relative_to(self.folder)
        whole = copied.read_bytes()
        if self.changed not in (None, copied):
            self.builder.build(self.changed)
        self.changed = copied
        try:
            copied.write_bytes(source)
            if not self.builder.build(copied):
                return None
            return any(self.fails(link, part) for part in (cases[:FIRST], cases[FIRST:]) if part)
        finally:
            copied.write_bytes(whole)

    def fails(self, link: Link, cases: list[int]) -> bool:
        answers = self.answers(link, cases)
        for number, answer in zip(cases, answers or []):
            if not link.cases[number][1](answer):
                link.noticed_by(number)
                return True
        return answers is None or len(answers) < len(cases)

    def answers(self, link: Link, cases: list[int]) -> list[dict] | None:
        """What the testee answers; None: it fails, or does not end."""

        def limits() -> None:
            resource.setrlimit(resource.RLIMIT_CPU, (COMMAND_LOOP, COMMAND_LOOP))
            resource.setrlimit(resource.RLIMIT_FSIZE, (OUTPUT, OUTPUT))

        asked, answered = self.copy / "mutants/asked", self.copy / "mutants/answered"
        asked.write_text("".join(json.dumps(link.cases[number][0]) + "\n" for number in cases))
        with asked.open() as stdin, answered.open("w") as stdout:
            try:
                done = subprocess.run(
                    self.builder.command, cwd=self.copy, stdin=stdin, stdout=stdout, stderr=subprocess.DEVNULL, preexec_fn=limits, timeout=300, check=False
                )
            except subprocess.TimeoutExpired:
                return None
        try:
            answers = [json.loads(line) for line in answered.read_text().splitlines()]
        except ValueError:
            return None
        return answers if done.returncode == 0 else None
