"""The table of messages, and what a message means (sections 4 and 5.2 of reference/kawasaki-msg.md)."""

from dataclasses import dataclass, field
from typing import Any

from ..stream import Json, Refused
from . import codec
from .job import Field, Layout, Unfit, Wrong

RANGES = {  # KM-19
    "order": (0, 65535),
    "ended": (0, 65535),
    "phase": (0, 255),
    "number": (1, 9999),
    "queued": (1, 9999),
    "executed": (1, 9999),
    "value": (codec.I32[0], codec.I32[-1]),
}
MAY_BE_EMPTY = ("ended", "queued", "executed")
OWN = "work"  # a job's own fields
LONGEST_NUMBER = 11  # KM-45
NAME_SHOWN = 15
MAX_FIELDS = 16
TABLE: dict[str, tuple[str, str | None, list[str]]] = {  # KM-18: name, sender (None: both), fields
    "order_start": ("TilausAlkaa", "pc", ["order", "number"]),
    "order_ack": ("TilausKuittaus", "robot", ["order"]),
    "job": ("Tyo", "pc", ["order", "number", OWN]),
    "job_ack": ("TyoKuittaus", "robot", ["order", "number"]),
    "job_request": ("TyoPyynto", "robot", ["order", "number"]),
    "pause": ("TyoTauko", "robot", ["order", "queued"]),
    "order_end": ("TilausLoppuu", "pc", ["order"]),
    "order_interrupt": ("TilausKeskeytyy", "pc", ["order"]),
    "end_ack": ("LoppuKuittaus", "robot", ["ended", "order", "executed"]),
    "status": ("Tila", None, ["order", "phase", "queued", "executed", "ended"]),
    "filler": ("Huuhaa", None, []),
}
PHASES = ["idle", "starting", "active", "ending", "interrupted", "alarm"]  # KM-20
COMMAND = "command_"
MAY_LACK = ("job_ack", "pause", "order_interrupt")  # KM-28
NEEDED = {"job_ack": ["number"], "job_request": ["number"], "job": ["number", OWN], "order_ack": ["order"]} | {
    "status": ["order", "queued", "executed"],
    "end_ack": ["ended", "executed"],
    "order_start": ["order"],
}


@dataclass(frozen=True)
class Entry:
    """A message of the table; a field is a name, `=TEXT`, or `unused`."""

    role: str
    name: str
    header: list[str] = field(default_factory=list)
    fields: list[str] = field(default_factory=list)

    @property
    def sender(self) -> str | None:
        return TABLE[self.role][1] if self.role in TABLE else "pc"

    @property
    def fixed(self) -> int:
        """How many fields are not a job's own."""
        return len(self.fields) - (OWN in self.fields)


def phase_name(code: int) -> str | Json:
    return PHASES[code] if code < len(PHASES) else {"other": code}


