"""Computes the `values` of vectors from the specifications.

Usage: python3 reference/checks/values.py

The rows of sections 4.2 and 4.4 are read from fanuc-hmi-modbus.md; nothing of our code is asked. Prints
`link: passed of all` for each link that has values; exit status 1 on a failure.
"""

import json
import math
import re
import struct
import sys
from pathlib import Path

REFERENCE = Path(__file__).resolve().parent.parent
TEXT = (REFERENCE / "fanuc-hmi-modbus.md").read_text()
# What the vectors call the signals that the table names with more than a word.
NAMES = {"flag F": "flag", "WSI (wire stick)": "wsi", "dynamic assignment": "dynamic"}
PERIOD = 8_000_000


def table(section):
    """The cells of the rows of a section's table."""
    body = TEXT.split(f"### {section} ")[1].split("\n### ")[0]
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in body.splitlines() if line.startswith("|")]
    return rows[2:]


def signals():
    """Name to (first number, last number, table, first address)."""
    rows = {}
    for name, numbers, kind, _, _, addresses in table("4.2"):
        first, last = map(int, numbers.split(" to "))
        key = NAMES.get(name, name.lower())
        rows[key] = (first, last, kind.replace(" ", "_"), int(addresses.split(" to ")[0]))
    return rows


def join(order, words):
    low, high = words if order == "low_first" else words[::-1]
    return low | high << 16


def split(order, bits):
    words = [bits & 0xFFFF, bits >> 16 & 0xFFFF]
    return words if order == "low_first" else words[::-1]


def real(order, words):
    return struct.unpack("<f", struct.pack("<I", join(order, words)))[0]


def real_words(order, value):
    return split(order, struct.unpack("<I", struct.pack("<f", value))[0])


def signed(bits, width):
    return bits - (bits >> width - 1 << width)


def whole(value):
    """Rounded, halves away from zero."""
    return int(math.copysign(math.floor(abs(value) + 0.5), value))


def units(amount):
    """A length or an angle of ALTER in units of its word; None: no number."""
    ((kind, value),) = amount.items()
    if value is None:
        return None
    # A million of either is outside of a word, and more would be no finite number.
    return whole(max(-1e6, min(1e6, value)) * (32 if kind == "mm" else 65536 / 360))


def word(amount):
    value = units(amount)
    return value if value is not None and -32768 <= value <= 32767 else "error"


def nearest_word(amount):
    return max(-32768, min(32767, units(amount) or 0))


def scale(number):
    return number["multiply"] if number["multiply"] > 0 else 1


def signal(given):
    ((name, number),) = given.items()
    first, last, kind, address = signals()[name]
    return {"table": kind, "address": address + number - first} if first <= number <= last else None


def place(given):
    for name, (first, last, kind, address) in signals().items():
        if kind == given["table"] and 0 <= given["address"] - address <= last - first:
            return {name: first + given["address"] - address}
    return None


def read(given):
    number, words = given["number"], given["registers"]
    if number["kind"] == "float32":
        return real(number["order"], words)
    bits = signed(words[0], 16) if number["kind"] == "int16" else signed(join(number["order"], words), 32)
    return bits / scale(number)


def write(given):
    number, value = given["number"], given["value"]
    if number["kind"] == "float32":
        try:
            return real_words(number["order"], value)
        except OverflowError:
            return "error"
    scaled, width = value * scale(number), 16 if number["kind"] == "int16" else 32
    if not math.isfinite(scaled):
        return "error"
    rounded = whole(scaled)
    if not -(2 ** (width - 1)) <= rounded < 2 ** (width - 1):
        return "error"
    return [rounded & 0xFFFF] if width == 16 else split(number["order"], rounded & 0xFFFFFFFF)


def read_text(given):
    data = b"".join(struct.pack(">H", word) for word in given["registers"])
    return data.split(b"\0")[0].decode()


def write_text(given):
    data, room = given["text"].encode(), 2 * given["registers"]
    if len(data) > room or 0 in data:
        return "error"
    return list(struct.unpack(f">{given['registers']}H", data.ljust(room, b"\0")))


