"""Converts a DXF drawing to SVG in its true size, for `cellwire run laser`.

    python3 dxf-to-svg.py part.dxf part.svg

The lower left corner of the drawing becomes that of the page. Units are those of the drawing, or mm if it names none. Layers that are off
are left out; an entity that cannot be converted is an error. It needs `pip install ezdxf pillow`. The size is exact to a millionth of the
page; `ezdxf draw` itself rounds it to 0.1 mm.
"""

import math
import sys

import ezdxf
from ezdxf import units
from ezdxf.addons.drawing import Frontend, RenderContext, layout, svg
from ezdxf.addons.drawing.config import BackgroundPolicy, ColorPolicy, Configuration


class Strict(Frontend):
    def skip_entity(self, entity, msg):
        if msg != "invisible":
            sys.exit(f"{entity} cannot be converted: {msg}")


def main(source, target):
    drawing = ezdxf.readfile(source)
    scale = units.conversion_factor(drawing.units, units.MM) if drawing.units else 1.0
    backend = svg.SVGBackend()
    config = Configuration(background_policy=BackgroundPolicy.OFF, color_policy=ColorPolicy.BLACK)
    Strict(RenderContext(drawing), backend, config).draw_layout(drawing.modelspace())
    box = backend.player().bbox()
    if not box.has_data:
        sys.exit(f"{source} has nothing to convert in its model space")
    size = box.size * scale
    # A page of whole millimetres: its size is written with one digit after the point.
    page = layout.Page(math.ceil(size.x) or 1, math.ceil(size.y) or 1)
    corner = layout.PageAlignment.BOTTOM_LEFT
    settings = layout.Settings(fit_page=False, scale=scale, page_alignment=corner)
    with open(target, "w", encoding="utf-8") as file:
        file.write(backend.get_string(page, settings=settings))


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(*sys.argv[1:])
