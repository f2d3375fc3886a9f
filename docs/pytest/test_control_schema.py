"""Every command of every device, and every answer, against docs/simulate-control.schema.json."""

import pathlib
import re
import socket
import threading
import time

import jsonschema
import pytest

from cellwire_sim import simulate  # noqa: F401, a fixture
from conftest import REQUEST, SCHEMA

DEVICES = [
    "kawasaki-robot", "kawasaki-pc", "puma", "viewer", "ball", "fanuc", "laser", "mma-robot", "mma-platform",
]  # fmt: skip
COMMON = {
    "drop", "delay", "corrupt", "cut", "close", "twice", "freeze", "restart", "forget", "clear", "happened",
    "executed", "counts", "help",
}  # fmt: skip
OWN = {
    "puma": {"incident"}, "ball": {"set"}, "fanuc": {"set"}, "mma-robot": {"end_motion"}, "mma-platform": {"end_motion"}
}  # fmt: skip


PAGE = (pathlib.Path(__file__).parent.parent / "simulate.md").read_text().partition("## Commands")[2]


def test_the_page_has_every_command_and_its_program_runs(simulate, capsys):
    assert COMMON == {line.split("`")[1] for line in PAGE.splitlines() if line.startswith("| `")} & COMMON
    for device, commands in OWN.items():
        [row] = [line for line in PAGE.splitlines() if line.startswith("| `") and f"`{device}`" in line]
        assert all(f"`{command}`" in row for command in commands | {"get"}), row
    port = simulate("fanuc").ready["control"].rpartition(":")[2]
    [program] = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    exec(program.replace("9301", port), {})
    assert "'fault': 'restart', 'seconds': 0.5" in capsys.readouterr().out


def test_the_schema_is_one():
    jsonschema.Draft202012Validator.check_schema(SCHEMA)


@pytest.mark.parametrize("device", DEVICES)
def test_every_example_of_help_is_executed(simulate, device):
    client = simulate(device)
    help = client.exchange({"do": "help"})
    assert help["device"] == device
    assert {command["do"] for command in help["commands"]} == COMMON | {"get"} | OWN.get(device, set())
    for command in help["commands"]:
        for example in command["examples"]:
            assert example["do"] == command["do"]
            answer = client.exchange({**example, "id": [command["do"], 1]})
            # A device at rest has no motion.
            assert answer["ok"] or command["do"] == "end_motion" and "no motion" in answer["error"], answer
    assert {"freeze", "restart", "forget"} <= {fault["fault"] for fault in client.exchange({"do": "happened"})["happened"]}


