"""The tables of a server (FM-64 of reference/fanuc-hmi-modbus.md)."""

from collections.abc import Sequence
from typing import TypeVar

from ..stream import Json

Value = TypeVar("Value", bool, int)
ILLEGAL_FUNCTION, ILLEGAL_ADDRESS, ILLEGAL_VALUE, DEVICE_FAILURE = 1, 2, 3, 4
ADDRESSES = 0x10000
MAX_FIFO = 31
LIST = 246  # bytes of a PDU for the objects of function 43
LAST_OF = {1: 2, 2: 0x7F, 3: 0xFF}  # the ids of a category


class Refusal(Exception):
    """A request is answered with this exception code; nothing has changed."""

    def __init__(self, code: int) -> None:
        super().__init__(f"exception {code}")
        self.code = code


class Registers:
    """Four tables, each from address 0 on; a server has no functions of one that is None."""

    def __init__(
        self,
        coils: list[bool] | None = None,
        discrete_inputs: list[bool] | None = None,
        holding_registers: list[int] | None = None,
        input_registers: list[int] | None = None,
        server_id: list[int] | None = None,
        objects: dict[int, str] | None = None,  # of at most 244 characters
        exception_status: int | None = None,
        events: Json | None = None,  # status, events, messages and log of functions 11 and 12
        files: dict[int, list[int]] | None = None,
        queues: dict[int, list[int]] | None = None,
    ) -> None:
        self.coils = coils
        self.discrete_inputs = discrete_inputs
        self.holding_registers = holding_registers
        self.input_registers = input_registers
        self.server_id = server_id
        self.objects = objects or {}
        self.exception_status = exception_status
        self.events = events
        self.files = files
        self.queues = queues

    def serve(self, request: Json) -> Json:
        """The reply to a request, both without a transaction and a unit; raises Refusal."""
        function, reply = request["function"], {"function": request["function"]}
        if function in (1, 2):
            table = self.coils if function == 1 else self.discrete_inputs
            return reply | {"bits": run(table, request["address"], request["quantity"])}
        if function in (3, 4):
            words = self.holding_registers if function == 3 else self.input_registers
            return reply | {"registers": run(words, request["address"], request["quantity"])}
        if function == 23:
            run(self.holding_registers, request["address"], request["quantity"])
            write(self.holding_registers, request["write_address"], request["values"])
            return reply | {"registers": run(self.holding_registers, request["address"], request["quantity"])}
        if function in (5, 15):
            write(self.coils, request["address"], request["values"] if function == 15 else [request["value"]])
        elif function in (6, 16):
            write(self.holding_registers, request["address"], request["values"] if function == 16 else [request["value"]])
        elif function == 22:
            (word,) = run(self.holding_registers, request["address"], 1)
            masked = word & request["and"] | request["or"] & ~request["and"] & 0xFFFF  # FM-14
            write(self.holding_registers, request["address"], [masked])
        elif function == 8:
            return reply | {"subfunction": request["subfunction"], "values": self.diagnose(request["subfunction"], request["values"])}
        elif function in (7, 11, 12, 20, 21, 24):
            return reply | self.serve_device(request)
        elif function == 17 and self.server_id is not None:
            return reply | {"id": self.server_id}
        elif "category" in request and 0 in self.objects:
            return reply | self.identify(request["category"], request["object"])
        else:
            return self.serve_other(function, bytes(request.get("data", b"")))
        if function in (15, 16):
            return reply | {"address": request["address"], "quantity": len(request["values"])}
        return request

    def serve_device(self, request: Json) -> Json:
        """Functions 7, 11, 12, 20, 21 and 24 (FM-103 to FM-105)."""
        function = request["function"]
        if function == 7 and self.exception_status is not None:
            return {"status": self.exception_status}
        if function in (11, 12) and self.events is not None:
            names = ("status", "events") if function == 11 else ("status", "events", "messages", "log")
            return {name: self.events[name] for name in names}
        if function == 20 and self.files is not None:
            return {"contents": [run(self.file(it), it["record"], it["quantity"]) for it in request["ranges"]]}
        if function == 21 and self.files is not None:
            if any(it["record"] + len(it["values"]) > ADDRESSES for it in request["records"]):
                raise Refusal(ILLEGAL_ADDRESS)
            for it in request["records"]:
                write(self.file(it), it["record"], it["values"])
            return {"records": request["records"]}
        if function == 24 and self.queues is not None:
            if request["address"] not in self.queues:
                raise Refusal(ILLEGAL_ADDRESS)
            if len(self.queues[request["address"]]) > MAX_FIFO:
                raise Refusal(ILLEGAL_VALUE)
            return {"registers": self.queues[request["address"]]}
        raise Refusal(ILLEGAL_FUNCTION)

    def file(self, run: Json) -> list[int]:
        """The file of a run."""
        if self.files is None or run["file"] not in self.files:
            raise Refusal(ILLEGAL_ADDRESS)
        return self.files[run["file"]]

    def diagnose(self, subfunction: int, values: list[int]) -> list[int]:
        """Function 8: the words of the reply."""
        raise Refusal(ILLEGAL_FUNCTION)

    def identify(self, category: int, number: int) -> Json:
        """FM-98"""
        if category == 4 and number not in self.objects:
            raise Refusal(ILLEGAL_ADDRESS)
        if category != 4 and category not in LAST_OF:
            raise Refusal(ILLEGAL_VALUE)
        last = LAST_OF.get(category, number)
        first = number if number in self.objects and number <= last else 0
        found: list[Json] = []
        left, rest = LIST, 0
        for at in sorted(at for at in self.objects if first <= at <= last):
            left -= 2 + len(self.objects[at])
            if left < 0:
                rest = at
                break
            found.append({"id": at, "text": self.objects[at]})
        conformity = 0x80 + next(level for level, end in ((3, 0x80), (2, 3), (1, 0)) if max(self.objects) >= end)
        return {"category": category, "conformity": conformity, "more": left < 0, "next": rest, "objects": found}

    def serve_other(self, function: int, data: bytes) -> Json:
        """A function that has no table."""
        raise Refusal(ILLEGAL_FUNCTION)


def place(table: list[Value] | None, address: int, quantity: int) -> tuple[list[Value], slice]:
    """The table, and the place of a run in it; raises Refusal (FM-64)."""
    end = address + quantity
    if end > ADDRESSES:
        raise Refusal(ILLEGAL_ADDRESS)
    if table is None:
        raise Refusal(ILLEGAL_FUNCTION)
    if end > len(table):
        raise Refusal(ILLEGAL_ADDRESS)
    return table, slice(address, end)


def run(table: list[Value] | None, address: int, quantity: int) -> list[Value]:
    """The values of a run."""
    found, where = place(table, address, quantity)
    return found[where]


def write(table: list[Value] | None, address: int, values: Sequence[Value]) -> None:
    """Puts values into a run."""
    found, where = place(table, address, len(values))
    found[where] = values
