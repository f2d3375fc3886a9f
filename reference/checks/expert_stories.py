"""What breaks each rule that a dissector knows: for each link and expert info, packets that raise it.

A story is (expert, preferences, packets); a packet is (end of the TCP connection, bytes), a number is a wait in seconds.
"""

import struct


def alter(*data):
    """An ALTER frame."""
    data = bytes(data)
    return b"\x10\x10\x02" + data.replace(b"\x10", b"\x10\x10") + b"\x10\x03" + bytes([sum(data) % 256])


def laser(payload, check=None):
    """A laser frame."""
    check = sum(payload) % 256 if check is None else check
    return b"\xeb\x90\x82\xf0" + payload.replace(b"\x90", b"\x90\x90") + b"\x90\x82" + bytes([check])


def word(number):
    return b"\xf1\x01" + struct.pack("<H", number)


def pose(count):
    """A line of the viewer."""
    body = f"POSE,{count}" + ",0" * 12
    checksum = 0
    for byte in body.encode():
        checksum ^= byte
    return f"${body}*{checksum:02X}\r\n".encode()


def modbus(pdu, transaction=1):
    return struct.pack(">HHHB", transaction, 0, len(pdu) + 1, 1) + pdu


def kawasaki(name, *fields, length=None):
    data = "$".join(map(str, fields))
    return f"<{name}${len(data) if length is None else length}#{data}#>".encode()


def job(number):
    return kawasaki("Tyo", 50, number, 1, 0, 0, 100, 0)


S, C = "server", "client"
MOTION, REPLY, START = (S, alter(0x80, 2, 1, 0, 0, 0)), (C, alter(0, 0)), (S, alter(0xA0, 0x17))
PACKET, POLL = bytes.fromhex("08F85D0001FE03FC05FA817A"), (C, b"\x05")
JOG, ECHO = (C, laser(word(0x0201))), (S, laser(word(0x0201)))
READ = (C, modbus(bytes.fromhex("0300000025")))
QUATERNION = struct.pack(">f", 1.0)
FILLER = kawasaki("Huuhaa")
ACTIVE = kawasaki("Tila", 50, 2, "", "", "")
ASK = [
    (C, kawasaki("TyoPyynto", 50, 1)),
    (S, job(1) + job(2)),
]


def telemetry(spare):
    """The reply with the telemetry block; `spare` is POS_X."""
    reals = [struct.pack(">f", value) for value in [spare, *[0.0] * 5, 1.0, *[0.0] * 10]]
    swapped = b"".join(real[2:] + real[:2] for real in reals)
    return modbus(bytes([3, 74]) + bytes.fromhex("000100000064") + swapped)


