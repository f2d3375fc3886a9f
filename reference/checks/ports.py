"""Builds and checks the ports of ports/, and runs their testees.

Usage: python3 reference/checks/ports.py [python | c]…

Python is checked by `mypy --strict`, C is built with every warning an error, and with the address and undefined behaviour
sanitizers. Prints what testee.py prints for each; exit status 1 on a failure.
"""

import os
import subprocess
import sys
from pathlib import Path

REFERENCE = Path(__file__).resolve().parent.parent
TARGET = REFERENCE.parent / "target/reference"
CODECS = ["fanuc-hmi-modbus", "isra-ball", "kawasaki-msg", "laser-eb90", "mmacell-proto", "val2-alter", "val2-viewer"]
SESSIONS = ["laser-eb90/host", "mmacell-proto/central", "val2-alter/host"]
# What the C port has besides.
C_SESSIONS = [
    "fanuc-hmi-modbus/client",
    "fanuc-hmi-modbus/server",
    "isra-ball/ball",
    "isra-ball/host",
    "laser-eb90/controller",
    "mmacell-proto/device",
    "val2-alter/controller",
    "val2-viewer/host",
    "val2-viewer/workstation",
]


def testee(claims):
    """The check of a port, of whose claims none may be skipped."""
    return [sys.executable, REFERENCE / "checks/testee.py", *(word for claim in claims for word in ("--claim", claim))]


def passes(*command, **options):
    """Whether a command succeeds."""
    return subprocess.run(command, check=False, **options).returncode == 0


def python():
    folder = REFERENCE / "ports/python"
    venv = TARGET / "venv/bin/python"
    interpreter = venv if venv.exists() else sys.executable
    cache = TARGET / "mypy"
    typed = passes(interpreter, "-m", "mypy", "--strict", "--cache-dir", cache, "testee.py", "links", "sessions", cwd=folder)
    return passes(*testee(CODECS + SESSIONS), sys.executable, "-B", folder / "testee.py") and typed


def c():
    build = TARGET / "c"
    if not passes("make", "--silent", "-j2", "-C", REFERENCE / "ports/c", f"BUILD={build}"):
        return False
    return passes(*testee(CODECS + SESSIONS + C_SESSIONS), build / "testee", env=os.environ | {"ASAN_OPTIONS": "detect_leaks=1"})


def main():
    ports = {"python": python, "c": c}
    results = []
    for name in sys.argv[1:] or ports:
        print(f"-- {name}", flush=True)
        results.append(ports[name]())
    sys.exit(not all(results))


if __name__ == "__main__":
    main()
