"""Runs a port against the vectors, streams and session stories.

Usage: python3 reference/checks/testee.py [--link LINK]… [--claim CLAIM]… COMMAND [ARGUMENT…]

COMMAND starts the testee; ports/README.md describes what it reads and writes. Prints what is wrong, and
`link: passed of all` with the number of cases that the testee skipped; exit status 1 on a failure.
"""

import argparse
import json
import math
import struct
import subprocess
import sys
from pathlib import Path

import programs

REFERENCE = Path(__file__).resolve().parent.parent
TIMEOUT = 120
NEVER = 2**63  # nanoseconds, or more
# How many bytes a read returns; 0: everything up to the next end.
READS = [0, 1, 3]
# What a side and a setting are when a file does not name them.
DEFAULTS = {"options": {}}


def load(kind, link):
    path = REFERENCE / kind / f"{link}.json"
    return json.loads(path.read_text()) if path.exists() else {}


def same(found, expected, name=None):
    """Whether two JSON values are equal; `f32` values need the precision of a float only."""
    if isinstance(expected, dict):
        return (
            isinstance(found, dict)
            and found.keys() == expected.keys()
            and all(same(found[k], v, k) for k, v in expected.items())
        )
    if isinstance(expected, list):
        return (
            isinstance(found, list)
            and len(found) == len(expected)
            and all(same(f, e, name) for f, e in zip(found, expected))
        )
    if name == "f32" and isinstance(found, float | int) and isinstance(expected, float | int):
        return struct.pack("<f", found) == struct.pack("<f", expected)
    if isinstance(expected, float | int) and isinstance(found, float | int):
        return isinstance(found, bool) == isinstance(expected, bool) and math.isclose(found, expected, rel_tol=1e-15)
    return found == expected


def covers(found, expected):
    """Whether an error has the fields that a vector gives."""
    return isinstance(found, dict) and all(
        name in found and same(found[name], value) for name, value in expected.items()
    )


def vector_cases(vector, side):
    """Requests, and what is wrong with the answer to each."""
    hexes, result = vector["hex"], vector["result"]
    size = len(bytes.fromhex(hexes.replace("|", "")))
    if "|" not in hexes:
        hexes += "|"

    def decoded(answer):
        items = answer.get("items", [])
        first = items[0] if items else {}
        if result in ("valid", "acceptable"):
            whole = len(items) == 1 and first.get("length") == size and not first.get("end")
            return whole and same(first.get("message"), vector["message"])
        if result == "incomplete" and not first.get("end"):
            return False
        only = vector.get("only", False)
        return covers(first.get("error"), vector["error"]) and (not only or len(items) == 1)

    def encoded(answer):
        if result == "acceptable" and "refused" in answer:
            return True
        same_bytes = bytes.fromhex(answer.get("hex", "")) == bytes.fromhex(vector["hex"])
        return "hex" in answer and same_bytes == (result == "valid")

    cases = [({"task": "decode", **side, "hex": hexes, "read": read}, decoded) for read in READS]
    if result in ("valid", "acceptable"):
        # What an option makes acceptable is written in another way without it.
        options = side["options"] if result == "valid" else {}
        cases.append(({"task": "encode", **side, "options": options, "message": vector["message"]}, encoded))
    return cases


def stream_cases(stream, side):
    def decoded(answer):
        return same(answer.get("items"), stream["items"])

    hexes = stream["hex"].rstrip().removesuffix("|") + "|"
    return [({"task": "stream", **side, "hex": hexes, "read": read}, decoded) for read in READS]


def refused_cases(refused, side):
    return [({"task": "encode", **side, "message": refused["message"]}, lambda answer: "refused" in answer)]


def without_names(event):
    """An event; the states and inputs of `unexpected` are named by our machines."""
    return {"event": "unexpected"} if event.get("event") == "unexpected" else event


