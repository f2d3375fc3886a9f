"""Holds `cellwire identify` to plants that the Python port has made (plants.py): it names the right options, or says what is undecided.

Usage: python3 reference/checks/identify.py [--count N] [--first N] [--link LINK]… [--show]

CELLWIRE names the tool [default: target/debug/cellwire]. Each plant is captured twice: as it is, and with 1 % of the bytes changed and
begun in the middle of a message; half of them as a connection, half as one line with both directions. Prints
`link: passed of all`, with how many plants are right, undecided (an option that the bytes decide was not named) and wrong (a wrong value
was named). Exit status 1 if one is wrong, or fewer than 95 % are right.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from plants import ANY, LINKS, REFERENCE, pcap, plant

CELLWIRE = os.environ.get("CELLWIRE", REFERENCE.parent / "target/debug/cellwire")
RATES = [0.0, 0.01]
# The least share that is right.
RIGHT = 0.95
PORTS = {"mmacell-proto": 2001, "fanuc-hmi-modbus": 502}


def ask(link, frames, seed, named):
    """What the tool makes of the frames."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "capture"
        if seed % 2:
            file.write_bytes(pcap(link, frames, PORTS.get(link, 9105)))
        else:
            file.write_bytes(b"".join(data for _, data in frames))
        command = [CELLWIRE, "identify", "--json", "--format", "pcap" if seed % 2 else "raw", file]
        run = subprocess.run(command + (["--link", link] if named else []), capture_output=True, text=True)
    lines = run.stdout.splitlines()
    if len(lines) != 1:
        raise SystemExit(f"{link} plant {seed}: {run.stderr}")
    return json.loads(lines[0])["findings"]


def truth(options, name):
    """The value of an option, or of one inside a table."""
    table, _, inner = name.partition(".")
    if name == "echo":
        return False  # no plant has such a line
    return options[table][inner] if inner else options[table]


def judge(link, seed, rate, named):
    """right, undecided or wrong, and why."""
    options, frames, alike = plant(link, seed, rate)
    findings = ask(link, frames, seed, named)
    if not findings or not findings[0]["sure"]:
        return "undecided", ["no link is sure"]
    found = findings[0]
    if found["crate"] != link:
        return "wrong", [f"it is no {found['crate']}"]
    wrong, undecided = [], []
    for option in found["options"]:
        name, expected = option["name"], truth(options, option["name"])
        others = option.get("others", []) if option["decided"] == "no" else []
        if others is None:
            if ANY not in alike[name]:
                undecided.append(f"{name}: any")
            continue
        if expected not in [option["value"], *others]:
            wrong.append(f"{name}: {option['value']} by {option['decided']}, or {others}, not {expected}")
        elif ANY not in alike[name] and any(value not in [expected, *alike[name]] for value in [option["value"], *others]):
            undecided.append(f"{name}: {option['value']} or {others}, not only {expected} or {alike[name]}")
    return ("wrong" if wrong else "undecided" if undecided else "right"), wrong + undecided


def check(link, arguments):
    """Whether the plants of a link hold; prints the figures."""
    passed = all_of_them = 0
    for rate in RATES:
        seeds = range(arguments.first, arguments.first + arguments.count)
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            # Each fourth without a hint of which link it is.
            judged = list(pool.map(lambda seed: judge(link, seed, rate, seed % 4 > 1), seeds))
        count = {word: sum(found == word for found, _ in judged) for word in ("right", "undecided", "wrong")}
        kind = "as it is" if rate == 0 else "corrupt, begun in the middle"
        print(f"{link}, {kind}: {count['right']} right, {count['undecided']} undecided, {count['wrong']} wrong")
        for seed, (word, why) in zip(seeds, judged):
            if word == "wrong" or arguments.show and word == "undecided":
                print(f"{link} plant {seed}, {kind}: {word}: {'; '.join(why)}")
        all_of_them += arguments.count
        passed += arguments.count if count["wrong"] == 0 and count["right"] >= RIGHT * arguments.count else count["right"]
    print(f"{link}: {passed} of {all_of_them}")
    return passed == all_of_them


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=20)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--link", action="append")
    parser.add_argument("--show", action="store_true")
    arguments = parser.parse_args()
    results = [check(link, arguments) for link in arguments.link or LINKS]
    sys.exit(not all(results))


if __name__ == "__main__":
    main()
