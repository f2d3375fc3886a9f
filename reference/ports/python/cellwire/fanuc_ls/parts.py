"""fanuc-ls: attributes, instructions and positions. Clauses LS-… are those of reference/fanuc-ls.md."""

import re
from typing import Any

from ..stream import Json
from .text import BLANKS, WHITE, Cursor, Fault, is_letter, is_word, join_lines, number

KINDS = {"J": "joint", "L": "linear", "C": "circular", "A": "arc", "S": "spline"}  # LS-47
OPEN = "..."  # what a template leaves open
UNITS = {
    "%": "percent",
    "sec": "sec",
    "msec": "msec",
    "mm/sec": "mm_per_sec",
    "cm/min": "cm_per_min",
    "inch/min": "inch_per_min",
    "deg/sec": "deg_per_sec",
    "sek": "sec",
    "msek": "msec",
    "mm/sek": "mm_per_sec",
    "deg/sek": "deg_per_sec",
}
U8, U16, U32 = 2**8 - 1, 2**16 - 1, 2**32 - 1
NAME = re.compile(r"[^=:;,\r\n]*")
AXES = [f"{letter}{digit}" for letter in "JE" for digit in range(1, 10)]
AXES += ["RX", "RY", "RZ", "RW", "RP", "RR", "X", "Y", "Z", "W", "P", "R"]


def read_attribute(cursor: Cursor) -> Json:
    """LS-44; the cursor is behind its `;` then."""
    name = attribute_name(cursor, "attribute")
    value: Json
    if cursor.take(":"):
        items = []
        while True:
            cursor.skip(WHITE)
            item = attribute_name(cursor, "attribute_value")
            cursor.expect("=", "attribute_value")
            items.append([item, attribute_value(cursor, ";,")])
            if not cursor.take(","):
                break
        value = {"list": items}
    else:
        cursor.expect("=", "attribute_value")
        value = {"text": attribute_value(cursor, ";")}
    cursor.take(";")
    return {"name": name, "value": value}


def attribute_name(cursor: Cursor, kind: str) -> str:
    match = NAME.match(cursor.text, cursor.at)
    name = match[0] if match else ""
    if not name.rstrip(WHITE) or any(c in name.rstrip(WHITE) for c in ' \t"'):
        raise cursor.fault(kind)
    cursor.at += len(name)
    return name.rstrip(WHITE)


def attribute_value(cursor: Cursor, ends: str) -> str:
    """LS-10."""
    text, begin = cursor.text, cursor.at
    quoted, end = False, None
    for at in range(begin, len(text)):
        c = text[at]
        if c == '"':
            quoted = not quoted
        elif quoted and c in "\r\n":
            held = text[begin:at].rstrip(WHITE)
            if held[-1] in ends and held[:-1].endswith('"') and held.rpartition("\n")[2].count('"') > 1:
                end = begin + len(held) - 1
            break
        elif not quoted and c in ends:
            end = at
            break
        elif c == "\n":
            following = text[at + 1 :].partition("\n")[0]
            if following and is_letter(following[0]) and ("=" in following or ":" in following):
                break
    if end is None:
        raise cursor.fault("attribute_end")
    cursor.at = end
    lines = [line.strip(WHITE) for line in text[begin:end].split("\n")]
    return " ".join(line for line in lines if line)


def comment_of(attribute: Json) -> str | None:
    """LS-11."""
    if attribute["name"] not in ("COMMENT", "KOMMENTAR") or "text" not in attribute["value"]:
        return None
    text: str = attribute["value"]["text"]
    if text.startswith('"') and text.endswith('"'):
        text = text[1:-1]
    return text.rstrip(WHITE)


def read_instruction(text: str, base: int) -> Any:
    """What stands between the `:` and the `;` of a statement (LS-45)."""
    body = text.strip(" \t\r\n")
    base += len(text) - len(text.lstrip(" \t\r\n"))
    if not body:
        return "empty"
    if body[0] == "!":
        comment = body[1:]
        return {"comment": comment[: len(comment) - len(comment.lstrip(BLANKS))] + join_lines(comment)}
    if body[0] in KINDS and body[1:2] in (" ", "\t"):  # LS-16
        return {"motion": read_motion(Cursor(body, base))}
    for name, key in (("UFRAME_NUM=", "user_frame"), ("UTOOL_NUM=", "user_tool")):
        value = number(body[len(name) :].lstrip(BLANKS), U16)
        if body.startswith(name) and value is not None:
            return {key: value}
    return {"other": join_lines(body)}


def read_motion(cursor: Cursor) -> Json:
    """LS-46, in the order of LS-35."""
    kind = KINDS[cursor.here()]
    cursor.at += 1
    cursor.joint()
    target, via, via_options = read_target(cursor), None, ""
    if kind == "circular":
        via = target
        line, line_end, _ = cursor.rest().partition("\n")
        if line_end:  # LS-17
            via_options = line.strip(WHITE)
            cursor.at += len(line)
        cursor.joint()
        target = read_target(cursor)
    cursor.joint()
    speed = read_speed(cursor)
    cursor.joint()
    termination = read_termination(cursor)
    cursor.joint()
    options = join_lines(cursor.rest())
    return {
        "kind": kind,
        "via": via,
        "via_options": via_options,
        "target": target,
        "speed": speed,
        "termination": termination,
        "options": options,
    }


def read_target(cursor: Cursor) -> Json:
    """LS-18."""
    letters, inside = cursor.reference("target")
    digits, colon, name = inside.partition(":")
    value = number(digits.strip(WHITE), U32)
    key = {"P": "position", "PR": "register"}.get(letters)
    if key is None or value is None:
        return {"other": f"{letters}[{inside}]"}
    return {key: {"number": value, "name": name.strip(WHITE) if colon else None}}


