"""Plants that never were: what both ends of a link send with options drawn at random, written by the Python port.

A plant has what a capture of it has, the options, and for each of them the other values that these bytes do not rule out: with which
the port reads every frame, and would write it the same; of corrupt bytes, every frame but one.
"""

import json
import math
import random
import struct
import sys
from pathlib import Path

REFERENCE = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(REFERENCE / "ports/python"))

from cellwire import fanuc_hmi_modbus, isra_ball, kawasaki_msg, laser_eb90, mmacell_proto, val2_alter, val2_viewer  # noqa: E402
from cellwire.stream import Refused  # noqa: E402

MESSAGES = 20
FLAG = [False, True]
# Any byte that is no other tag.
ANY = "any"


def alter(rng):
    """A session of ALTER: the robot tells where it is, the host answers."""
    options = {"leading_dle": rng.choice([1, 2]), **{name: rng.choice(FLAG) for name in ("negated_sum", "stuffed_checksum", "ignore_spare_select")}}
    transform = rng.random() < 0.5
    messages = []
    if rng.random() < 0.5:
        messages += [("robot", {"kind": "start", "mode": rng.choice([22, 23]), "data": []}), ("host", {"kind": "start_reply", "reply": "accept"})]
    segment, percent, offset = rng.randrange(400), rng.randrange(9000), [rng.randrange(-300, 300) for _ in range(6)]
    words = [rng.randrange(-16384, 16385) for _ in range(12)]
    while len(messages) < MESSAGES:
        percent += rng.randrange(600)
        if percent > 16384:
            segment, percent = segment + 1, percent - 16384
        words = [max(-32768, min(32767, word + rng.randrange(-40, 41))) for word in words]
        motion = {"kind": "motion", "phase": "running", "error": 0, "segment_status": 2, "segment": segment, "percent": percent}
        messages.append(("robot", motion | {"transform": words if transform else None}))
        offset = [value + rng.randrange(-20, 21) for value in offset]
        values = [value if rng.random() < 0.8 else None for value in offset]
        messages.append(("host", {"kind": "reply", "exception": 0, "values": values}))
    return options, messages


def f32(value):
    """The nearest float of 32 bits."""
    return struct.unpack("<f", struct.pack("<f", value))[0]


def laser(rng):
    """Instructions and their echoes."""
    options = {
        "tail": rng.choice(["printed", "etx", "either"]),
        "flag": rng.choice(["separate", "first_tag"]),
        "tags": dict(zip(["f32", "i16", "u8", "char"], rng.sample(range(256), 4))),
        "checksum": rng.choice(["u8", "u16_le", "u16_be"]),
        "checksum_negated": rng.choice(FLAG),
        "checksum_with_flag": rng.choice(FLAG),
        "byte_order": rng.choice(["little", "big"]),
    }
    if rng.random() < 0.3:
        options["tags"] = {"f32": 0xF0, "i16": 0xF1, "u8": 0xF2, "char": 0xF3}
    texts = ["READY", "PROGRAM ONE", "laser head", "shutter is open", "Axis fault", "Door", "GAS 2 BAR"]
    kinds = rng.sample(["move", "bytes", "text", "short"], rng.randrange(1, 5))
    messages = []
    while len(messages) < MESSAGES:
        word = rng.choice([0x101, 0x102, 0x103, 0x201, 0x202, 0x301])
        items = [{"i16": [word]}]
        kind = rng.choice(kinds)
        if kind == "move":
            items.append({"f32": [f32(round(rng.uniform(-600, 600), 2)) for _ in range(6)]})
        elif kind == "bytes":
            items.append({"u8": [rng.randrange(rng.choice([8, 256])) for _ in range(rng.randrange(1, 9))]})
        elif kind == "text":
            items.append({"char": rng.choice(texts)})
        messages += [("host", {"items": items}), ("controller", {"items": [{"i16": [word]}]})]
    return options, messages


