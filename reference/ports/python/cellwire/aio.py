"""Drivers for asyncio: a session runs in a task of its own.

    async with Line(session, Tcp("192.168.0.7", 502)) as line:
        line.do(session.request, {"unit": 1, "function": 3, "address": 0, "quantity": 37})
        async for event in line:
            print(event)
"""

import asyncio
import importlib
import socket
from collections.abc import AsyncIterator, Callable
from typing import Any, Protocol

from .line import Core, P, R, S, shortest
from .stream import Json

READ_SIZE = 4096
CONNECT_TIMEOUT = 5.0


class Stream(Protocol):
    """An open connection or port. Whatever ends it is an OSError."""

    async def receive(self) -> bytes:
        """What has come next; empty: the peer has closed the connection."""

    async def send(self, data: bytes) -> bool:
        """Writes everything; whether the last byte is known to have left."""

    def close(self) -> None: ...


class Transport(Protocol):
    """Makes connections, one after the other."""

    async def open(self) -> Stream: ...
    def close(self) -> None: ...


class Socket:
    """A TCP connection."""

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self.reader, self.writer = reader, writer
        connection = writer.get_extra_info("socket")
        if connection is not None:
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    async def receive(self) -> bytes:
        return await self.reader.read(READ_SIZE)

    async def send(self, data: bytes) -> bool:
        self.writer.write(data)
        await self.writer.drain()
        return False

    def close(self) -> None:
        self.writer.close()


class Tcp:
    """Connects to an address."""

    def __init__(self, host: str, port: int) -> None:
        self.host, self.port = host, port

    async def open(self) -> Stream:
        opening = asyncio.open_connection(self.host, self.port)
        try:
            return Socket(*await asyncio.wait_for(opening, CONNECT_TIMEOUT))
        except asyncio.TimeoutError as timeout:
            raise ConnectionError(f"no connection within {CONNECT_TIMEOUT} s") from timeout

    def close(self) -> None:
        pass


