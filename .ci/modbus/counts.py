"""The instructions and the clock readings of a call: counts.py NAME LESS MORE, two outputs of callgrind of 200 and of 600 calls."""

import re
import sys


def counts(path):
    names, called, total, clock = {}, "", 0, 0
    for line in open(path):
        if match := re.match(r"c?fn=\((\d+)\)(?: (.*))?", line):
            if match[2]:
                names[match[1]] = match[2]
            called = names[match[1]]
        elif line.startswith("calls=") and called.split("@")[0] == "clock_gettime":
            clock += int(line[6:].split()[0])
        elif match := re.match(r"(?:summary|totals): (\d+)", line):
            total = int(match[1])
    return total, clock


(less, fewer), (more, many) = counts(sys.argv[2]), counts(sys.argv[3])
print(f"{sys.argv[1]:15} {(more - less) / 400:12.0f} {(many - fewer) / 400:6.1f}")
