"""A simulated robot in a pytest test: `cellwire simulate`, started for the test and ended with it.

    from cellwire_sim import simulate  # a fixture

    def test_my_program(simulate):
        robot = simulate("fanuc", "--set", "faults=nan:1-2")
        my_program.connect(robot.address)
        assert robot.wait_for("connected")["peer"].startswith("127.0.0.1:")
        robot.do("set", signal="DI[1]", value=1)
        robot.do("cut")  # the connection ends in the middle of the next reply
        my_program.expects_a_reconnect()

The commands of `do` are those of --control, in docs/simulate.md; robot.do("help") lists them.

Copy this file beside your tests. It needs Python 3.9, pytest, and `cellwire` in PATH or in the variable CELLWIRE.
"""

import json
import os
import queue
import socket
import subprocess
import threading

import pytest


class Refused(Exception):
    """The simulator did not execute a command."""


class Simulator:
    """A running `cellwire simulate DEVICE`."""

    def __init__(self, device, *arguments, endpoint=("--listen", "127.0.0.1:0"), timeout=10):
        command = [os.environ.get("CELLWIRE", "cellwire"), "simulate", device, *endpoint, *arguments]
        command += ["--control", "127.0.0.1:0"]
        self._control = None
        self.events = []
        self._lines = queue.Queue()
        self._errors = []
        self._process = subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, encoding="utf-8"
        )
        self._threads = [
            threading.Thread(target=self._read_events, daemon=True),
            threading.Thread(target=self._read_errors, daemon=True),
        ]
        for thread in self._threads:
            thread.start()
        try:
            #: What the simulator has said when it was ready: where it listens, or which pseudo-terminal it is.
            self.ready = self._wait(lambda line: "ready" in line, "line that says ready", timeout)
            connection = socket.create_connection(_address(self.ready["control"]), timeout)
            self._control = connection.makefile("rw", encoding="utf-8", newline="\n")
            connection.close()  # when the file is closed
        except BaseException:
            self.stop()
            raise

    @property
    def address(self):
        """The host and the port to connect to."""
        return _address(self.ready["listen"])

    def do(self, command, **fields):
        """Executes a command, such as do("delay", ms=200), and returns the fields of its answer."""
        answer = self.exchange({"do": command, **fields})
        if not answer["ok"]:
            raise Refused(answer["error"])
        return answer

    def exchange(self, request):
        """Sends a request and returns its answer, an error too."""
        print(json.dumps(request), file=self._control, flush=True)
        line = self._control.readline()
        if not line:
            raise RuntimeError(f"the simulator has ended: {''.join(self._errors).strip()}")
        return json.loads(line)

    def wait_for(self, event, timeout=10):
        """The next event of this name; those before it are in `events`, too."""
        return self._wait(lambda line: line.get("event") == event, event, timeout)

    def _wait(self, is_it, what, timeout):
        while True:
            try:
                found = self._lines.get(timeout=timeout)
            except queue.Empty:
                raise TimeoutError(f"no {what} within {timeout} s, but {self.events}") from None
            if found is None:
                raise RuntimeError(f"the simulator has ended: {''.join(self._errors).strip()}")
            self.events.append(found)
            if is_it(found):
                return found

    def stop(self):
        """Ends it; what it has said since is in `events`."""
        self._process.terminate()
        if self._control:
            self._control.close()
        try:
            self._process.wait(10)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        for thread in self._threads:
            thread.join(10)
        while not self._lines.empty():
            found = self._lines.get()
            if found is not None:
                self.events.append(found)
        for stream in (self._process.stdout, self._process.stderr):
            stream.close()

    def _read_events(self):
        for line in self._process.stdout:
            self._lines.put(json.loads(line))
        self._threads[1].join(10)  # why it has ended
        self._lines.put(None)

    def _read_errors(self):
        self._errors.extend(self._process.stderr)


def _address(text):
    host, _, port = text.rpartition(":")
    return host.strip("[]"), int(port)


@pytest.fixture
def simulate():
    """Starts devices by name, with arguments of `cellwire simulate`; all end with the test."""
    running = []

    def start(device, *arguments, **options):
        running.append(Simulator(device, *arguments, **options))
        return running[-1]

    yield start
    for simulator in running:
        simulator.stop()
