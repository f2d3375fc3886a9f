"""fanuc-ls: TP programs as text, read. Clauses LS-… are those of reference/fanuc-ls.md; fanuc_ls_write.py writes them."""

import re
from dataclasses import dataclass, field
from typing import Any

from ..stream import Json, error
from .parts import U32, comment_of, read_attribute, read_instruction, read_position
from .text import BLANKS, WHITE, Cursor, Fault, Place, is_word, leading_digits, lines_of, number

SECTIONS = ["/PROG", "/ATTR", "/APPL", "/MN", "/POS", "/END"]
PROG, ATTR, APPL, MN, POS, END = range(6)
COMMENT_LENGTH = 16
HEAD = re.compile(r"([0-9]*)[ \t]*:")
NOWHERE = (0, 0)  # a section that is not there


def decode(data: bytes) -> str:
    """The characters of a file (LS-4)."""
    try:
        return data.decode()
    except UnicodeDecodeError:
        return data.decode("latin-1")


def section(line: str) -> int | None:
    """Which section a line begins (LS-6)."""
    words = line.lstrip(WHITE)
    for index, name in enumerate(SECTIONS):
        behind = words[len(name) : len(name) + 1]
        if words.startswith(name) and (behind == "_" or not is_word(behind)):
            return index
    return None


def is_nested(line: str, last: int, in_block: bool) -> bool:
    """LS-15; `last` is the number of the last line that is in no block."""
    body = line.lstrip(" ")
    own = number(leading_digits(body))
    begins = own != last + 1 and not body.startswith(":")
    return len(line) - len(body) >= 5 and last > 0 and (in_block or begins)


@dataclass
class Statement:
    """A statement of /MN: where it is, and what was read of it."""

    text: str
    base: int
    nested: bool

    @property
    def head(self) -> re.Match[str] | None:
        return HEAD.match(self.text, len(self.text) - len(self.text.lstrip(WHITE)))

    @property
    def number(self) -> int | None:
        return number(self.head[1]) if self.head and not self.nested else None

    @property
    def body(self) -> int:
        """Where the instruction begins."""
        begin = self.head.end() if self.head else 0
        return self.base + begin + len(self.text[begin:]) - len(self.text[begin:].lstrip(WHITE))

    def read(self) -> Any:
        """LS-14."""
        if self.nested:
            return {"nested": self.text.rstrip(WHITE)}
        head, begin = self.head, len(self.text) - len(self.text.lstrip(WHITE))
        if head is None or head[1] and number(head[1]) is None:
            raise Fault(self.base + begin, "line_number")
        body = self.text[head.end() :].rstrip(WHITE)
        if not body.endswith(";"):
            closed = -1 if body.lstrip(WHITE).startswith("!") else body.rfind(";", body.rfind("\n") + 1)
            if closed >= 0:
                behind = body[closed + 1 :]
                behind_at = head.end() + closed + 1 + len(behind) - len(behind.lstrip(WHITE))
                raise Fault(self.base + behind_at, "after_instruction")
            raise Fault(self.base + len(self.text.rstrip(WHITE)), "instruction_end")
        return read_instruction(body[:-1], self.base + head.end())


