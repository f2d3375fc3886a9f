"""Parses every vector with the parser that Kaitai Struct makes of kaitai/<link>.ksy, in Python.

Usage: target/reference/venv/bin/python reference/checks/kaitai.py [LINK…]

Prints `link: passed of all`; exit status 1 on a failure. The rules are those of kaitai.mjs.
"""

import importlib
import json
import struct
import subprocess
import sys
import tempfile
from io import BytesIO
from pathlib import Path

from kaitaistruct import KaitaiStream, KaitaiStructError

REFERENCE = Path(__file__).resolve().parent.parent


def alter(data, leading_dle=2, stuffed_checksum=False, **_):
    """The data bytes and the checksum of a frame of val2-alter."""
    at = len(data) - len(data.lstrip(b"\x10"))
    if at < leading_dle or data[at : at + 1] != b"\x02":
        raise ValueError("no start mark")
    plain = bytearray()
    at += 1
    while data[at] != 0x10 or data[at + 1] == 0x10:
        plain.append(data[at])
        at += 2 if data[at] == 0x10 else 1
    if data[at + 1] != 0x03:
        raise ValueError("no end mark")
    rest = data[at + 2 :]
    if stuffed_checksum and rest[:1] == b"\x10":
        if rest[1:2] != b"\x10":
            raise ValueError("no end mark")
        rest = rest[:1] + rest[2:]
    return bytes(plain) + rest


def laser(data, flag="separate", **_):
    """A frame of laser-eb90 with its payload unstuffed."""
    at = 4 if flag == "separate" else 3
    plain = bytearray(data[:at])
    while data[at] != 0x90 or data[at + 1] == 0x90:
        plain.append(data[at])
        at += 2 if data[at] == 0x90 else 1
    return bytes(plain) + data[at:]


# What is around the described bytes. A link without an entry has nothing.
ENVELOPES = {"laser-eb90": laser, "val2-alter": alter}


# Keys that Kaitai's expressions do not allow as names.
NAMES = {"and": "and_mask", "or": "or_mask"}
# What an object of this kind means where it does not name these.
UNSAID = {"start": {"marked": True, "error": 0}}


def compare(found, expected, path):
    """Raises unless `found` has what `expected` has."""
    if isinstance(expected, dict):
        for name, value in expected.items():
            compare(getattr(found, NAMES.get(name, name)), value, f"{path}.{name}")
    elif isinstance(expected, list):
        found = getattr(found, "value", found)  # an object stands for its value
        compare(len(found), len(expected), f"{path}.length")
        for index, value in enumerate(expected):
            compare(found[index], value, f"{path}[{index}]")
    elif isinstance(found, float) and found == struct.unpack("f", struct.pack("f", expected))[0]:
        return  # a single, of which JSON has the shortest decimal
    elif getattr(found, "value", found) != expected:  # an object stands for its value
        raise ValueError(f"{path} is {found}, not {expected}")


def check(vector, link, params, parser):
    options = vector.get("options", {}) | ({"sender": vector["from"]} if "from" in vector else {})
    # The parts of an option that is an object are parameters of their own.
    parts = {f"{name}_{part}": v for name, inner in options.items() if isinstance(inner, dict) for part, v in inner.items()}
    options |= parts
    data = bytes.fromhex(vector["hex"])
    try:
        if link in ENVELOPES:
            data = ENVELOPES[link](data, **options)
        stream = KaitaiStream(BytesIO(data))
        parsed = parser(*[options.get(param["id"], param.get("-default")) for param in params], stream)
        if not stream.is_eof():
            raise ValueError("bytes are left")
    except (EOFError, IndexError, KaitaiStructError, ValueError):
        if "error" in vector:
            return
        raise
    if "error" in vector:
        raise ValueError("was not rejected")
    message = vector["message"]
    compare(parsed, UNSAID.get(message.get("kind"), {}) | message, "message")


def run(link, directory):
    params = json.loads((directory / f"{link}.params.json").read_text())
    module = importlib.import_module(link.replace("-", "_"))
    parser = getattr(module, "".join(part.capitalize() for part in link.split("-")))
    vectors = json.loads((REFERENCE / f"vectors/{link}.json").read_text())["vectors"]
    passed = 0
    for vector in vectors:
        try:
            check(vector, link, params, parser)
            passed += 1
        except Exception as error:
            print(f"{link} {vector['id']}: {type(error).__name__} {error}")
    print(f"{link}: {passed} of {len(vectors)}")
    return passed == len(vectors)


def main():
    links = sys.argv[1:] or sorted(path.stem for path in (REFERENCE / "kaitai").glob("*.ksy"))
    with tempfile.TemporaryDirectory() as directory:
        compiler = ["node", REFERENCE / "checks/kaitai.mjs", "--compile", directory, *links]
        subprocess.run(compiler, check=True)
        sys.path.insert(0, directory)
        results = [run(link, Path(directory)) for link in links]
    sys.exit(not all(results))


if __name__ == "__main__":
    main()