REFUSED = [
    ("fanuc", {}, "there is no `do`; give one object a line"),
    ("fanuc", {"do": 1}, "`do` is not a text"),
    ("fanuc", [1], "the line is not a JSON object"),
    ("fanuc", {"do": "cut", "next": 0}, "cut: `next` is 1 to 1000"),
    ("fanuc", {"do": "cut", "next": 1001}, "cut: `next` is 1 to 1000"),
    ("fanuc", {"do": "cut", "every": 0}, "cut: `every` is 1 or more"),
    ("fanuc", {"do": "cut", "next": 1, "every": 1}, "cut: give `next` or `every`, not both"),
    ("fanuc", {"do": "cut", "now": True, "next": 1}, "cut: with `now`, there is no `next`, `every` or `of`"),
    ("fanuc", {"do": "close", "now": True, "of": "answer"}, "close: with `now`, there is no `next`, `every` or `of`"),
    ("fanuc", {"do": "drop", "now": True}, "drop: only cut and close have `now`"),
    ("fanuc", {"do": "cut", "ms": 1}, "only delay, freeze and restart have a time"),
    ("fanuc", {"do": "cut", "of": "all"}, "cut: unknown variant `all`, expected `answer` or `request`"),
    ("fanuc", {"do": "delay"}, "delay: give the time, `ms` or `seconds`"),
    ("fanuc", {"do": "delay", "ms": 1, "seconds": 1}, "delay: give `ms` or `seconds`, not both"),
    ("fanuc", {"do": "freeze", "seconds": 3601}, "freeze: a time is 0 to 3600 seconds"),
    ("fanuc", {"do": "freeze", "seconds": -1}, "freeze: a time is 0 to 3600 seconds"),
    ("fanuc", {"do": "forget", "all": True}, "forget: unknown field `all`, the command has no fields"),
    ("fanuc", {"do": "happened", "from": 1}, "happened: unknown field `from`"),
    ("fanuc", {"do": "executed", "most": 1001}, "executed: `most` is 0 to 1000"),
    ("fanuc", {"do": "set"}, "set: give `signal`, or `address` and `table`"),
    ("fanuc", {"do": "set", "signal": "DI[0]", "value": 1}, "set: there is no signal DI[0]; a signal is DI[n],"),
    ("fanuc", {"do": "set", "signal": "X[1]", "value": 1}, "set: there is no signal X[1]; a signal is DI[n],"),
    ("fanuc", {"do": "set", "signal": "DI[1]"}, "set: give `value`, or `values` with an address"),
    ("fanuc", {"do": "set", "signal": "DI[1]", "value": 2}, "set: a bit is 0, 1, false or true"),
    ("fanuc", {"do": "set", "signal": "R[1]", "value": 65536}, "set: a register is -32768 to 65535"),
    ("fanuc", {"do": "set", "signal": "R[1]", "value": 1.5}, "set: a register is -32768 to 65535"),
    ("fanuc", {"do": "set", "address": 16447, "values": [1, 2]}, "set: the addresses of holding_registers are 0 to 16447"),
    ("fanuc", {"do": "get", "table": "coils", "address": 30000}, "get: the addresses of coils are 0 to 29999"),
    ("fanuc", {"do": "get", "table": "rows", "address": 1}, "get: unknown variant `rows`, expected one of"),
    ("fanuc", {"do": "get", "address": 1, "count": 1001}, "get: `count` is 0 to 1000"),
    ("ball", {"do": "set"}, "set: missing field `grip`"),
    ("ball", {"do": "set", "grip": {"keys": [9]}}, "set: `keys` are 1 to 8"),
    ("ball", {"do": "set", "grip": {"force": [0, 0, 128]}}, "set: invalid value: integer `128`"),
    ("mma-robot", {"do": "end_motion", "fate": "explodes"}, "end_motion: unknown variant `explodes`"),
    ("puma", {"do": "incident", "incident": "rain"}, "incident: an incident is interrupt TIME, misread ERROR,"),
    ("laser", {"do": "set", "signal": "DI[1]", "value": 1}, "unknown command `set`; laser has drop, delay,"),
]  # fmt: skip


def test_a_request_that_is_refused_says_what_is_allowed(simulate):
    clients = {device: simulate(device) for device in {device for device, _, _ in REFUSED}}
    for device, request, error in REFUSED:
        answer = clients[device].exchange(request)
        assert not answer["ok"] and error in answer["error"], (request, answer)
    for client in clients.values():
        assert client.exchange({"do": "counts"})["faults"] == 0


# The ranges of signals and tables, the incidents, and what each device has are not in the schema.
OUTSIDE_THE_SCHEMA = ("no signal DI[0]", "a bit is", "the addresses of", "an incident is", "laser has")


def test_what_the_schema_refuses_is_refused():
    for _, request, error in REFUSED:
        is_valid = any(text in error for text in OUTSIDE_THE_SCHEMA)
        assert REQUEST.is_valid(request) == is_valid, request


def executed(device, count):
    """The commands that a device has executed, once there are so many."""
    deadline = time.monotonic() + 20
    while device.do("counts")["executed"] < count:
        assert time.monotonic() < deadline, device.events
        time.sleep(0.02)
    return [done["work"] for done in device.do("executed", most=count)["executed"]]


