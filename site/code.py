"""Checks every block of code in the pages of the site that nothing else compiles or runs. Usage: code.py ROOT CELLWIRE BRIDGE

Rust on the crates' pages is a doctest, and what ports' pages have is run by the checks of the ports: ELSEWHERE says by which, and that
must name the page. Of shell the syntax is checked; a command of the tool parses with its arguments; scripts, packages and binaries
that it names are there. TOML and JSON parse. Prints how many blocks were checked, by language.
"""

import json
import re
import shlex
import subprocess
import sys
import tomllib
from collections import Counter
from pathlib import Path

ROOT = Path(sys.argv[1]).resolve()
TOOLS = {"cellwire": sys.argv[2], "cellwire-bridge": sys.argv[3]}
FENCE = re.compile(r"^( *)```([^\n]*)\n(.*?)^ *```[^\n]*$", re.MULTILINE | re.DOTALL)
# What compiles or runs a page's blocks, and how it names the page.
ELSEWHERE = {
    ("README.md", "rust"): ("testkit/src/lib.rs", '#[doc = include_str!("../../README.md")]'),
    ("docs/fuzzing.md", "rust"): ("testkit/src/lib.rs", '#[doc = include_str!("../../docs/fuzzing.md")]'),
    ("docs/bridge.md", "toml"): ("bridge/tests/it/file.rs", "docs/bridge.md"),
    ("docs/bridge.md", "python"): (".ci/sparkplug/whole_site.py", "docs/bridge.md"),
    ("docs/simulate.md", "python"): ("docs/pytest/test_control_schema.py", "simulate.md"),
    ("reference/ports/python/README.md", "python"): ("reference/checks/wire.py", "README.md"),
    ("reference/ports/c/README.md", "c"): (".ci/ports-c", "README.md"),
    ("javascript/README.md", "js"): (".ci/javascript", "README.md"),
}
# Shapes, in place of programs: names of a contract, and an error as crates have it.
SHAPES = {("CONTRIBUTING.md", "rust")}
# Pictures of bytes and screens, results, and what a browser draws.
PICTURES = {"text", "", "mermaid"}
PLACEHOLDER = re.compile(r"\bLINK\b")

wrong: list[str] = []
counts: Counter[str] = Counter()
metadata = json.loads(subprocess.check_output(["cargo", "metadata", "--no-deps", "--offline", "--format-version", "1"], cwd=ROOT))
packages = {package["name"]: package for package in metadata["packages"]}


def rust(page: Path, language: str) -> bool:
    """Whether the page is the documentation of its crate, and its blocks are doctests."""
    source = page.parent / "src/lib.rs"
    return source.is_file() and 'include_str!("../README.md")' in source.read_text() and "ignore" not in language


def commands(block: str) -> list[list[str]]:
    """The commands of a block of shell, as words."""
    found: list[list[str]] = [[]]
    lexer = shlex.shlex(block.replace("\\\n", " ").replace("\n", " ; "), posix=True, punctuation_chars=True)
    lexer.whitespace_split = True
    lexer.commenters = ""
    for word in lexer:
        if set(word) <= set("|&;()"):
            found.append([])
        else:
            found[-1].append(word)
    return [command for command in found if command]


def without_comments(block: str) -> str:
    return re.sub(r"(^|\s)#[^\n]*", r"\1", block)


def shell(block: str, where: str) -> None:
    syntax = subprocess.run(["bash", "-n"], input=block, text=True, capture_output=True)
    if syntax.returncode:
        wrong.append(f"{where}: {syntax.stderr.strip()}")
        return
    for command in commands(without_comments(block)):
        words = []
        for word in command:
            if set(word) <= set("<>"):
                break
            words.append(word)
        while words and re.match(r"(env|nice|sudo|[A-Za-z_]+=.*)$", words[0]):
            words = words[1:]
        if not words or "…" in words and words[0] not in TOOLS:
            continue
        if words[0] in TOOLS:
            parses(words[0], [word for word in words[1:] if word != "…"], where)
        elif words[0] == "cargo":
            cargo(words[1:], where)
        elif "/" in words[0] and not (ROOT / words[0]).is_file():
            wrong.append(f"{where}: there is no {words[0]}")


def parses(tool: str, arguments: list[str], where: str) -> None:
    """A command of the tool: names, and the values of those that are not free."""
    counts["commands of the tool"] += 1
    arguments = [PLACEHOLDER.sub("isra-ball", argument) for argument in arguments]
    done = subprocess.run([TOOLS[tool], *arguments, "--help"], capture_output=True, text=True)
    if done.returncode or "Usage" not in done.stdout:
        wrong.append(f"{where}: {tool} {shlex.join(arguments)}: {done.stderr.strip() or 'no usage'}")


def cargo(words: list[str], where: str) -> None:
    """The packages and binaries that a command of Cargo names. `.ci/first-robot` runs `cargo add`."""
    given = dict(zip(words, words[1:]))
    package = packages.get(given.get("-p", ""))
    if "-p" in given and not package and given["-p"] != "ends":
        wrong.append(f"{where}: there is no package {given['-p']}")
    if "--bin" in given and package and given["--bin"] not in {target["name"] for target in package["targets"]}:
        wrong.append(f"{where}: {package['name']} has no binary {given['--bin']}")
    if words[0] == "run" and "--" in words and package and package["name"] in TOOLS:
        parses(package["name"], words[words.index("--") + 1:], where)


def objects(block: str, where: str) -> None:
    """JSON, one value after the other; what `…` leaves out has no shape to check."""
    text, decoder = block.replace(',…', '').replace('"…"', '""').strip(), json.JSONDecoder()
    try:
        while text:
            _, end = decoder.raw_decode(text)
            text = text[end:].lstrip()
    except ValueError as error:
        wrong.append(f"{where}: {error}")


def check(page: Path, found: re.Match, text: str) -> None:
    name, language = str(page.relative_to(ROOT)), found[2].strip()
    kind = language.split(",")[0]
    block = re.sub(rf"^{found[1]}", "", found[3], flags=re.MULTILINE)
    where = f"{name}:{text.count(chr(10), 0, found.start()) + 1}"
    if kind in PICTURES:
        counts["pictures"] += 1
    elif (name, kind) in ELSEWHERE:
        counts[f"{kind}, run elsewhere"] += 1
        by, called = ELSEWHERE[name, kind]
        if called not in (ROOT / by).read_text():
            wrong.append(f"{where}: {by} does not name {called}")
    elif (name, kind) in SHAPES:
        counts["shapes"] += 1
    elif kind == "rust":
        counts["rust, doctests"] += 1
        if not rust(page, language):
            wrong.append(f"{where}: no doctest")
    elif kind == "sh":
        counts["sh"] += 1
        shell(block, where)
    elif kind == "toml":
        counts["toml"] += 1
        try:
            tomllib.loads(block)
        except tomllib.TOMLDecodeError as error:
            wrong.append(f"{where}: {error}")
    elif kind == "json":
        counts["json"] += 1
        objects(block, where)
    else:
        wrong.append(f"{where}: nothing checks {kind}")


summary = (ROOT / "site/SUMMARY.md").read_text()
for target in re.findall(r"\]\(([^)]+)\)", summary):
    page = (ROOT / "site" / target).resolve()
    text = page.read_text()
    for found in FENCE.finditer(text):
        check(page, found, text)
print("\n".join(wrong), file=sys.stderr)
print(", ".join(f"{count} {kind}" for kind, count in sorted(counts.items())) + f"; {len(wrong)} wrong")
sys.exit(bool(wrong))