def mma(rng):
    """Commands of the central controller to the robot or the platform, and replies."""
    options = {name: rng.choice(FLAG) for name in ("itr", "ovrd", "clos", "off", "lone_lf", "blank", "wide_integers")}
    device = rng.choice(["robot", "platform"])
    axes = lambda: [round(rng.uniform(-400, 400), 3) for _ in range(3)] + [round(rng.uniform(-3, 3), 4)] if device == "robot" else [round(rng.uniform(-3, 3), 4) for _ in range(2)]  # noqa: E731
    code = lambda: rng.choice([1, 2, 3, 40_000, 70_001]) if options["wide_integers"] and rng.random() < 0.4 else rng.randrange(1, 4)  # noqa: E731
    messages = []
    while len(messages) < MESSAGES:
        name = rng.choice(["STA", "STA", "STA", "STP", "RST", "SRV", "OVR", "MOV", "HND", "ACQ", "CLO"])
        command = {"command": name}
        command |= {
            "SRV": {"on": rng.choice(FLAG)},
            "OVR": {"percent": rng.randrange(101)},
            "MOV": {"mode": rng.choice(["absolute", "relative"]), "axes": axes()},
            "HND": {"gripper": rng.randrange(2), "open": rng.choice(FLAG)},
            "ACQ": {"camera": rng.randrange(3)},
        }.get(name, {})
        reply = {"reply": "ok"}
        if name == "STA":
            reply = {"reply": "status", "moving": rng.choice(FLAG), "axes": axes(), "servo": True, "override": 80, "error": rng.choice([0, 0, code()])}
        elif rng.random() < 0.1:
            reply = {"reply": "error", "error": code()}
        messages += [("central", command), (device, reply)]
    return options, messages


def modbus(rng):
    """The telemetry block, polled, and a few other requests."""
    options = {"framing": rng.choice(["tcp", "rtu"]), "word_order": rng.choice(["low_first", "high_first"])}
    only = rng.random() < 0.2
    counter, position = rng.randrange(10**6), [rng.uniform(-500, 500) for _ in range(6)]
    messages, transaction = [], rng.randrange(1000)
    while len(messages) < MESSAGES:
        transaction += 1
        number = {"transaction": transaction, "unit": 1} if options["framing"] == "tcp" else {"unit": 1}
        if only or rng.random() < 0.2:
            at = rng.randrange(16000)
            request = {"function": 6, "address": at, "value": rng.randrange(65536)}
            messages += [("client", number | request), ("server", number | request)]
            continue
        counter += rng.randrange(1, 9)
        position = [value + rng.uniform(-1, 1) for value in position]
        quaternion = [rng.uniform(-1, 1) for _ in range(4)]
        size = math.sqrt(sum(value * value for value in quaternion))
        values = position + [value / size for value in quaternion] + [rng.uniform(-50, 50) for _ in range(3)] + [rng.uniform(-1, 1) for _ in range(4)]
        words = lambda bits: [bits & 0xFFFF, bits >> 16][:: 1 if options["word_order"] == "low_first" else -1]  # noqa: E731
        registers = words(counter) + [100] + [word for value in values for word in words(struct.unpack("<I", struct.pack("<f", value))[0])]
        messages.append(("client", number | {"function": 3, "address": 0, "quantity": 37}))
        messages.append(("server", number | {"function": 3, "registers": registers}))
    return options, messages


def kawasaki(rng):
    """Messages of a plant with its own names."""
    options = {"charset": rng.choice(["ascii", "latin1"])}
    letters = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ" + ("äöåÄÖÅ" * 2 if options["charset"] == "latin1" else "")
    names = ["".join(rng.choices(letters, k=rng.randrange(4, 16))) for _ in range(6)]
    messages, order, number = [], rng.randrange(1, 9999), 0
    while len(messages) < MESSAGES:
        number += 1
        fields = [str(order), str(number)] + [str(rng.randrange(-9999, 9999)) for _ in range(rng.randrange(5))]
        messages += [("robot", {"name": rng.choice(names[:3]), "header": [], "fields": fields[:2]}), ("pc", {"name": rng.choice(names[3:]), "header": [], "fields": fields})]
    return options, messages


def ball(rng):
    """Packets of a hand that moves."""
    ident = {"sensor_type": rng.randrange(8), "sensor": rng.randrange(8)}
    hand = [rng.randrange(-60, 60) for _ in range(6)]
    messages = []
    for _ in range(MESSAGES):
        hand = [max(-128, min(127, value + rng.randrange(-9, 10))) for value in hand]
        messages.append(("ball", ident | {"status": "fresh", "force": hand[:3], "moment": hand[3:], "keys": rng.choice([0, 0, 1])}))
    return {}, messages


def viewer(rng):
    """Poses."""
    pose, messages = [rng.randrange(-16384, 16384) for _ in range(12)], []
    for count in range(MESSAGES):
        pose = [value + rng.randrange(-50, 51) for value in pose]
        messages.append(("host", {"count": count, "pose": pose}))
    return {}, messages


LINKS = {
    "fanuc-hmi-modbus": (fanuc_hmi_modbus, modbus),
    "isra-ball": (isra_ball, ball),
    "kawasaki-msg": (kawasaki_msg, kawasaki),
    "laser-eb90": (laser_eb90, laser),
    "mmacell-proto": (mmacell_proto, mma),
    "val2-alter": (val2_alter, alter),
    "val2-viewer": (val2_viewer, viewer),
}
CHOICES = {
    "leading_dle": [1, 2],
    "tail": ["printed", "etx", "either"],
    "flag": ["separate", "first_tag"],
    "checksum": ["u8", "u16_le", "u16_be"],
    "byte_order": ["little", "big"],
    "framing": ["tcp", "rtu"],
    "word_order": ["low_first", "high_first"],
    "charset": ["ascii", "latin1"],
}
# Which end opens the connection.
CLIENTS = {"kawasaki-msg": "robot", "mmacell-proto": "central", "fanuc-hmi-modbus": "client"}
# What the port has not: the view of the telemetry block, whose bytes are the same in both orders.
UNKNOWN = {"word_order"}


