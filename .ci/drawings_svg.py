"""drawings_svg.py FOLDER: compares the lines of SVG drawings, as `run laser` cuts them, with the pictures of `rsvg-convert`.

A drawing is compared, or refused with a text. Every dark pixel of one picture must be near a dark pixel of the other.
"""

import gzip
import json
import os
import re
import subprocess
import sys
from pathlib import Path

from PIL import Image, ImageChops, ImageFilter

FOLDER = Path(sys.argv[1]) / "svg"
CELLWIRE = os.environ["CELLWIRE"]
HEAD = 'xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink"'
PAGE = 'width="100mm" height="100mm" viewBox="0 0 100 100"'
WIDTH = 400  # pixels
# The distance, in pixels, of a dark pixel from one of the other picture: half of a stroke that is cut off.
NEAR = 3
SLIVERS = 20  # pixels, of the ends of strokes at the edge of a clip
LINE = '<path d="M10 10h30"/>'


def svg(body, page=PAGE):
    return f'<svg {HEAD} {page}><g fill="none" stroke="black">{body}</g></svg>'


def symbol(attributes, inner="<path stroke-width='.5' d='M0 5h20M5 0v20'/>"):
    return f"<symbol id='s' {attributes}>{inner}</symbol>"


CLIPPED = "<path clip-path='url(#c)' d='M5 50h90M50 5v90M10 10l80 80'/>"
ARROW = "<marker id='m' markerWidth='6' markerHeight='6' refX='3' refY='3' orient='auto' stroke-width='.3'><path d='M0 0L6 3L0 6'/></marker>"
# Not in the list, since this rsvg-convert has its own reading: clips of clips, clips of symbols, `transform-origin`.
DRAWN = {
    "path": "<path d='M10 10h20v20l-5 5zM50 50l10 10M60 20c10 0 10 20 20 20s0 20-10 10q-5-5 0-10t3 3'/>",
    "arcs": "<path d='M20 20a10 20 30 1 0 20 20M60 60A10 10 0 0 1 80 60'/><circle cx='30' cy='70' r='12'/><ellipse cx='70' cy='20' rx='20' ry='9'/>",
    "shapes": "<rect x='10' y='10' width='40' height='20' rx='4'/><line x1='5' y1='90' x2='95' y2='80'/><polyline points='5,60 20,40 30,60'/>"
    "<polygon points='50,60 70,40 80,60'/><rect x='60' y='5' width='30' height='20' rx='20' ry='3'/>",
    "percent": "<rect x='10%' y='20%' width='50%' height='30%'/><line x1='5%' y1='5%' x2='95%' y2='9%'/><circle cx='50%' cy='70%' r='10%'/>",
    "units": "<rect x='2mm' y='2mm' width='0.5in' height='1cm'/><line x1='10pt' y1='3pc' x2='40px' y2='45'/>",
    "transforms": "<g transform='translate(50 50) rotate(30)'><rect width='30' height='10' transform='skewX(20) scale(1.2 .8)'/></g>"
    "<path d='M0 0h20v10' transform='matrix(1 .2 -.3 1 20 20)'/><path d='M5 5h20v9' transform='rotate(45 20 70) translate(10,65)'/>",
    "mirrored": "<g transform='translate(100) scale(-1 1)'><path d='M20 20a20 20 0 0 1 20 20l10 0'/></g>",
    "flattened": "<path d='M20 20h20v20' transform='scale(0)'/>" + LINE,
    "use": "<defs><g id='a'><path d='M0 0h10v20'/></g></defs><use href='#a' x='10' y='20'/><use xlink:href='#a' transform='rotate(20) translate(50 10)'/>",
    "use of use": "<g id='a'><path id='b' d='M5 5h20v5'/><use href='#b' y='15'/></g><use href='#a' x='40' y='40'/>",
    "symbol": symbol("viewBox='0 0 20 20'") + "<use href='#s' x='10' y='10' width='40' height='40'/>",
    "symbol without a box": symbol("", "<path d='M5 5h30v20'/>") + "<use href='#s' x='30' y='30'/>",
    "symbol turned": symbol("viewBox='0 0 20 20'") + "<use href='#s' x='10' y='10' width='40' height='40' transform='rotate(20) translate(20 0)'/>",
    "nested": "<svg x='20' y='20' width='50' height='40'><path d='M-10 10h90M10 -10v90'/></svg>",
    "nested with a box": "<svg x='20' y='20' width='50' height='40' viewBox='0 0 10 10'><path stroke-width='.2' d='M-10 5h40M5 -10v40'/></svg>",
    "nested and sliced": "<svg x='20' y='20' width='50' height='40' viewBox='0 0 10 10' preserveAspectRatio='xMidYMid slice'><path stroke-width='.2' d='M-10 5h40M5 -10v40M2 1h6'/></svg>",
    "nested and stretched": "<svg x='20' y='20' width='50' height='20' viewBox='0 0 10 10' preserveAspectRatio='none'><circle stroke-width='.2' cx='5' cy='5' r='4'/></svg>",
    "nested in full": "<svg x='20' y='20' width='50' height='40' overflow='visible'><path d='M-10 10h70M10 -10v60'/></svg>",
    "clip to a circle": "<clipPath id='c'><circle cx='50' cy='50' r='30'/></clipPath>" + CLIPPED,
    "clip to a star": "<clipPath id='c'><path clip-rule='evenodd' d='M50 5L80 95L5 40H95L20 95Z'/></clipPath>" + CLIPPED,
    "clip without a hole": "<clipPath id='c'><path d='M50 5L80 95L5 40H95L20 95Z'/></clipPath>" + CLIPPED,
    "clip of two": "<clipPath id='c'><rect x='10' y='10' width='30' height='80'/><rect x='60' y='10' width='30' height='45'/></clipPath>" + CLIPPED,
    "clip moved": "<clipPath id='c' transform='translate(20 0)'><rect x='10' y='10' width='30' height='80' transform='rotate(9)'/></clipPath>" + CLIPPED,
    "clip of the box": "<clipPath id='c' clipPathUnits='objectBoundingBox'><rect x='.1' y='.1' width='.4' height='.6'/></clipPath>" + CLIPPED,
    "clip in a clip": "<clipPath id='d'><rect x='40' width='60' height='100'/></clipPath><clipPath id='c'><circle cx='50' cy='50' r='30'/></clipPath><g clip-path='url(#d)' transform='translate(5 5)'>" + CLIPPED + "</g>",
    "clip by use": "<clipPath id='c'><use href='#r' x='10'/></clipPath><defs><rect id='r' x='20' y='20' width='30' height='60'/></defs>" + CLIPPED,
    "clip of nothing": "<clipPath id='c'><rect width='100' height='100'/></clipPath>" + CLIPPED,
    "clip of everything": "<clipPath id='c'/>" + CLIPPED + LINE,
    "clip of a curve": "<clipPath id='c'><rect x='20' y='20' width='25' height='60'/></clipPath><circle cx='45' cy='45' r='30' clip-path='url(#c)'/>",
    "arrow": ARROW + "<path d='M20 20L70 40L60 80' marker-end='url(#m)' marker-mid='url(#m)' marker-start='url(#m)'/>",
    "dashes": "<path d='M10 10h80v40' stroke-dasharray='9 5'/><circle cx='40' cy='60' r='20' stroke-dasharray='7'/><rect x='60' y='60' width='30' height='25' stroke-dasharray='5 3 1'/>",
    "dashes moved": "<path d='M10 10h80' stroke-dasharray='9 5' stroke-dashoffset='4'/><path d='M10 30h80' stroke-dasharray='9 5' stroke-dashoffset='-5'/><path d='M10 50h80' stroke-dasharray='9 5 2' stroke-dashoffset='100'/>",
    "style": "<style>.a{stroke:none} #b{display:none} path.c{visibility:hidden} g>path.d{stroke-opacity:0}</style>"
    "<path class='a' d='M10 20h50'/><path id='b' d='M10 30h50'/><path class='c' d='M10 40h50'/><path class='d' d='M10 50h50'/>" + LINE,
    "hidden": "<g visibility='hidden'><path d='M10 30h20'/><path visibility='visible' d='M10 60h20'/></g><g display='none'>" + LINE + "</g><path opacity='0' d='M9 9h9'/>",
    "hidden text": "<style>.h{display:none}</style><text class='h'>a</text><defs><text>b</text></defs><g style='display:none'><image href='x.png'/></g>" + LINE,
    "switch": "<switch><foreignObject requiredExtensions='http://example.org'><p/></foreignObject><path d='M10 10h50'/><text>a</text></switch>",
    "links": "<a href='x'><path d='M10 10h50'/></a>",
    "gradient": "<linearGradient id='g' gradientUnits='userSpaceOnUse'><stop stop-color='black'/><stop offset='1' stop-color='#222'/></linearGradient><path stroke='url(#g)' d='M10 10L90 30'/>",
    "entities": "<path d='&#77;10 10h50'/>",
    "background": "<path style='background-color:white' d='M10 10h50'/>",
    "context": ARROW.replace("stroke-width", "stroke='context-stroke' stroke-width") + "<path d='M20 20L70 40' marker-end='url(#m)'/>",
    "gaps": "<path d='M10 10h10m10 0h10M10 50z l20 5m5 5'/>",
    "numbers": "<path d='M1e1.5.5-5+20e-1.5L30-.5e1,6e1,10'/>",
}
PAGES = {
    "fit": ('width="100mm" height="50mm" viewBox="0 0 40 40"', (100, 50)),
    "slice": ('width="80mm" height="40mm" viewBox="0 0 40 40" preserveAspectRatio="xMinYMin slice"', (80, 40)),
    "stretch": ('width="80mm" height="40mm" viewBox="0 0 40 40" preserveAspectRatio="none"', (80, 40)),
    "corner": ('width="80mm" height="40mm" viewBox="-10 -5 40 40" preserveAspectRatio="xMaxYMin"', (80, 40)),
    "no box": ('width="40mm" height="40mm"', (40, 40)),
    "inches": ('width="2in" height="1in" viewBox="0 0 50 25"', (50.8, 25.4)),
}
INK = '<g fill="none" stroke="black" stroke-width=".3"><path d="M1 1h20l5 9-20 5z"/><circle cx="20" cy="10" r="9"/></g>'
REFUSED = {
    "text": ("<text x='5' y='5'>a</text>", "1 text (line 1)"),
    "image": ("<image width='9' height='9' href='x.png'/>", "1 image (line 1)"),
    "foreign object": ("<foreignObject width='9' height='9'><p/></foreignObject>", "1 foreign object (line 1)"),
    "filter": ("<filter id='f'><feGaussianBlur stdDeviation='1'/></filter><g filter='url(#f)'><circle cx='20' cy='20' r='9'/>" + LINE + "</g>", "1 filter (line 1)"),
    "mask": ("<mask id='m'><rect width='20' height='20' fill='white'/></mask><g mask='url(#m)'>" + LINE + "</g>", "1 mask (line 1)"),
    "pattern": ("<pattern id='p' width='9' height='9' patternUnits='userSpaceOnUse'><rect width='5' height='9' fill='red'/></pattern><path stroke='url(#p)' d='M5 5L60 60'/>", "translucent stroke"),
    "fading": ("<linearGradient id='g'><stop/><stop offset='1' stop-opacity='0'/></linearGradient><path stroke='url(#g)' d='M5 5L60 60'/>", "translucent stroke"),
    "css transform": ("<path style='transform:translate(20px,9px)' d='M5 5h9'/>", "transform"),
    "css path": ("<style>path{d:path('M0 0h9')}</style><path d='M5 5h9'/>", "the style property `d` (line 1)"),
    "css rule": ("<style>@media print{path{stroke:none}}</style>" + LINE, "The @media rule is not supported"),
    "css variable": ("<path stroke='var(--a)' d='M5 5h9'/>", "Failed to parse stroke value: 'var(--a)'"),
    "external use": ("<use href='other.svg#a'/>", "`use` that refers to `other.svg#a` (line 1)"),
    "missing use": ("<use href='#none'/>", "`use` that refers to `#none` (line 1)"),
    "missing clip": ("<path clip-path='url(#none)' d='M5 5h9'/>", "`clip-path` that refers to `#none` (line 1)"),
    "css clip": ("<path clip-path='circle(9px)' d='M5 5h9'/>", "clip-path"),
    "two of one name": ("<path id='a' d='M5 5h9'/><path id='a' d='M5 9h9'/><use href='#a' y='9'/>", "several elements"),
    "dot": ("<path d='M50 50h0' stroke-linecap='round' stroke-width='9'/>", "1 dot (line 1)"),
    "dots": ("<path d='M5 5h50' stroke-linecap='round' stroke-dasharray='0 5'/>", "1 line of dots (line 1)"),
    "unit": ("<rect x='3foo' width='9' height='9'/>", "Failed to parse x value: '3foo' (line 1)"),
    "font unit": ("<rect x='3em' width='9' height='9'/>", "1 length in the size of a font (line 1)"),
    "path error": ("<path d='M5 5h9 v9 x'/>", "Error during path parsing"),
    "negative": ("<rect width='-9' height='9'/>", "Rect has an invalid 'width' value. Skipped (line 1)"),
    "huge": ("<path d='M0 0L1e39 5'/>", "has lines beyond"),
    "far": ("<path d='M0 0C1e30 1 2 3e30 4 5A1e20 1 0 0 0 1e19 5'/>", "has lines beyond"),
    "outside": ("<path d='M50 50h90'/>", "has lines outside of its page"),
    "unstroked": ("<rect stroke='none' fill='red' width='9' height='9'/>", "1 unstroked shape (line 1)"),
    "nested without a size": ("<svg x='50' viewBox='0 0 10 10'><path d='M-4 5h14'/></svg>", "nested `svg` without a width or height (line 1)"),
    "flow": ("<flowRoot><flowPara>a</flowPara></flowRoot>", "<flowRoot> (line 1)"),
    "animation": ("<path d='M5 5h9'><animate attributeName='d' dur='1s'/></path>", "1 animation (line 1)"),
    "page without area": ("<svg width='0' viewBox='0 0 0 9'>" + LINE + "</svg>", "`viewBox` of `0 0 0 9` (line 1)"),
    "dashes of a length": ("<path pathLength='9' stroke-dasharray='1' d='M5 5h50'/>", "pathLength"),
}


