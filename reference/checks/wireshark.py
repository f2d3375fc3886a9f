"""Reads captures of the vectors with the dissectors of wireshark/, through tshark.

Usage: python3 reference/checks/wireshark.py [LINK…]

Every valid vector is a capture of TCP connections: the frame whole, every byte in a segment of its own, two frames in a segment,
and one and a half before the other half. Each must show the values of `message` in the fields of the same names. An invalid
vector is followed by a valid one: the dissector must name the error and show the valid one. PAIRS are requests and their
answers: the answer must name the request and the time between them. expert_stories.py breaks each rule that a dissector knows: its
expert info must show, and nothing of the kind where no rule is broken.

Prints `link: passed of all`; exit status 1 on a failure.
"""

import json
import re
import struct
import subprocess
import sys
import tempfile
from pathlib import Path

import expert_stories

REFERENCE = Path(__file__).resolve().parent.parent
SERVER_PORT = 9100
# The sides that are the client of the TCP connection; all others are the server.
CLIENTS = {
    "laser-eb90": ["host"], "mmacell-proto": ["central"], "fanuc-hmi-modbus": ["client"], "val2-alter": ["host"],
    "kawasaki-msg": ["robot"],
}
# Requests of a client of the connection and the server's answers, or vice versa: the first begins.
PAIRS = {
    "val2-alter": [("server", "101002A0171003B7"), ("client", "10100200100300")],
    "val2-viewer": [("client", "05"), ("server", b"$POSE,0,0,0,0,0,0,0,0,0,0,0,0,0*15\r\n".hex())],
    "isra-ball": [("client", "05"), ("server", "08F85D0001FE03FC05FA817A")],
    "fanuc-hmi-modbus": [("client", "000100000006010300000025"), ("server", "000100000003018302")] * 2,
    "mmacell-proto": [("client", "5354410D0A"), ("server", "45522B30303030310D0A")] * 2,
    "kawasaki-msg": [("client", b"<Tila$6#0$0$$$#>".hex()), ("server", b"<Huuhaa$0##>".hex())] * 2,
    "laser-eb90": [("client", "EB9082F0F10101019082F4"), ("server", "EB9082F0F10101019082F4")] * 2,
}
# Preferences that follow from the side that sends.
PREFERENCES = {"mmacell-proto": {"robot": {"device": "robot"}, "platform": {"device": "platform"}}}
GAP = 0.010
AGGREGATOR = "\x1f"