GROUPS = {"POS_X": ("position", 3), "POS_W": ("wpr", 3), "Q_1": ("quaternion", 4), "SPD_X": ("velocity", 3), "SPD_Q1": ("quaternion_rate", 4)}


def block_rows():
    """The first address of each value of the block: the counter's, the override's, and the reals' by group."""
    addresses = [int(number) for row in table("4.4") for number in re.findall(r"\d+", row[2])]
    groups = []
    for name, count in GROUPS.values():
        first = 2 + sum(size for _, size in groups)
        groups.append((name, count))
        yield name, addresses[first : first + count]


def read_block(given):
    order, words = given["order"], given["registers"]
    block = {"life_counter": join(order, words[:2]), "override": signed(words[2], 16)}
    for name, addresses in block_rows():
        values = [real(order, words[at : at + 2]) for at in addresses]
        block[name] = [value if math.isfinite(value) else None for value in values]
    return block


def write_block(given):
    order, block = given["order"], given["block"]
    words = split(order, block["life_counter"]) + [block["override"] & 0xFFFF] + [0] * 34
    for name, addresses in block_rows():
        for at, value in zip(addresses, block[name]):
            words[at : at + 2] = real_words(order, value)
    return words


def assign(slots):
    ranges = []
    for slot in slots:
        first, last = slot["address"] - 1, slot["address"] + slot["size"] - 2
        name, multiply = slot["var_name"], slot["multiply"]
        wrong = not 0 <= first <= last < 16384 or not re.fullmatch("[ -&(-~]{1,37}", name)
        wrong |= multiply not in (0, -1) and not 0.0001 <= multiply <= 10000
        if wrong or any(first <= end and begin <= last for begin, end in ranges):
            return "error"
        ranges.append([first, last])
    return ranges if len(ranges) <= 80 else "error"


def track(blocks):
    seen, last, time = [], None, 0
    for block in blocks:
        step = (block["life_counter"] - last["life_counter"]) % 2**32 if last else None
        if step is None or step >= 2**31:
            seen.append("first" if last is None else "restarted")
            last, time = dict(block), 0
        elif step == 0:
            seen.append("repeated")
        else:
            quaternion = block["quaternion"]
            if sum(a * b for a, b in zip(quaternion, last["quaternion"])) < 0:
                quaternion = [-value for value in quaternion]
            time += step * PERIOD
            rate = lambda now, before: [(a - b) / (step * PERIOD / 1e9) for a, b in zip(now, before)]
            seen.append({
                "time": time,
                "missed": step - 1,
                "orientation": quaternion,
                "velocity": rate(block["position"], last["position"]),
                "quaternion_rate": rate(quaternion, last["quaternion"]),
            })
            last = block | {"quaternion": quaternion}
    return seen


KINDS = {function.__name__: function for function in (
    signal, place, read, write, read_text, write_text, read_block, write_block, assign, track, word, nearest_word
)}


def same(found, expected):
    """Whether two values are equal; reals need the precision of a float."""
    if isinstance(expected, dict):
        return isinstance(found, dict) and found.keys() == expected.keys() and all(same(found[k], v) for k, v in expected.items())
    if isinstance(expected, list):
        return isinstance(found, list) and len(found) == len(expected) and all(map(same, found, expected))
    if isinstance(expected, float):
        return isinstance(found, float | int) and math.isclose(found, expected, rel_tol=1e-6, abs_tol=1e-9)
    return found == expected


def check(link, vectors):
    """Whether all values of a link are as computed."""
    passed = 0
    for vector in vectors:
        ((kind, given),) = vector["given"].items()
        found = KINDS[kind](given)
        expected = "error" if "error" in vector else vector["gives"]
        if same(found, expected):
            passed += 1
        else:
            print(f"{link} value {vector['id']}: {found}, not {expected}")
    print(f"{link}: {passed} of {len(vectors)}")
    return passed == len(vectors)


def main():
    files = {path.stem: json.loads(path.read_text()) for path in sorted((REFERENCE / "vectors").glob("*.json"))}
    results = [check(link, file["values"]) for link, file in files.items() if "values" in file]
    sys.exit(not all(results))


if __name__ == "__main__":
    main()
