"""What no story of val2-viewer can have: a format is code, and a count ends after 65536 packets."""

import unittest
from typing import Any

from cellwire.session import NEVER
from cellwire.stream import Refused
from cellwire.val2_viewer import Host, HostConfig

POSE = [0] * 12


def asked(**config: Any) -> Host:
    host = Host(HostConfig(max_age=NEVER, **config))
    host.connected(0)
    host.set_pose(POSE)
    host.input(0, b"\x05")
    host.events.clear()
    return host


class TestViewer(unittest.TestCase):
    def test_a_packet_with_xon_or_xoff_is_not_sent(self) -> None:
        for byte in (b"\x11", b"\x13"):
            host = asked(interval=5, format=lambda message, byte=byte: b"7" + byte)
            self.assertIsNone(host.transmit(5))
            self.assertEqual(host.events, [{"event": "unsendable"}])
            host.events.clear()
            # It has had no packet, and the interval counts from now on.
            host.input(6, b"\x05")
            self.assertEqual((host.deadline(), host.count), (10, 0))

    def test_a_format_without_them_is_sent(self) -> None:
        host = asked(interval=1, format=lambda message: b"%d\x12" % message["count"])
        self.assertEqual(host.transmit(1), b"0\x12")
        self.assertEqual(host.events, [{"event": "sent", "message": {"count": 0, "pose": POSE}}])

    def test_a_count_begins_anew(self) -> None:
        host = asked(interval=1)
        host.count = 0xFFFF
        self.assertTrue((host.transmit(1) or b"").startswith(b"$POSE,65535,"))
        host.input(1, b"\x05")
        self.assertTrue((host.transmit(2) or b"").startswith(b"$POSE,0,"))

    def test_a_pose_that_does_not_fit_is_refused(self) -> None:
        host = Host()
        with self.assertRaises(Refused):
            host.set_pose([0] * 11 + [32768])
        self.assertIsNone(host.pose)


if __name__ == "__main__":
    unittest.main()
