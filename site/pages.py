"""Copies the pages that SUMMARY.md lists into a book's source folder, with their pictures. Usage: pages.py ROOT BOOK

A page stays as it is in the repository, where its links lead to files. In the copy a link to a file that is no page leads to the
repository, each clause of a specification has an anchor, and each mention of one is a link.
"""

import html
import os
import re
import shutil
import sys
import tomllib
from pathlib import Path

ROOT, BOOK = (Path(argument).resolve() for argument in sys.argv[1:3])
SITE = ROOT / "site"
REPOSITORY = tomllib.loads((ROOT / "Cargo.toml").read_text())["workspace"]["package"]["repository"]
PICTURES = {".png", ".svg", ".gif"}
LINK = re.compile(r"(\]\()([^()\s]+)(\))|^(\[[^\]]+\]: +)(\S+)()|(<(?:img|source)[^>]*\ssrc=\")([^\"]+)(\")", re.MULTILINE)
DEFINITION = re.compile(r"^((?:- )?)\*\*([A-Z]{2}-\d+)\*\*", re.MULTILINE)
MENTION = re.compile(r"(?<![\w\[*/#`-])([A-Z]{2}-\d+)(?![\w\]`-])")
FENCE = re.compile(r"(^ *```.*?^ *```[^\n]*$)", re.MULTILINE | re.DOTALL)
CODE = re.compile(r"(`+[^`]+`+)")


def place(page: Path) -> Path:
    """Where a page of the repository is in the book: the page of a folder is its index."""
    page = page.relative_to(ROOT)
    return page.with_name("index.md") if page.name == "README.md" else page


def link(target: str, page: Path) -> str:
    """A link of a page, as it is in the book."""
    if re.match(r"[a-z]+:|#|//", target):
        return target
    path, _, anchor = target.partition("#")
    file = Path(os.path.normpath(page.parent / path))
    anchor = f"#{anchor}" if anchor else ""
    if (file / "README.md") in pages:
        file /= "README.md"
    if file in pages:
        return os.path.relpath(place(file), place(page).parent) + anchor
    if file.suffix in PICTURES and file.is_file():
        to = BOOK / "src" / file.relative_to(ROOT)
        to.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(file, to)
        return target
    if not file.exists():
        sys.exit(f"{page.relative_to(ROOT)}: there is no {target}")
    kind = "tree" if file.is_dir() else "blob"
    return f"{REPOSITORY}/{kind}/main/{file.relative_to(ROOT)}{anchor}"


def prose(text: str, page: Path, clauses: set[str]) -> str:
    """A text without blocks of code."""
    parts = CODE.split(text)
    for at, part in enumerate(parts[::2]):
        part = LINK.sub(lambda m: linked(m, page), part)
        part = MENTION.sub(lambda m: f"[{m[1]}](#{m[1]})" if m[1] in clauses else m[1], part)
        parts[2 * at] = DEFINITION.sub(r'\1<a id="\2"></a>**\2**', part)
    return "".join(parts)


def linked(found: re.Match, page: Path) -> str:
    before, target, behind = (part for part in found.groups() if part is not None)
    return before + link(target, page) + behind


def copy(page: Path) -> None:
    text = page.read_text()
    clauses = {found[2] for found in DEFINITION.finditer(text)} if page.parent.name == "reference" else set()
    parts = FENCE.split(text)
    drawn = False
    for at, part in enumerate(parts):
        if at % 2 == 0:
            parts[at] = prose(part, page, clauses)
        elif part.lstrip().startswith("```mermaid"):
            drawn = True
            parts[at] = '<pre class="mermaid">' + html.escape("\n".join(part.strip().split("\n")[1:-1])) + "</pre>"
    if drawn:
        root = os.path.relpath(".", place(page).parent)
        parts.append(f'\n\n<script src="{root}/mermaid.min.js"></script>\n<script src="{root}/mermaid-start.js"></script>\n')
    to = BOOK / "src" / place(page)
    to.parent.mkdir(parents=True, exist_ok=True)
    to.write_text("".join(parts))


def summary() -> None:
    """The contents, whose links lead to the copies."""
    text = (SITE / "SUMMARY.md").read_text()
    text = re.sub(r"\]\(([^)]+)\)", lambda m: f"]({place((SITE / m[1]).resolve())})", text)
    (BOOK / "src/SUMMARY.md").write_text(text)


pages = {(SITE / target).resolve() for target in re.findall(r"\]\(([^)]+)\)", (SITE / "SUMMARY.md").read_text())}
shutil.rmtree(BOOK / "src", ignore_errors=True)
(BOOK / "src").mkdir(parents=True)
for page in sorted(pages):
    copy(page)
summary()
for file in ("book.toml", "site.css"):
    shutil.copy(SITE / file, BOOK / file)
shutil.copytree(SITE / "theme", BOOK / "theme", dirs_exist_ok=True)
shutil.copy(SITE / "mermaid-start.js", BOOK / "src/mermaid-start.js")
diagrams = [place(page).with_suffix(".html") for page in sorted(pages) if "```mermaid" in page.read_text()]
(BOOK / "src/diagrams.txt").write_text("\n".join(map(str, diagrams)) + "\n")
print(f"{len(pages)} pages, {len(diagrams)} with diagrams")
