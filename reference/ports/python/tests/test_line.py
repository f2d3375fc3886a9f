"""The drivers over real sockets: every test with the blocking one and with that of asyncio."""

import asyncio
import socket
import time
import unittest
from collections.abc import Callable, Coroutine
from contextlib import asynccontextmanager
from typing import Any, AsyncIterator

from cellwire import aio, blocking
from cellwire.fanuc_hmi_modbus import Client, Registers, Server
from cellwire.kawasaki_msg import Robot
from cellwire.mmacell_proto import Central, Device
from cellwire.session import Session

READ = {"unit": 1, "function": 3, "address": 0, "quantity": 1}
REQUEST = bytes.fromhex("0001 0000 0006 01 03 0000 0001")
REPLY = bytes.fromhex("0001 0000 0005 01 03 02 0007")
LIMIT = 5.0


class Blocking:
    """The blocking driver in the shape of the other one: its calls in threads."""

    module: Any = blocking

    def __init__(self, session: Session, transport: Any) -> None:
        self.line = blocking.Line(session, transport)

    async def next(self, timeout: float) -> Any:
        return await asyncio.to_thread(self.line.next, timeout)

    async def do(self, call: Callable[..., Any], *args: Any) -> Any:
        return await asyncio.to_thread(self.line.do, call, *args)

    async def close(self) -> None:
        await asyncio.to_thread(self.line.close)


class Aio:
    """The driver of asyncio."""

    module: Any = aio

    def __init__(self, session: Session, transport: Any) -> None:
        self.line = aio.Line(session, transport)

    async def next(self, timeout: float) -> Any:
        if self.line.task is None:
            await self.line.__aenter__()
        return await self.line.next(timeout)

    async def do(self, call: Callable[..., Any], *args: Any) -> Any:
        return self.line.do(call, *args)

    async def close(self) -> None:
        await self.line.close()


@asynccontextmanager
async def running(kind: Any, session: Session, transport: Any) -> AsyncIterator[Any]:
    line = kind(session, transport)
    try:
        yield line
    finally:
        await line.close()


class Failing:
    """A transport that notes when it is asked, and never connects."""

    def __init__(self) -> None:
        self.times: list[float] = []

    def open(self, timeout: float | None = None) -> Any:
        self.times.append(time.monotonic())
        raise ConnectionRefusedError

    def close(self) -> None:
        pass


class FailingLater(Failing):
    """The same for asyncio."""

    async def open(self, timeout: float | None = None) -> Any:
        return super().open()


def with_both(test: Callable[[Any, Any], Coroutine[Any, Any, None]]) -> Callable[[Any], None]:
    """Runs a test with each driver."""

    def run(self: Any) -> None:
        for kind in (Blocking, Aio):
            with self.subTest(kind.__name__):
                asyncio.run(asyncio.wait_for(test(self, kind), 30))

    return run


def listening() -> tuple[socket.socket, int]:
    listener = socket.create_server(("127.0.0.1", 0))
    listener.settimeout(LIMIT)
    return listener, int(listener.getsockname()[1])


async def accepted(listener: socket.socket) -> socket.socket:
    connection, _ = await asyncio.to_thread(listener.accept)
    connection.settimeout(LIMIT)
    return connection


async def received(connection: socket.socket) -> bytes:
    return await asyncio.to_thread(connection.recv, 4096)


