"""drawings.py FOLDER: converts DXF drawings with docs/dxf-to-svg.py, and compares what `run laser` makes of them with their sizes in mm."""

import json
import os
import subprocess
import sys
from pathlib import Path

import ezdxf
from ezdxf import units

FOLDER = Path(sys.argv[1])


def convert(name, unit, draw):
    drawing = ezdxf.new("R2010", setup=True)
    drawing.units = unit
    draw(drawing, drawing.modelspace())
    source, target = FOLDER / f"{name}.dxf", FOLDER / f"{name}.svg"
    drawing.saveas(source)
    command = [sys.executable, "docs/dxf-to-svg.py", source, target]
    done = subprocess.run(command, capture_output=True, text=True)
    return target, done


def check(name, unit, expected, draw):
    target, done = convert(name, unit, draw)
    assert done.returncode == 0, done.stderr
    run = [os.environ["CELLWIRE"], "run", "laser", target, "--dry-run"]
    output = subprocess.run(run, capture_output=True, text=True)
    assert output.returncode == 0, output.stderr
    found = json.loads(output.stdout)["mm"]
    for side in (0, 1):
        assert abs(found["least"][side]) < 0.002, (name, found)
        assert abs(found["most"][side] - expected[side]) < 0.002, (name, found, expected)
    print(f"{name}: {found['most'][0]} by {found['most'][1]} mm")


def plate(drawing, space):
    bulge = 0.41421356237
    corners = [(10, 0, 0), (323.3337, 0, bulge), (333.3337, 10, 0), (333.3337, 18.7771, 0), (0, 18.7771, 0), (0, 10, bulge)]
    space.add_lwpolyline([(x + 30, y - 40, b) for x, y, b in corners], format="xyb", close=True)


def mirrored(drawing, space):
    # About (-10, 0): the extrusion mirrors X. A layer that is off is not cut.
    space.add_arc((10, 0), 10, 0, 90, dxfattribs={"extrusion": (0, 0, -1)})
    space.add_line((0, 0), (0, 30))
    drawing.layers.add("off").off()
    space.add_line((0, 0), (60, 60), dxfattribs={"layer": "off"})


check("plate", units.MM, (333.3337, 18.7771), plate)
check("hole", units.MM, (14.246, 14.246), lambda _, space: space.add_circle((5, 5), 7.123))
check("whole circle", units.MM, (20, 20), lambda _, space: space.add_arc((0, 0), 10, 0, 360))
check("inch", units.IN, (50.8, 25.4), lambda _, space: space.add_lwpolyline([(1, 1), (3, 1), (3, 2), (1, 2)], close=True))
check("no unit", 0, (3, 4), lambda _, space: space.add_line((1, 1), (4, 5)))
check("mirrored", units.MM, (20, 30), mirrored)
for name, draw, reason in (
    ("tolerance", lambda _, space: space.new_entity("TOLERANCE", {}), "cannot be converted: unsupported"),
    ("empty", lambda *_: None, "has nothing to convert"),
):
    _, refused = convert(name, units.MM, draw)
    assert refused.returncode == 1 and reason in refused.stderr, refused
    print(f"{name}: {refused.stderr.strip()}")
