"""Compares the vectors of fanuc-hmi-modbus with two implementations of Modbus that are not ours.

Usage: target/reference/venv/bin/python reference/checks/modbus.py

tshark reads captures of the vectors with its own dissector (not that of wireshark/), over Modbus TCP and RTU; pymodbus reads the
bytes and, of a valid vector, writes them again. A vector passes if the other implementation has every value of `message`. Of
invalid vectors those are judged whose error the other one looks for: the checksum and the header. What it has no field for is
not judged: LEFT_OUT says what and why. Prints `peer: passed of all`; exit status 1 on a failure.
"""

import json
import logging
import struct
import sys
from pathlib import Path

import wireshark
from pymodbus.exceptions import ModbusException
from pymodbus.framer import FramerRTU, FramerSocket
from pymodbus.pdu import DecodePDU

LINK = "fanuc-hmi-modbus"
# Errors that an implementation has to find too.
FOUND_BY = {"tshark": {"crc"}, "pymodbus": {"crc", "protocol"}}
LEFT_OUT = {
    # Its function codes from 65 on, and those whose data it gives other names, are bytes to us. It shows no exception code of 0.
    "tshark": lambda message: "data" in message or message.get("exception") == 0 or message["function"] in (7, 8, 11, 12, 17, 20, 21, 24, 43),
    # It has no words of function 8, and nothing of an identification that it does not keep as a table.
    # Of a read of files it halves the number of registers, and does not read an odd one.
    "pymodbus": lambda message: (message["function"] in (8, 17, 43) or "ranges" in message) and "exception" not in message,
}
# Our names, in the order of the wire, and tshark's fields.
TSHARK = {
    "transaction": ["mbtcp.trans_id"],
    "unit": ["mbtcp.unit_id", "mbrtu.unit_id"],
    "function": ["modbus.func_code"],
    "exception": ["modbus.exception_code"],
    "address": ["modbus.reference_num", "modbus.read_reference_num"],
    "quantity": ["modbus.word_cnt", "modbus.bit_cnt", "modbus.read_word_cnt"],
    "write_address": ["modbus.write_reference_num"],
    "and": ["modbus.and_mask"],
    "or": ["modbus.or_mask"],
    "registers": ["modbus.regval_uint16"],
    "bits": ["modbus.bitval"],
    "crc": ["mbrtu.crc16.incorrect"],
    "data": ["modbus.data"],
}


def tshark(vectors):
    """What is wrong with each vector as tshark shows it: by id, None if nothing is."""
    wireshark.SERVER_PORT = 502
    wrong = {}
    for framing, dissector in (("tcp", "mbtcp"), ("rtu", "mbrtu")):
        group = [v for v in vectors if v.get("options", {}).get("framing", "tcp") == framing]
        capture = wireshark.Capture()
        for vector in group:
            capture.send(10_000 + vector["id"], vector["from"], bytes.fromhex(vector["hex"]))
        fields = [field for names in TSHARK.values() for field in names]
        preferences = ["-d", f"tcp.port==502,{dissector}", "-o", f"{dissector}.tcp.port:502", "-o", "mbrtu.crc_verification:TRUE"]
        shown = wireshark.read(capture, preferences, fields)
        for vector in group:
            rows = shown[10_000 + vector["id"]]
            values = {ours: [v for name in names for v in rows[name]] for ours, names in TSHARK.items()}
            wrong[vector["id"]] = check_tshark(vector, values)
    return wrong


def check_tshark(vector, values):
    if vector["result"] == "invalid":
        return None if values["crc"] else "no bad CRC is shown"
    message = vector["message"]
    for name, expected in message.items():
        wanted = [int(v) for v in (expected if isinstance(expected, list) else [expected])]
        if name in ("registers", "values", "value"):
            found = [int(v) for v in values["registers"]] or raw_values("".join(values["data"]), message["function"])
        else:
            found = [int(v, 0) for v in values[name]]
        # Bits that fill the last byte, and the second quantity of function 23.
        if name in ("values", "quantity"):
            found = found[: len(wanted)]
        if found != wanted:
            return f"{name} is {found}, not {wanted}"
    return None


