"""The simulated cells, one class a link: how it is simulated, its table in the site file, and what it is ordered to do."""
import collections
import json


class Cell:
    """Its `orders` are triples: the id, the order, and the outcome that it must have."""

    SIMULATE, SETTINGS, COMMANDS, OPTIONS = None, "", True, ()

    def __init__(self, name, cellwire, folder, spawn, listen="127.0.0.1"):
        self.name, self.folder, self.log = name, folder, f"{name}.log"
        options = [text.format(folder=folder, name=name) for text in self.OPTIONS]
        command = [cellwire, "simulate", self.SIMULATE, "--listen", f"{listen}:0", *options]
        self.process = spawn(command, self.log, stderr=open(folder / f"{name}.err", "a"))
        self.address = None

    def ready(self):
        text = (self.folder / self.log).read_text()
        if "\n" in text:
            self.address = json.loads(text.splitlines()[0])["listen"]
        return self.address

    def table(self):
        commands = "commands = true\n" if self.COMMANDS else ""
        return f'[cell.{self.name}]\nlink = "{self.NAME}"\naddress = "{self.address}"\n{commands}settings = {{ {self.SETTINGS} }}\n'

    def orders(self, round):
        return []

    def slow_order(self):
        """An order that takes seconds, if there is one."""
        return None

    def stop(self):
        self.process.kill()
        self.process.wait()

    def verify(self, rounds, fail):
        """Whether the device has executed what was reported as done, and nothing twice."""

    def once(self, rounds, fail, *events):
        """Whether the device reports each of these events once for each round of orders."""
        lines = (self.folder / self.log).read_text().splitlines()
        found = collections.Counter(json.loads(line).get("event") for line in lines)
        if any(found[event] != rounds for event in events):
            fail(f"{self.name} was to report each of {events} {rounds} times, and has reported {found}")


class Fanuc(Cell):
    NAME, SIMULATE, SETTINGS = "fanuc-hmi-modbus", "fanuc", 'poll = "100ms"'

    def orders(self, round):
        return [
            (f"{self.name}/{round}/a", {"write_register": {"address": 100, "value": 7 * round}}, "done"),
            (f"{self.name}/{round}/b", {"write_registers": {"address": 65535, "values": [1, 2]}}, "refused"),
            (f"{self.name}/{round}/c", {"lift": {}}, "refused"),
        ]


class Kawasaki(Cell):
    NAME, SIMULATE = "kawasaki-msg", "kawasaki-robot"
    OPTIONS = ("--set", "record={folder}/{name}.csv", "--set", "speed=1000")

    @staticmethod
    def line(x, y):
        return {"kind": 1, "x1": x, "y1": 0, "x2": x, "y2": y}

    def orders(self, round):
        return [
            (f"{self.name}/{round}/a", {"jobs": [self.line(100 * place, 1000 * round) for place in range(1, 6)]}, "done"),
            (f"{self.name}/{round}/b", {"jobs": [{"colour": 1}]}, "refused"),
        ]

    def slow_order(self):
        # Half a metre each: not done before the bridge is killed.
        return f"{self.name}/slow", {"jobs": [self.line(place, 50_000) for place in range(1, 201)]}

    def verify(self, rounds, fail):
        lines = [line.split(",") for line in (self.folder / f"{self.name}.csv").read_text().splitlines()[1:]]
        executed = collections.Counter(tuple(line[2:]) for line in lines)
        quick = [job for job in executed if job[-1] != "50000"]
        if len(quick) != 5 * rounds or set(executed.values()) != {1}:
            fail(f"{self.name} has executed {executed}")


class Laser(Cell):
    NAME, SIMULATE, SETTINGS = "laser-eb90", "laser", 'poll = "500ms"'

    def orders(self, round):
        cut = lambda place: {"word": 0x0101, "values": [place, 0, 0, 0, 0, 0]}
        return [
            (f"{self.name}/{round}/a", {"instructions": [cut(1), cut(2)]}, "done"),
            (f"{self.name}/{round}/b", {"instructions": [{"word": 1}]}, "refused"),
        ]

    def verify(self, rounds, fail):
        self.once(rounds, fail, "queued")


class Mma(Cell):
    NAME, SIMULATE, SETTINGS = "mmacell-proto", "mma-robot", 'poll = "200ms"'

    def orders(self, round):
        return [
            (f"{self.name}/{round}/a", {"command": "SRV", "on": True}, "done"),
            (f"{self.name}/{round}/b", {"command": "MOV", "mode": "absolute", "axes": [round, 2, 3, 0]}, "done"),
            (f"{self.name}/{round}/c", {"command": "OVR", "percent": 200}, "refused"),
        ]

    def verify(self, rounds, fail):
        self.once(rounds, fail, "servo", "move")


class Alter(Cell):
    NAME, SIMULATE, SETTINGS = "val2-alter", "puma", 'report = "200ms"'

    def orders(self, round):
        return [(f"{self.name}/{round}/a", {"target": [1, 0, 0, 0, 0, 0]}, "refused")]


class Ball(Cell):
    NAME, SIMULATE, SETTINGS, COMMANDS = "isra-ball", "ball", 'report = "200ms"', False

    def orders(self, round):
        return [(f"{self.name}/{round}/a", {}, "refused")]


class Viewer(Cell):
    NAME, SIMULATE, SETTINGS = "val2-viewer", "viewer", 'report = "500ms"'

    def orders(self, round):
        pose = [16384, 0, 0, 0, 16384, 0, 0, 0, 16384, 320 * round, 0, 0]
        return [(f"{self.name}/{round}/a", {"pose": pose}, "done")]


LINKS = [Kawasaki, Alter, Viewer, Ball, Fanuc, Laser, Mma]
