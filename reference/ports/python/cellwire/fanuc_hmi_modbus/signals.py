"""The robot's signals and their places in the tables (section 4.2 of reference/fanuc-hmi-modbus.md)."""

from dataclasses import dataclass

DISCRETE_INPUTS, COILS, INPUT_REGISTERS, HOLDING_REGISTERS = "discrete_inputs", "coils", "input_registers", "holding_registers"


@dataclass(frozen=True)
class Range:
    """A row of the table: the numbers of a signal, and the PDU address of the first."""

    first: int
    last: int
    table: str
    address: int


SIGNALS = {
    "di": Range(1, 10000, DISCRETE_INPUTS, 0),
    "ri": Range(1, 10000, DISCRETE_INPUTS, 10000),
    "ui": Range(1, 1000, DISCRETE_INPUTS, 20000),
    "uo": Range(1, 999, DISCRETE_INPUTS, 21000),
    "si": Range(0, 999, DISCRETE_INPUTS, 21999),
    "so": Range(0, 1000, DISCRETE_INPUTS, 22999),
    "wi": Range(1, 1000, DISCRETE_INPUTS, 24000),
    "wo": Range(1, 1000, DISCRETE_INPUTS, 25000),
    "wsi": Range(1, 1000, DISCRETE_INPUTS, 26000),
    "wso": Range(1, 1000, DISCRETE_INPUTS, 27000),
    "do": Range(1, 10000, COILS, 0),
    "ro": Range(1, 10000, COILS, 10000),
    "flag": Range(1, 10000, COILS, 20000),
    "gi": Range(1, 1000, INPUT_REGISTERS, 0),
    "go": Range(1, 1000, INPUT_REGISTERS, 1000),
    "ai": Range(1, 1000, INPUT_REGISTERS, 2000),
    "ao": Range(1, 1000, INPUT_REGISTERS, 3000),
    "r": Range(1, 16384, HOLDING_REGISTERS, 0),
    "dynamic": Range(0, 63, HOLDING_REGISTERS, 16384),
}


def place_of(name: str, number: int) -> tuple[str, int] | None:
    """The table and the PDU address of a signal; None: there is no such number (FM-17)."""
    row = SIGNALS[name]
    return (row.table, row.address + number - row.first) if row.first <= number <= row.last else None


def signal_at(table: str, address: int) -> tuple[str, int] | None:
    """The signal at an address, and its number; None: there is none."""
    for name, row in SIGNALS.items():
        if row.table == table and 0 <= address - row.address <= row.last - row.first:
            return name, row.first + address - row.address
    return None
