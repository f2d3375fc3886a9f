"""The testee of the Python port: reference/ports/README.md describes what it reads and writes."""

import json
import sys
from collections.abc import Callable
from functools import partial
from typing import Any, Protocol

import testee_values
from cellwire import (
    fanuc_hmi_modbus,
    fanuc_ls,
    isra_ball,
    kawasaki_msg,
    laser_eb90,
    mmacell_proto,
    val2_alter,
    val2_viewer,
)
from cellwire.session import NEVER, NotTaken, Session
from cellwire.stream import Decoder, Json, Refused


class Link(Protocol):
    """What the modules of all links have."""

    @property
    def Decoder(self) -> Callable[..., Decoder]: ...
    @property
    def encode(self) -> Callable[..., bytes]: ...


LINKS: dict[str, Link] = {
    "fanuc-hmi-modbus": fanuc_hmi_modbus,
    "isra-ball": isra_ball,
    "kawasaki-msg": kawasaki_msg,
    "laser-eb90": laser_eb90,
    "mmacell-proto": mmacell_proto,
    "val2-alter": val2_alter,
    "val2-viewer": val2_viewer,
}


def sides(request: Json) -> Json:
    """The arguments that choose a side and its settings."""
    return {"options": request["options"]} | ({"sender": request["from"]} if "from" in request else {})


def decode(link: Link, request: Json) -> Json:
    """Everything that the decoder makes of the bytes."""
    decoder = link.Decoder(**sides(request))
    items: list[Json] = []

    def drain(end: bool) -> None:
        while (item := decoder.next()) is not None:
            shown: Json = {"offset": item.offset, "length": item.length}
            shown |= {"end": True} if end else {}
            shown |= {"message": item.message} if item.error is None else {"error": item.error}
            items.append(shown)

    *parts, rest = request["hex"].split("|")
    for part in [*parts, rest]:
        data = bytes.fromhex(part)
        size = request["read"] or max(len(data), 1)
        for first in range(0, len(data), size):
            decoder.push(data[first : first + size])
            drain(False)
        if part is not rest:
            decoder.end()
            drain(True)
    return {"items": items}


def encode(link: Link, request: Json) -> Json:
    """The bytes of a message."""
    try:
        return {"hex": link.encode(request["message"], **sides(request)).hex().upper()}
    except Refused as refused:
        return {"refused": str(refused)}
    except (AttributeError, KeyError, TypeError) as wrong:
        return {"refused": f"no message of this link: {wrong!r}"}


def kawasaki(config: Callable[..., object]) -> Callable[..., object]:
    """A configuration of kawasaki-msg, whose table is three fields of a story's."""

    def make(**fields: Any) -> object:
        tables = {"limits": kawasaki_msg.Limits, "recovery": kawasaki_msg.RecoveryLimits}
        dialect = {name: fields.pop(name) for name in ("messages", "charset", "job") if name in fields}
        values = {name: tables[name](**value) if name in tables else value for name, value in fields.items()}
        return config(dialect=kawasaki_msg.Dialect(**dialect), **values)

    return make


class StoryRobot(kawasaki_msg.Robot):
    """The motion program of the stories: a job that is taken is an event, and `execute` is the whole of it."""

    def take(self, number: int | None = None) -> Json:
        job = super().take(number)
        self.report("taken", **job)
        return job

    def execute(self) -> None:
        self.job_done(self.take()["number"])
        self.complete()


# What the stories' server says of itself.
OBJECTS = {0: "cellwire", 1: "FM", 2: "1.0", 3: "", 128: "x" * 230, 129: "\xfc", 130: "y" * 244}


class StoryRegisters(fanuc_hmi_modbus.Registers):
    """The tables of the stories, and their functions."""

    def __init__(self) -> None:
        on = [address % 3 == 0 for address in range(100)]
        holding = [7 * address for address in range(100)]
        events = {"status": 0, "events": 264, "messages": 289, "log": [0x20, 0]}
        queues = {1246: [440, 4740], 1247: [], 1248: [0] * 32}
        super().__init__(on, [not coil for coil in on], holding, None, [0x11, 0xFF], OBJECTS, 0x6D, events, {4: holding}, queues)

    def serve(self, request: Json) -> Json:
        if request["function"] == 2 and self.coils is not None:
            self.discrete_inputs = [not coil for coil in self.coils]
        return super().serve(request)

    def diagnose(self, subfunction: int, values: list[int]) -> list[int]:
        if subfunction not in (0, 11):
            return super().diagnose(subfunction, values)
        return values if subfunction == 0 else [7, *values[1:]]

    def serve_other(self, function: int, data: bytes) -> Json:
        if function == 67:
            raise fanuc_hmi_modbus.Refusal(6)
        if function not in (65, 66):
            return super().serve_other(function, data)
        return {"function": function, "data": list(data) if function == 65 else [0] * 253}


def modbus_server(config: fanuc_hmi_modbus.ServerConfig) -> Session:
    return fanuc_hmi_modbus.Server(config, StoryRegisters())


# The owner of the stories' controller has room for 8 instructions, and takes none with characters.
laser_controller = partial(laser_eb90.Controller, takes=lambda _, items: not any("char" in item for item in items))
controller_config = partial(laser_eb90.ControllerConfig, queue=8)


