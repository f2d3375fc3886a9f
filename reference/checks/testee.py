"""Runs a port against the vectors, streams, session stories and values.

Usage: python3 reference/checks/testee.py [--link LINK]… [--clause CLAUSE]… [--claim CLAIM]… [--json FILE] [--html FILE] COMMAND…
       python3 reference/checks/testee.py --link LINK --explain "streams 12" [COMMAND…]

COMMAND starts the testee; ports/README.md describes what it reads and writes. Prints what is wrong, and
`link: passed of all` with the number of cases that the testee skipped; exit status 1 on a failure.
"""

import argparse
import difflib
import html
import json
import math
import re
import struct
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

REFERENCE = Path(__file__).resolve().parent.parent
TIMEOUT = 600  # of a machine that has other things to do
NEVER = 2**63  # nanoseconds, or more
# How many bytes a read returns; 0: everything up to the next end.
READS = [0, 1, 3]
# What a side and a setting are when a file does not name them.
DEFAULTS = {"options": {}}


@dataclass
class Wrong:
    """The first wrong step of a story, from 1; it is false."""

    step: int
    text: str

    def __bool__(self):
        return False


@dataclass
class Case:
    """An example of the reference, and what a testee makes of it."""

    name: str
    entry: Any
    # Requests, and what says whether the answer to each is right.
    checks: list[Any]
    result: str = "passed"
    why: str = ""
    answers: list[Any] = field(default_factory=list)


def case(kind, entry, checks, prefix=""):
    return Case(f"{prefix}{kind} {entry['id']}", entry, checks)


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
        # What only the end shows is given with it, and all else before it.
        if first.get("end", False) != vector.get("end", False):
            return False
        if result in ("valid", "acceptable"):
            whole = len(items) == 1 and first.get("length") == size
            return whole and same(first.get("message"), vector["message"])
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


def is_refused(answer):
    return "refused" in answer


def refused_cases(refused, side):
    return [({"task": "encode", **side, "message": refused["message"]}, is_refused)]


def without_names(event):
    """An event; the states and inputs of `unexpected` are named by our machines."""
    return {"event": "unexpected"} if event.get("event") == "unexpected" else event


def until(deadline):
    """A deadline; none at all is never, too."""
    return NEVER if deadline is None else min(deadline, NEVER)


def story_cases(story, link):
    def played(answer):
        found = answer.get("steps", [])
        if len(found) != len(story["steps"]):
            return False
        for number, (got, step) in enumerate(zip(found, story["steps"]), 1):
            expected = {name: step[name] for name in ("refused", "events", "transmit", "deadline") if name in step}
            for name, empty in (("refused", None), ("events", []), ("transmit", []), ("deadline", None)):
                value, given = expected.get(name, empty), got.get(name, empty)
                if name == "transmit":
                    value = [bytes.fromhex(text).hex().upper() for text in value]
                if name == "deadline":
                    given, value = until(given), until(value)
                if name == "refused" and value is not None and isinstance(given, dict):
                    continue  # a port may use other kinds
                if name == "events":
                    given, value = ([without_names(event) for event in events] for events in (given, value))
                if not same(given, value):
                    return Wrong(number, f"step {number}, {step['do']}: {name} is {given}, not {value}")
        return True

    steps = [{name: step[name] for name in ("at", "do", "hold", "keep") if name in step} for step in story["steps"]]
    request = {"task": "session", "link": link, "end": story["end"], "config": story.get("config", {}), "steps": steps}
    return [(request, played)]


def config_cases(refused, link):
    request = {"task": "session", "link": link, "end": refused["end"], "config": refused["config"], "steps": []}
    return [(request, is_refused)]


def value_cases(value, link):
    """What words mean, apart from any frame."""

    def computed(answer):
        return "error" in answer if "error" in value else same(answer.get("gives"), value["gives"])

    return [({"task": "value", "link": link, "given": value["given"]}, computed)]


def whole(part, text):
    """The text of a program that has this part."""
    return part["before"] + text + part["behind"] if part else text


