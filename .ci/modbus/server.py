"""Our client, `cellwire modbus`, reads and writes every table of the servers of pymodbus, libmodbus and jsmodbus."""

import asyncio
import json
import os
import subprocess
import sys
import threading
import tty

from pymodbus import FramerType
from pymodbus.server import ModbusSerialServer, ModbusTcpServer
from pymodbus.simulator import DataType, SimData, SimDevice

cellwire, libmodbus, jsmodbus = sys.argv[1:]
SIZE = 3200  # of every table


def device():
    bits = lambda value: [SimData(0, values=[value(n) for n in range(SIZE)], datatype=DataType.BITS)]
    words = lambda value: [SimData(0, values=[value(n) for n in range(SIZE)], datatype=DataType.REGISTERS)]
    coils, discrete = bits(lambda n: n % 7 == 0), bits(lambda n: n % 3 == 0)
    return SimDevice(1, (coils, discrete, words(lambda n: n), words(lambda n: 60000 + n)))


def line():
    """A serial line: two pseudo-terminals, each of which gets what the other one is given."""
    ends = [os.openpty() for _ in range(2)]
    for _, client in ends:
        tty.setraw(client)  # it stays open, and so its settings are kept

    def forward(source, target):
        while data := os.read(source, 4096):
            os.write(target, data)

    for (source, _), (target, _) in [ends, reversed(ends)]:
        threading.Thread(target=forward, args=(source, target), daemon=True).start()
    return [os.ttyname(client) for _, client in ends]


def pymodbus(kind):
    ready, place = threading.Event(), []

    async def serve():
        if kind == "rtu":
            path, client = line()
            server = ModbusSerialServer(device(), framer=FramerType.RTU, port=path, baudrate=115200)
            place.append(client)
            await server.serve_forever(background=True)
        else:
            framer = FramerType.RTU if kind == "rtu-over-tcp" else FramerType.SOCKET
            server = ModbusTcpServer(device(), framer=framer, address=("127.0.0.1", 0))
            await server.serve_forever(background=True)
            place.append(f"127.0.0.1:{server.transport.sockets[0].getsockname()[1]}")
        ready.set()
        await asyncio.Event().wait()

    threading.Thread(target=lambda: asyncio.run(serve()), daemon=True).start()
    assert ready.wait(10)
    return place[0]


processes = []


def process(command, kind):
    path, client = line() if kind == "rtu" else ("", "")
    server = subprocess.Popen([*command, kind, path], stdout=subprocess.PIPE, text=True)
    processes.append(server)
    said = server.stdout.readline().strip()
    assert said, f"{command} is not ready"
    return client if kind == "rtu" else f"127.0.0.1:{said}"


def ask(place, kind, requests):
    text = "".join(json.dumps({"unit": 1, **request}) + "\n" for request in requests)
    command = [cellwire, "modbus", "send", place, "--baud", "115200", "--set", "timeout=3000ms"]
    command += ["--set", "framing=rtu"] if kind == "rtu-over-tcp" else []
    done = subprocess.run(command, input=text, capture_output=True, text=True, timeout=120)
    replies = [json.loads(line) for line in done.stdout.splitlines()]
    status = 6 if any("exception" in reply for reply in replies) else 0
    assert done.returncode == status, f"{done.returncode}: {done.stderr} {done.stdout[-500:]}"
    return replies


pattern = [n % 5 == 0 for n in range(1968)]
numbers = [65535 - 3 * n for n in range(123)]


def refused(function, exception=2):
    return {"unit": 1, "function": function, "exception": exception}


def reads(function, key, value, step):
    for first in range(0, SIZE, step):
        count = min(step, SIZE - first)
        reply = {"unit": 1, "function": function, key: [value(n) for n in range(first, first + count)]}
        yield {"function": function, "address": first, "quantity": count}, reply


def echo(request):
    return request, {"unit": 1, **request}


def common(most=123):
    """Functions 1 to 6, 15 and 16, which every peer has; so many registers in one write at most, and 16 bits for each."""
    bits, words = pattern[: 16 * most], numbers[:most]
    yield from reads(1, "bits", lambda n: n % 7 == 0, 2000)
    yield from reads(2, "bits", lambda n: n % 3 == 0, 2000)
    yield from reads(3, "registers", lambda n: n, 125)
    yield from reads(4, "registers", lambda n: 60000 + n, 125)
    yield echo({"function": 5, "address": SIZE - 1, "value": True})
    yield {"function": 1, "address": SIZE - 1, "quantity": 1}, {"unit": 1, "function": 1, "bits": [True]}
    yield echo({"function": 6, "address": SIZE - 1, "value": 0xABCD})
    yield {"function": 3, "address": SIZE - 1, "quantity": 1}, {"unit": 1, "function": 3, "registers": [0xABCD]}
    written = {"unit": 1, "function": 15, "address": 11, "quantity": len(bits)}
    yield {"function": 15, "address": 11, "values": bits}, written
    yield {"function": 1, "address": 11, "quantity": len(bits)}, {"unit": 1, "function": 1, "bits": bits}
    written = {"unit": 1, "function": 16, "address": 1000, "quantity": most}
    yield {"function": 16, "address": 1000, "values": words}, written
    yield {"function": 3, "address": 1000, "quantity": most}, {"unit": 1, "function": 3, "registers": words}