class Lines(unittest.TestCase):
    @with_both
    async def test_a_connection_that_is_lost_is_made_again(self, kind: Any) -> None:
        listener, port = listening()
        client = Client()
        async with running(kind, client, kind.module.Tcp("127.0.0.1", port)) as line:
            await line.do(client.request, READ)
            event = asyncio.create_task(line.next(LIMIT))
            first = await accepted(listener)
            self.assertEqual(await received(first), REQUEST)
            first.close()
            self.assertEqual((await event)["reason"], "disconnected")
            await line.do(client.request, READ)
            event = asyncio.create_task(line.next(LIMIT))
            second = await accepted(listener)
            sent = await received(second)
            second.sendall(sent[:2] + REPLY[2:])
            self.assertEqual((await event)["message"]["registers"], [7])
            second.close()
        listener.close()

    @with_both
    async def test_pauses_between_attempts_grow(self, kind: Any) -> None:
        transport = FailingLater() if kind is Aio else Failing()
        async with running(kind, Client(), transport) as line:
            with self.assertRaises(TimeoutError):
                await line.next(1.0)
        gaps = [later - sooner for sooner, later in zip(transport.times, transport.times[1:])]
        self.assertEqual(len(gaps), 3, gaps)
        for gap, least in zip(gaps, (0.1, 0.2, 0.4)):
            self.assertGreaterEqual(gap, least)

    @with_both
    async def test_a_wait_has_a_deadline(self, kind: Any) -> None:
        listener, port = listening()
        begun = time.monotonic()
        async with running(kind, Client(), kind.module.Tcp("127.0.0.1", port)) as line:
            with self.assertRaises(TimeoutError):
                await line.next(0.2)
            took = time.monotonic() - begun
        self.assertGreaterEqual(took, 0.2)
        self.assertLess(took, LIMIT)
        listener.close()

    @with_both
    async def test_a_session_times_out_by_itself(self, kind: Any) -> None:
        listener, port = listening()
        client = Client()
        async with running(kind, client, kind.module.Tcp("127.0.0.1", port)) as line:
            await line.do(client.request, READ)
            self.assertEqual((await line.next(LIMIT))["reason"], "timed_out")
        listener.close()

    @with_both
    async def test_another_client_takes_the_place_of_the_first(self, kind: Any) -> None:
        transport = kind.module.Listen("127.0.0.1", 0)
        server = Server(registers=Registers(holding_registers=[7]))
        async with running(kind, server, transport) as line:
            event = asyncio.create_task(line.next(LIMIT))
            await asyncio.sleep(0.05)
            first = socket.create_connection(("127.0.0.1", transport.port), LIMIT)
            first.sendall(REQUEST)
            self.assertEqual((await event)["event"], "served")
            self.assertEqual(await received(first), REPLY)
            event = asyncio.create_task(line.next(LIMIT))
            second = socket.create_connection(("127.0.0.1", transport.port), LIMIT)
            second.sendall(REQUEST)
            self.assertEqual((await event)["event"], "served")
            self.assertEqual(await received(second), REPLY)
            first.settimeout(LIMIT)
            self.assertEqual(await received(first), b"")
            first.close()
            second.close()

    @with_both
    async def test_the_session_ends_a_connection(self, kind: Any) -> None:
        listener, port = listening()
        central = Central()
        async with running(kind, central, kind.module.Tcp("127.0.0.1", port)) as line:
            event = asyncio.create_task(line.next(LIMIT))
            first = await accepted(listener)
            self.assertEqual((await event)["event"], "connected")
            first.sendall(b"what is that\r\n")
            self.assertEqual((await line.next(LIMIT))["event"], "closed")
            self.assertEqual(await received(first), b"")
            event = asyncio.create_task(line.next(LIMIT))
            second = await accepted(listener)
            self.assertEqual((await event)["event"], "connected")
            first.close()
            second.close()
        listener.close()

    @with_both
    async def test_a_robot_connects_when_it_says_so(self, kind: Any) -> None:
        listener, port = listening()
        async with running(kind, Robot(), kind.module.Tcp("127.0.0.1", port)) as line:
            self.assertEqual((await line.next(LIMIT))["event"], "connect")
            event = asyncio.create_task(line.next(LIMIT))
            first = await accepted(listener)
            self.assertEqual(await received(first), b"<Tila$6#0$0$$$#>")
            first.close()
            self.assertEqual((await event)["event"], "connect")  # after reconnect_delay
            event = asyncio.create_task(line.next(LIMIT))
            (await accepted(listener)).close()
            self.assertEqual((await event)["event"], "connect")
        listener.close()

    @with_both
    async def test_what_a_session_does_not_read_stays_in_the_transport(self, kind: Any) -> None:
        transport = kind.module.Listen("127.0.0.1", 0)
        device = Device()
        async with running(kind, device, transport) as line:
            event = asyncio.create_task(line.next(LIMIT))
            await asyncio.sleep(0.05)
            client = socket.create_connection(("127.0.0.1", transport.port), LIMIT)
            client.sendall(b"SRVON\r\n")
            self.assertEqual((await event)["order"], {"order": "servo", "on": True})
            client.sendall(b"STP\r\n" * 1000)
            with self.assertRaises(TimeoutError):
                await line.next(0.1)
            await line.do(device.accept, {"order": "servo", "on": True})
            self.assertEqual((await line.next(LIMIT))["order"], {"order": "stop"})
            self.assertEqual(await received(client), b"OK\r\n")
            client.close()


if __name__ == "__main__":
    unittest.main()
