use super::*;

const A4: Point = Point { x: 29700, y: 21000 };

fn picture_text(body: &str) -> String {
    format!(r#"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 297 210">{body}</svg>"#)
}

fn picture(body: &str) -> Result<Picture> {
    Picture::from_svg(picture_text(body).as_bytes(), A4, false).map(|(picture, _)| picture)
}

/// Returns the lines that are drawn, in mm.
fn drawn(body: &str) -> Vec<[i32; 4]> {
    let picture = picture(body).unwrap();
    let ends = |line: &Line| [line.from.x, line.from.y, line.to.x, line.to.y].map(|part| part / 100);
    let mut drawn: Vec<_> = picture.lines.iter().filter(|line| line.draws).map(ends).collect();
    drawn.sort_unstable();
    drawn
}

const LINE: &str = r#"<path d="M0 0 L 10 0" stroke="red"/>"#;

#[test]
fn dashes_are_lines_and_what_nobody_sees_is_none() {
    let dashed = r#"<path d="M0 5 L 40 5" stroke="red" stroke-dasharray="10 5"/>"#;
    assert_eq!(drawn(dashed), [[0, 5, 10, 5], [15, 5, 25, 5], [30, 5, 40, 5]]);
    let shifted = r#"<g transform="scale(2)"><path d="M0 5 L 20 5" stroke="red" stroke-dasharray="10" stroke-dashoffset="5"/></g>"#;
    assert_eq!(drawn(shifted), [[0, 10, 10, 10], [30, 10, 40, 10]]);
    for unseen in [
        r#"<path d="M0 5 L 40 50" fill="black"/>"#,
        r#"<path d="M0 5 L 40 50" stroke="red" stroke-opacity="0" fill="none"/>"#,
        r#"<path d="M0 5 L 40 50" stroke="red" visibility="hidden"/>"#,
        r#"<path d="M0 5 L 40 50" stroke="red" display="none"/>"#,
        r#"<g opacity="0"><path d="M0 5 L 40 50" stroke="red"/></g>"#,
        r#"<path d="M0 300 L 40 300 L 40 400" stroke="red"/>"#,
    ] {
        assert_eq!(drawn(&format!("{LINE}{unseen}")), [[0, 0, 10, 0]], "{unseen}");
    }
    // A line that leaves the view box ends there, and follows no edge of it.
    assert_eq!(
        drawn(r#"<path d="M280 10 L 310 10 L 310 50 L 280 50" stroke="red"/>"#),
        [[280, 10, 297, 10], [297, 50, 280, 50]]
    );
    let beyond = picture_text(r#"<path d="M280 10 L 310 10" stroke="red"/>"#);
    let (_, warnings) = Picture::from_svg(beyond.as_bytes(), A4, false).unwrap();
    assert_eq!(warnings, ["is cut off at the edge of its page"]);
}

#[test]
fn what_a_pen_cannot_follow_is_named_and_left_out_where_that_is_allowed() {
    let mask = r##"<mask id="m"><rect width="5" height="5" fill="white"/></mask><g mask="url(#m)"><path d="M0 1 L 9 1" stroke="red"/></g>"##;
    for (body, named) in [
        (r#"<text x="5" y="5">A</text><text>B</text>"#, "2 texts (line 1)"),
        (r##"<defs><text id="t">A</text></defs><use href="#t"/>"##, "1 text (line 1)"),
        (r#"<image href="x.png" width="9" height="9"/>"#, "1 image (line 1)"),
        (mask, "1 mask (line 1)"),
        (
            r#"<path d="M0 5 L 9 5" stroke="red" stroke-linecap="round" stroke-dasharray="0 2"/>"#,
            "1 line of dots (line 1)",
        ),
    ] {
        let text = picture_text(&format!("{LINE}{body}"));
        let refused = Picture::from_svg(text.as_bytes(), A4, false).unwrap_err().to_string();
        assert!(refused.starts_with(&format!("has {named}: convert them to paths")), "{refused}");
        let (picture, warnings) = Picture::from_svg(text.as_bytes(), A4, true).unwrap();
        assert_eq!(warnings, [format!("is drawn without {named}")]);
        assert!(picture.strokes() >= 1);
    }
    for nothing in [
        r#"<text> </text>"#,
        r#"<text display="none">A</text>"#,
        r#"<defs><text id="t">A</text></defs>"#,
        r#"<g style="display: none"><text>A</text></g>"#,
    ] {
        assert_eq!(drawn(&format!("{LINE}{nothing}")), [[0, 0, 10, 0]], "{nothing}");
    }
}

#[test]
fn the_built_in_picture_is_detailed_and_continuous() {
    let picture = Picture::built_in(A4).unwrap();
    assert!(picture.strokes() >= 2000, "{}", picture.strokes());
    assert!(picture.lines.windows(2).all(|w| w[0].to == w[1].from));
    assert!(picture.lines.windows(2).all(|w| w[0].draws || w[1].draws), "two moves in a row");
    assert!(picture.lines.iter().all(|l| l.from != l.to));
}

#[test]
fn a_square_is_a_move_and_four_lines() {
    let picture =
        picture(r#"<rect x="10" y="20" width="30" height="40" fill="none" stroke="red"/>"#).unwrap();
    let corner = |x, y| Point { x, y };
    let at = [corner(1000, 2000), corner(4000, 2000), corner(4000, 6000), corner(1000, 6000)];
    let line = |draws, from, to| Line { draws, from, to };
    assert_eq!(
        picture.lines,
        [
            line(false, corner(0, 0), at[0]),
            line(true, at[0], at[1]),
            line(true, at[1], at[2]),
            line(true, at[2], at[3]),
            line(true, at[3], at[0]),
        ]
    );
}

#[test]
fn a_curve_stays_within_the_tolerance() {
    let picture = picture(r#"<circle cx="100" cy="100" r="50" fill="none" stroke="red"/>"#).unwrap();
    assert!(picture.strokes() > 20);
    for line in picture.lines.iter().filter(|l| l.draws) {
        let middle = (f64::from(line.from.x + line.to.x) / 2.0, f64::from(line.from.y + line.to.y) / 2.0);
        let radius = (middle.0 - 10000.0).hypot(middle.1 - 10000.0);
        assert!((radius - 5000.0).abs() <= 7.0, "{radius}");
    }
}

#[test]
fn what_cannot_be_drawn_is_reported() {
    let error = |result: Result<Picture>| format!("{:#}", result.unwrap_err());
    assert!(error(picture("")).contains("has no outlines to draw"));
    assert!(
        error(Picture::from_svg(b"no svg", A4, false).map(|(picture, _)| picture))
            .starts_with("is not an SVG file")
    );
    let missing = Picture::from_file(Path::new("no/such.svg"), A4, false);
    assert!(error(missing).starts_with("cannot read the drawing no/such.svg"));
    let endless = Picture::from_file(Path::new("/dev/zero"), A4, false);
    assert_eq!(error(endless), "the drawing /dev/zero is larger than 32 MiB");
}

#[test]
fn no_drawing_is_too_large_to_be_refused() {
    let error = |text: &str| format!("{:#}", Picture::from_svg(text.as_bytes(), A4, false).unwrap_err());
    let svg =
        |head: &str, body: &str| format!(r#"<svg xmlns="http://www.w3.org/2000/svg" {head}>{body}</svg>"#);
    let curve = r#"<path d="M0 0 C 1 1 2 3 4 5" stroke="red"/>"#;
    let tiny = error(&svg(r#"viewBox="0 0 1e-30 1e-30""#, curve));
    assert!(tiny.starts_with("has a view box of 0.0"), "{tiny}");
    let far = r#"<path d="M0 0 C 1e30 1 2 3e30 4 5 A 1e20 1 0 0 0 1e19 5" stroke="red"/>"#;
    let far = error(&svg(r#"viewBox="0 0 297 210""#, far));
    assert_eq!(far, "has lines beyond 100 sheets: check the view box and the coordinates in line 1");
    let mut body = String::from(r#"<g id="a0"><path d="M0 0 L 9 9" stroke="red"/></g>"#);
    for level in 1..40 {
        let below = level - 1;
        body += &format!(r##"<g id="a{level}"><use href="#a{below}"/><use href="#a{below}"/></g>"##);
    }
    let laughs = error(&svg(r#"viewBox="0 0 297 210""#, &body));
    let refused =
        "has more than 1000000 elements, including those repeated by `use`, or is nested deeper than 256";
    assert_eq!(laughs, refused);
    let deep = "<g>".repeat(2000) + &"</g>".repeat(2000);
    assert_eq!(error(&svg(r#"viewBox="0 0 297 210""#, &deep)), refused);
}

#[test]
fn a_drawing_opens_no_other_file() {
    let folder = tempfile::tempdir().unwrap();
    let other = folder.path().join("other.svg");
    std::fs::write(&other, picture_text(r#"<path d="M0 0 L 9 9" stroke="red"/>"#)).unwrap();
    let image = format!(r#"<image href="{}" width="9" height="9"/>"#, other.display());
    assert!(format!("{:#}", picture(&image).unwrap_err()).contains("has 1 image (line 1): "));
}