def raw_values(data, function):
    """The coils or registers in bytes of hex, where tshark shows no more than these."""
    octets = bytes.fromhex(data)
    if function == 5:
        return [int(octets == b"\xff\0")]
    if function == 15:
        return [octet >> place & 1 for octet in octets for place in range(8)]
    return [int.from_bytes(octets[at : at + 2], "big") for at in range(0, len(octets), 2)]


def pymodbus(vectors):
    """What is wrong with each vector as pymodbus reads and writes it: by id, None if nothing is."""
    logging.getLogger("pymodbus.logging").setLevel(logging.CRITICAL)
    return {vector["id"]: check_pymodbus(vector) for vector in vectors}


def check_pymodbus(vector):
    wire = bytes.fromhex(vector["hex"])
    is_rtu = vector.get("options", {}).get("framing") == "rtu"
    decoder = DecodePDU(is_server=vector["from"] == "client")
    framer = (FramerRTU if is_rtu else FramerSocket)(decoder)
    _, unit, transaction, pdu = framer.decode(wire)
    try:
        found = decoder.decode(pdu) if pdu else None
    except ModbusException:
        found = None
    if vector["result"] == "invalid":
        return None if found is None else f"it reads {found}"
    message = vector["message"]
    outer = [unit, pdu[0] & 0x7F] + ([] if is_rtu else [transaction])
    if outer != [message["unit"], message["function"]] + ([] if is_rtu else [message["transaction"]]):
        return f"unit, function, transaction are {outer}"
    if "data" in message:
        return None if list(pdu[1:]) == message["data"] else f"data is {list(pdu[1:])}"
    if found is None:
        return "it reads nothing"
    for name, expected in message.items():
        value = attribute(found, name, message)
        if value is not None and value != expected:
            return f"{name} is {value}, not {expected}"
    if vector["result"] == "valid":
        found.dev_id, found.transaction_id = unit, transaction
        written = framer.buildFrame(found)
        if written != wire:
            return f"it writes {written.hex(' ')}"
    return None


def attribute(pdu, name, message):
    """The value that pymodbus has under our name; None for what was compared already."""
    function = message["function"]
    if name in ("transaction", "unit", "function"):
        return None
    if name == "exception":
        return pdu.exception_code
    if function in (11, 12):
        names = {"status": "status", "events": "count" if function == 11 else "event_count", "messages": "message_count", "log": "events"}
        # It has whether the device is ready.
        return (0 if pdu.status else 0xFFFF) if name == "status" else getattr(pdu, names[name])
    if name in ("records", "contents"):
        return [run(record, name) for record in pdu.records]
    if name == "registers" and function == 24:
        return pdu.values
    if name in ("and", "or"):
        return getattr(pdu, f"{name}_mask")
    if function == 23 and name in ("address", "quantity"):
        return pdu.read_address if name == "address" else pdu.read_count
    if name == "values" and function == 23:
        return pdu.write_registers
    if name == "value":
        return pdu.bits[0] if function == 5 else pdu.registers[0]
    if name in ("values", "bits"):
        if function in (1, 2, 15):
            found = [int(bit) if isinstance(message[name][0], int) else bit for bit in pdu.bits]
            return found[: len(message[name])]
        return pdu.registers
    return getattr(pdu, {"quantity": "count"}.get(name, name))


def run(record, name):
    """A run of registers in a file, as it is in our messages."""
    values = list(struct.unpack(f">{len(record.record_data) // 2}H", record.record_data))
    if name == "contents":
        return values
    return {"file": record.file_number, "record": record.record_number, "values": values}


def main():
    vectors = json.loads((Path(wireshark.REFERENCE) / f"vectors/{LINK}.json").read_text())["vectors"]
    failed = False
    for peer, judge in (("tshark", tshark), ("pymodbus", pymodbus)):
        judged = [
            v
            for v in vectors
            if (v["error"]["kind"] in FOUND_BY[peer] if "error" in v else not LEFT_OUT[peer](v["message"]))
        ]
        wrong = {number: text for number, text in judge(judged).items() if text}
        for number, text in wrong.items():
            print(f"{LINK} {number}: {peer}: {text}")
        print(f"{LINK}: {len(judged) - len(wrong)} of {len(judged)} ({peer}; {len(vectors) - len(judged)} not judged)")
        failed |= bool(wrong)
    sys.exit(failed)


if __name__ == "__main__":
    main()
