"""pymodbus reads and writes every table of the simulated FANUC controller."""

import struct
import sys
import time

from pymodbus import FramerType
from pymodbus.pdu.file_message import FileRecord
from pymodbus.client import ModbusSerialClient, ModbusTcpClient

kind, address = sys.argv[1:]
if kind == "rtu":
    client = ModbusSerialClient(address, baudrate=115200, timeout=2)
else:
    host, port = address.split(":")
    framer = FramerType.RTU if kind == "rtu-over-tcp" else FramerType.SOCKET
    client = ModbusTcpClient(host, port=int(port), framer=framer, timeout=2)
assert client.connect()
checks = 0
ONE = {"device_id": 1}


def same(found, expected, what):
    global checks
    checks += 1
    assert found == expected, f"{what}: {found} is not {expected}"


def exception(reply, expected, what):
    assert reply.isError(), f"{what}: no exception"
    same(reply.exception_code, expected, what)


def bits(reply, count):
    assert not reply.isError(), reply
    return reply.bits[:count]


def words(reply):
    assert not reply.isError(), reply
    return reply.registers


def discrete(n):
    return n % 3 == 0


def holding(n):
    return n if n <= 16384 else 0


# On a line at 115200 baud a whole table takes too long: only its beginning, its middle and its end.
def runs(end, step):
    all_runs = [(a, min(step, end - a)) for a in range(0, end, step)]
    return all_runs if kind != "rtu" else [all_runs[0], all_runs[len(all_runs) // 2], all_runs[-1]]


tables = [
    ("discrete inputs", client.read_discrete_inputs, 28000, 2000, lambda r, c: bits(r, c), discrete),
    ("coils", client.read_coils, 30000, 2000, lambda r, c: bits(r, c), lambda n: False),
    ("input registers", client.read_input_registers, 4000, 125, lambda r, c: words(r), lambda n: n),
    ("holding registers", client.read_holding_registers, 16448, 125, lambda r, c: words(r), holding),
]
for name, read, end, step, values, expected in tables:
    for first, count in runs(end, step):
        found = values(read(first, count=count, **ONE), count)
        due = [expected(n) for n in range(first + 1, first + 1 + count)]
        if name == "holding registers" and first == 0:
            found, due = found[37:], due[37:]  # the telemetry block is checked below
        same(found, due, f"{name} {first}")
    same(values(read(end - 1, count=1, **ONE), 1), [expected(end)], f"last of {name}")
    exception(read(end, count=1, **ONE), 2, f"after the end of {name}")
    exception(read(end - 1, count=2, **ONE), 2, f"across the end of {name}")
    exception(read(65535, count=1, **ONE), 2, f"{name} 65535")

# Writes, and the values after them.
pattern = [n % 5 == 0 for n in range(1968)]
numbers = [65535 - 3 * n for n in range(123)]
assert not client.write_coil(29999, True, **ONE).isError()
same(bits(client.read_coils(29998, count=2, **ONE), 2), [False, True], "one coil")
assert not client.write_coils(11, pattern, **ONE).isError()
same(bits(client.read_coils(11, count=1968, **ONE), 1968), pattern, "1968 coils")
assert not client.write_register(16447, 0xABCD, **ONE).isError()
same(words(client.read_holding_registers(16447, **ONE)), [0xABCD], "one register")
assert not client.write_registers(1000, numbers, **ONE).isError()
same(words(client.read_holding_registers(1000, count=123, **ONE)), numbers, "123 registers")
assert not client.mask_write_register(address=1000, and_mask=0x0F0F, or_mask=0x1234, **ONE).isError()
same(words(client.read_holding_registers(1000, **ONE)), [(0xFFFF & 0x0F0F) | (0x1234 & 0xF0F0)], "mask")
reply = client.readwrite_registers(read_address=1999, read_count=125, write_address=2000, values=numbers[:121], **ONE)
same(words(reply), [2000] + numbers[:121] + [2122, 2123, 2124], "read/write")
exception(client.write_coil(30000, True, **ONE), 2, "coil after the table")
exception(client.write_coils(29999, [True, True], **ONE), 2, "coils across the end")
exception(client.write_register(16448, 1, **ONE), 2, "register after the table")
exception(client.write_registers(16447, [1, 2], **ONE), 2, "registers across the end")
same(words(client.read_holding_registers(16447, **ONE)), [0xABCD], "a refused write changes nothing")
exception(client.mask_write_register(address=16448, **ONE), 2, "mask after the table")
for number, request in [  # functions that it does not have
    (8, lambda **one: client.diag_query_data(b"\x12\x34", **one)),
    (11, client.diag_get_comm_event_counter),
    (12, client.diag_get_comm_event_log),
    (17, client.report_device_id),
    (43, client.read_device_information),
]:
    exception(request(**ONE), 1, f"function {number}")

# The serial line, the files and the queues that its settings give it.
reply = client.read_exception_status(**ONE)
same(reply.status, 109, "exception status")


def files(*runs):
    """A read of files. Of a number of registers the library has two for each one that it was given as the length."""
    return client.read_file_record([FileRecord(file_number=f, record_number=r, record_length=2 * n) for f, r, n in runs], **ONE)


contents = lambda reply: [struct.unpack(f">{len(it.record_data) // 2}H", it.record_data) for it in reply.records]
same(contents(files((4, 0, 3), (5, 1, 1))), [(10, 20, 30), (2,)], "two files")
record = FileRecord(file_number=4, record_number=1, record_data=b"\x12\x34\xab\xcd")
written = client.write_file_record([record], **ONE)
assert not written.isError(), written
same(contents(written), [(0x1234, 0xABCD)], "what was written")
same(contents(files((4, 0, 3))), [(10, 0x1234, 0xABCD)], "a file after a write")
exception(files((4, 1, 3)), 2, "records after the end of a file")
exception(files((6, 0, 1)), 2, "a file that is not there")
if kind == "tcp":  # in RTU it takes the reply for two bytes shorter than it is
    same(client.read_fifo_queue(address=1246, **ONE).values, [440, 4740], "a queue")
    same(client.read_fifo_queue(address=1, **ONE).values, [], "an empty queue")
    exception(client.read_fifo_queue(address=1247, **ONE), 2, "a queue that is not there")


def telemetry():
    w = words(client.read_holding_registers(0, count=37, **ONE))
    real = lambda i: struct.unpack(">f", struct.pack(">HH", w[i + 1], w[i]))[0]
    return w[0] | w[1] << 16, w[2], [real(i) for i in range(3, 37, 2)]


(before, _, _), started = telemetry(), time.monotonic()
time.sleep(0.5)
after, percent, reals = telemetry()
runs_due = (time.monotonic() - started) / 0.008
assert abs((after - before) - runs_due) < 10, f"{after - before} runs of the background task, {runs_due} due"
same(percent, 100, "override")
x, y, z, w, p, r, q1, q2, q3, q4 = reals[:10]
assert 399 < x < 601 and -101 < y < 101 and 279 < z < 321, (x, y, z)
assert abs(q1 * q1 + q2 * q2 + q3 * q3 + q4 * q4 - 1) < 1e-5 and q1 >= 0
assert abs(sum(v * v for v in reals[10:12]) ** 0.5 - 100) < 1, "100 mm/s on the circle"
if kind == "tcp":
    others = [ModbusTcpClient(host, port=int(port), timeout=2) for _ in range(8)]
    assert all(other.connect() for other in others)
    for n in range(50):
        for i, other in enumerate(others):
            same(words(other.read_holding_registers(3000 + n + i, **ONE)), [3001 + n + i], "eight clients at once")
    assert not others[0].write_register(4000, 7, **ONE).isError()
    same(words(others[7].read_holding_registers(4000, **ONE)), [7], "what one writes another reads")
client.close()
print(f"pymodbus, {kind}: {checks} checks")
