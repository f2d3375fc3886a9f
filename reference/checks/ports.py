"""Builds and checks the ports of ports/, and runs their testees.

Usage: python3 reference/checks/ports.py [python | c]…

Python is checked by `mypy --strict`, and its drivers are tested over sockets; C is built with every warning an error, and with the address
and undefined behaviour sanitizers. Prints what testee.py prints for each; exit status 1 on a failure.
"""

import json
import os
import subprocess
import sys
from pathlib import Path

REFERENCE = Path(__file__).resolve().parent.parent
TARGET = REFERENCE.parent / "target/reference"
# Of the two links that have them.
VALUES = ["fanuc-hmi-modbus/values", "val2-alter/values"]
CODECS = ["fanuc-hmi-modbus", "isra-ball", "kawasaki-msg", "laser-eb90", "mmacell-proto", "val2-alter", "val2-viewer"]
ENDS = [f"{path.stem}/{end}" for path in (REFERENCE / "sessions").glob("*.json") for end in json.loads(path.read_text())["ends"]]


def testee(port):
    """The command that runs a port's testee; nothing of what the port claims may be skipped."""
    claims = [argument for claim in CODECS + ENDS + (VALUES if port != "c" else []) for argument in ("--claim", claim)]
    return [sys.executable, REFERENCE / "checks/testee.py", *claims]


def passes(*command, **options):
    """Whether a command succeeds."""
    return subprocess.run(command, check=False, **options).returncode == 0


def python():
    folder = REFERENCE / "ports/python"
    venv = TARGET / "venv/bin/python"
    interpreter = venv if venv.exists() else sys.executable
    cache = TARGET / "mypy"
    typed = passes(interpreter, "-m", "mypy", "--strict", "--cache-dir", cache, "testee.py", "testee_values.py", "cellwire", "tests", cwd=folder)
    tested = passes(sys.executable, "-B", "-W", "error", "-m", "unittest", "-q", "tests.test_line", "tests.test_viewer", "tests.test_modbus", cwd=folder)
    return passes(*testee("python"), sys.executable, "-B", folder / "testee.py") and typed and tested


def c():
    build = TARGET / "c"
    if not passes("make", "--silent", "-j2", "-C", REFERENCE / "ports/c", f"BUILD={build}"):
        return False
    return passes(*testee("c"), build / "testee", env=os.environ | {"ASAN_OPTIONS": "detect_leaks=1"})


def main():
    ports = {"python": python, "c": c}
    results = []
    for name in sys.argv[1:] or ports:
        print(f"-- {name}", flush=True)
        results.append(ports[name]())
    sys.exit(not all(results))


if __name__ == "__main__":
    main()
