"""Prints a table of links and checkers from what the checkers printed, and one of the ends from the heads of their stories.

Usage: python3 reference/checks/table.py FOLDER CHECKER…

A checker's file in the folder has lines `link: passed of all`, several for a link if it counts more than one thing. The
second table has for each link the clauses that have a case of all, and for each end the cells reached of those that can be,
and the rules needed of all. Exit status 1 if the stories do not reach or need what they can.
"""

import json
import re
import sys
from pathlib import Path

REFERENCE = Path(__file__).resolve().parent.parent
LINE = re.compile(r"^([\w/-]+): (\d+) of (\d+)")
WITH_CASES = re.compile(r"^([\w/-]+): \d+ of (\d+) \((\d+) with a case\)", re.MULTILINE)
RUST = re.compile(r"^([\w/-]+): (\d+) vectors, (\d+) disagree")


def read(path):
    """The counts of each link in what a checker printed."""
    counts = {}
    for line in path.read_text().splitlines():
        if match := LINE.match(line):
            link, passed, total = match[1], int(match[2]), int(match[3])
        elif match := RUST.match(line):
            link, passed, total = match[1], int(match[2]) - int(match[3]), int(match[2])
        else:
            continue
        before = counts.get(link, (0, 0))
        counts[link] = (before[0] + passed, before[1] + total)
    return counts


def with_cases(path):
    """The clauses of each link that have a case, of all, as checks/clauses.py prints them."""
    return {match[1]: f"{match[3]}/{match[2]}" for match in WITH_CASES.finditer(path.read_text())} if path.is_file() else {}


def ends():
    """The link, the name and the counts of each end that has stories."""
    for path in sorted((REFERENCE / "sessions").glob("*.json")):
        document = json.loads(path.read_text())
        for end, counts in document["ends"].items():
            yield document["link"], end, counts


def show(rows):
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    for row in rows:
        first, *rest = [cell.rjust(width) if column else cell.ljust(width) for column, (cell, width) in enumerate(zip(row, widths))]
        print("  ".join([first, *rest]).rstrip())


def main():
    folder, checkers = Path(sys.argv[1]), sys.argv[2:]
    columns = {checker: read(folder / checker) for checker in checkers}
    links = sorted({link for counts in columns.values() for link in counts})
    rows = [["", *checkers]]
    for link in links:
        cells = [columns[checker].get(link) for checker in checkers]
        rows.append([link, *(f"{cell[0]}/{cell[1]}" if cell and cell[1] else "–" for cell in cells)])
    show(rows)

    clauses, complete = with_cases(folder / "clauses"), True
    rows = [["", "end", "cells reached", "rules needed", "clauses with a case"]]
    of_link = {}
    for link, end, counts in ends():
        of_link.setdefault(link, []).append((end, counts))
    for link in sorted(clauses.keys() | of_link):
        name, share = link, clauses.get(link, "–")
        for end, counts in of_link.get(link, [("–", None)]):
            cells = rules = "–"
            if counts:
                reachable = counts["cells"] - counts["unreachable"]
                cells, rules = f"{counts['reached']}/{reachable}", f"{counts['needed']}/{counts['rules']}"
                complete &= counts["reached"] == reachable
            rows.append([name, end, cells, rules, share])
            name = share = ""
    print()
    show(rows)
    sys.exit(not complete)


if __name__ == "__main__":
    main()