def program(part, message):
    """The object of a program that has this part."""
    base = {"name": "A", "kind": None, "attributes": None, "application": None, "instructions": [], "positions": []}
    return base | {part["list"]: [message]} if part else message


def inside(part, error):
    """An error by its place in the program, not in its part."""
    before = part["before"] if part else ""
    return error | {"line": error["line"] + before.count("\n"), "offset": error["offset"] + len(before)}


def items_are(items):
    return lambda answer: same(answer.get("items"), items)


def written_as(text):
    return lambda answer: "hex" in answer and bytes.fromhex(answer["hex"]).decode(errors="replace") == text


def ls_request(task, entry, **fields):
    return {"task": task, "link": "fanuc-ls", "options": entry.get("options", {})} | fields


def read(task, entry, data):
    return ls_request(task, entry, hex=data.hex().upper() + "|", read=0)


def program_cases(vector, parts):
    part = parts.get(vector.get("part"))
    data = whole(part, vector["text"]).encode()
    item = {"offset": 0, "length": len(data)}
    if vector["result"] == "invalid":
        return [(read("decode", vector, data), items_are([item | {"error": inside(part, vector["error"])}]))]
    message = program(part, vector["message"])
    text = whole(part, vector.get("written", vector["text"]))
    writes = is_refused if "refused" in vector else written_as(text)
    return [
        (read("decode", vector, data), items_are([item | {"message": message}])),
        (ls_request("encode", vector, message=message), writes),
    ]


def ls_cases(vectors, streams):
    """The cases of fanuc-ls: texts of programs, and of parts of them."""
    parts = vectors["parts"]
    for vector in vectors["vectors"]:
        yield case("vectors", vector, program_cases(vector, parts))
    for refused in vectors["refused"]:
        message = program(parts.get(refused.get("part")), refused["message"])
        yield case("refused", refused, [(ls_request("encode", refused, message=message), is_refused)])
    for stream in streams["streams"]:
        data = stream["text"].encode(stream.get("encoding", "utf-8"))
        yield case("streams", stream, [(read("stream", stream, data), items_are(stream["items"]))])


def cases(link):
    """The cases of a link, each with its requests and what says whether the answer to each is right."""
    yield from ((case, case.checks) for case in every_case(link))


def every_case(link):
    if link == "fanuc-ls":
        yield from ls_cases(load("vectors", link), load("streams", link))
        return
    sessions = load("sessions", link)
    for refused in sessions.pop("refused", []):
        yield case("configs", refused, config_cases(refused, link))
    for document in (load("vectors", link), load("streams", link), sessions):
        yield from entries("", document, link)
    # What was seen at machines.
    for path in sorted((REFERENCE / "field").glob("*.json")):
        document = json.loads(path.read_text())
        if document["link"] == link:
            yield from entries(f"{path.stem} ", document, link)


def entries(prefix, document, link):
    """The cases of one file."""
    for kind, make in (("vectors", vector_cases), ("refused", refused_cases), ("streams", stream_cases)):
        for entry in document.get(kind, []):
            side = DEFAULTS | {"link": link} | {name: entry[name] for name in ("from", "options") if name in entry}
            yield case(kind, entry, make(entry, side), prefix)
    for story in document.get("stories", []):
        yield case("story", story, story_cases(story, link), prefix)
    for value in document.get("values", []):
        yield case("values", value, value_cases(value, link), prefix)


def ask(command, requests):
    """The answer to each request; a testee that ends too early has none for the rest."""
    lines = "".join(json.dumps(request) + "\n" for request in requests)
    done = subprocess.run(command, input=lines, capture_output=True, text=True, timeout=TIMEOUT, check=False)
    answers = [json.loads(line) for line in done.stdout.splitlines()]
    if len(answers) < len(requests) or done.returncode != 0 or done.stderr:
        print(f"{' '.join(map(str, command))}: exit status {done.returncode}\n{done.stderr}")
    return answers + [{}] * (len(requests) - len(answers))


