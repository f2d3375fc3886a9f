"""Writes the vectors that a Cortex-M reads as initializers of C.

Usage: python3 vectors.py > vectors.h

Those of every link with its default options: what is valid, and what gives an error.
"""

import json
from pathlib import Path

REFERENCE = Path(__file__).resolve().parents[3]
LINKS = ["fanuc-hmi-modbus", "isra-ball", "kawasaki-msg", "laser-eb90", "mmacell-proto", "val2-alter", "val2-viewer"]
SIDES = {
    "fanuc-hmi-modbus": ["client", "server"],
    "mmacell-proto": ["central", "robot", "platform"],
    "val2-alter": ["robot", "host"],
}


def main():
    for number, link in enumerate(LINKS):
        for vector in json.loads((REFERENCE / "vectors" / f"{link}.json").read_text())["vectors"]:
            data = bytes.fromhex(vector["hex"].replace("|", ""))
            is_valid = vector["result"] == "valid"
            if vector.get("options") or vector["result"] == "acceptable" or "data" in vector.get("message", {}) and link == "isra-ball":
                continue
            side = SIDES[link].index(vector["from"]) if link in SIDES else 0
            text = "".join(f"\\{byte:03o}" for byte in data)
            print(f'{{{number}, {side}, {str(is_valid).lower()}, {len(data)}, "{text}"}},')


if __name__ == "__main__":
    main()
