"""fanuc-ls: TP programs as text, written. Clauses LS-… are those of reference/fanuc-ls.md."""

import math
import re
from decimal import Decimal
from typing import Any

from ..stream import Json, Refused, integer, one_of
from .parts import (
    AXES,
    KINDS,
    U8,
    U16,
    U32,
    UNITS,
    comment_of,
    read_attribute,
    read_instruction,
)
from .read import APPL, COMMENT_LENGTH, PROG, fits, in_range, is_nested, section
from .text import WHITE, Cursor, Fault, is_control, is_word


def encode(program: Json, options: Json) -> str:
    """The text of a program (LS-37 to LS-40)."""
    name = text_of(program["name"])
    if not re.fullmatch("[A-Za-z_][A-Za-z0-9_]*", name) or len(name) > options.get("name_limit", 36):
        raise Refused("a name is letters, digits and _, of which no digit is the first, and not too long")
    out = [f"/PROG  {name}"]
    if program.get("kind") is not None:
        kind = text_of(program["kind"])
        if not kind or kind != kind.strip(WHITE) or not is_line(kind):
            raise Refused("a kind is on one line, without blanks around it")
        out[0] += f"\t  {kind}"
    if program.get("attributes") is not None:
        out.append("/ATTR")
        out += [write_attribute(attribute, options.get("comment") == "truncate") for attribute in program["attributes"]]
    if program.get("application") is not None:
        out.append("/APPL")
        for line in program["application"]:
            if not is_line(text_of(line)) or section(line) not in (None, PROG, APPL):
                raise Refused("a line of /APPL is a line, and begins no section")
            out.append(line.rstrip(WHITE))
    out.append("/MN")
    last, in_block = 0, False
    for instruction in program["instructions"]:
        if isinstance(instruction, dict) and "nested" in instruction:
            line = text_of(one(instruction)[1])
            if line.rstrip(WHITE) != line or any(map(is_control, line)) or not is_nested(line, last, in_block):
                raise Refused("a nested line would be read as something else")
            in_block = True
            out.append(line)
            continue
        last, in_block = last + 1, False
        out.append(f"{last:4}:{write_instruction(instruction)} ;")
    out.append("/POS")
    out += [write_position(position) for position in program["positions"]]
    return "\r\n".join([*out, "/END", ""])


def text_of(value: Any) -> str:
    if not isinstance(value, str):
        raise Refused(f"a text, not {value!r}")
    return value


def one(value: Json) -> tuple[str, Any]:
    """The only key of an object, and its value."""
    if not isinstance(value, dict) or len(value) != 1:
        raise Refused(f"an object of one key, not {value!r}")
    return next(iter(value.items()))


def is_line(text: str) -> bool:
    return not any(is_control(c) and c != "\t" for c in text)


def write_attribute(attribute: Json, cut: bool) -> str:
    name, (form, value) = text_of(attribute["name"]), one(attribute["value"])
    if form == "text":
        comment = comment_of({"name": name, "value": {"text": text_of(value)}})
        if comment is not None and len(comment) > COMMENT_LENGTH:
            if not cut:
                raise Refused("a comment has at most 16 characters")
            value = f'"{comment[:COMMENT_LENGTH].rstrip(WHITE)}"'
        text = name + ("\t" if len(name) >= 8 else "\t\t") + f"= {value};"
    elif form == "list":
        items = [f"{text_of(item)}\t= {text_of(inner)}" for item, inner in value]
        text, value = f"{name}:  " + ",\r\n      ".join(items) + ";", [list(item) for item in value]
    else:
        raise Refused(f"no value of an attribute: {form}")
    cursor = Cursor(text, 0)
    try:
        again = read_attribute(cursor)
    except Fault as fault:
        raise Refused(f"an attribute would not be read again: {fault}") from fault
    if again != {"name": name, "value": {form: value}}:
        raise Refused("an attribute would be read as something else")
    return text


def is_plain(text: str) -> bool:
    """No line but the last closes the instruction, and none has a control character."""
    *others, last = text.split("\n")
    return all(map(is_line, [*others, last])) and not any(line.rstrip(WHITE).endswith(";") for line in others)


def write_instruction(instruction: Any) -> str:
    """What stands between the `:` and the ` ;` of a statement."""
    if instruction == "empty":
        return "  "
    key, value = one(instruction)
    if key in ("user_frame", "user_tool"):
        return ("  UFRAME_NUM=" if key == "user_frame" else "  UTOOL_NUM=") + str(integer(value, 0, U16, key))
    if key == "motion":
        return write_motion(value)
    text = text_of(value).rstrip(WHITE)
    before = "  !" if key == "comment" else " " * 9 if text.startswith("=") else "  "
    written = before + text.replace("\n", "\r\n    :  ")
    if not is_plain(value) or reads_as(written) != {key: text}:
        raise Refused("an instruction would be read as something else")
    return written