def judge(case, link, claims):
    """Says of a case whether its answers are right, those that were not skipped: a decoder alone passes the decoder's half of a vector."""
    for (request, is_right), answer in zip(case.checks, case.answers):
        if "skipped" in answer:
            claim = {"session": f"{link}/{request.get('end')}", "value": f"{link}/values"}.get(request["task"], link)
            if claim in claims:
                case.result = "wrong"
                case.why = f"is skipped, and {claim} is claimed"
                return
        elif not (verdict := is_right(answer)):
            case.result = "wrong"
            case.why = verdict.text if isinstance(verdict, Wrong) else f"{json.dumps(request)}\n  gives {json.dumps(answer)}"
            return
    if all("skipped" in answer for answer in case.answers):
        case.result, case.why = "skipped", case.answers[0]["skipped"]


def run(command, link, chosen, claims):
    """The cases of a link, judged."""
    found = [case for case in every_case(link) if chosen(case)]
    answers = iter(ask(command, [request for case in found for request, _ in case.checks]) if found else [])
    for case in found:
        case.answers = [next(answers) for _ in case.checks]
        judge(case, link, claims)
        if case.result == "wrong":
            print(f"{link} {case.name}: {case.why}")
    counts = count(found)
    total = len(found) - counts["skipped"]
    in_part = sum(case.result == "passed" and any("skipped" in answer for answer in case.answers) for case in found)
    notes = [f"{n} {what}" for n, what in ((counts["skipped"], "skipped"), (in_part, "passed in part")) if n]
    print(f"{link}: {counts['passed']} of {total}" + (f" ({', '.join(notes)})" if notes else ""))
    return found


def count(found):
    return {result: sum(case.result == result for case in found) for result in ("passed", "wrong", "skipped")}


def clause_text(link, clause):
    """A clause of the specification, to the blank line behind it."""
    text = (REFERENCE / f"{link}.md").read_text()
    match = re.search(rf"^(- |\| )?\*{{0,2}}{clause}\b.*?(?=\n\n|\n- |\n\| )", text, re.M | re.S)
    return match[0] if match else f"**{clause}** is not in {link}.md"


def explain(link, case):
    """What a case tests, its bytes by field, what is expected, and what the testee gives."""
    entry = case.entry
    lines = [f"{link} {case.name}: {entry.get('comment', '')}"]
    lines += [clause_text(link, clause) for clause in entry.get("clauses", [])]
    for name in ("end", "config", "from", "options", "part"):
        if entry.get(name):
            lines.append(f"{name}: {json.dumps(entry[name])}")
    if "hex" in entry:
        lines.append("bytes, by field:")
        offset = 0
        for field_bytes in re.findall(r"[0-9A-F]+|\|", entry["hex"]):
            for part in re.findall(".{1,64}", field_bytes):
                lines.append(f"  {offset:5}  {'(an end)' if part == '|' else part + as_text(link, part)}")
                offset += 0 if part == "|" else len(part) // 2
    if "text" in entry:
        lines += ["text:", *(f"  {number:4}  {line!r}" for number, line in enumerate(entry["text"].split("\n"), 1))]
    lines.append("expected:")
    for name in ("result", "message", "written", "refused", "error", "only", "given", "gives"):
        if name in entry:
            lines.append(f"  {name}: {json.dumps(entry[name], ensure_ascii=False)}")
    lines += numbered(link, [*entry.get("items", []), *entry.get("steps", [])])
    for (request, is_right), answer in zip(case.checks, case.answers):
        size = f", read {request['read']}" if request.get("read") else ""
        verdict = is_right(answer)
        lines.append(f"{request['task']}{size}: {'right' if verdict else 'wrong'}")
        given = answer.get("items") or answer.get("steps") or [answer]
        lines += numbered(link, given, getattr(verdict, "step", None))
        lines += [f"  {verdict.text}"] if isinstance(verdict, Wrong) else []
    return "\n".join(lines)


# The links whose frames are text.
TEXTS = {"kawasaki-msg", "mmacell-proto", "val2-viewer"}


def as_text(link, digits):
    """The bytes of a link of texts as a comment."""
    text = repr(bytes.fromhex(digits).decode("latin-1"))[1:-1]
    return f"  {text}" if link in TEXTS and text else ""


