"""What no story of fanuc-hmi-modbus shows: how many places an end may have (FM-79)."""

import unittest

from cellwire.fanuc_hmi_modbus.client import ClientConfig
from cellwire.fanuc_hmi_modbus.server import ServerConfig


class Places(unittest.TestCase):
    def test_a_client_has_1_to_16_and_a_server_1_to_255(self) -> None:
        ClientConfig(places=16)
        ServerConfig(places=255)
        for places in (0, 17):
            with self.assertRaises(ValueError):
                ClientConfig(places=places)
        for places in (0, 256):
            with self.assertRaises(ValueError):
                ServerConfig(places=places)


if __name__ == "__main__":
    unittest.main()