def test_a_program_reads_an_input_and_a_register_that_are_set(simulate, tmp_path):
    program, assignments = tmp_path / "P.LS", tmp_path / "assignments.txt"
    program.write_text("/PROG P\n/MN\n   1:  WAIT DI[1]=ON ;\n   2:  R[41]=R[40]+1 ;\n   3:  DO[3]=ON ;\n/POS\n/END\n")
    assigned = {"ADDRESS": 201, "SIZE": 20, "VAR_NAME": "'R[40]'", "MULTIPLY": 1}
    assignments.write_text("".join(f"SETVAR $SNPX_ASG[1].${name} {value}\n" for name, value in assigned.items()))
    robot = simulate("fanuc", "--set", f"program={program}", "--set", f"assignments={assignments}")
    robot.do("set", address=200, value=41)
    assert robot.do("get", signal="DO[3]")["value"] == 0
    robot.do("set", signal="DI[1]", value=True)
    while robot.do("get", signal="DO[3]")["value"] == 0:
        time.sleep(0.02)
    assert robot.do("get", address=200, count=3)["values"] == [41, 0, 42]


def test_a_motion_is_listed_and_ends_as_it_is_told(simulate):
    robot = simulate("mma-robot")
    with socket.create_connection(robot.address, 5) as connection:
        connection.sendall(b"SRVON\r\nMOVA+250.000+000.000+100.000+00.0000\r\n")
        robot.wait_for("move")
        robot.do("end_motion", fate="stalls")
        assert executed(robot, 1) == [{"to": [250.0, 0.0, 100.0, 0.0], "at": [125.0, 0.0, 100.0, 0.0]}]
    assert robot.do("get")["motions"] == 1


def test_an_instruction_is_listed(simulate):
    laser = simulate("laser")
    with socket.create_connection(laser.address, 5) as connection:
        connection.sendall(bytes.fromhex("EB90 82F0 F10101 01 9082 F4"))
        assert executed(laser, 1) == [{"word": 257, "items": []}]
    assert laser.do("get")["held"] == 0


def test_the_jobs_of_an_order_are_listed_and_so_is_its_end(simulate):
    pc = simulate("kawasaki-pc")
    endpoint = ("--connect", pc.ready["listen"])
    robot = simulate("kawasaki-robot", "--set", "speed=20000", endpoint=endpoint)
    first = executed(robot, 2)
    assert [(job["order"], job["number"]) for job in first] == [(50, 1), (50, 2)]
    robot.do("forget")
    [end] = executed(pc, 1)
    assert (end["event"], end["order"], end["complete"]) == ("order_over", 50, False)


def test_a_pose_that_is_drawn_is_listed(simulate):
    viewer = simulate("viewer")
    with socket.create_connection(viewer.address, 5) as connection:
        assert connection.recv(1) == b"\x05"
        connection.sendall(b"$POSE,0,16384,0,0,0,16384,0,0,0,16384,0,0,0*1D\r\n")
        assert executed(viewer, 1) == [{"count": 0, "position_mm": [0.0, 0.0, 0.0]}]
    assert viewer.do("get")["poses"] == 1


def move_along_x(connection, ended):
    """Accepts ALTER and moves the arm with each reply, until it is told to end. A reply that comes late ends ALTER."""
    accept = bytes.fromhex("101002 00 1003 00")
    move = bytes.fromhex("101002 00 01 0800 1003 09")  # 8 units, a quarter of a millimetre, along X
    received = b""
    while not ended.is_set():
        try:
            received += connection.recv(64)
        except TimeoutError:
            continue
        # The start, and each standard message, ends with its checksum.
        if received[-3:-1] == b"\x10\x03":
            is_start = received[received.rindex(b"\x10\x10\x02") + 3] in (0xA0, 0xA6)
            connection.sendall(accept if is_start else move)
            received = b""


def test_a_reply_that_moves_the_arm_is_listed(simulate):
    puma, ended = simulate("puma"), threading.Event()
    with socket.create_connection(puma.address, 0.2) as connection:
        host = threading.Thread(target=move_along_x, args=(connection, ended))
        host.start()
        try:
            first, second = executed(puma, 2)
            assert first["values"] == [8, 0, 0, 0, 0, 0]
            assert second["position_mm"][0] == first["position_mm"][0] + 0.25
            puma.do("incident", incident="finish")
            assert puma.wait_for("script")["what"] == "finish"
        finally:
            ended.set()
            host.join()
