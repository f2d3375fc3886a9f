"""Checks the clauses of the specifications.

Usage: python3 reference/checks/clauses.py [LINK…]

Every clause has a number of its own with the prefix of its file and names its source, and every clause that the text
refers to exists. Prints `link: clauses`; exit status 1 on a failure.
"""

import re
import sys
from pathlib import Path

REFERENCE = Path(__file__).resolve().parent.parent
# A clause ends before the next one, or at a blank line.
CLAUSE = re.compile(r"^(?:- )?\*\*([A-Z]{2})-(\d+)\*\* (.*?)(?=\n\n|\n(?:- )?\*\*|\Z)", re.MULTILINE | re.DOTALL)
SOURCE = re.compile(r"\[[§A-Za-z][^\]]*\](?!\()")


def check(text):
    """The prefix and number of clauses, and what is wrong with them."""
    clauses = CLAUSE.findall(text)
    names = [f"{prefix}-{number}" for prefix, number, _ in clauses]
    wrong = [f"{name} is there twice" for name in sorted(set(names)) if names.count(name) > 1]
    wrong += [f"{name} has another prefix" for name in names if name[:2] != names[0][:2]]
    wrong += [f"{name} names no source" for name, (_, _, body) in zip(names, clauses) if not SOURCE.search(body)]
    referred = set(re.findall(rf"\b{names[0][:2]}-\d+\b", text)) if names else set()
    wrong += [f"{name} is not there" for name in sorted(referred - set(names))]
    return len(names), wrong


def main():
    links = sys.argv[1:] or sorted(path.stem for path in REFERENCE.glob("*.md") if path.stem != "README")
    failed = False
    for link in links:
        count, wrong = check((REFERENCE / f"{link}.md").read_text())
        for fault in wrong:
            print(f"{link}: {fault}")
        print(f"{link}: {count} clauses")
        failed |= bool(wrong) or count == 0
    sys.exit(failed)


if __name__ == "__main__":
    main()