def laser(file, *more):
    plan = FOLDER / "plan.svg"
    run = [CELLWIRE, "run", "laser", file, "--dry-run", "--picture", plan, "--set", "program.tolerance=0.02", *more]
    return plan, subprocess.run(run, capture_output=True, text=True)


def picture(file, height):
    target = file.with_suffix(".png")
    size = ["--width", str(WIDTH), "--height", str(height)]
    subprocess.run(["rsvg-convert", *size, "--background-color=white", file, "-o", target], check=True)
    return Image.open(target).convert("L").point(lambda value: 255 * (value < 160))


def cuts(plan, mm, page):
    """The cut lines of a plan as a drawing of the page. The plan has an origin of its own: its lines have the bounds `mm`."""
    lines = re.search(r'<path[^>]*stroke="black"[^>]*>', plan.read_text()).group()
    data = re.search(r' d="([^"]*)"', lines).group(1)
    numbers = [float(number) for number in re.findall(r"-?[\d.]+", data)]
    x = mm["least"][0] - min(numbers[::2])
    y = page[1] - mm["most"][1] - min(numbers[1::2])
    file = plan.with_name("cuts.svg")
    place = f'width="{page[0]}mm" height="{page[1]}mm" viewBox="0 0 {page[0]} {page[1]}"'
    path = f'<path transform="translate({x} {y})" fill="none" stroke="black" stroke-width="{page[0] / 150}" d="{data}"/>'
    file.write_text(f"<svg {HEAD} {place}>{path}</svg>")
    return file