@dataclass
class Parts:
    """Where the parts of a file are (section 3.1, the pseudocode of section 5)."""

    text: str
    name: tuple[int, int] = field(init=False)
    head_end: int = field(init=False)
    kind: str | None = None
    sections: dict[int, tuple[int, int]] = field(default_factory=dict)
    blocks: list[tuple[int, int]] = field(default_factory=list)  # where each begins, and its line

    def __post_init__(self) -> None:
        text = self.text
        start = len(text) - len(text.lstrip(WHITE + "\ufeff"))
        last, begins = PROG, start
        for at, line in lines_of(text, start, len(text)):
            found = section(line)
            if found == PROG and at != start or (last, found) == (APPL, APPL):
                found = None
            words = line.lstrip(WHITE)
            if found is None:
                if at == start:
                    raise Fault(start, "program")
                if last == PROG and words:
                    raise Fault(at, "main")
                if last == POS and (words.startswith("P[") or not self.blocks and words):
                    self.blocks.append((at + len(line) - len(words), at))
                continue
            if found == PROG:
                self.head(at, line)
                continue
            if at == start:
                raise Fault(start, "program")
            if found <= last or found > MN > last:
                raise Fault(at, "main" if last < MN else "end")
            behind = at + len(line) - len(words) + len(SECTIONS[found])
            if found == MN and text[behind : at + len(line)].strip(WHITE):
                raise Fault(behind, "main")
            self.sections[last] = (begins, at)
            stop = text.find("\n", at)
            last, begins = found, len(text) if stop < 0 else stop + 1
            if found == END:
                break
        if last != END:
            raise Fault(len(text), "program" if start == len(text) else "main" if last < MN else "end")
        rest = text[begins:].lstrip(WHITE + "\x1a")
        if rest:
            raise Fault(len(text) - len(rest), "trailing")

    def head(self, at: int, line: str) -> None:
        match = re.compile(f"/PROG[{WHITE}]*([^{WHITE}]+)").match(line)
        if match is None:
            raise Fault(at + len(line.rstrip(WHITE)), "program")
        self.name = (at + match.start(1), at + match.end())
        self.kind = line[match.end() :].strip(WHITE) or None
        self.head_end = at + len(line.rstrip(WHITE))

    def attributes(self) -> list[tuple[int, int, Json | Fault]]:
        """Where each attribute begins and ends, and what it is or what is wrong (LS-36)."""
        at, end = self.sections.get(ATTR, NOWHERE)
        found: list[tuple[int, int, Json | Fault]] = []
        while rest := self.text[at:end].lstrip(WHITE):
            at = end - len(rest)
            cursor = Cursor(rest, at)
            try:
                attribute: Json | Fault = read_attribute(cursor)
                stop = cursor.at
            except Fault as fault:
                attribute = fault
                following = re.compile(f"\n(?![{WHITE}])").search(rest, fault.at - at)
                stop = following.end() if following else len(rest)
            found.append((at, at + len(rest[:stop].rstrip(WHITE)), attribute))
            at += stop
        return found

    def application(self) -> list[tuple[int, str]]:
        return lines_of(self.text, *self.sections.get(APPL, NOWHERE))

    def statements(self) -> list[Statement]:
        """LS-14, LS-15."""
        lines = [(at, line) for at, line in lines_of(self.text, *self.sections[MN])]
        found: list[Statement] = []
        last, in_block, index = 0, False, 0
        while index < len(lines):
            at, line = lines[index]
            index += 1
            if not line.lstrip(WHITE):
                continue
            in_block = is_nested(line, last, in_block)
            end = at + len(line)
            if not in_block:
                first = Statement(line, at, False)
                while not line.rstrip(WHITE).endswith(";") and index < len(lines):
                    if not lines[index][1].lstrip(BLANKS).startswith(":"):
                        break
                    end, line = lines[index][0] + len(lines[index][1]), lines[index][1]
                    index += 1
                last = last + 1 if first.number is None else first.number
            found.append(Statement(self.text[at:end], at, in_block))
        return found

    def positions(self) -> list[tuple[int, str]]:
        ends = [line for _, line in self.blocks[1:]] + [self.sections.get(POS, NOWHERE)[1]]
        return [(begin, self.text[begin:end]) for (begin, _), end in zip(self.blocks, ends)]


def read_program(text: str) -> tuple[Json | None, Json | None]:
    """A program (LS-33), or the first error."""
    try:
        parts = Parts(text)
        attributes = []
        for _, _, attribute in parts.attributes():
            if isinstance(attribute, Fault):
                raise attribute
            attributes.append(attribute)
        return {
            "name": text[slice(*parts.name)],
            "kind": parts.kind,
            "attributes": attributes if ATTR in parts.sections else None,
            "application": [line.rstrip(WHITE) for _, line in parts.application()] if APPL in parts.sections else None,
            "instructions": [statement.read() for statement in parts.statements()],
            "positions": [read_position(block, at) for at, block in parts.positions()],
        }, None
    except Fault as fault:
        return None, Place(text).error(fault)


