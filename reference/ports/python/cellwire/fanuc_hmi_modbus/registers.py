"""The tables of a server (FM-64 of reference/fanuc-hmi-modbus.md)."""

from collections.abc import Sequence
from typing import TypeVar

from ..stream import Json

Value = TypeVar("Value", bool, int)
ILLEGAL_FUNCTION, ILLEGAL_ADDRESS, ILLEGAL_VALUE, DEVICE_FAILURE = 1, 2, 3, 4
ADDRESSES = 0x10000


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
    ) -> None:
        self.coils = coils
        self.discrete_inputs = discrete_inputs
        self.holding_registers = holding_registers
        self.input_registers = input_registers

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
        else:
            return self.serve_other(function, bytes(request["data"]))
        if function in (15, 16):
            return reply | {"address": request["address"], "quantity": len(request["values"])}
        return request

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
