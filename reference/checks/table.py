"""Prints a table of links and checkers from what the checkers printed.

Usage: python3 reference/checks/table.py FOLDER CHECKER…

A checker's file in the folder has lines `link: passed of all`, several for a link if it counts more than one thing.
"""

import re
import sys
from pathlib import Path

LINE = re.compile(r"^([\w/-]+): (\d+) of (\d+)")
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


def main():
    folder, checkers = Path(sys.argv[1]), sys.argv[2:]
    columns = {checker: read(folder / checker) for checker in checkers}
    links = sorted({link for counts in columns.values() for link in counts})
    rows = [["", *checkers]]
    for link in links:
        cells = [columns[checker].get(link) for checker in checkers]
        rows.append([link, *(f"{cell[0]}/{cell[1]}" if cell and cell[1] else "–" for cell in cells)])
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    for row in rows:
        first, *rest = [cell.ljust(width) if not column else cell.rjust(width) for column, (cell, width) in enumerate(zip(row, widths))]
        print("  ".join([first, *rest]).rstrip())


if __name__ == "__main__":
    main()