def story_cases(story, link):
    def played(answer):
        found = answer.get("steps", [])
        if len(found) != len(story["steps"]):
            return False
        for number, (got, step) in enumerate(zip(found, story["steps"])):
            expected = {name: step[name] for name in ("refused", "events", "transmit", "deadline") if name in step}
            for name, empty in (("refused", None), ("events", []), ("transmit", []), ("deadline", None)):
                value = expected.get(name, empty)
                if name == "transmit":
                    value = [bytes.fromhex(text).hex().upper() for text in value]
                if name == "deadline" and None not in (value, got.get(name)):
                    got[name], value = min(got[name], NEVER), min(value, NEVER)
                if name == "refused" and value is not None and isinstance(got.get(name), dict):
                    continue  # a port may use other kinds
                if name == "events":
                    got[name] = [without_names(event) for event in got.get(name, empty)]
                    value = [without_names(event) for event in value]
                if not same(got.get(name, empty), value):
                    answer["wrong"] = f"step {number}, {step['do']}: {name} is {got.get(name, empty)}, not {value}"
                    return False
        return True

    steps = [{name: step[name] for name in ("at", "do", "hold", "keep") if name in step} for step in story["steps"]]
    request = {"task": "session", "link": link, "end": story["end"], "config": story.get("config", {}), "steps": steps}
    return [(request, played)]


def cases(link):
    """The name of each case, and its requests."""
    if link == "fanuc-ls":
        yield from programs.cases(load("vectors", link), load("streams", link), same)
        return
    for folder in ("vectors", "streams", "sessions"):
        yield from entries("", load(folder, link), link)
    # What was seen at machines.
    for path in sorted((REFERENCE / "field").glob("*.json")):
        document = json.loads(path.read_text())
        if document["link"] == link:
            yield from entries(f"{path.stem} ", document, link)


def entries(name, document, link):
    """The cases of one file."""
    for kind, make in (("vectors", vector_cases), ("refused", refused_cases), ("streams", stream_cases)):
        for entry in document.get(kind, []):
            side = DEFAULTS | {"link": link} | {field: entry[field] for field in ("from", "options") if field in entry}
            yield f"{name}{kind} {entry['id']}", make(entry, side)
    for story in document.get("stories", document.get("sessions", [])):
        yield f"{name}story {story['id']}", story_cases(story, link)


def ask(command, requests):
    """The answer to each request; a testee that ends too early has none for the rest."""
    lines = "".join(json.dumps(request) + "\n" for request in requests)
    done = subprocess.run(command, input=lines, capture_output=True, text=True, timeout=TIMEOUT, check=False)
    answers = [json.loads(line) for line in done.stdout.splitlines()]
    if len(answers) < len(requests) or done.returncode != 0 or done.stderr:
        print(f"{' '.join(map(str, command))}: exit status {done.returncode}\n{done.stderr}")
    return answers + [{}] * (len(requests) - len(answers))


def run(command, link, claims):
    groups = list(cases(link))
    answers = iter(ask(command, [request for _, group in groups for request, _ in group]))
    passed = skipped = 0
    for name, group in groups:
        got = [(request, check, next(answers)) for request, check in group]
        if all("skipped" in answer for _, _, answer in got):
            request = got[0][0]
            claim = f"{link}/{request['end']}" if "end" in request else link
            if claim in claims:
                print(f"{link} {name}: is skipped, and {claim} is claimed")
            else:
                skipped += 1
            continue
        wrong = next(((r, a) for r, check, a in got if not check(a)), None)
        if wrong is None:
            passed += 1
        else:
            request, answer = wrong
            what = answer.get("wrong") or f"{json.dumps(request)}\n  gives {json.dumps(answer)}"
            print(f"{link} {name}: {what}")
    total = len(groups) - skipped
    print(f"{link}: {passed} of {total}" + (f" ({skipped} skipped)" if skipped else ""))
    return passed == total


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--link", action="append", help="only this link")
    parser.add_argument("--claim", action="append", default=[], help="LINK, or LINK/END: none of it may be skipped")
    parser.add_argument("command", nargs=argparse.REMAINDER)
    args = parser.parse_args()
    links = args.link or sorted(path.stem for path in (REFERENCE / "vectors").glob("*.json"))
    results = [run(args.command, link, set(args.claim)) for link in links]
    sys.exit(not all(results))


if __name__ == "__main__":
    main()