def read_speed(cursor: Cursor) -> Json:
    """LS-19."""
    begin = end = cursor.at
    if cursor.text.startswith(OPEN, begin):
        cursor.at += len(OPEN)
        try:
            return {"register": {"register": OPEN, "unit": read_unit(cursor)}}
        except Fault:
            cursor.at = begin
    while end < len(cursor.text) and cursor.text[end].isascii() and (cursor.text[end].isalpha() or cursor.text[end] in "_."):
        end += 1
    word, behind = cursor.text[begin:end], cursor.text[end : end + 1]
    if behind == "[":
        letters, inside = cursor.reference("speed")
        cursor.joint()
        return {"register": {"register": f"{letters}[{inside}]", "unit": read_unit(cursor)}}
    if word and behind in ("", *" \t\r\n") and not is_termination(cursor):
        cursor.at = end
        return {"named": word}
    value = cursor.decimal("speed")
    cursor.joint()
    return {"fixed": {"value": value, "unit": read_unit(cursor)}}


def read_unit(cursor: Cursor) -> str:
    for text, unit in UNITS.items():
        begin = cursor.at
        if cursor.take(text):
            behind = cursor.here()
            if unit == "percent" or behind == "_" or not (is_word(behind) or behind == "/"):
                return unit
            cursor.at = begin
    raise cursor.fault("speed_unit")


def is_termination(cursor: Cursor) -> bool:
    """Whether FINE or CNT is here, right or wrong."""
    begin = cursor.at
    try:
        return read_termination(cursor) is not None
    except Fault:
        return True
    finally:
        cursor.at = begin


def read_termination(cursor: Cursor) -> Any:
    """LS-22."""
    begin = cursor.at
    if cursor.take("FINE"):
        if not is_word(cursor.here()):
            return "fine"
        cursor.at = begin
    if not cursor.take("CNT"):
        return None
    cursor.joint()
    if cursor.here().isalpha():
        letters, inside = cursor.reference("continuous")
        return {"continuous_register": f"{letters}[{inside}]"}
    begin = cursor.at
    value = cursor.whole(100, "continuous")
    if cursor.here() in (".", "_"):
        raise cursor.fault("continuous", begin)
    return {"continuous": value}


def read_position(text: str, base: int) -> Json:
    """LS-48: a part of /POS that is one position and nothing else."""
    cursor = Cursor(text, base)
    cursor.expect("P[", "position")
    cursor.space()
    value, name = cursor.whole(U32, "position"), None
    cursor.space()
    if cursor.take(":"):
        cursor.space()
        name = read_name(cursor)
    cursor.spaced("]", "position")
    cursor.spaced("{", "position")
    cursor.space()
    groups = []
    while cursor.take("GP"):
        groups.append(read_group(cursor))
    cursor.spaced("}", "group")
    cursor.spaced(";", "group")
    cursor.space()
    if cursor.rest().strip(WHITE):
        raise cursor.fault("position")
    return {"number": value, "name": name, "groups": groups}


def read_until(cursor: Cursor, end: str, kind: str, begin: int) -> str:
    """The text before a character that is on the same line; `begin` is where it is missed."""
    for at in range(cursor.at, len(cursor.text)):
        c = cursor.text[at]
        if c == end:
            text = cursor.text[cursor.at : at]
            cursor.at = at
            return text
        if c in "\r\n":
            break
    raise cursor.fault(kind, begin)


def read_name(cursor: Cursor) -> str:
    """LS-27."""
    begin = cursor.at
    quoted = cursor.take('"')
    name = read_until(cursor, '"' if quoted else "]", "position", begin)
    cursor.at += quoted
    return name.strip(WHITE)


def read_group(cursor: Cursor) -> Json:
    """What follows GP."""
    value = cursor.whole(U8, "group")
    cursor.spaced(":", "group")
    frames = []
    for name in ("UF", "UT"):
        cursor.spaced(name, "frames")
        cursor.spaced(":", "frames")
        cursor.space()
        frames.append(None if cursor.take("F") else cursor.whole(U16, "frames"))
        cursor.spaced(",", "frames")
    cursor.space()
    configuration, begin = None, cursor.at
    keyword = cursor.word()
    if len(keyword) > 2:
        cursor.spaced(":", "configuration")
        cursor.space()
        quote = cursor.at
        cursor.expect("'", "configuration")
        text = read_until(cursor, "'", "configuration", quote)
        cursor.at += 1
        cursor.spaced(",", "configuration")
        cursor.space()
        configuration = {"keyword": keyword, "text": text}
    else:
        cursor.at = begin
    axes = [read_axis(cursor)]
    while True:
        cursor.space()
        if not cursor.take(",") and axis_name(cursor) is None:
            break
        cursor.space()
        axes.append(read_axis(cursor))
    return {"number": value, "user_frame": frames[0], "user_tool": frames[1], "configuration": configuration, "axes": axes}


def axis_name(cursor: Cursor) -> str | None:
    return next((name for name in AXES if cursor.text.startswith(name, cursor.at)), None)


def read_axis(cursor: Cursor) -> Json:
    name = axis_name(cursor)
    if name is None:
        raise cursor.fault("axis")
    cursor.at += len(name)
    cursor.spaced("=", "axis")
    cursor.space()
    value = None
    if cursor.here() == "*":
        cursor.skip("*")
    else:
        value = cursor.decimal("number")
    cursor.space()
    for unit in ("deg", "mm"):
        if cursor.take(unit):
            return {"name": name, "value": value, "unit": unit}
    raise cursor.fault("axis_unit")