def reads_as(written: str) -> Any:
    try:
        return read_instruction(written, 0)
    except Fault:
        return None


def write_motion(motion: Json) -> str:
    letters = {kind: letter for letter, kind in KINDS.items()}
    kind, via = one_of(motion["kind"], set(letters), "kind"), motion["via"]
    text = letters[kind]
    if via is not None:
        text += " " + write_target(via) + (f" {motion['via_options']}" if motion["via_options"] else "") + "    \r\n    : "
    text += f" {write_target(motion['target'])} {write_speed(motion['speed'], kind)}"
    if motion["termination"] is not None:
        text += " " + write_termination(motion["termination"])
    if motion["options"]:
        text += " " + motion["options"].replace("\n", "\r\n    :  ")
    if reads_as(text) != {"motion": motion} or not is_plain(text.replace("\r\n", "\n")):
        raise Refused("a motion would be read as something else")
    return text + "   "


def write_target(target: Json) -> str:
    form, value = one(target)
    if form == "other":
        return text_of(value)
    letters = {"position": "P", "register": "PR"}[form]
    name = "" if value["name"] is None else ":" + text_of(value["name"])
    return f"{letters}[{integer(value['number'], 0, U32, form)}{name}]"


def write_speed(speed: Json, kind: str) -> str:
    form, value = one(speed)
    if form == "named":
        return text_of(value)
    unit = value["unit"]
    if unit not in UNITS.values() or not fits(kind, unit):
        raise Refused("the motion does not take this unit")
    written = next(text for text, name in UNITS.items() if name == unit)
    if form == "register":
        return text_of(value["register"]) + written
    if not in_range(decimal(value["value"]), unit):
        raise Refused("a speed is within the range of its unit")
    digits = plain(value["value"])
    if unit == "sec":
        return (digits if "." in digits else digits + ".0") + written
    return without_zero(digits) + written


def write_termination(termination: Any) -> str:
    if termination == "fine":
        return "FINE"
    form, value = one(termination)
    if form == "continuous":
        return f"CNT{value}"
    return f"CNT {text_of(value)}"


def decimal(value: Any) -> float:
    if not isinstance(value, int | float) or isinstance(value, bool) or not math.isfinite(value):
        raise Refused(f"a number, not {value!r}")
    return float(value)


def plain(value: float) -> str:
    """All digits that it has, without an exponent."""
    text = repr(float(value))
    return format(Decimal(text), "f") if "e" in text else text.removesuffix(".0")


def without_zero(text: str) -> str:
    return re.sub(r"^(-?)0\.", r"\1.", text)


def coordinate(value: float) -> str:
    """LS-39."""
    text = f"{value:.3f}"
    if float(text) != value:
        text = plain(value)
    return text if text == "0.000" else without_zero(text)


def write_position(position: Json) -> str:
    name, groups = position["name"], position["groups"]
    if name is not None and (any(is_control(c) or c == '"' for c in text_of(name)) or name != name.strip(WHITE)):
        raise Refused("a position's name has no quote, no control character, no blanks around it")
    if not groups:
        raise Refused("a position has a group")
    head = f"P[{integer(position['number'], 0, U32, 'number')}" + ("" if name is None else f':"{name}"')
    return head + "]{\r\n" + "".join(map(write_group, groups)) + "};"


def write_group(group: Json) -> str:
    frames = []
    for key in ("user_frame", "user_tool"):
        frames.append("F" if group[key] is None else str(integer(group[key], 0, U16, key)))
    text = f"   GP{integer(group['number'], 0, U8, 'group')}:\r\n\tUF : {frames[0]}, UT : {frames[1]},\t"
    if group["configuration"] is not None:
        keyword, inner = text_of(group["configuration"]["keyword"]), text_of(group["configuration"]["text"])
        if len(keyword) < 3 or not all(map(is_word, keyword)) or any(is_control(c) or c == "'" for c in inner):
            raise Refused("a configuration is a word of three letters and a text without a quote")
        text += f"\t{keyword} : '{inner}',"
    if not group["axes"]:
        raise Refused("a group has axes")
    axes = [write_axis(axis) for axis in group["axes"]]
    rows = [",\t".join(axes[first : first + 3]) for first in range(0, len(axes), 3)]
    return text + "\r\n\t" + ",\r\n\t".join(rows) + "\r\n"


def write_axis(axis: Json) -> str:
    name = one_of(axis["name"], set(AXES), "axis")
    value = "  ********" if axis["value"] is None else f"{coordinate(decimal(axis['value'])):>10}"
    unit = {"deg": " deg", "mm": "  mm"}[axis["unit"]]
    return name + ("=" if name[0] in "JE" else " =") + value + unit