class Listen:
    """Waits for clients at an address; the next one takes the place of the one before. Port 0 is any free one."""

    def __init__(self, host: str, port: int) -> None:
        self.listener = socket.create_server((host, port))
        self.listener.setblocking(False)
        self.port: int = self.listener.getsockname()[1]
        self.server: asyncio.Server | None = None
        self.clients: asyncio.Queue[Socket] = asyncio.Queue()
        self.current: Socket | None = None

    async def open(self) -> Stream:
        if self.server is None:
            self.server = await asyncio.start_server(self.accept, sock=self.listener)
        self.current = await self.clients.get()
        return self.current

    def accept(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        if self.current is not None:
            self.current.close()
        self.clients.put_nowait(Socket(reader, writer))

    def close(self) -> None:
        if self.server is not None:
            self.server.close()  # and its socket
        else:
            self.listener.close()


class Port:
    """A serial port of pyserial, whose calls block in threads."""

    def __init__(self, port: Any) -> None:
        self.port = port

    async def receive(self) -> bytes:
        while True:
            data = await asyncio.to_thread(self.read)
            if data:
                return data

    def read(self) -> bytes:
        return bytes(self.port.read(1) + self.port.read(self.port.in_waiting))

    async def send(self, data: bytes) -> bool:
        await asyncio.to_thread(self.write, data)
        return True

    def write(self, data: bytes) -> None:
        self.port.write(data)
        self.port.flush()

    def close(self) -> None:
        self.port.close()


class Serial:
    """Opens a serial port: a name or a URL of pyserial, a rate, and what else `serial_for_url` takes."""

    POLL = 0.5  # how long a read that nothing ends may outlast its port

    def __init__(self, name: str, baudrate: int, **settings: Any) -> None:
        self.name, self.settings = name, {"baudrate": baudrate, "timeout": self.POLL, **settings}

    async def open(self) -> Stream:
        serial = importlib.import_module("serial")
        return Port(await asyncio.to_thread(serial.serial_for_url, self.name, **self.settings))

    def close(self) -> None:
        pass


class Line(Core[S]):
    """A session over a transport: reconnected automatically, after growing pauses."""

    def __init__(self, session: S, transport: Transport) -> None:
        super().__init__(session)
        self.transport = transport
        self.stream: Stream | None = None
        self.wake = asyncio.Event()  # for the task
        self.has_events = asyncio.Event()  # for the owner
        self.task: asyncio.Task[None] | None = None

    async def __aenter__(self) -> "Line[S]":
        self.task = asyncio.create_task(self.run())
        return self

    async def __aexit__(self, *_: object) -> None:
        await self.close()

    async def close(self) -> None:
        """Ends the connection, and makes no other."""
        if self.task is not None:
            self.task.cancel()
            await asyncio.gather(self.task, return_exceptions=True)
        self.drop()
        self.transport.close()

    def drop(self) -> None:
        if self.stream is not None:
            self.stream.close()
            self.stream = None
            self.closed()

    async def __aiter__(self) -> AsyncIterator[Json]:
        while True:
            yield await self.next()

    async def next(self, timeout: float | None = None) -> Json:
        """The next event; raises TimeoutError after so many seconds."""
        if not self.taken:
            waiting = asyncio.create_task(self.has_events.wait())
            ended = {waiting} | ({self.task} if self.task is not None else set())
            await asyncio.wait(ended, timeout=timeout, return_when=asyncio.FIRST_COMPLETED)
            waiting.cancel()
        if not self.taken:
            if self.task is not None and self.task.done():
                self.task.result()  # what the session could not do
            raise TimeoutError("no event")
        event = self.taken.popleft()
        if not self.taken:
            self.has_events.clear()
        return event

    def do(self, call: Callable[P, R], *args: P.args, **kwargs: P.kwargs) -> R:
        """A call of the session; what it is to send goes out as soon as the task runs."""
        result = super().do(call, *args, **kwargs)
        self.wake.set()
        return result

    def take(self) -> None:
        super().take()
        if self.taken:
            self.has_events.set()

    async def run(self) -> None:
        """The session's life."""
        pending: asyncio.Task[Any] | None = None
        waking = asyncio.create_task(self.wake.wait())
        try:
            while True:
                if self.stream is None and pending is None and self.rest() == 0:
                    pending = asyncio.create_task(self.transport.open())
                elif self.stream is not None and pending is None and self.session.wants_input():
                    pending = asyncio.create_task(self.stream.receive())
                rest = self.rest() if self.stream is None and pending is None else None
                waits = [task for task in (pending, waking) if task is not None]
                await asyncio.wait(waits, timeout=shortest(self.wait(), rest), return_when=asyncio.FIRST_COMPLETED)
                if waking.done():
                    self.wake.clear()
                    waking = asyncio.create_task(self.wake.wait())
                if pending is not None and pending.done():
                    self.settle(pending)
                    pending = None
                self.expire()
                if await self.send():
                    continue
                if pending is not None:  # a read of a connection that is over
                    pending.cancel()
                    pending = None
        finally:
            waking.cancel()
            if pending is not None:
                pending.cancel()

    def settle(self, done: "asyncio.Task[Any]") -> None:
        """A connection was made or not, or bytes have come or the end."""
        try:
            result = done.result()
        except OSError:
            result = None
        if self.stream is None and result is not None:
            self.stream = result
            self.opened()
        elif self.stream is None:
            self.closed()
        elif result:
            self.received(result)
        else:
            self.drop()

    async def send(self) -> bool:
        """Whether the connection, if there is one, goes on."""
        had_stream = self.stream is not None
        try:
            for data in self.due():
                if self.stream is not None and await self.stream.send(data):
                    self.session.transmitted(self.now())
        except OSError:
            self.drop()
        if self.has_closed:
            self.drop()
        return not had_stream or self.stream is not None