class Document:
    """Everything that there is in a file (LS-32, LS-36), as the annex of reference/fanuc-ls.md orders it in `items`."""

    def __init__(self, text: str, options: Json) -> None:
        self.text = text
        self.place = Place(text)
        self.limit = options.get("name_limit", 36)
        self.items: list[Json] = []
        self.used: set[int] = set()
        self.any_used = False
        self.motions: dict[int, tuple[int, int]] = {}  # position: entry and character of the first motion there
        # Of each entry: where it begins and ends, its content or its fault, its findings by their key, which are made in the order of LS-54.
        self.entries: list[tuple[int, int, Any, list[Json]]] = []
        try:
            self.parts = Parts(text)
        except Fault as fault:
            self.items.append({"offset": 0, "length": len(text.encode()), "error": self.place.error(fault)})
            return
        self.head()
        count_at = self.attributes()
        for at, line in self.parts.application():
            if line.strip(WHITE):
                self.add(at, line, {"application": line.rstrip(WHITE)})
        self.statements(count_at)
        self.positions()
        self.show()

    def add(self, at: int, text: str, content: Any) -> None:
        begin = at + len(text) - len(text.lstrip(WHITE))
        self.entries.append((begin, begin + len(text.strip(WHITE)), content, []))

    def find(self, at: int, kind: str, entry: int = -1, key: str = "warning", **fields: int) -> None:
        self.entries[entry][3].append({key: error(kind, **fields, **self.place.of(at))})

    def head(self) -> None:
        begin, end = self.parts.name
        name = self.text[begin:end]
        content = {"program": {"name": name, "kind": self.parts.kind}}
        self.add(begin, self.text[begin : self.parts.head_end], content)
        if not re.fullmatch("[A-Za-z_][A-Za-z0-9_]*", name):
            self.find(begin, "name")
        elif len(name) > self.limit:
            self.find(begin, "name_length", key="error", found=len(name), limit=self.limit)

    def attributes(self) -> tuple[int, int, int] | None:
        """The entry, the place and the value of LINE_COUNT."""
        count = None
        for begin, end, attribute in self.parts.attributes():
            content = attribute if isinstance(attribute, Fault) else {"attribute": attribute}
            self.add(begin, self.text[begin:end], content)
            if isinstance(attribute, Fault):
                continue
            length = len(comment_of(attribute) or "")
            if length > COMMENT_LENGTH:
                self.find(begin, "comment_length", found=length)
            if attribute["name"] in ("LINE_COUNT", "ZEILEN") and "text" in attribute["value"]:
                stated = number(attribute["value"]["text"])
                count = None if stated is None else (len(self.entries) - 1, begin, stated)
        return count

    def statements(self, count_at: tuple[int, int, int] | None) -> None:
        last, count, numbered, is_off, clean = 0, 0, True, False, True
        for statement in self.parts.statements():
            self.note(statement.text)
            content: Any
            try:
                content = {"statement": {"number": statement.number, "instruction": statement.read()}}
            except Fault as fault:
                content = fault
            self.add(statement.base, statement.text, content)
            if statement.nested:
                continue
            count += 1
            found = statement.number
            if found is None:
                numbered = False
            else:
                numbered = numbered and (found == last + 1 or not is_off)
                is_off = found != last + 1
                if is_off and numbered:
                    self.find(self.entries[-1][0], "line_number", expected=last + 1, found=found)
                last = found
            if not isinstance(content, Fault) and "motion" in content["statement"]["instruction"]:
                self.motion(content["statement"]["instruction"]["motion"], statement.body)
            clean = clean and not isinstance(content, Fault) and not self.entries[-1][3]
        if count_at and clean and count_at[2] not in (0, count):
            self.find(count_at[1], "line_count", count_at[0], expected=count_at[2], found=count)

    def motion(self, motion: Json, at: int) -> None:
        ((form, speed),) = motion["speed"].items()
        unit = None if form == "named" else speed["unit"]
        if unit is not None and not fits(motion["kind"], unit):
            self.find(at, "speed_unit")
        elif form == "fixed" and not in_range(speed["value"], speed["unit"]):
            self.find(at, "speed_range", key="error")
        for target in (motion["via"], motion["target"]):
            if target and "position" in target:
                self.motions.setdefault(target["position"]["number"], (len(self.entries) - 1, at))

    def note(self, text: str) -> None:
        """Every P[n] in an instruction's text."""
        for match in re.finditer(r"P\[", text):
            if is_word(text[match.start() - 1 : match.start()]):
                continue
            value = leading_number(text[match.end() :])
            if value is None:
                self.any_used = True
            else:
                self.used.add(value)

    def positions(self) -> None:
        defined: dict[int | None, int] = {}
        for at, block in self.parts.positions():
            try:
                position = read_position(block, at)
            except Fault as fault:
                self.add(at, block, fault)
                value = leading_number(block[2:]) if block.startswith("P[") else None
                defined.setdefault(value, 1)
                continue
            self.add(at, block, {"position": position})
            value = position["number"]
            defined[value] = defined.get(value, 0) + 1
            if defined[value] == 1 and not self.any_used and value not in self.used:
                self.find(at, "unused_position", number=value)
            elif defined[value] == 2:
                self.find(at, "repeated_position", number=value)
            if any(axis["value"] is None for group in position["groups"] for axis in group["axes"]):
                self.find(at, "untaught_position", number=value)
        for value, (entry, at) in sorted(self.motions.items()):
            if value not in defined:
                self.find(at, "undefined_position", entry, number=value)

    def show(self) -> None:
        for begin, end, content, findings in self.entries:
            place = {"offset": self.place.bytes(begin), "length": len(self.text[begin:end].encode())}
            if isinstance(content, Fault):
                self.items.append(place | {"error": self.place.error(content)})
            else:
                self.items.append(place | {"message": content})
            self.items += [place | finding for finding in findings]


def leading_number(text: str) -> int | None:
    return number(leading_digits(text.lstrip(WHITE)), U32)


def fits(kind: str, unit: str) -> bool:
    """LS-20."""
    return unit in ("sec", "msec") or (unit == "percent") == (kind == "joint")


def in_range(value: float, unit: str) -> bool:
    """LS-21."""
    return 0.001 <= value <= (100 if unit == "percent" else 100_000)
