"""Checks the clauses of the specifications.

Usage: python3 reference/checks/clauses.py [LINK…]

Every clause has a number of its own with the prefix of its file and names its source, and every clause that the text
refers to exists. Every clause has a case, a vector, a stream or a session that names it in its `clauses`, or stands in
no-case.txt with a reason; every clause that is named there or in the data exists.

Prints `link: passed of all`; exit status 1 on a failure.
"""

import json
import re
import sys
from pathlib import Path

CHECKS = Path(__file__).resolve().parent
REFERENCE = CHECKS.parent
DATA = ["vectors", "streams", "sessions", "states"]
# A clause ends before the next one, or at a blank line.
CLAUSE = re.compile(r"^(?:- )?\*\*([A-Z]{2})-(\d+)\*\* (.*?)(?=\n\n|\n(?:- )?\*\*|\Z)", re.MULTILINE | re.DOTALL)
SOURCE = re.compile(r"\[[§A-Za-z][^\]]*\](?!\()")


def check(text):
    """The names of the clauses, and what is wrong with them."""
    clauses = CLAUSE.findall(text)
    names = [f"{prefix}-{number}" for prefix, number, _ in clauses]
    wrong = {name: "is there twice" for name in names if names.count(name) > 1}
    wrong |= {name: "has another prefix" for name in names if name[:2] != names[0][:2]}
    wrong |= {name: "names no source" for name, (_, _, body) in zip(names, clauses) if not SOURCE.search(body)}
    referred = set(re.findall(rf"\b{names[0][:2]}-\d+\b", text)) if names else set()
    wrong |= {name: "is not there" for name in referred - set(names)}
    return names, wrong


def named(value):
    """The clauses that a JSON value names, at any depth."""
    if isinstance(value, list):
        return {name for inner in value for name in named(inner)}
    if not isinstance(value, dict):
        return set()
    return set(value.get("clauses", [])) | {name for inner in value.values() for name in named(inner)}


def with_cases(link):
    files = [REFERENCE / folder / f"{link}.json" for folder in DATA]
    return {name for file in files if file.is_file() for name in named(json.loads(file.read_text()))}


def without_case():
    """Clause to the reason why it has no case: lines `KM-1, KM-4..KM-6: reason`."""
    reasons = {}
    for line in (CHECKS / "no-case.txt").read_text().splitlines():
        if not line.strip() or line.startswith("#"):
            continue
        names, _, reason = line.partition(": ")
        for part in names.split(","):
            first, _, last = part.strip().partition("..")
            prefix, number = first.split("-")
            for each in range(int(number), int((last or first).split("-")[1]) + 1):
                reasons[f"{prefix}-{each}"] = reason.strip()
    return reasons


def main():
    links = sys.argv[1:] or sorted(path.stem for path in (REFERENCE / "vectors").glob("*.json"))
    reasons, failed = without_case(), False
    for link in links:
        names, wrong = check((REFERENCE / f"{link}.md").read_text())
        data = with_cases(link)
        if names:
            listed = {name for name in reasons if name[:2] == names[0][:2]}
            wrong |= {name: "is in the data or in no-case.txt, and not there" for name in (data | listed) - set(names)}
        for name, text in sorted(wrong.items()):
            print(f"{link}: {name} {text}")
        bare = [name for name in names if name not in data and not reasons.get(name)]
        both = [name for name in names if name in data and name in reasons]
        if both:
            print(f"{link}: has a case now, to be struck out of no-case.txt: {', '.join(both)}")
        if bare:
            print(f"{link}: no case, and no reason: {', '.join(bare)}")
        wrong |= dict.fromkeys(bare, "has no case")
        print(f"{link}: {len(names) - len(set(wrong) & set(names))} of {len(names)} ({len(data & set(names))} with a case)")
        failed |= bool(wrong) or not names
    sys.exit(failed)


if __name__ == "__main__":
    main()