ENDS: dict[tuple[str, str], tuple[Callable[..., Session], Callable[..., object]]] = {
    ("fanuc-hmi-modbus", "client"): (fanuc_hmi_modbus.Client, fanuc_hmi_modbus.ClientConfig),
    ("fanuc-hmi-modbus", "server"): (modbus_server, fanuc_hmi_modbus.ServerConfig),
    ("isra-ball", "ball"): (isra_ball.Ball, isra_ball.BallConfig),
    ("isra-ball", "host"): (isra_ball.Host, isra_ball.HostConfig),
    ("kawasaki-msg", "pc"): (kawasaki_msg.Pc, kawasaki(kawasaki_msg.PcConfig)),
    ("kawasaki-msg", "robot"): (StoryRobot, kawasaki(kawasaki_msg.RobotConfig)),
    ("laser-eb90", "controller"): (laser_controller, controller_config),
    ("laser-eb90", "host"): (laser_eb90.Host, laser_eb90.HostConfig),
    ("mmacell-proto", "central"): (mmacell_proto.Central, mmacell_proto.CentralConfig),
    ("mmacell-proto", "device"): (mmacell_proto.Device, mmacell_proto.DeviceConfig),
    ("val2-alter", "controller"): (val2_alter.Controller, val2_alter.ControllerConfig),
    ("val2-alter", "host"): (val2_alter.Host, val2_alter.HostConfig),
    ("val2-viewer", "host"): (val2_viewer.Host, val2_viewer.HostConfig),
    ("val2-viewer", "workstation"): (val2_viewer.Workstation, val2_viewer.WorkstationConfig),
}
# Inputs of every end; all others are calls of its owner.
INPUTS = {"connected", "disconnected", "timeout", "transmitted"}


# What `null` is in the configuration of an end, where it is not never (reference/README.md).
WORDS = {"server": {"unit": "any"}}


def session(link: Link, request: Json) -> Json:
    """What an end does at each step of a story."""
    make = ENDS.get((request["link"], request["end"]))
    if make is None:
        return {"skipped": "not implemented"}
    words = WORDS.get(request["end"], {})
    config = {name: words.get(name, NEVER) if value is None else value for name, value in request["config"].items()}
    try:
        end = make[0](make[1](**config))
    except ValueError as refused:
        return {"refused": str(refused)}
    return {"steps": [play(end, step) for step in request["steps"]]}


def play(end: Session, step: Json) -> Json:
    """One step, as reference/README.md describes it."""
    now, ((name, argument),) = step["at"], step["do"].items()
    answer: Json = {"events": [], "transmit": []}
    try:
        if name in INPUTS:
            getattr(end, name)(now)
        elif name == "input":
            end.input(now, bytes.fromhex(argument))
        elif name != "nothing":
            call(end, now, name, argument)
    except NotTaken as not_taken:
        answer["refused"] = not_taken.refused
    is_over = False
    while not is_over:
        is_over = True
        if end.events and not step.get("keep"):
            answer["events"] += end.events
            end.events.clear()
            is_over = False
        while not step.get("hold") and (sent := end.transmit(now)) is not None:
            answer["transmit"].append(sent.hex().upper())
            is_over = False
    return answer | {"deadline": end.deadline()}


def call(end: Session, now: int, name: str, argument: Any) -> None:
    """A call of the end's owner; an object is one of its arguments, or all of them by name."""
    end.now = now
    if isinstance(end, mmacell_proto.Device) and name in ("accept", "refuse", "accept_another"):
        # Stories do not name the order that is accepted or refused.
        order = end.order if name != "accept_another" else {"order": "none"}
        name, arguments = name.removesuffix("_another"), [] if argument is None else [argument]
        getattr(end, name)(order, *arguments)
        return
    method = getattr(end, "job_done" if name == "report" else name)
    if argument is None:
        method()
    elif name == "set_segment":
        method(*argument)
    elif isinstance(argument, dict) and name != "request":
        method(**argument)
    else:
        taken = method(argument)
        if isinstance(end, laser_eb90.Controller) and name == "take":
            for instruction in taken:
                end.report("taken", **instruction)


def programs(request: Json) -> Json:
    """The answers of fanuc-ls: texts in the place of frames."""
    task, options = request["task"], request["options"]
    if task == "encode":
        try:
            return {"hex": fanuc_ls.encode(request["message"], options).encode().hex().upper()}
        except (Refused, AttributeError, KeyError, TypeError) as wrong:
            return {"refused": repr(wrong)}
    text = fanuc_ls.decode(bytes.fromhex(request["hex"].removesuffix("|")))
    if task == "stream":
        return {"items": fanuc_ls.Document(text, options).items}
    program, fault = fanuc_ls.read_program(text)
    item = {"offset": 0, "length": len(text.encode())}
    return {"items": [item | ({"error": fault} if program is None else {"message": program})]}


TASKS: dict[str, Callable[[Link, Json], Json]] = {
    "value": lambda link, request: testee_values.answer(request["given"]),
    "decode": decode,
    "stream": decode,
    "encode": encode,
    "session": session,
}


def main() -> None:
    for line in sys.stdin:
        request = json.loads(line)
        link, task = LINKS.get(request["link"]), TASKS.get(request["task"])
        if request["link"] == "fanuc-ls" and request["task"] != "session":
            answer = programs(request)
        elif link is None or task is None:
            answer = {"skipped": "not implemented"}
        else:
            answer = task(link, request)
        print(json.dumps(answer), flush=True)


if __name__ == "__main__":
    main()