def compare(name, text, page=(100, 100), may_be_cut_off=True):
    file = FOLDER / f"{name.replace(' ', '-')}.svg"
    file.write_text(text)
    plan, done = laser(file, "--allow", "drawing")
    assert done.returncode == 0, (name, done.stderr)
    allowed = "is cut off at the edge" if may_be_cut_off else None
    warnings = [line for line in done.stderr.splitlines() if not allowed or allowed not in line]
    assert not warnings, (name, warnings)
    height = round(WIDTH * page[1] / page[0])
    theirs = picture(file, height)
    ours = picture(cuts(plan, json.loads(done.stdout)["mm"], page), height)
    near = ImageFilter.MaxFilter(2 * NEAR + 1)
    wrong = 0
    for one, other in ((theirs, ours), (ours, theirs)):
        assert one.getbbox(), (name, "has no line")
        wrong += ImageChops.subtract(one, other.filter(near)).histogram()[255]
    return wrong


def refuse(name, body, reason):
    file = FOLDER / f"refused-{name.replace(' ', '-')}.svg"
    file.write_text(svg(body) if not isinstance(body, bytes) else "")
    if isinstance(body, bytes):
        file.write_bytes(body)
    _, done = laser(file)
    return done.returncode == 2 and reason in done.stderr or done.stdout + done.stderr


