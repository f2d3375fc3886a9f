"""The fixture, against the tool in CELLWIRE."""

import socket
import struct

import pytest

from cellwire_sim import Refused, simulate  # noqa: F401, a fixture


def read_register(connection, transaction, address):
    connection.sendall(struct.pack(">HHHBBHH", transaction, 0, 6, 1, 3, address, 1))
    reply = b""
    while len(reply) < 9 or len(reply) < 6 + struct.unpack(">H", reply[4:6])[0]:
        piece = connection.recv(260)
        assert piece, "the controller has closed the connection"
        reply += piece
    return reply[7], reply[9:]


def test_a_controller_answers_and_tells_who_connects(simulate):
    robot = simulate("fanuc")
    with socket.create_connection(robot.address, 5) as connection:
        peer = robot.wait_for("connected")["peer"]
        assert peer == "{}:{}".format(*connection.getsockname())
        assert read_register(connection, 1, 99) == (3, struct.pack(">H", 100))
    robot.wait_for("disconnected")


def test_settings_and_faults_are_those_of_the_tool(simulate):
    robot = simulate("mma-robot", "--set", "mute_every=2", "--set", "drop_every=3")
    with socket.create_connection(robot.address, 5) as connection:
        connection.sendall(b"STP\r\n")
        assert connection.recv(64) == b"OK\r\n"
        connection.sendall(b"STP\r\n")
        robot.wait_for("muted")
        connection.sendall(b"STP\r\n")
        assert connection.recv(64) == b""
    assert robot.wait_for("disconnected")["why"] == "the set fault: the connection ends before the reply"


def test_a_reply_is_cut(simulate):
    robot = simulate("fanuc")
    with socket.create_connection(robot.address, 5) as connection:
        assert read_register(connection, 1, 99) == (3, struct.pack(">H", 100))
        robot.do("cut")
        connection.sendall(struct.pack(">HHHBBHH", 2, 0, 6, 1, 3, 99, 1))
        reply = b""
        while piece := connection.recv(260):
            reply += piece
        assert reply == struct.pack(">HHB", 2, 0, 0), "5 of 11 bytes"
    with socket.create_connection(robot.address, 5) as connection:
        assert read_register(connection, 3, 99) == (3, struct.pack(">H", 100))
    assert [fault["fault"] for fault in robot.do("happened")["happened"]] == ["cut"]


def test_a_register_is_set_and_a_write_is_seen(simulate):
    robot = simulate("fanuc")
    robot.do("set", signal="R[201]", value=-2)
    with socket.create_connection(robot.address, 5) as connection:
        assert read_register(connection, 1, 200) == (3, struct.pack(">h", -2))
        connection.sendall(struct.pack(">HHHBBHH", 2, 0, 6, 1, 6, 201, 7))
        assert len(connection.recv(260)) == 12
    assert robot.do("get", address=200, count=2)["values"] == [65534, 7]
    written = robot.do("executed")["executed"]
    assert [done["work"] for done in written] == [{"table": "holding_registers", "address": 201, "values": [7]}]


def test_what_is_not_a_command_is_refused_with_what_is_allowed(simulate):
    ball = simulate("ball")
    with pytest.raises(Refused, match="unknown command `cat`; ball has drop, delay,"):
        ball.do("cat")
    with pytest.raises(Refused, match="delay: give the time, `ms` or `seconds`"):
        ball.do("delay")


def test_what_cannot_start_says_why(simulate):
    with pytest.raises(RuntimeError, match="speed"):
        simulate("mma-robot", "--set", "speed=0")
