"""Checks every internal link of the built site, with its anchor. Usage: links.py FOLDER

Links to other hosts are counted, not followed. Scripts, styles and pictures must be the site's own. Two links of rustdoc lead nowhere and do
no harm: the path of what a crate that is not here has, and the list of implementors of a trait that no other crate implements.
"""

import os
import re
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

FOLDER = Path(sys.argv[1]).resolve()
# What a page loads by itself, in place of what a reader may follow.
LOADED = {("script", "src"), ("img", "src"), ("link", "href"), ("iframe", "src"), ("source", "src")}


class Page(HTMLParser):
    def __init__(self, file: Path) -> None:
        super().__init__()
        self.links: list[tuple[str, bool]] = []
        self.anchors: set[str] = {""}
        self.base = file.parent
        self.redirect = ""
        self.feed(file.read_text(errors="replace"))

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        found = dict(attributes)
        self.anchors |= {found[name] for name in ("id", "name") if found.get(name)}
        if tag == "meta" and found.get("http-equiv") == "refresh":
            self.redirect = (found["content"] or "").partition("=")[2]
        if tag == "base" and found.get("href"):
            self.base /= found["href"]
            return
        for name in ("href", "src"):
            if found.get(name) and (tag, name) != ("link", "canonical"):
                self.links.append((found[name], (tag, name) in LOADED))


def main() -> None:
    pages = {file: Page(file) for file in FOLDER.rglob("*.html")}
    checked, outside, wrong = 0, 0, []
    for file, page in pages.items():
        for link, loaded in page.links:
            parts = urlsplit(link)
            if parts.scheme or parts.netloc:
                outside += 1
                if loaded and parts.scheme != "data":
                    wrong.append(f"{file.relative_to(FOLDER)}: loads {link}")
                continue
            path = unquote(parts.path)
            if is_of_rustdoc(path):
                outside += 1
                continue
            to = Path(os.path.normpath(page.base / path)) if path else file
            if to.is_dir():
                to /= "index.html"
            # rustdoc's redirects keep the anchor.
            while to in pages and pages[to].redirect:
                to = Path(os.path.normpath(pages[to].base / pages[to].redirect))
            checked += 1
            if not to.is_file() or FOLDER not in to.parents:
                wrong.append(f"{file.relative_to(FOLDER)}: there is no {link}")
            elif to in pages and is_anchor(parts.fragment) and pages[to].anchors.isdisjoint({parts.fragment, unquote(parts.fragment)}):
                wrong.append(f"{file.relative_to(FOLDER)}: no such place, {link}")
    print("\n".join(sorted(set(wrong))[:100]), file=sys.stderr)
    print(f"{len(pages)} pages, {checked} internal links, {outside} external ones not followed, {len(wrong)} wrong")
    sys.exit(bool(wrong))


def is_of_rustdoc(path: str) -> bool:
    crate = re.fullmatch(r"(\w+)::[\w:]+", path)
    return bool(crate and not (FOLDER / "api" / crate[1]).is_dir()) or "/trait.impl/" in path


def is_anchor(fragment: str) -> bool:
    """Not the lines of a source in rustdoc, which its script marks."""
    return not fragment.replace("-", "").isdigit()


main()
