"""Holds the report of `cellwire identify` on bytes that no option explains to made-up protocols: the links' own with one thing changed
that no option covers.

Usage: python3 reference/checks/unknown.py [--count N] [--first N] [--link LINK]… [--show]

CELLWIRE names the tool [default: target/debug/cellwire]. The Python port writes the messages, and this script changes them: another mark,
another check, a byte more, a length. Half of them are bytes alone, half a capture with packets and times. Prints for each link and each thing how many reports name it, and `unknown: passed of all`; exit
status 1 if fewer than 90 % do.
"""

import argparse
import json
import os
import random
import struct
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from functools import reduce
from operator import xor
from pathlib import Path

from plants import LINKS, REFERENCE, segment, wire

CELLWIRE = os.environ.get("CELLWIRE", REFERENCE.parent / "target/debug/cellwire")
NAMED = 0.9
# The links over TCP; the others are serial lines.
TCP = {"kawasaki-msg", "mmacell-proto"}
MESSAGES = 60


def crc(data, bits, poly, init, reflect, out):
    """A recomputed CRC."""
    value = init
    for byte in data:
        byte = int(f"{byte:08b}"[::-1], 2) if reflect else byte
        value ^= byte << (bits - 8)
        for _ in range(8):
            value = (value << 1) ^ (poly if value >> (bits - 1) else 0)
            value &= (1 << bits) - 1
    if reflect:
        value = int(f"{value:0{bits}b}"[::-1], 2)
    return value ^ out


CRCS = {
    "CRC-16/MODBUS": (16, 0x8005, 0xFFFF, True, 0),
    "CRC-16/XMODEM": (16, 0x1021, 0, False, 0),
    "CRC-16/IBM-3740": (16, 0x1021, 0xFFFF, False, 0),
    "CRC-16/KERMIT": (16, 0x1021, 0, True, 0),
    "CRC-8/SMBUS": (8, 0x07, 0, False, 0),
    "CRC-8/MAXIM-DOW": (8, 0x31, 0, True, 0),
    "CRC-32/ISO-HDLC": (32, 0x04C11DB7, 0xFFFFFFFF, True, 0xFFFFFFFF),
}


