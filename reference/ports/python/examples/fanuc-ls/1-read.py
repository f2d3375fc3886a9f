from pathlib import Path
from cellwire.fanuc_ls import decode, encode, read_program

program, fault = read_program(decode(Path("PROGRAM.LS").read_bytes()))
if program is None:
    raise SystemExit(fault)
print(program["name"], len(program["instructions"]), "instructions", len(program["positions"]), "positions")
print(encode(program, {"comment": "truncate"}))  # as a writer that knows values alone has it
