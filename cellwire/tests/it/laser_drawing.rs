//! SVG drawings as programs of a laser: the exact path in mm, and what is refused.

use core::f64::consts::FRAC_1_SQRT_2;
use std::fs;

use cellwire::run::laser::{Coordinate, Program, Settings};

/// Returns a page of 100 by 80 mm, one unit of which is a millimetre.
fn page(body: &str) -> String {
    svg(r#"width="100mm" height="80mm" viewBox="0 0 100 80""#, body)
}

fn svg(head: &str, body: &str) -> String {
    format!(r#"<svg xmlns="http://www.w3.org/2000/svg" {head}>{body}</svg>"#)
}

fn read(drawing: &str, allow: bool) -> Result<Program, String> {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("part.svg");
    fs::write(&file, drawing).unwrap();
    let Settings { host, mapping } = Settings::at_baud(115_200);
    Program::read(&file, &mapping, &host, allow)
        .map_err(|error| format!("{error:#}").replace(&file.display().to_string(), "part.svg"))
}

/// Whether the laser is on, and the place to which an instruction leads.
type Step = (bool, [f64; 2]);
type Path = Vec<Step>;

fn path(drawing: &str) -> Path {
    let program = read(drawing, false).unwrap();
    assert_eq!(program.warnings, [""; 0]);
    steps(&program)
}

fn steps(program: &Program) -> Path {
    let cut = Settings::at_baud(115_200).mapping.cut;
    program
        .instructions
        .iter()
        .map(|it| (it.word == cut, [it.values[0].into(), it.values[1].into()]))
        .collect()
}

fn assert_same(found: &Path, expected: &[Step]) {
    let is_near =
        |(found, expected): (&Step, &Step)| found.0 == expected.0 && distance(found.1, expected.1) < 1e-4;
    assert!(
        found.len() == expected.len() && found.iter().zip(expected).all(is_near),
        "{found:?}\n{expected:?}"
    );
}

fn distance([x, y]: [f64; 2], [a, b]: [f64; 2]) -> f64 {
    (x - a).hypot(y - b)
}

/// Returns the greatest distance of the middles of chords from a curve, and of their ends.
fn errors(path: &Path, from_curve: impl Fn([f64; 2]) -> f64) -> [f64; 2] {
    let chords = path.windows(2).filter(|pair| pair[1].0).map(|pair| [pair[0].1, pair[1].1]);
    chords.fold([0.0, 0.0], |[middles, ends], [a, b]| {
        let middle = [(a[0] + b[0]) / 2.0, (a[1] + b[1]) / 2.0];
        [middles.max(from_curve(middle)), ends.max(from_curve(a)).max(from_curve(b))]
    })
}

/// The setting program.tolerance.
const TOLERANCE: f64 = 0.05;

#[test]
fn a_rectangle_is_a_move_and_four_cuts_with_y_upwards() {
    let drawing = page(r#"<rect x="10" y="20" width="30" height="40" fill="none" stroke="red"/>"#);
    let corners = [(false, [10.0, 60.0]), (true, [40.0, 60.0]), (true, [40.0, 20.0]), (true, [10.0, 20.0])];
    assert_same(&path(&drawing), &[&corners[..], &[(true, [10.0, 60.0])]].concat());
    // Strokes that meet are one cut; others begin with a move.
    let lines =
        page(r#"<g stroke="red"><path d="M0 80 L 10 80"/><path d="M10 80 L 10 70 M 20 70 h 5"/></g>"#);
    let expected = [(false, [0.0, 0.0]), (true, [10.0, 0.0]), (true, [10.0, 10.0])];
    assert_same(&path(&lines), &[&expected[..], &[(false, [20.0, 10.0]), (true, [25.0, 10.0])]].concat());
    let numbers: Vec<u64> = read(&lines, false).unwrap().instructions.iter().map(|it| it.line).collect();
    assert_eq!(numbers, [1, 1, 2, 3, 3]);
}

#[test]
fn a_circle_has_its_radius_everywhere() {
    for radius in [2.0, 38.0] {
        let circle = format!(r#"<circle cx="50" cy="40" r="{radius}" fill="none" stroke="red"/>"#);
        let found = path(&page(&circle));
        assert_eq!((found[0].0, found.iter().filter(|it| !it.0).count()), (false, 1));
        for end in [found[0], *found.last().unwrap()] {
            assert!(distance(end.1, [50.0 + radius, 40.0]) < 1e-3, "{end:?}");
        }
        let [chords, ends] = errors(&found, |at| (distance(at, [50.0, 40.0]) - radius).abs());
        assert!(ends < 1e-4 && chords < TOLERANCE + 1e-4, "{ends} {chords}");
        // As many chords as eight arcs of G-code have.
        let most = 8.0 * (core::f64::consts::TAU / 8.0 / (2.0 * (1.0 - TOLERANCE / radius).acos())).ceil();
        #[expect(clippy::cast_precision_loss, reason = "a hundred")]
        let chords = (found.len() - 1) as f64;
        assert!(chords <= most, "{chords} {most}");
    }
}

/// A quarter of a circle from (40, 10) to (50, 20) in the drawing: to the right of its way, about (40, 20).
const QUARTER: &str = "M40 10 A 10 10 0 0 1 50 20";

#[test]
fn a_mirrored_arc_is_on_the_side_where_it_is_drawn() {
    let beside = 10.0 * FRAC_1_SQRT_2;
    // The transform, and in mm with Y upwards: the beginning, the centre, the middle and the end of the arc.
    for (transform, places) in [
        ("scale(1)", [[40.0, 70.0], [40.0, 60.0], [40.0 + beside, 60.0 + beside], [50.0, 60.0]]),
        (
            "translate(100 0) scale(-1 1)",
            [[60.0, 70.0], [60.0, 60.0], [60.0 - beside, 60.0 + beside], [50.0, 60.0]],
        ),
        (
            "translate(0 80) scale(1 -1)",
            [[40.0, 10.0], [40.0, 20.0], [40.0 + beside, 20.0 - beside], [50.0, 20.0]],
        ),
        ("matrix(0 1 1 0 0 0)", [[10.0, 40.0], [20.0, 40.0], [20.0 - beside, 40.0 - beside], [20.0, 30.0]]),
        ("rotate(90 50 40)", [[80.0, 50.0], [70.0, 50.0], [70.0 + beside, 50.0 - beside], [70.0, 40.0]]),
    ] {
        let [begin, centre, middle, end] = places;
        let found = path(&page(&format!(
            r#"<g transform="{transform}"><path d="{QUARTER}" fill="none" stroke="red"/></g>"#
        )));
        assert_same(&vec![found[0], *found.last().unwrap()], &[(false, begin), (true, end)]);
        let [_, ends] = errors(&found, |at| (distance(at, centre) - 10.0).abs());
        assert!(ends < 1e-3, "{transform}: {ends}");
        let nearest = found.iter().map(|it| distance(it.1, middle)).fold(f64::INFINITY, f64::min);
        assert!(nearest < 1.0, "{transform}: {found:?}");
    }
}

#[test]
fn an_ellipse_that_a_transform_makes_of_a_circle_is_accurate() {
    let circle = r#"<circle cx="25" cy="10" r="10" transform="scale(2 4)" fill="none" stroke="red"/>"#;
    let found = path(&page(circle));
    // As a circle again.
    let [_, ends] = errors(&found, |[x, y]| (((x - 50.0) / 20.0).hypot((y - 40.0) / 40.0) - 1.0).abs());
    assert!(ends < 1e-4, "{ends}");
}

#[test]
fn curves_are_within_the_tolerance() {
    let cubic: fn(f64) -> [f64; 2] = |t| {
        let u = 1.0 - t;
        let at = |a: f64, b: f64, c: f64, d: f64| {
            u * u * u * a + 3.0 * u * u * t * b + 3.0 * u * t * t * c + t * t * t * d
        };
        [at(10.0, 0.0, 100.0, 90.0), 80.0 - at(10.0, 80.0, 60.0, 10.0)]
    };
    let square: fn(f64) -> [f64; 2] = |t| {
        let at = |a: f64, b: f64, c: f64| (1.0 - t) * (1.0 - t) * a + 2.0 * (1.0 - t) * t * b + t * t * c;
        [at(10.0, 50.0, 90.0), 80.0 - at(70.0, 10.0, 70.0)]
    };
    for (data, curve) in [("M10 10 C 0 80 100 60 90 10", cubic), ("M10 70 Q 50 10 90 70", square)] {
        let found = path(&page(&format!(r#"<path d="{data}" fill="none" stroke="red"/>"#)));
        assert_same(&vec![found[0], *found.last().unwrap()], &[(false, curve(0.0)), (true, curve(1.0))]);
        let from_curve =
            |at| (0..=20_000).map(|n| distance(at, curve(f64::from(n) / 2e4))).fold(f64::INFINITY, f64::min);
        let [chords, ends] = errors(&found, from_curve);
        assert!(chords < TOLERANCE && ends < 0.01, "{data}: {chords} {ends}");
        assert!((10..100).contains(&found.len()), "{}", found.len());
    }
}

#[test]
fn layers_that_are_off_are_not_cut() {
    let on = r#"<path d="M0 0 h 10" stroke="red"/>"#;
    let expected = path(&page(on));
    for off in [
        r#"<g inkscape:groupmode="layer" xmlns:inkscape="http://www.inkscape.org/namespaces/inkscape" style="display:none"><path d="M5 5 h 10" stroke="red"/></g>"#,
        r#"<g display="none"><g display="inline"><path d="M5 5 h 10" stroke="red"/><text>A</text></g></g>"#,
        r#"<path d="M5 5 h 10" stroke="red" visibility="hidden"/>"#,
        r#"<defs><path id="p" d="M5 5 h 10" stroke="red"/></defs>"#,
    ] {
        assert_same(&path(&page(&format!("{on}{off}"))), &expected);
    }
}

#[test]
fn the_size_is_that_of_the_page() {
    let line = r#"<path d="M0 10 h 20" stroke="red"/>"#;
    for (head, length, height) in [
        (r#"width="100mm" height="80mm" viewBox="0 0 100 80""#, 20.0, 70.0),
        (r#"width="50mm" height="40mm" viewBox="0 0 100 80""#, 10.0, 35.0),
        (r#"width="2.5cm" height="2cm" viewBox="0 0 100 80""#, 5.0, 17.5),
        (r#"width="10in" height="8in" viewBox="0 0 100 80""#, 50.8, 177.8),
        (r#"width="72pt" height="72pt" viewBox="0 0 100 100""#, 5.08, 22.86),
        (r#"width="6pc" height="6pc" viewBox="0 0 100 100""#, 5.08, 22.86),
        // Units of the drawing are pixels of CSS without a view box.
        (r#"width="1in" height="1in""#, 25.4 * 20.0 / 96.0, 25.4 * 86.0 / 96.0),
        // A view box of another shape is in the middle of the page.
        (r#"width="100mm" height="100mm" viewBox="0 0 100 80""#, 20.0, 80.0),
        (r#"width="100mm" height="160mm" viewBox="0 0 100 80" preserveAspectRatio="none""#, 20.0, 140.0),
    ] {
        assert_same(&path(&svg(head, line)), &[(false, [0.0, height]), (true, [length, height])]);
    }
    for head in [
        r#"width="100px" height="80px" viewBox="0 0 100 80""#,
        r#"width="100" height="80""#,
        r#"viewBox="0 0 100 80""#,
        r#"width="100%" height="100%" viewBox="0 0 100 80""#,
        r#"width="100" height="80mm" viewBox="0 0 100 302.36""#,
        r#"width="26.4583333mm" height="80" viewBox="0 0 100 80""#,
    ] {
        let refused = read(&svg(head, line), false).unwrap_err();
        assert_eq!(
            refused,
            "the drawing part.svg has no size in mm: give the width and the height of its <svg> in mm, or take 96 pixels as an inch with --allow drawing"
        );
        let program = read(&svg(head, line), true).unwrap();
        assert_eq!(program.warnings, ["is taken to have 96 pixels per inch"]);
        let found = steps(&program);
        assert!((distance(found[0].1, found[1].1) - 20.0 * 25.4 / 96.0).abs() < 1e-3, "{head} {found:?}");
    }
}

#[test]
fn what_cannot_be_cut_is_named_and_left_out_where_that_is_allowed() {
    let line = r#"<path d="M0 80 h 10" stroke="red"/>"#;
    let expected = path(&page(line));
    for (body, named) in [
        (r#"<rect width="9" height="9"/>"#, "1 unstroked shape (line 1)"),
        (r#"<rect width="9" height="9"/><circle r="9"/>"#, "2 unstroked shapes (line 1)"),
        (r#"<text x="5" y="5" stroke="red">A</text>"#, "1 text (line 1)"),
        (r#"<image href="x.png" width="9" height="9"/>"#, "1 image (line 1)"),
        (r#"<path d="M5 5 h 9" stroke="red" stroke-opacity=".5"/>"#, "1 translucent stroke (line 1)"),
        (r#"<g opacity=".5"><path d="M5 5 h 9" stroke="red"/></g>"#, "1 translucent group (line 1)"),
    ] {
        let drawing = page(&format!("{line}{body}"));
        assert_eq!(
            read(&drawing, false).unwrap_err(),
            format!(
                "the drawing part.svg has {named}: convert them to paths with an opaque stroke, or leave them out with --allow drawing"
            )
        );
        let program = read(&drawing, true).unwrap();
        assert_eq!(program.warnings, [format!("is cut without {named}")]);
        assert_same(&steps(&program), &expected);
    }
    // A drawing has no feed, and no value is made up.
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("part.svg");
    fs::write(&file, page(line)).unwrap();
    let Settings { host, mut mapping } = Settings::at_baud(115_200);
    mapping.values.push(Coordinate::F);
    let refused = Program::read(&file, &mapping, &host, true).unwrap_err().to_string();
    assert!(
        refused
            .ends_with("has no feed, which the setting program.values asks for: write the program as G-code")
    );
    for (body, named) in [("", "has no strokes to cut"), ("<path", "is not an SVG file: ")] {
        let refused = read(&page(body), false).unwrap_err();
        assert!(refused.starts_with(&format!("the drawing part.svg {named}")), "{refused}");
    }
}

#[test]
fn lines_outside_of_the_page_are_not_cut_unasked() {
    let drawing = page(r#"<path d="M90 40 H 110 V 50 H 90" fill="none" stroke="red"/>"#);
    assert_eq!(
        read(&drawing, false).unwrap_err(),
        "the drawing part.svg has lines outside of its page of 100.0 by 80.0 mm: move them onto it, or cut them off with --allow drawing"
    );
    let program = read(&drawing, true).unwrap();
    assert_eq!(program.warnings, ["is cut off at the edge of its page of 100.0 by 80.0 mm"]);
    let expected =
        [(false, [90.0, 40.0]), (true, [100.01, 40.0]), (false, [100.01, 30.0]), (true, [90.0, 30.0])];
    assert_same(&steps(&program), &expected);
    // The edge of the page is on it.
    let edge = page(r#"<rect width="100" height="80" fill="none" stroke="red"/>"#);
    assert_eq!(path(&edge).len(), 5);
}

/// Returns the cuts of a drawing of one line that is 100 mm long, as its beginning and its end.
fn cuts(body: &str) -> Vec<[f64; 2]> {
    let found = path(&page(&format!(r#"<g fill="none" stroke="red">{body}</g>"#)));
    found.windows(2).filter(|pair| pair[1].0).map(|pair| [pair[0].1[0], pair[1].1[0]]).collect()
}

#[test]
fn clips_are_applied() {
    let line = r#"<path clip-path="url(#c)" d="M0 40 h 100"/>"#;
    let far = r#"<clipPath id="d"><rect x="40" width="60" height="80"/></clipPath>"#;
    for (clip, expected) in [
        (r#"<clipPath id="c"><rect x="20" width="30" height="80"/></clipPath>"#, vec![[20.0, 50.0]]),
        (r#"<clipPath id="c"><rect width="100" height="80"/></clipPath>"#, vec![[0.0, 100.0]]),
        // A line along the edge of a clip is half visible.
        (r#"<clipPath id="c"><rect y="40" x="10" width="50" height="9"/></clipPath>"#, vec![[10.0, 60.0]]),
        (
            r#"<clipPath id="c"><rect width="10" height="80"/><rect x="50" width="10" height="80"/></clipPath>"#,
            vec![[0.0, 10.0], [50.0, 60.0]],
        ),
        (
            r#"<clipPath id="c"><path clip-rule="evenodd" d="M10 0H90V80H10ZM30 10V70H60V10Z"/></clipPath>"#,
            vec![[10.0, 30.0], [60.0, 90.0]],
        ),
        (
            r#"<clipPath id="c" clip-path="url(#d)"><rect x="20" width="30" height="80"/></clipPath>"#,
            vec![[40.0, 50.0]],
        ),
        (
            r#"<clipPath id="c"><rect x="20" width="30" height="80" clip-path="url(#d)"/></clipPath>"#,
            vec![[40.0, 50.0]],
        ),
    ] {
        let body = format!(r#"{far}{clip}{line}<path d="M0 0 h 1"/>"#);
        let mut found = cuts(&body);
        assert_eq!(found.pop(), Some([0.0, 1.0]), "{clip}");
        let is_near = |(found, expected): (&[f64; 2], &[f64; 2])| distance(*found, *expected) < 1e-3;
        assert!(
            found.len() == expected.len() && found.iter().zip(&expected).all(is_near),
            "{clip}: {found:?}"
        );
    }
    let symbol = |overflow: &str| {
        let symbol = format!(
            r##"<symbol id="s" viewBox="0 0 10 10"{overflow}><path d="M-5 5 h 20"/></symbol><use href="#s" x="20" width="40" height="40"/>"##
        );
        cuts(&symbol)
    };
    let found = [symbol(""), symbol(r#" overflow="visible""#)].map(|cuts| (cuts.len(), cuts[0]));
    let [(1, hidden), (1, visible)] = found else { panic!("{found:?}") };
    assert!(distance(hidden, [20.0, 60.0]) < 1e-2 && distance(visible, [0.0, 80.0]) < 1e-2, "{found:?}");
}

#[test]
fn what_the_reader_omits_is_named_with_its_line() {
    for (body, named) in [
        (
            r#"<path style="transform:matrix(1 0 0 1 9 9)" d="M0 0h9"/>"#,
            "the style property `transform` (line 2)",
        ),
        (r#"<style>path{d:none;x:9px}</style>"#, "the style property `x` (line 1)"),
        (r#"<path transform="move(9)" d="M0 0h9"/>"#, "Failed to parse transform value: 'move(9)' (line 2)"),
        (r#"<style>@media print{path{stroke:none}}</style>"#, "The @media rule is not supported. Skipped"),
        (r##"<use href="other.svg#a"/>"##, "`use` that refers to `other.svg#a` (line 2)"),
        (r##"<path clip-path="url(#x)" d="M0 0h9"/>"##, "`clip-path` that refers to `#x` (line 2)"),
        (r#"<rect x="1foo" width="9" height="9"/>"#, "Failed to parse x value: '1foo' (line 2)"),
        (r#"<rect x="1em" width="9" height="9"/>"#, "1 length in the size of a font (line 2)"),
        (r#"<rect width="-9" height="9"/>"#, "Rect has an invalid 'width' value. Skipped (line 2)"),
        (r#"<path d="M0 0h9 v9 x"/>"#, "Error during path parsing: unexpected data at position 11 (line 2)"),
        (r#"<path stroke-linecap="round" d="M50 50h0"/>"#, "1 dot (line 2)"),
        (
            r#"<path pathLength="9" stroke-dasharray="1" d="M0 0h9"/>"#,
            "dashes with `pathLength` or `vector-effect` (line 2)",
        ),
        (r#"<flowRoot/>"#, "<flowRoot> (line 2)"),
        (
            r#"<svg x="50" viewBox="0 0 10 10"><path d="M-4 5h9"/></svg>"#,
            "nested `svg` without a width or height (line 2)",
        ),
        (r#"<path d="M0 0h9"><animate/></path>"#, "1 animation (line 2)"),
        (
            r##"<path id="a" d="M0 0h9"/><path id="a" d="M0 0h9"/><use href="#a"/>"##,
            "`use` that refers to `a`, which several elements are called, (line 2)",
        ),
    ] {
        let drawing = page(&format!("<g fill=\"none\" stroke=\"red\"><path d=\"M0 0h9\"/>\n{body}</g>"));
        let refused = read(&drawing, false).unwrap_err();
        assert!(
            refused.contains(&format!("has {named}")) || refused.contains(&format!(", {named}")),
            "{body}: {refused}"
        );
        let warnings = read(&drawing, true).unwrap().warnings;
        assert!(warnings[0].starts_with("is cut without "), "{warnings:?}");
    }
    for hidden in [
        r#"<style>.h{display:none}</style><text class="h">a</text>"#,
        r#"<switch><foreignObject requiredExtensions="x"/><path d="M0 0h9"/><text>a</text></switch>"#,
        r#"<text><tspan display="none">a</tspan></text>"#,
        r#"<g style="background-color:white;-inkscape-x:1;font-size:3px"/>"#,
    ] {
        path(&page(&format!("<g fill=\"none\" stroke=\"red\"><path d=\"M0 0h9\"/>{hidden}</g>")));
    }
}

#[test]
fn encodings_are_read_or_refused_by_name() {
    let drawing = page(r#"<path d="M0 80 h 10" stroke="red"/>"#);
    let folder = tempfile::tempdir().unwrap();
    let Settings { host, mapping } = Settings::at_baud(115_200);
    let read = |name: &str, data: Vec<u8>| {
        let file = folder.path().join(name);
        fs::write(&file, data).unwrap();
        Program::read(&file, &mapping, &host, false).map_err(|error| error.to_string())
    };
    let wide = |unit: fn(u16) -> [u8; 2]| {
        [0xFEFF].into_iter().chain(drawing.encode_utf16()).flat_map(unit).collect()
    };
    for data in [wide(u16::to_le_bytes), wide(u16::to_be_bytes)] {
        assert_same(&steps(&read("part.svg", data).unwrap()), &path(&drawing));
    }
    for unit in [u16::to_le_bytes, u16::to_be_bytes] {
        let data = drawing.encode_utf16().flat_map(unit).collect();
        let refused = read("part.svg", data).unwrap_err();
        assert!(refused.ends_with("is UTF-16 without a byte order mark: save it as UTF-8"), "{refused}");
        let data = "G1 X1\n".encode_utf16().flat_map(unit).collect();
        let refused = read("part.nc", data).unwrap_err();
        assert!(refused.ends_with("part.nc is UTF-16: save it as UTF-8"), "{refused}");
    }
    for name in ["part.svg", "part.svgz"] {
        let refused = read(name, vec![0x1F, 0x8B, 8]).unwrap_err();
        assert!(
            refused.ends_with("is compressed (SVGZ): unpack it with `gzip -dc FILE.svgz > FILE.svg`"),
            "{refused}"
        );
    }
}

#[test]
fn coordinates_far_from_the_page_are_refused_at_once() {
    for body in [
        r#"<path d="M0 0 C 1e30 1 2 3e30 4 5 A 1e20 1 0 0 0 1e19 5" stroke="red"/>"#,
        r#"<path d="M0 0 L 1e39 5" stroke="red"/>"#,
        r#"<rect width="1e30" height="1" stroke="red" stroke-dasharray="1"/>"#,
        r#"<g transform="scale(1e5)"><g transform="scale(1e5)"><path d="M0 0h9" stroke="red"/></g></g>"#,
    ] {
        let refused = read(&page(body), false).unwrap_err();
        assert!(refused.contains("has lines beyond 100 sheets: check the view box"), "{refused}");
    }
}
