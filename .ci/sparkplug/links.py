"""The simulated cells, one class a link: how it is simulated, its table in the hall's file, and what it is ordered to do."""
import json


class Cell:
    SIMULATE, SETTINGS, COMMANDS, OPTIONS = None, "", False, ()

    def __init__(self, name, cellwire, folder, spawn):
        self.name, self.folder, self.log = name, folder, f"{name}.log"
        options = [text.replace("FOLDER", str(folder)).replace("NAME", name) for text in self.OPTIONS]
        self.process = spawn([cellwire, "simulate", self.SIMULATE, "--listen", "127.0.0.1:0", *options],
                             self.log, stderr=open(folder / f"{name}.err", "a"))
        self.address = None

    def ready(self):
        text = (self.folder / self.log).read_text()
        if "\n" in text:
            self.address = json.loads(text.splitlines()[0])["listen"]
        return self.address

    def table(self):
        commands = "commands = true\n" if self.COMMANDS else ""
        return f'[cell.{self.name}]\nlink = "{self.LINK}"\naddress = "{self.address}"\n{commands}settings = {{ {self.SETTINGS} }}\n'

    def orders(self, round):
        return []

    def stop(self):
        self.process.kill()

    def verify(self, fail):
        pass


class Fanuc(Cell):
    NAME = LINK = "fanuc-hmi-modbus"
    SIMULATE, SETTINGS, COMMANDS = "fanuc", 'poll = "100ms"', True

    def orders(self, round):
        return [
            (f"{self.name}/{round}/a", {"write_register": {"address": 100, "value": 7 * round}}, "done"),
            (f"{self.name}/{round}/b", {"write_registers": {"address": 65535, "values": [1, 2]}}, "refused"),
            (f"{self.name}/{round}/c", {"lift": {}}, "refused"),
        ]


LINKS = [Fanuc]
