"""The fixture, against the tool in CELLWIRE."""

import socket
import struct

import pytest

from cellwire_sim import simulate  # noqa: F401, a fixture


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


def test_what_cannot_start_says_why(simulate):
    with pytest.raises(RuntimeError, match="speed"):
        simulate("mma-robot", "--set", "speed=0")
