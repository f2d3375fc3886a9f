"""Compares the two ports with each other, and with `cellwire decode`, on what no vector has.

Usage: python3 reference/checks/fuzz.py [--seed N] [--count N] [--link LINK]…

Streams are pieces of vectors, cut, changed and with noise between them; stories are the committed ones with steps left out,
repeated, and at other times. Where the ports differ, or differ from the tool, a clause can be read in two ways. The ports are
built by ports.py before; without target/debug/cellwire the tool is left out. Exit status 1 on a difference.
"""

import argparse
import json
import random
import subprocess
import sys

from ports import REFERENCE, TARGET
from testee import ask, load, same, until, without_names

CELLWIRE = REFERENCE.parent / "target/debug/cellwire"
PORTS = [[sys.executable, "-B", REFERENCE / "ports/python/testee.py"], [TARGET / "c/testee"]]
LONGEST_NOISE = 700
SHOWN, WIDTH = 3, 2000  # differences, characters of an answer


def change(data, rng, alphabet):
    """A frame as a bad line leaves it."""
    data = bytearray(data)
    kind = rng.randrange(8)
    at = rng.randrange(len(data) + 1)
    if kind == 0:
        return data[:at]
    if kind == 1:
        return data[at:]
    if kind == 2 and at < len(data):
        data[at] = rng.choice(alphabet)
    elif kind == 3:
        data[at:at] = rng.choices(alphabet, k=rng.randrange(1, 4))
    elif kind == 4:
        long = rng.random() < 0.1
        return bytearray(rng.choices(alphabet, k=rng.randrange(1, LONGEST_NOISE if long else 30)))
    return data


def stream(link, vectors, rng):
    """A request: frames of one side with the same options, some of them corrupt."""
    model = rng.choice(vectors)
    alike = [v for v in vectors if v.get("from") == model.get("from") and v.get("options") == model.get("options")]
    frames = [bytes.fromhex(vector["hex"].replace("|", "")) for vector in alike]
    alphabet = list(b"".join(frames)) + list(range(256))
    data = b"".join(change(rng.choice(frames), rng, alphabet) for _ in range(rng.randrange(1, 8)))
    request = {"task": "stream", "link": link, "options": model.get("options", {}), "hex": data.hex() + "|"}
    return request | {"read": rng.choice([0, 1, 5])} | ({"from": model["from"]} if "from" in model else {})


def story(link, stories, rng):
    """A request: a story whose steps were left out, repeated and moved in time."""
    model = rng.choice(stories)
    others = [other for other in stories if other["end"] == model["end"]]
    steps = model["steps"][:1] + rng.choices(rng.choice(others)["steps"] + model["steps"], k=rng.randrange(1, 20))
    changed, now = [], 0
    for step in steps:
        now += rng.choice([0, 0, 1, 1000, 10**6, 5 * 10**6, 14 * 10**6, 28 * 10**6, 10**8, 15 * 10**8])
        changed.append({"at": now, "do": step["do"]} | ({"hold": True} if rng.random() < 0.1 else {}))
    return {"task": "session", "link": link, "end": model["end"], "config": model.get("config", {}), "steps": changed}


def claimed(link, stories):
    """The stories of the ends that both ports have."""
    ends = {story["end"]: story for story in stories}
    requests = [{"task": "session", "link": link, "end": end, "config": ends[end].get("config", {}), "steps": []} for end in ends]
    answers = [ask(port, requests) for port in PORTS]
    have = {end for end, *pair in zip(ends, *answers) if not any("skipped" in answer for answer in pair)}
    return [story for story in stories if story["end"] in have]


def tool(request):
    """What the tool makes of a stream."""
    command = [CELLWIRE, "decode", request["link"], "--format", "raw"]
    command += ["--from", request["from"]] if "from" in request else []
    for name, value in request["options"].items():
        command += ["--set", f"{name}={value if isinstance(value, str) else json.dumps(value)}"]
    done = subprocess.run(command, input=bytes.fromhex(request["hex"][:-1]), capture_output=True, check=False)
    return {"items": [json.loads(line) for line in done.stdout.splitlines()]}


def without_ends(answer):
    """The items; the tool does not say which ones only the end has given."""
    return [{name: value for name, value in item.items() if name != "end"} for item in answer.get("items", [])]


def comparable(answer):
    """An answer without what is a port's own."""
    if "refused" in answer:
        return {"refused": True}
    for step in answer.get("steps", []):
        step["refused"] = "refused" in step
        step["deadline"] = until(step["deadline"])
        step["events"] = [without_names(event) for event in step["events"]]
    return answer


def run(link, count, seed):
    rng = random.Random(seed)
    vectors, stories = load("vectors", link)["vectors"], claimed(link, load("sessions", link).get("stories", []))
    requests = [stream(link, vectors, rng) for _ in range(count)]
    requests += [story(link, stories, rng) for _ in range(count if stories else 0)]
    requests = [request for request in requests if request.get("hex") != "|"]
    one, other = (ask(port, requests) for port in PORTS)
    differences = 0
    for request, a, b in zip(requests, one, other):
        compared = [(a, b, same(comparable(a), comparable(b)))]
        if request["task"] == "stream" and CELLWIRE.exists():
            c = tool(request)
            compared.append((a, c, same(without_ends(a), without_ends(c))))
        for left, right, alike in compared:
            differences += not alike
            if not alike and differences <= SHOWN:
                print(f"{link}: {json.dumps(request)}\n  {json.dumps(left)[:WIDTH]}\n  {json.dumps(right)[:WIDTH]}")
    print(f"{link}: {len(requests) - differences} of {len(requests)}")
    return differences == 0


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--count", type=int, default=100, help="streams of each link, and as many stories")
    parser.add_argument("--link", action="append", help="only this link")
    args = parser.parse_args()
    links = args.link or sorted(path.stem for path in (REFERENCE / "sessions").glob("*.json"))
    results = [run(link, args.count, args.seed) for link in links]
    sys.exit(not all(results))


if __name__ == "__main__":
    main()