class Dialect:
    """The table, the character set and the layout of jobs of a plant."""

    def __init__(self, messages: Json | None = None, charset: str = "ascii", job: list[Json] | None = None) -> None:
        self.layout = Layout() if job is None else Layout([Field.of(spec) for spec in job])
        self.options: Json = {"charset": charset}
        entries = {role: Entry(role, name, [], fields) for role, (name, _, fields) in TABLE.items()}
        for role, spec in (messages or {}).items():
            if spec is None:
                entries.pop(role)
            else:
                entries[role] = Entry(role, spec["name"], spec.get("header", []), spec.get("fields", []))
        self.entries = entries
        self.names = {entry.name: entry for entry in entries.values()}
        self.check()

    def check(self) -> None:
        """KM-27, KM-28"""
        for role in TABLE:
            if role not in self.entries and role not in MAY_LACK:
                raise ValueError(f"a table may not lack {role}")
        if len(self.names) < len(self.entries):
            raise ValueError("a name is in the table twice")
        for entry in self.entries.values():
            named = [name for name in entry.header + entry.fields if is_named(name)]
            foreign = set(named) - set(TABLE[entry.role][2]) if entry.role in TABLE else set()
            lacking = set(NEEDED.get(entry.role, [])) - set(named)
            if len(set(named)) < len(named) or foreign or OWN in entry.header or lacking:
                raise ValueError(f"the fields of {entry.role}")
            if max(len(entry.header), len(entry.fields)) > MAX_FIELDS:
                raise ValueError(f"{entry.role} has up to {MAX_FIELDS} fields")

    def lacks_order(self) -> bool:
        """Whether a message that a datagram may bring late does not name its order (KM-83)."""
        roles = ("job", "job_ack", "job_request", "pause", "order_end", "order_interrupt")
        return any("order" not in [*entry.header, *entry.fields] for role in roles if (entry := self.entries.get(role)))

    def longest(self) -> int:
        """The bytes of the longest message (KM-45)."""
        return max(len(self.write_long(entry)) for entry in self.entries.values())

    def write_long(self, entry: Entry) -> bytes:
        def longest(name: str) -> str:
            return "0" * LONGEST_NUMBER if is_named(name) else write_field(name, {})

        fields = ["0" * (self.layout.longest() - 1) if name == OWN else longest(name) for name in entry.fields]
        message = {"name": entry.name, "header": [longest(name) for name in entry.header], "fields": fields}
        return codec.encode(message, options=self.options)

    # Reading

    def read(self, message: Json) -> Json:
        """What a message means: its `role`, its fields, and a job's own as texts in `work`. Raises Wrong (KM-35)."""
        entry = self.names.get(message["name"])
        if entry is None:
            raise Wrong({"kind": "unknown_name", "name": message["name"][:NAME_SHOWN]})
        found: Json = {"role": entry.role}
        if entry.header:
            self.read_header(entry, message["header"], found)
        texts = message["fields"]
        if not texts and len(entry.fields) == 1 and (entry.fields[0] == "unused" or entry.fields[0] in MAY_BE_EMPTY):
            texts = [""]  # KM-37
        self.read_fields(entry, texts, found)
        return found

    def read_header(self, entry: Entry, texts: list[str], found: Json) -> None:
        for at, name in enumerate(entry.header):
            if at >= len(texts):
                raise Wrong({"kind": "header", "value": at})
            try:
                read_field(name, texts[at], at, found)
            except Wrong as wrong:
                raise Wrong({"kind": "header", "value": at}) from wrong
        if len(texts) > len(entry.header):
            raise Wrong({"kind": "header", "value": len(entry.header)})

    def read_fields(self, entry: Entry, texts: list[str], found: Json) -> None:
        count = {"kind": "field_count", "expected": len(entry.fields), "found": len(texts)}
        has_own = OWN in entry.fields
        if has_own and len(texts) < entry.fixed:
            raise Wrong(count)
        own = len(texts) - entry.fixed
        at = 0
        for name in entry.fields:
            if name == OWN:
                found[OWN] = texts[at : at + own]
                at += own
                continue
            if at >= len(texts):
                raise Wrong(count)
            read_field(name, texts[at], at, found)
            at += 1
        if at < len(texts):
            raise Wrong(count)

    def read_job(self, found: Json) -> Json:
        """A job's own fields; raises Wrong (KM-36)."""
        try:
            return self.layout.read(found[OWN], self.entries["job"].fixed)
        except Unfit as unfit:
            raise Wrong({"kind": "field", **unfit.error}) from unfit

    def place(self, role: str, name: str) -> int:
        """Where a field is in a message, counted from 0."""
        fields = self.entries[role].fields
        return fields.index(name) if name in fields else 0

    # Writing

    def write(self, role: str, **values: Any) -> bytes | None:
        """A message; None: the table lacks it (KM-29). Raises Unfit."""
        entry = self.entries.get(role)
        if entry is None:
            return None
        fields: list[str] = []
        for name in entry.fields:
            if name == OWN:
                job = values.get("job")  # a command has none
                fields += [""] if job is None else self.layout.write(job, self.options["charset"] == "ascii")
            else:
                fields.append(write_field(name, values))
        message = {"name": entry.name, "header": [write_field(name, values) for name in entry.header], "fields": fields}
        return codec.encode(message, options=self.options)


def is_named(name: str) -> bool:
    return name in RANGES or name == OWN


def read_field(name: str, text: str, at: int, found: Json) -> None:
    """Step 4 of KM-35."""
    if name == "unused":
        return
    if name.startswith("="):
        if text != name[1:]:
            raise Wrong({"kind": "not_the_constant", "field": at})
        return
    if text == "" and name in MAY_BE_EMPTY:
        found[name] = None
        return
    value = codec.number(text.encode(codec.LATIN1))
    if value is None:
        raise Wrong({"kind": "not_a_number", "field": at})
    low, high = RANGES[name]
    if not low <= value <= high:
        raise Wrong({"kind": "out_of_range", "field": at, "found": value, "min": low, "max": high})
    found[name] = value


def write_field(name: str, values: Json) -> str:
    if name.startswith("="):
        return name[1:]
    value = values.get(name)  # `unused` has none
    return "" if value is None else str(value)


class Packet:
    """Messages that are sent together, up to a limit (KM-6)."""

    def __init__(self, dialect: Dialect, limit: int) -> None:
        self.dialect, self.limit = dialect, limit
        self.data = b""

    def add(self, role: str, **values: Any) -> bool:
        """Whether the message has room, or the table lacks it; raises Unfit."""
        message = self.dialect.write(role, **values)
        if message is None:
            return True
        if len(self.data) + len(message) > self.limit:
            return False
        self.data += message
        return True

    def finish(self) -> bytes:
        """The bytes; filler, if there are none."""
        if not self.data:
            self.add("filler")
        return self.data


@dataclass
class Limits:
    """KM-4, KM-5: bytes of a string of AS, and of a packet."""

    element: int = 255
    packet: int = 4096

    def check(self, dialect: Dialect) -> None:
        """KM-45"""
        try:
            fits = 1 <= self.element and dialect.longest() <= self.packet <= codec.MAX_LEN
        except Refused as refused:
            raise ValueError(str(refused)) from refused
        if not fits:
            raise ValueError("a message that no packet can hold")
