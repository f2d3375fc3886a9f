"""Checks the links of reference/**/*.md to files and to headings.

Usage: python3 reference/checks/links.py

Prints `name: passed of all` for each page that has links; exit status 1 on a failure.
"""

import re
import sys
from pathlib import Path

REFERENCE = Path(__file__).resolve().parent.parent
LINK = re.compile(r"\[[^\]]*\]\(([^)\s]+)\)")
CODE = re.compile(r"^```.*?^```|`[^`\n]*`", re.MULTILINE | re.DOTALL)


def anchors(text):
    """The anchors that a page's headings have where it is shown."""
    for heading in re.findall(r"^#+ (.*)$", re.sub(r"^```.*?^```", "", text, flags=re.MULTILINE | re.DOTALL), re.MULTILINE):
        yield re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")


def is_dead(page, link):
    if re.match(r"[a-z]+:", link):
        return False
    name, _, anchor = link.partition("#")
    target = page.parent / name if name else page
    if not target.exists():
        return True
    return bool(anchor) and target.suffix == ".md" and anchor not in anchors(target.read_text())


def main():
    failed = False
    for page in sorted(REFERENCE.rglob("*.md")):
        links = LINK.findall(CODE.sub("", page.read_text()))
        dead = [link for link in links if is_dead(page, link)]
        for link in dead:
            print(f"{page.relative_to(REFERENCE)}: {link} leads nowhere")
        if links:
            print(f"{page.relative_to(REFERENCE).with_suffix('')}: {len(links) - len(dead)} of {len(links)}")
        failed |= bool(dead)
    sys.exit(failed)


if __name__ == "__main__":
    main()