def numbered(link, steps, wrong=None):
    """Items or steps with their numbers, and the bytes of a link of texts as text; the wrong one is marked."""
    lines = []
    for number, step in enumerate(steps, 1):
        lines.append(f"{'>' if number == wrong else ' '} {number:3}  {json.dumps(step, ensure_ascii=False)}")
        for digits in [step.get("do", {}).get("input"), *step.get("transmit", [])]:
            lines += [f"        {text.strip()}"] if digits and (text := as_text(link, digits)) else []
    return lines


def report(results):
    """All cases as an object."""
    one = lambda case: {"case": case.name, "clauses": case.entry.get("clauses", []), "result": case.result} | ({"why": case.why} if case.why else {})
    return {link: count(found) | {"cases": [one(case) for case in found]} for link, found in results.items()}


def page(results):
    """All cases as a page: a table of links, and what is wrong."""
    rows = "".join(
        f"<tr><td>{link}<td>{c['passed']}<td class={'bad' if c['wrong'] else 'good'}>{c['wrong']}<td>{c['skipped']}"
        for link, c in ((link, count(found)) for link, found in results.items())
    )
    wrong = "".join(
        f"<details><summary>{html.escape(' '.join([link, case.name, case.entry.get('comment', '')]))}</summary>"
        f"<pre>{html.escape(explain(link, case))}</pre></details>"
        for link, found in results.items()
        for case in found
        if case.result == "wrong"
    )
    style = "body{font:15px sans-serif;margin:2em}td,th{padding:.2em 1em;text-align:left}.bad{color:#b00}pre{white-space:pre-wrap;background:#eee;padding:1em}"
    head = "<tr><th>link<th>passed<th>wrong<th>skipped"
    return f"<!doctype html><meta charset=utf-8><title>testee</title><style>{style}</style><table>{head}{rows}</table>{wrong or '<p>Nothing is wrong.'}\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--link", action="append", help="only this link")
    parser.add_argument("--clause", action="append", help="only cases that test this clause")
    parser.add_argument("--claim", action="append", default=[], help="LINK, LINK/END or LINK/values: none of it may be skipped")
    parser.add_argument("--explain", metavar="CASE", help="shows one case, such as \"streams 12\": its clauses, bytes and result")
    parser.add_argument("--json", type=Path, help="writes all cases there")
    parser.add_argument("--html", type=Path, help="writes a page there")
    parser.add_argument("command", nargs=argparse.REMAINDER)
    args = parser.parse_args()
    known = sorted(path.stem for path in (REFERENCE / "vectors").glob("*.json"))
    links = args.link or known
    if unknown := set(links) - set(known):
        parser.error(f"there is no link {', '.join(sorted(unknown))}; the links are {', '.join(known)}")
    if args.explain:
        shown = [(link, case) for link in links for case in every_case(link) if case.name == args.explain]
        for link, case in shown:
            case.answers = ask(args.command, [request for request, _ in case.checks]) if args.command else []
            print(explain(link, case))
        names = [case.name for link in links for case in every_case(link)]
        near = difflib.get_close_matches(args.explain, names, 3)
        kinds = {name.rpartition(" ")[0]: name.rpartition(" ")[2] for name in names}
        last = ", ".join(f"{kind} 1 to {number}" for kind, number in kinds.items())
        sys.exit(0 if shown else f"there is no case {args.explain!r}, but {', '.join(near) or 'none like it'}; the names are {last}")
    wanted = set(args.clause or [])
    if untested := wanted - {clause for link in links for case in every_case(link) for clause in case.entry.get("clauses", [])}:
        sys.exit(f"no case of {', '.join(links)} tests {', '.join(sorted(untested))}")
    chosen = lambda case: not wanted or not wanted.isdisjoint(case.entry.get("clauses", []))
    results = {link: run(args.command, link, chosen, set(args.claim)) for link in links}
    if args.json:
        args.json.write_text(json.dumps(report(results), indent=1))
    if args.html:
        args.html.write_text(page(results))
    sys.exit(any(case.result == "wrong" for found in results.values() for case in found))


if __name__ == "__main__":
    main()