def masks():
    """Functions 22 and 23."""
    yield echo({"function": 22, "address": 1000, "and": 0x0F0F, "or": 0x1234})
    masked = 0xFFFF & 0x0F0F | 0x1234 & 0xF0F0
    yield {"function": 3, "address": 1000, "quantity": 1}, {"unit": 1, "function": 3, "registers": [masked]}
    both = {"function": 23, "address": 1999, "quantity": 125, "write_address": 2000, "values": numbers[:121]}
    after = [1999] + numbers[:121] + [2121, 2122, 2123]
    yield both, {"unit": 1, "function": 23, "registers": after}


def exceptions(reads=True):
    for function in [1, 2, 3, 4] if reads else []:
        yield {"function": function, "address": SIZE, "quantity": 1}, refused(function)
        yield {"function": function, "address": SIZE - 1, "quantity": 2}, refused(function)
    yield {"function": 5, "address": SIZE, "value": True}, refused(5)
    yield {"function": 6, "address": SIZE, "value": 1}, refused(6)
    yield {"function": 15, "address": SIZE, "values": [True, True]}, refused(15)
    yield {"function": 16, "address": SIZE - 1, "values": [1, 2]}, refused(16)


def own(function, *keys):
    """What a server has of its own."""
    return {"function": function}, {"unit": 1, "function": function} | dict.fromkeys(keys)


def check(name, kind, place, pairs):
    pairs = list(pairs)
    answers = ask(place, kind, [request for request, _ in pairs])
    for (request, expected), found in zip(pairs, answers, strict=True):
        if any(value is None for value in expected.values()):  # its own words
            is_given = lambda key, value: key in found if value is None else found.get(key) == value
            given = found.keys() == expected.keys() and all(is_given(key, value) for key, value in expected.items())
            assert given, f"{request}: {found}"
            continue
        assert found == expected, f"{request}: {found} is not {expected}"
    print(f"cellwire modbus against {name}'s server, {kind}: {len(pairs)} requests", flush=True)


category = {"function": 43, "category": 1}
no_objects = category | {"object": 0}, {"unit": 1, **category, "conformity": 0x83, "more": False, "next": 0, "objects": []}
own_id = own(17, "id")
# What it has of every file; of an odd number of registers it gives no reply.
words = [int.from_bytes(b"SERVER DUMMY RECORD."[at : at + 2], "big") for at in range(0, 20, 2)]
dummy_record = {"function": 20, "ranges": [{"file": 4, "record": 1, "quantity": 10}]}, {"unit": 1, "function": 20, "contents": [words]}

try:
    for kind in ["tcp", "rtu-over-tcp", "rtu"]:
        others = [
            own(7, "status"),
            echo({"function": 8, "subfunction": 0, "values": [0x1234]}),
            own(11, "status", "events"),
            own(12, "status", "events", "messages", "log"),
            dummy_record,
            echo({"function": 21, "records": [{"file": 4, "record": 7, "values": [1, 2, 3]}, {"file": 9, "record": 0, "values": [4]}]}),
            ({"function": 24, "address": 1246}, {"unit": 1, "function": 24, "registers": [0, 1, 2, 3]}),
            own_id,
            no_objects,
        ]
        pairs = [*common(), *masks(), *exceptions(), *others]
        check("pymodbus", kind, pymodbus(kind), pairs)
    for kind in ["tcp", "rtu"]:
        others = [own_id]  # 7 it drops without a reply
        check("libmodbus", kind, process([libmodbus], kind), [*common(), *masks(), *exceptions(), *others])
    check("jsmodbus", "tcp", process(["node", jsmodbus], "tcp"), common())
    # It takes a write that arrives in two pieces for a corrupt one, and drops it: only short ones are sure to be whole.
    check("jsmodbus", "rtu", process(["node", jsmodbus], "rtu"), common(most=8))
finally:
    for server in processes:
        server.kill()