STORIES = {
    "val2-alter": [
        ("bad_checksum", {}, [(S, alter(0xA0, 0x17)[:-1] + b"\0"), START]),
        ("corrupt", {}, [(S, b"\x10\x10\x02\x10\x05"), START]),
        ("noise", {}, [(S, b"\x55" + START[1])]),
        ("unnamed", {}, [(S, alter(0x80, 99, 1, 0, 0, 0))]),
        ("rejected", {}, [(S, alter(0x81, 2, 1, 0, 0, 0))]),
        ("late", {}, [START, (C, alter(0)), MOTION, 0.02, REPLY]),
        ("missed", {}, [MOTION, MOTION]),
        ("stray", {}, [MOTION, REPLY, REPLY]),
        ("wrong_answer", {}, [MOTION, (C, alter(0))]),
    ],
    "val2-viewer": [
        ("bad_checksum", {}, [POLL, (S, pose(0)[:-4] + b"00\r\n"), (S, pose(1))]),
        ("corrupt", {}, [POLL, (S, b"$POSE,1\r\n")]),
        ("unknown", {}, [(C, b"\x06")]),
        ("unasked", {}, [(S, pose(0))]),
        ("again", {}, [POLL, POLL]),
        ("packets_lost", {}, [POLL, (S, pose(0)), POLL, (S, pose(2))]),
    ],
    "isra-ball": [
        ("bad_checksum", {}, [POLL, (S, PACKET[:-1] + b"\0"), (S, PACKET)]),
        ("noise", {}, [POLL, (S, b"\x33\x33\x33" + PACKET)]),
        ("unknown", {}, [(C, b"\x06")]),
        ("layout", {}, [POLL, (S, b"\x01\xff\x54\x00\xff")]),
        ("unasked", {}, [POLL, (S, PACKET), (S, PACKET)]),
        ("missed", {}, [POLL, POLL]),
    ],
    "laser-eb90": [
        ("bad_checksum", {}, [(C, laser(word(0x0201), 0)), JOG]),
        ("no_head", {}, [(C, b"\0\0" + JOG[1])]),
        ("bad_flag", {}, [(C, b"\xeb\x90\x82\x00"), JOG]),
        ("bad_stuffing", {}, [(C, b"\xeb\x90\x82\xf0\xf2\x01\x90\x33"), JOG]),
        ("too_long", {}, [(C, b"\xeb\x90\x82\xf0\xf2" + b"\1" * 600), JOG]),
        ("bad_tag", {}, [(C, b"\xeb\x90\x82\xf0\x01"), JOG]),
        ("bad_item", {}, [(C, laser(b"\xf2\x09\x01")), JOG]),
        ("no_word", {}, [(C, laser(b"\xf2\x01\x01"))]),
        ("not_finite", {}, [(C, laser(word(0x0101) + b"\xf0\x01\0\0\x80\x7f"))]),
        ("refused", {}, [JOG, (S, laser(word(0xE006)))]),
        ("other_word", {}, [JOG, (S, laser(word(0x0202)))]),
        ("unasked", {}, [JOG, ECHO, ECHO]),
        ("early", {}, [JOG, JOG]),
    ],
    "mmacell-proto": [
        ("malformed", {}, [(C, b"STX\r\n")]),
        ("refused", {}, [(C, b"STP\r\n"), (S, b"ER+00001\r\n")]),
        ("wrong_kind", {}, [(C, b"STA\r\n"), (S, b"OK\r\n")]),
        ("unasked", {}, [(S, b"OK\r\n")]),
        ("early", {}, [(C, b"STP\r\n"), (C, b"STP\r\n")]),
    ],
    "fanuc-hmi-modbus": [
        ("bad_crc", {"framing": "rtu"}, [(C, bytes.fromhex("0103000000250000")), (C, bytes.fromhex("01030000002585D1"))]),
        ("bad_header", {}, [(C, bytes.fromhex("000100070006010300000025")), READ]),
        ("bad_pdu", {}, [(C, modbus(bytes.fromhex("0300000000")))]),
        ("refused", {}, [READ, (S, modbus(b"\x83\x02"))]),
        ("mismatch", {}, [READ, (S, modbus(bytes.fromhex("03020001")))]),
        ("unasked", {}, [READ, (S, telemetry(1.0)), (S, telemetry(1.0))]),
        ("beyond", {}, [(C, modbus(bytes.fromhex("03FFF00025")))]),
        ("not_used", {}, [(C, modbus(bytes.fromhex("0475300001")))]),
        ("impossible", {}, [READ, (S, telemetry(float("inf")))]),
    ],
    "kawasaki-msg": [
        ("bad_length", {}, [(C, kawasaki("TyoPyynto", 50, 1, length=5)), (C, FILLER)]),
        ("garbage", {}, [(C, b"x" + FILLER)]),
        ("malformed", {}, [(C, b"<TyoPyynto$4" + FILLER)]),
        ("unknown_name", {}, [(C, kawasaki("Tuntematon", 1))]),
        ("bad_field", {}, [(C, kawasaki("TyoPyynto", 50, 10000))]),
        ("wrong_side", {}, [(C, job(1))]),
        ("unasked", {}, [(S, FILLER)]),
        ("unasked", {}, [(C, FILLER), (S, FILLER), 0.2, (S, FILLER)]),
        ("packet_too_long", {}, [(C, FILLER), (S, FILLER * 200), (S, FILLER * 200)]),
        ("late", {}, [(C, FILLER), 1.0, (S, FILLER)]),
        ("not_requested", {}, [(C, FILLER), (S, job(1))]),
        ("job_jump", {}, [*ASK, (C, kawasaki("TyoPyynto", 50, 3)), (S, job(4))]),
        ("ack_jump", {}, [*ASK, (C, kawasaki("TyoKuittaus", 50, 3))]),
        ("ack_jump", {}, [*ASK, (C, kawasaki("TyoPyynto", 50, 4))]),
        ("wrong_order", {}, [*ASK, (C, kawasaki("TyoKuittaus", 51, 1))]),
        ("refused", {}, [(C, ACTIVE), (S, kawasaki("TilausAlkaa", 51, 1)), (C, kawasaki("TilausKuittaus", 50))]),
        ("alarm", {}, [(C, kawasaki("Tila", 50, 5, 3, 3, ""))]),
    ],
}
# What keeps every rule raises nothing.
GOOD = {
    "val2-alter": [START, (C, alter(0)), MOTION, REPLY, MOTION, REPLY, (S, alter(0xE0))],
    "val2-viewer": [POLL, (S, pose(65535)), POLL, (S, pose(0))],
    "isra-ball": [POLL, (S, PACKET), POLL, (S, PACKET)],
    "laser-eb90": [JOG, ECHO, (C, laser(word(0x0101) + b"\xf0\x01\0\0\x90\x41")), (S, laser(word(0x0101)))],
    "mmacell-proto": [(C, b"STP\r\n"), (S, b"OK\r\n"), (C, b"STA\r\n"), (S, b"OKF+00.5000-00.2500T+00080+00000\r\n")],
    "fanuc-hmi-modbus": [READ, (S, telemetry(1.0)), READ, (S, telemetry(2.0))],
    "kawasaki-msg": [
        (C, kawasaki("Tila", 0, 0, "", "", "")),
        (S, kawasaki("Tila", 50, 1, "", "", "") + kawasaki("TilausAlkaa", 50, 1)),
        (C, kawasaki("TilausKuittaus", 50) + ACTIVE + kawasaki("TyoPyynto", 50, 1)),
        (S, ACTIVE + job(1) + job(2) + job(3)),
        (C, kawasaki("TyoKuittaus", 50, 1) + kawasaki("TyoPyynto", 50, 4)),
        (S, FILLER),
        # The answer was lost: the same jobs once more, then one that follows them.
        (C, kawasaki("TyoPyynto", 50, 2)),
        (S, job(2) + job(3) + job(4)),
        (C, kawasaki("TyoKuittaus", 50, 2) + kawasaki("TyoKuittaus", 50, 4)),
        (S, kawasaki("TilausLoppuu", 50)),
        (C, kawasaki("LoppuKuittaus", 50, 0, 4) + kawasaki("Tila", 0, 0, 4, 4, 50)),
        (S, kawasaki("Tila", 0, 0, 4, 4, "")),
    ],
}