def wire(link, options):
    """The options that the port knows."""
    return {name: value for name, value in options.items() if name not in UNKNOWN}


def others(options):
    """Each open option by its name, with another value, and all options as they would be with that."""
    for name, value in options.items():
        if name == "tags":
            free = next(byte for byte in range(256) if byte not in value.values())
            for kind in value:
                yield f"tags.{kind}", ANY, options | {"tags": value | {kind: free}}
            swapped = value | {"u8": value["char"], "char": value["u8"]}
            yield "tags.u8", value["char"], options | {"tags": swapped}
            yield "tags.char", value["u8"], options | {"tags": swapped}
            # Of the two types of one byte only one may occur, and nobody knows which.
            yield "tags.u8", ANY, options | {"tags": value | {"char": value["u8"], "u8": free}}
            yield "tags.char", ANY, options | {"tags": value | {"u8": value["char"], "char": free}}
            continue
        for other in CHOICES.get(name, FLAG):
            if other != value:
                yield name, other, options | {name: other}


def rules_out(link, options, frames):
    """How many frames the port does not read with these options, or would not write so."""
    return sum(not reads(link, options, *frame) for frame in frames)


def reads(link, options, sender, frame):
    """Whether the port reads a frame with these options, and would write it so."""
    module = LINKS[link][0]
    decoder = module.Decoder(sender=sender, options=wire(link, options))
    decoder.push(frame)
    item = decoder.next()
    if item is None:
        decoder.end()
        item = decoder.next()
    if item is None or item.message is None or item.length != len(frame):
        return False
    try:
        return module.encode(item.message, sender=sender, options=wire(link, options)) == frame
    except (Refused, KeyError, TypeError, AttributeError):
        return False


def corrupted(frames, rng, rate):
    """The frames with bytes changed at this rate, begun in the middle of the first; and those that are whole."""
    seen, whole = [], []
    begun = set()
    for sender, frame in frames:
        data = bytes(byte ^ rng.randrange(1, 256) if rng.random() < rate else byte for byte in frame)
        if rate and sender not in begun:
            data = data[rng.randrange(1, len(data)) :]
        begun.add(sender)
        seen.append((sender, data))
        if data == frame:
            whole.append((sender, frame))
    return seen, whole


def plant(link, seed, rate):
    """One plant: options, the frames as captured, and which other values of each option explain them as well."""
    rng = random.Random(f"{link} {seed}")
    module, make = LINKS[link]
    options, messages = make(rng)
    frames = [(sender, module.encode(message, sender=sender, options=wire(link, options))) for sender, message in messages[:MESSAGES]]
    seen, whole = corrupted(frames, rng, rate)
    alike = {}
    for name, value, other in others(options):
        alike.setdefault(name, [])
        # Where bytes are corrupt, one frame alone may be one of them.
        if rules_out(link, other, whole) < (2 if rate else 1):
            alike[name].append(value)
    return options, seen, alike


def segment(source, target, sequence, data):
    """An IP packet with a TCP segment."""
    tcp = struct.pack(">HHIIBBHHH", source, target, sequence, 0, 0x50, 0x18, 0xFFFF, 0, 0) + data
    addresses = [10, 0, 0, 1 if source > target else 2, 10, 0, 0, 2 if source > target else 1]
    return struct.pack(">BBHHHBBH", 0x45, 0, 20 + len(tcp), 0, 0, 64, 6, 0) + bytes(addresses) + tcp


def pcap(link, frames, port):
    """A capture of the connection, without its beginning."""
    client = CLIENTS.get(link, "host")
    sequence = {False: 1, True: 1}
    out = struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, 101)
    for number, (sender, data) in enumerate(frames):
        from_client = sender == client
        ends = (50_000, port) if from_client else (port, 50_000)
        packet = segment(*ends, sequence[from_client], data)
        sequence[from_client] += len(data)
        out += struct.pack("<IIII", number // 100, number % 100 * 10_000, len(packet), len(packet)) + packet
    return out


if __name__ == "__main__":
    options, frames, alike = plant(sys.argv[1], sys.argv[2], float(sys.argv[3]))
    print(json.dumps(options), json.dumps(alike))
    for sender, data in frames:
        print(sender, data.hex(" "))