class Capture:
    """A pcap file of TCP connections to SERVER_PORT."""

    def __init__(self):
        self.packets = []
        self.seqs = {}
        self.now = 0.0

    def wait(self, seconds):
        self.now += seconds

    def send(self, client_port, side, data):
        """A segment of `data`, GAP after the one before."""
        ports = (client_port, SERVER_PORT) if side == "client" else (SERVER_PORT, client_port)
        addresses = b"\x0a\0\0\x01\x0a\0\0\x02" if side == "client" else b"\x0a\0\0\x02\x0a\0\0\x01"
        seq = self.seqs.get(ports, 1)
        self.seqs[ports] = seq + len(data)
        ack = self.seqs.get(ports[::-1], 1)
        tcp = struct.pack(">HHIIBBHHH", *ports, seq, ack, 0x50, 0x18, 0xFFFF, 0, 0) + data
        ip = struct.pack(">BBHHHBBH", 0x45, 0, 20 + len(tcp), 0, 0, 64, 6, 0) + addresses
        self.packets.append((self.now, ip + tcp))
        self.wait(GAP)

    def to_bytes(self):
        raw_ip = 101
        blocks = [struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, raw_ip)]
        for time, packet in self.packets:
            micros = round(time * 1e6)
            length = len(packet)
            blocks.append(struct.pack("<IIII", micros // 10**6, micros % 10**6, length, length) + packet)
        return b"".join(blocks)


def leaves(value, name=None):
    """The name and text of every number, string and truth value in an object, in order."""
    if isinstance(value, dict):
        return [leaf for key, inner in value.items() for leaf in leaves(inner, key)]
    if isinstance(value, list):
        return [leaf for inner in value for leaf in leaves(inner, name)]
    if value is None:
        return []
    return [(name, str(int(value)) if isinstance(value, bool) else str(value))]


def same(found, expected):
    """Whether a field shows a value: truth values, fractions and control characters are printed in more than one way."""
    found = {"True": "1", "False": "0"}.get(found, found)
    for escaped, character in (("\\t", "\t"), ("\\r", "\r"), ("\\n", "\n")):
        found = found.replace(escaped, character)
    if found == shown(expected):
        return True
    try:
        number, wanted = float(found), float(expected)
        # A single of which six digits are printed.
        single = struct.unpack("f", struct.pack("f", wanted))[0]
    except (ValueError, OverflowError):
        return False
    is_close = "." in found + expected and abs(number - wanted) <= 1e-6 * abs(wanted)
    return is_close or "." in found and float(f"{single:.6g}") == number


def shown(text):
    """What is printed of a string: it ends at its first NUL."""
    return text.split("\0")[0]


def cases(vector, good):
    """The segments of each connection that shows a vector, and the messages that they hold."""
    data = bytes.fromhex(vector["hex"])
    if "error" in vector:
        # What is incomplete takes the message after it.
        is_cut = vector["result"] == "incomplete" or vector["error"]["kind"] == "incomplete"
        after = [bytes.fromhex(good["hex"])] * (2 if is_cut else 1)
        return [([data, *after], [good["message"]])]
    half = len(data) // 2
    once, twice = [vector["message"]], [vector["message"]] * 2
    return [
        ([data], once),
        ([data[at : at + 1] for at in range(len(data))], once),
        ([data + data], twice),
        ([data + data[:half], data[half:]], twice),
    ]


def read(capture, options, columns):
    """The columns that tshark shows, for each client port: name to values in order."""
    with tempfile.TemporaryDirectory() as directory:
        path = Path(directory) / "capture.pcap"
        path.write_bytes(capture.to_bytes())
        command = ["tshark", "-r", path, *options, "-T", "fields", "-E", f"aggregator={AGGREGATOR}"]
        for column in ["tcp.srcport", "tcp.dstport", *columns]:
            command += ["-e", column]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0 or "Lua: " in done.stderr or "Lua Error" in done.stdout:
        sys.exit(f"tshark: {done.stderr}{done.stdout[:1000]}")
    shown = {}
    for line in done.stdout.splitlines():
        source, destination, *values = line.split("\t")
        port = int(destination if source == str(SERVER_PORT) else source)
        fields = shown.setdefault(port, {name: [] for name in columns})
        for name, value in zip(columns, values):
            fields[name] += value.split(AGGREGATOR) if value else []
    return shown


def tshark(link, options, capture, names):
    """The fields that the dissector of a link shows, for each client port: name to values in order."""
    proto = link.replace("-", "_")
    command = ["-X", f"lua_script:{REFERENCE}/wireshark/{link}.lua", "-d", f"tcp.port=={SERVER_PORT},{proto}"]
    parts = {f"{name}_{part}": v for name, inner in options.items() if isinstance(inner, dict) for part, v in inner.items()}
    scalars = {name: value for name, value in options.items() if not isinstance(value, dict)}
    for name, value in (scalars | parts).items():
        command += ["-o", f"{proto}.{name}:{str(value).upper() if isinstance(value, bool) else value}"]
    shown = read(capture, command, [f"{proto}.{name}" for name in names])
    return {port: {name: fields[f"{proto}.{name}"] for name in names} for port, fields in shown.items()}


def check(vector, fields, messages):
    """What is wrong with what was shown, or None."""
    expected = {}
    for message in messages:
        for name, value in leaves(message):
            expected.setdefault(name, []).append(value)
    for name, found in fields.items():
        if name in ("decode_error", "request_in", "response_time"):
            continue
        # An empty string alone in a segment shows nothing.
        values = [value for value in expected.get(name, []) if shown(value)]
        found = [value for value in found if value]
        if "error" in vector:
            # Its bytes may hold a frame after the error.
            found = found[max(0, len(found) - len(values)) :]
        if len(found) != len(values) or not all(map(same, found, values)):
            return f"{name} is {found}, not {values}"
    errors = fields["decode_error"]
    if "error" not in vector:
        return f"decode_error is {errors}" if errors else None
    kind = vector["error"]["kind"]
    # What comes after the rest of a frame decides what is wrong with it.
    if not errors or kind not in (errors[0], "incomplete") and vector["result"] != "incomplete":
        return f"decode_error is {errors}, not {kind}"
    return None


def run(link):
    vectors = json.loads((REFERENCE / f"vectors/{link}.json").read_text())["vectors"]
    # A frame that has its length takes so many bytes of what follows, whatever they are: a capture cannot show that it was cut.
    vectors = [vector for vector in vectors if vector.get("error", {}).get("kind") != "cut"]
    names = sorted({name for vector in vectors for name, _ in leaves(vector.get("message"))})
    names += ["decode_error", "request_in", "response_time"]
    groups = {}
    for vector in vectors:
        options = vector.get("options", {}) | PREFERENCES.get(link, {}).get(vector.get("from"), {})
        groups.setdefault(json.dumps(options), []).append(vector)
    failures = {}
    for options, group in groups.items():
        capture, expected = Capture(), {}
        for vector in group:
            side = "client" if vector.get("from") in CLIENTS.get(link, []) else "server"
            alike = [v for v in vectors if v.get("from") == vector.get("from") and v["result"] == "valid"]
            good = next((v for v in alike if json.dumps(v.get("options", {})) == options), alike[0])
            for segments, messages in cases(vector, good):
                port = 10_000 + len(expected)
                expected[port] = (vector, messages)
                for segment in segments:
                    capture.send(port, side, segment)
        shown = tshark(link, json.loads(options), capture, names)
        for port, (vector, messages) in expected.items():
            wrong = check(vector, shown[port], messages)
            if wrong:
                failures.setdefault(vector["id"], f"{link} {vector['id']}: {wrong[:300]}")
    print(*failures.values(), sep="\n", end="\n" if failures else "")
    pairs = PAIRS.get(link, [])
    if pairs:
        wrong = check_pairs(link, pairs, names)
        if wrong:
            print(f"{link} pair: {wrong}")
            failures["pair"] = wrong
    stories, wrong = check_experts(link)
    for place, text in wrong.items():
        print(f"{link} {place}: {text}")
    failures |= wrong
    total = len(vectors) + bool(pairs) + stories
    print(f"{link}: {total - len(failures)} of {total}")
    return not failures


def check_pairs(link, pairs, names):
    capture = Capture()
    for side, data in pairs:
        capture.send(10_000, side, bytes.fromhex(data))
    fields = tshark(link, {}, capture, names)[10_000]
    # Requests are the first, third, … frame of the capture.
    requests = [str(number) for number in range(1, len(pairs), 2)]
    if fields["request_in"] != requests:
        return f"request_in is {fields['request_in']}, not {requests}"
    times = [float(value) for value in fields["response_time"]]
    if len(times) != len(requests) or any(abs(time - GAP) > 1e-6 for time in times):
        return f"response_time is {times}, not {GAP} each"
    return None


def check_experts(link):
    """How many stories there are for the rules of a dissector, and what is wrong: by rule."""
    source = (REFERENCE / f"wireshark/{link}.lua").read_text()
    rules = re.findall(rf'(?:\brule\(|\bexpert_of\(|ProtoExpert\.new\()"(?:{link.replace("-", "_")}\.)?(\w+)"', source)
    stories = [("none", {}, expert_stories.GOOD[link]), *expert_stories.STORIES[link]]
    wrong = {rule: "no story breaks it" for rule in rules if rule not in [story[0] for story in stories]}
    for options in {json.dumps(options) for _, options, _ in stories}:
        capture, told = Capture(), {}
        for number, (rule, preferences, packets) in enumerate(stories):
            if json.dumps(preferences) != options:
                continue
            told[10_000 + number] = rule
            for packet in packets:
                if isinstance(packet, tuple):
                    capture.send(10_000 + number, *packet)
                else:
                    capture.wait(packet)
        shown = tshark(link, json.loads(options), capture, rules)
        for port, rule in told.items():
            raised = [name for name in rules if shown[port][name]]
            if rule == "none" and raised or rule != "none" and rule not in raised:
                wrong[rule] = f"raised are {raised}"
    return len(stories), wrong


def main():
    links = sys.argv[1:] or sorted(path.stem for path in (REFERENCE / "wireshark").glob("*.lua"))
    results = [run(link) for link in links]
    sys.exit(not all(results))


if __name__ == "__main__":
    main()