def check(rng, data):
    """Another check of some bytes, and how it is called."""
    name = rng.choice([*CRCS, "xor"])
    if name == "xor":
        return name, bytes([reduce(xor, data)])
    bits = CRCS[name][0]
    return name, crc(data, *CRCS[name]).to_bytes(bits // 8, "little")


# The check at the end of each link's frames: how many bytes it has, and the first byte that it covers.
CHECKS = {"val2-alter": (1, 0), "laser-eb90": (1, 3), "isra-ball": (1, 0), "fanuc-hmi-modbus": (2, 0)}
MARKS = {
    "val2-alter": bytes([0x10, 0x10, 0x02]),
    "laser-eb90": bytes([0xEB, 0x90, 0x82]),
    "isra-ball": bytes([0x08, 0xF8, 0x5D]),
    "val2-viewer": b"$POSE,",
    "kawasaki-msg": b"<",
}
NEW = {
    "val2-alter": [b"\x10\x10\x01", b"\x7e\x7e", b"\x10\x10\x05"],
    "laser-eb90": [b"\xaa\x55", b"\xeb\x91\x82", b"\x7e\x7e\x01"],
    "isra-ball": [b"\x08\xf8\x52", b"\x08\xf7\x5d", b"\xaa\x08"],
    "val2-viewer": [b"$POSX,", b"!P;", b"#POSE "],
    "kawasaki-msg": [b"[", b"{", b"("],
}
ENDS = {"mmacell-proto": b"\r\n", "val2-viewer": b"\r\n", "kawasaki-msg": b">"}
NEW_ENDS = {"mmacell-proto": [b"\r", b";", b"\x03", b"\n\r"], "val2-viewer": [b"\r", b"\x00", b";"], "kawasaki-msg": [b"]", b"}", b"\x03"]}


def things(link):
    """What can be changed of a link."""
    found = []
    if link in MARKS:
        found.append("begin")
    if link in ENDS:
        found.append("end")
    if link in CHECKS:
        found.append("check")
    if link in ("kawasaki-msg", "mmacell-proto"):
        found.append("added check")
    if link in ("val2-alter", "laser-eb90", "isra-ball"):
        found += ["counter", "length"]
    if link == "fanuc-hmi-modbus":
        found += ["counter"]
    return found


def protocol(link, seed):
    """A made-up protocol: the bytes, what is changed, and what names it."""
    rng = random.Random(f"unknown {link} {seed}")
    module, make = LINKS[link]
    thing = things(link)[seed % len(things(link))]
    frames, options, side = [], None, None
    while len(frames) < MESSAGES:
        drawn, messages = make(rng)
        if options is None:
            options = wire(link, drawn)
            if link == "laser-eb90":
                options |= {"checksum": "u8", "tail": "printed", "flag": "separate", "tags": {"f32": 0xF0, "i16": 0xF1, "u8": 0xF2, "char": 0xF3}}
            if link == "val2-alter":
                options |= {"leading_dle": 2, "stuffed_checksum": False}
            if link == "fanuc-hmi-modbus":
                options |= {"framing": "rtu"}
            if link == "mmacell-proto":
                options |= {"lone_lf": False}
            side = rng.choice(sorted({sender for sender, _ in messages}))
        for sender, message in messages:
            if link == "fanuc-hmi-modbus":
                message = {name: value for name, value in message.items() if name != "transaction"}
            if sender == side:
                try:
                    frames.append(module.encode(message, sender=sender, options=options))
                except Exception:
                    # Drawn with other options.
                    continue
    frames = frames[:MESSAGES]
    if thing == "begin":
        mark = rng.choice(NEW[link])
        frames = [mark + frame[len(MARKS[link]) :] for frame in frames]
        return frames, thing, mark
    if thing == "end":
        mark = rng.choice(NEW_ENDS[link])
        frames = [frame[: -len(ENDS[link])] + mark for frame in frames]
        return frames, thing, mark
    if thing == "check":
        name = None
        state = rng.getstate()
        made = []
        for frame in frames:
            rng.setstate(state)
            width, first = CHECKS[link]
            body = frame[:-width]
            name, data = check(rng, body[first:])
            made.append(body + data)
        if link == "fanuc-hmi-modbus" and name == "CRC-16/MODBUS":
            return protocol(link, seed + 1000)
        return made, thing, name
    if thing == "added check":
        width = rng.choice([1, 2])
        end = ENDS[link]
        made = []
        for frame in frames:
            inner = frame[: -len(end)]
            value = sum(inner) & 0xFF if width == 1 else crc(inner, *CRCS["CRC-16/XMODEM"])
            made.append(inner + (f"*{value:0{2 * width}X}").encode() + end)
        return made, "check", "sum" if width == 1 else "CRC-16/XMODEM"
    at = len(MARKS.get(link, b"\x01"))
    if thing == "counter":
        first = rng.randrange(200)
        made = [frame[:at] + bytes([(first + number) & 0xFF]) + frame[at:] for number, frame in enumerate(frames)]
        return made, thing, at
    made = [frame[:at] + bytes([len(frame) - at]) + frame[at:] for frame in frames]
    return made, "length", at


def names(report, thing, what):
    """Whether the report names what is changed."""
    for seen in report.get("seen", []):
        begin, end = (bytes.fromhex(seen[name]) for name in ("begin", "end"))
        if thing == "begin" and begin.startswith(what):
            return True
        if thing == "end" and end.endswith(what):
            return True
        if thing == "check" and seen["check"] and seen["check"]["kind"] == what:
            return True
        if thing == "counter" and any(counter["at"] == what for counter in seen["counters"]):
            return True
        if thing == "length":
            if seen["length"] and seen["length"]["at"] == what:
                return True
            # Of one length alone, the byte is one that is the same in all.
            shortest, longest = seen["lengths"]
            if shortest == longest and (len(begin) > what or any(at == what for at, _ in seen["constant"])):
                return True
    return False


def packets(link, frames, rng):
    """The frames as they arrive, each piece with its time in microseconds: of a TCP connection a few are joined or divided; of a serial
    line a driver hands over eight bytes at a time."""
    time, pieces, held = 0, [], b""
    for frame in frames:
        time += rng.randrange(15_000, 60_000)
        if link not in TCP:
            for at in range(0, len(frame), 8):
                time += 8 * 1042
                pieces.append((time, frame[at : at + 8]))
            continue
        frame, held = held + frame, b""
        if rng.random() < 0.03:
            held = frame
        elif rng.random() < 0.03 and len(frame) > 1:
            at = rng.randrange(1, len(frame))
            pieces += [(time, frame[:at]), (time + 200, frame[at:])]
        else:
            pieces.append((time, frame))
    return pieces + ([(time, held)] if held else [])


def capture(link, pieces):
    """A capture of the pieces, all of one end."""
    out = struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, 101 if link in TCP else 147)
    sequence = 1
    for time, data in pieces:
        packet = segment(50_000, 9105, sequence, data) if link in TCP else data
        sequence += len(data)
        out += struct.pack("<IIII", time // 1_000_000, time % 1_000_000, len(packet), len(packet)) + packet
    return out


def judge(link, seed):
    """The thing, whether it is named, and the report."""
    frames, thing, what = protocol(link, seed)
    with_times = seed // len(things(link)) % 2 == 1
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "capture"
        if with_times:
            file.write_bytes(capture(link, packets(link, frames, random.Random(f"times {link} {seed}"))))
        else:
            file.write_bytes(b"".join(frames))
        command = [CELLWIRE, "identify", "--json", "--format", "pcap" if with_times else "raw", file]
        run = subprocess.run(command, capture_output=True, text=True)
    if not run.stdout:
        raise SystemExit(f"{link} {seed}: {run.stderr}")
    report = json.loads(run.stdout)
    is_sure = "seen" not in report
    kind = f"{thing}, {'capture' if with_times else 'bytes alone'}"
    return kind, not is_sure and names(report, thing, what), (what, report)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--link", action="append")
    parser.add_argument("--show", action="store_true")
    arguments = parser.parse_args()
    links = arguments.link or list(LINKS)
    cases = [(links[number % len(links)], arguments.first + number // len(links)) for number in range(arguments.count)]
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        judged = list(pool.map(lambda case: judge(*case), cases))
    counts = {}
    for (link, seed), (thing, named, report) in zip(cases, judged):
        passed, total = counts.get((link, thing), (0, 0))
        counts[link, thing] = (passed + named, total + 1)
        if arguments.show and not named:
            print(f"{link} {seed}: {thing}: {report[0]!r}: {json.dumps(report[1].get('seen', report[1]['findings'][:1]))[:600]}")
    for (link, thing), (passed, total) in sorted(counts.items()):
        print(f"{link}, {thing}: {passed} named of {total}")
    for kind in ("bytes alone", "capture"):
        of_kind = [count for (_, thing), count in counts.items() if thing.endswith(kind)]
        print(f"{kind}: {sum(passed for passed, _ in of_kind)} named of {sum(total for _, total in of_kind)}")
    passed = sum(passed for passed, _ in counts.values())
    print(f"unknown: {passed} of {len(cases)}")
    sys.exit(passed < NAMED * len(cases))


if __name__ == "__main__":
    main()