if __name__ == "__main__":
    FOLDER.mkdir(parents=True, exist_ok=True)
    failures = []
    for name, body in DRAWN.items():
        try:
            wrong = compare(name, svg(body))
        except AssertionError as error:
            wrong = error
        if not isinstance(wrong, int) or wrong > SLIVERS:
            failures.append(f"{name}: {wrong}")
    for name, (page, size) in PAGES.items():
        try:
            wrong = compare(name, f"<svg {HEAD} {page}>{INK}</svg>", size)
        except AssertionError as error:
            wrong = error
        if not isinstance(wrong, int) or wrong > SLIVERS:
            failures.append(f"{name}: {wrong}")
    wide = svg(DRAWN["path"])
    for name, text in (("UTF-16", wide.encode("utf-16")), ("big endian", b"\xfe\xff" + wide.encode("utf-16-be"))):
        file = FOLDER / f"{name}.svg"
        file.write_bytes(text)
        _, done = laser(file)
        if done.returncode:
            failures.append(f"{name}: {done.stderr}")
    for name, (body, reason) in REFUSED.items():
        outcome = refuse(name, body, reason)
        if outcome is not True:
            failures.append(f"refused {name}: {outcome}")
    outcome = refuse("compressed", gzip.compress(wide.encode()), "is compressed (SVGZ)")
    if outcome is not True:
        failures.append(f"compressed: {outcome}")
    print(f"{len(DRAWN) + len(PAGES)} drawings compared, {len(REFUSED) + 1} refused by name")
    sys.exit("\n".join(failures))
