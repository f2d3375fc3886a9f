"""Our client, `cellwire modbus`, reads and writes every table of pymodbus's server."""

import asyncio
import json
import subprocess
import sys
import threading

from pymodbus import FramerType
from pymodbus.server import ModbusTcpServer
from pymodbus.simulator import DataType, SimData, SimDevice

(cellwire,) = sys.argv[1:]


def device():
    bits = lambda value: [SimData(0, values=[value(n) for n in range(3200)], datatype=DataType.BITS)]
    words = lambda value: [SimData(0, values=[value(n) for n in range(3200)], datatype=DataType.REGISTERS)]
    coils, discrete = bits(lambda n: n % 7 == 0), bits(lambda n: n % 3 == 0)
    return SimDevice(1, (coils, discrete, words(lambda n: n), words(lambda n: 60000 + n)))


async def serve(framer, ready):
    server = ModbusTcpServer(device(), framer=framer, address=("127.0.0.1", 0))
    await server.serve_forever(background=True)
    ready(server.transport.sockets[0].getsockname()[1])
    await asyncio.Event().wait()


def ask(port, framing, requests):
    text = "".join(json.dumps({"unit": 1, **request}) + "\n" for request in requests)
    command = [cellwire, "modbus", f"127.0.0.1:{port}", "--framing", framing]
    done = subprocess.run(command, input=text, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr + done.stdout[-500:]
    return [json.loads(line) for line in done.stdout.splitlines()]


pattern = [n % 5 == 0 for n in range(1968)]
numbers = [65535 - 3 * n for n in range(123)]
refused = lambda function: {"unit": 1, "function": function, "exception": 2}


def reads(function, key, value, step):
    for first in range(0, 3200, step):
        count = min(step, 3200 - first)
        reply = {"unit": 1, "function": function, key: [value(n) for n in range(first, first + count)]}
        yield {"function": function, "address": first, "quantity": count}, reply
    yield {"function": function, "address": 3200, "quantity": 1}, refused(function)
    yield {"function": function, "address": 3199, "quantity": 2}, refused(function)


def echo(request):
    return request, {"unit": 1, **request}


def checks():
    yield from reads(1, "bits", lambda n: n % 7 == 0, 2000)
    yield from reads(2, "bits", lambda n: n % 3 == 0, 2000)
    yield from reads(3, "registers", lambda n: n, 125)
    yield from reads(4, "registers", lambda n: 60000 + n, 125)
    yield echo({"function": 5, "address": 3199, "value": True})
    yield {"function": 1, "address": 3199, "quantity": 1}, {"unit": 1, "function": 1, "bits": [True]}
    yield echo({"function": 6, "address": 3199, "value": 0xABCD})
    yield {"function": 3, "address": 3199, "quantity": 1}, {"unit": 1, "function": 3, "registers": [0xABCD]}
    written = {"unit": 1, "function": 15, "address": 11, "quantity": 1968}
    yield {"function": 15, "address": 11, "values": pattern}, written
    yield {"function": 1, "address": 11, "quantity": 1968}, {"unit": 1, "function": 1, "bits": pattern}
    written = {"unit": 1, "function": 16, "address": 1000, "quantity": 123}
    yield {"function": 16, "address": 1000, "values": numbers}, written
    yield {"function": 3, "address": 1000, "quantity": 123}, {"unit": 1, "function": 3, "registers": numbers}
    yield echo({"function": 22, "address": 1000, "and": 0x0F0F, "or": 0x1234})
    masked = 0xFFFF & 0x0F0F | 0x1234 & 0xF0F0
    yield {"function": 3, "address": 1000, "quantity": 1}, {"unit": 1, "function": 3, "registers": [masked]}
    both = {"function": 23, "address": 1999, "quantity": 125, "write_address": 2000, "values": numbers[:121]}
    after = [1999] + numbers[:121] + [2121, 2122, 2123]
    yield both, {"unit": 1, "function": 23, "registers": after}
    yield {"function": 5, "address": 3200, "value": True}, refused(5)
    yield {"function": 6, "address": 3200, "value": 1}, refused(6)
    yield {"function": 15, "address": 3200, "values": [True, True]}, refused(15)
    yield {"function": 16, "address": 3199, "values": [1, 2]}, refused(16)


for framing, framer in [("tcp", FramerType.SOCKET), ("rtu", FramerType.RTU)]:
    started = threading.Event()
    port = []
    ready = lambda found: (port.append(found), started.set())
    threading.Thread(target=lambda: asyncio.run(serve(framer, ready)), daemon=True).start()
    assert started.wait(10)
    pairs = list(checks())
    answers = ask(port[0], framing, [request for request, _ in pairs])
    for (request, expected), found in zip(pairs, answers, strict=True):
        assert found == expected, f"{request}: {found} is not {expected}"
    print(f"cellwire modbus against pymodbus's server, {framing}: {len(pairs)} requests")
