//! The programs of `cellwire run laser`: read, drawn and refused by a dry run.

use std::fs;
use std::process::Command;

use serde_json::Value;

/// The feed of a program is not sent by the default words.
const NOT_CARRIED: [&str; 2] = ["--allow", "not-carried"];

/// Returns the printed lines of a dry run, and its drawing. `more` are additional arguments.
fn dry_run(name: &str, program: &str, more: &[&str]) -> (Option<i32>, String, String, String) {
    let folder = tempfile::tempdir().unwrap();
    let (file, drawing) = (folder.path().join(name), folder.path().join("plan.svg"));
    fs::write(&file, program).unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_cellwire"))
        .args(["run", "laser", file.to_str().unwrap(), "--dry-run", "--picture", drawing.to_str().unwrap()])
        .args(more)
        .output()
        .unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    let svg = fs::read_to_string(drawing).unwrap_or_default();
    (output.status.code(), text(output.stdout), text(output.stderr), svg)
}

#[test]
fn a_dry_run_says_and_draws_what_would_happen() {
    let gcode = "%\nG21 G90\nG0 X10 Y10\nM3\nG1 X20 F600\nY20\nG2 X30 Y30 I10 J0\nM5\nG91 G0 X-30 Y-30\nM30\nG0 X999\n";
    let (code, line, said, svg) = dry_run("part.nc", gcode, &NOT_CARRIED);
    assert_eq!((code, said.as_str()), (Some(0), ""));
    let line: Value = serde_json::from_str(&line).unwrap();
    let mm = &line["mm"];
    assert_eq!(
        (&mm["least"], &mm["most"]),
        (&serde_json::json!([0.0, 0.0]), &serde_json::json!([30.0, 30.0]))
    );
    assert_eq!(line["not_carried"], serde_json::json!(["f"]));
    // The arc in chords of at most 0.05 mm beside it: 2 acos(1 - 0.05 / 10) of a quarter.
    assert_eq!((&line["instructions"], &line["frames"]), (&(4 + 8).into(), &2.into()));
    assert!(
        svg.contains("stroke=\"black\"")
            && ["cut", "moved", "30", "start"].iter().all(|label| svg.contains(label)),
        "{svg}"
    );

    let drawing = |body: &str| {
        format!(
            r#"<svg xmlns="http://www.w3.org/2000/svg" width="60mm" height="30mm" viewBox="0 0 60 30">{body}</svg>"#
        )
    };
    let path = r#"<path d="M0 30 H 40 A 10 10 0 0 0 40 10" fill="none" stroke="black"/>"#;
    let (code, found, said, svg) = dry_run("part.svg", &drawing(path), &[]);
    assert_eq!((code, said.as_str()), (Some(0), ""));
    let found: Value = serde_json::from_str(&found).unwrap();
    let mm = &found["mm"];
    assert_eq!(
        (&mm["least"], &mm["most"]),
        (&serde_json::json!([0.0, 0.0]), &serde_json::json!([50.0, 20.0]))
    );
    assert_eq!(
        (&found["instructions"], &found["not_carried"]),
        (&(1 + 1 + 16).into(), &serde_json::json!([]))
    );
    assert!(svg.contains("stroke=\"black\""), "{svg}");
    let text = format!("{path}<text>hello</text>");
    let (code, _, said, _) = dry_run("part.svg", &drawing(&text), &[]);
    assert_eq!(code, Some(2));
    assert!(said.contains("has 1 text (line 1): convert them to paths"), "{said}");
}

#[test]
fn a_dxf_drawing_is_refused_with_the_command_that_converts_it() {
    for (name, content) in [
        ("part.dxf", "hello\n"),
        ("part.DXF", ""),
        ("part.nc", "  0\nSECTION\n  2\nHEADER\n"),
        ("part.nc", "\u{feff}0\r\nSECTION\r\n"),
        ("part.svg", "999\nwritten by a CAD program\n  0\nSECTION\n"),
        ("part", "AutoCAD Binary DXF\r\n\u{1a}\0"),
    ] {
        let (code, found, said, _) = dry_run(name, content, &[]);
        assert_eq!((code, found.as_str()), (Some(2), ""), "{name}: {said}");
        let [begin, end] =
            [said.find(name), said.find(" is a DXF drawing: convert it with `python3 dxf-to-svg.py ")];
        assert!(begin < end && said.lines().count() == 1, "{name}: {said}");
    }
}

/// Words that set the defaults of other controllers, at the beginning and at the end.
#[test]
fn words_without_an_effect_are_read() {
    let plain = "M3\nG1 X1\nG2 X11.0014 R5\nM5\n";
    let lines = [
        "G17 G21 G40 G49 G54 G69 G80 G90 G91.1 G94 G98",
        "M8",
        "M7",
        "G4 P0",
        "M3",
        "G1 X1",
        "G2 X11.0014 R5",
        "G4 P0",
        "M9",
        "M5",
        "G40 G80 M30",
    ];
    let (_, expected, ..) = dry_run("part.nc", plain, &[]);
    for end in ["\n", "\r\n"] {
        let (code, found, said, _) = dry_run("part.nc", &lines.join(end), &[]);
        assert_eq!((code, said.as_str()), (Some(0), ""));
        let without_name = |line: &str| line.split_once(",").unwrap().1.to_owned();
        assert_eq!(without_name(&found), without_name(&expected));
    }
    let (_, arc, ..) = dry_run("part.nc", "M3\nG1 X1\nG2 X11.0014 I5\nM5\n", &[]);
    assert!(arc.contains("\"most\":[11.001,5.0]"), "{arc}");
}

#[test]
fn values_that_the_words_of_the_plant_do_not_carry_are_refused() {
    let (code, line, said, _) = dry_run("part.nc", "M3\nG1 X1 F100\nG1 X2 S20\n", &[]);
    assert_eq!((code, line.as_str()), (Some(2), ""));
    let expected = "line 2: the robot does not get F; send it with --set 'program.values=[\"x\",\"y\",\"z\",\"a\",\"b\",\"length\",\"f\",\"s\"]'";
    assert!(said.contains(expected) && said.contains("--allow not-carried"), "{said}");
    let carried = ["--set", "program.values=[\"x\",\"y\",\"f\",\"s\"]"];
    let (code, _, said, _) = dry_run("part.nc", "M3\nG1 X1 F100 S1\nG1 X2 S20\n", &carried);
    assert_eq!((code, said.as_str()), (Some(0), ""));
    for (program, expected) in [
        ("M3 S1\nG0 X1\nG1 X2\n", "line 3: a cut without a feed rate: give F first"),
        ("M3 F100\nG0 X1\nG1 X2\n", "line 3: a cut without a power: give S first"),
    ] {
        let (code, _, said, _) = dry_run("part.nc", program, &carried);
        assert!(code == Some(2) && said.contains(expected), "{said}");
    }
    // The run is refused for the same reason, before it opens the port.
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("part.nc");
    fs::write(&file, "M3\nG1 X1 F100\n").unwrap();
    let run = Command::new(env!("CARGO_BIN_EXE_cellwire"))
        .args(["run", "laser", file.to_str().unwrap(), "--serial", "nowhere"])
        .output()
        .unwrap();
    let said = String::from_utf8(run.stderr).unwrap();
    assert!(run.status.code() == Some(2) && said.contains("line 2: the robot does not get F"), "{said}");
}

#[test]
fn a_program_that_never_cuts_says_so() {
    let never = |program: &str| {
        let (code, _, said, _) = dry_run("part.nc", program, &[]);
        assert_eq!(code, Some(0), "{said}");
        said.contains(
            "never switches the laser on: no G1, G2 or G3 has M3 or M4 before it and a power above 0",
        )
    };
    assert!(never("G0 X1\nG1 X2\n"));
    assert!(never("M3\nG0 X1\nM5\nG1 X2\n"));
    assert!(never("M3\nG1 X2 S0\n"));
    assert!(!never("M3\nG1 X2\n"));
}

/// Laser software writes its travel as cuts without power.
#[test]
fn a_cut_without_power_is_a_move() {
    let cuts = |gcode: &str| {
        let (code, _, said, svg) = dry_run("part.nc", gcode, &NOT_CARRIED);
        let is_never = said.contains("part.nc never switches the laser on");
        assert_eq!((code, said.is_empty()), (Some(0), !is_never), "{said}");
        let is_cut = |line: &str| line.starts_with("<path") && line.contains("stroke=\"black\"");
        let cuts = svg.lines().any(|line| is_cut(line) && !line.contains("d=\"\""));
        assert_eq!(cuts, !is_never);
        cuts
    };
    let travel = "G21 G90\nM4 F600\nG1 X10 S0\nG1 Y10 S0\n";
    assert!(!cuts(travel));
    assert!(cuts(&travel.replace("Y10 S0", "Y10 S80")));
    assert!(cuts(&travel.replace(" S0", "")), "without S the plant's own power");
}

#[test]
fn a_program_that_is_not_understood_is_refused_with_its_line() {
    for (name, program, expected) in [
        ("a.csv", "cut,1,2\nfold,1,2\n", "line 2: `fold` is not a command word"),
        ("a.csv", "cut,1,two\n", "line 1: `two` is not a number"),
        ("a.csv", "0x0301\n", "line 1: 0x0301 is a query"),
        ("a.csv", "# nothing\n", "has no instructions"),
        ("a.csv", "cut,1e39\n", "line 1: number too large"),
        ("a.csv", "2305,1\n", "line 1: 0x0901 is not a command word"),
        ("a.csv", "cut,1,2\ncut,1,,3\n", "line 2: cell 3 is empty"),
        ("a.csv", "# x\nword,y,x\ncut,1,2\n", "line 2: column `y`, expected \"x\""),
        ("a.nc", "G0 X1\nG41 X2\n", "line 2: G41 is not supported"),
        ("a.nc", "M3 F100\nG2 X10 Y0 R2\n", "line 2: the ends of the arc are farther apart than 2 R"),
        ("a.nc", "G2 X10 Y0 I3\n", "line 1: the arc begins 3.000 mm and ends 7.000 mm from its centre"),
        ("a.nc", "X10\n", "line 1: coordinates without a preceding G0, G1, G2 or G3"),
        ("a.nc", "G1 X1 X2\n", "line 1: X is given twice"),
        ("a.nc", "G1 X1 F0\n", "line 1: F0 is not a valid feed"),
        ("a.nc", "M6 T1\n", "line 1: M6 is not supported"),
        ("a.nc", "M3\nG2 X10.11 R5\n", "line 2: the ends of the arc are farther apart than 2 R: 10.110 mm"),
        ("a.nc", "M3\nG2 X10.11 I5\n", "line 2: the arc begins 5.000 mm and ends 5.110 mm from its centre"),
        ("a.nc", "G2 X10 R5 I5\n", "line 1: R together with I or J"),
        (
            "a.nc",
            "G0 X1\n\nG1 X1 (open\nX2 (b)\n",
            "line 3: a comment begins with ( and has no ) in its line",
        ),
        ("a.nc", "G0 X1 (a (b) c\n", "line 1: a comment has a ( within it"),
        ("a.nc", "G0 X1\rY2\r", "line 1: a carriage return without a line feed"),
        ("a.nc", "%\nG0 X1\n%\n\nG0 X2\n", "line 5: text after the % that ends the program"),
        ("a.nc", "G0 X1 % Y2\n", "line 1: % is not alone in its line"),
        ("a.nc", "G0 X1\n/G0 X2\n", "line 2: a line that begins with / is optional"),
        ("a.nc", "G0 X1\nG429496730 X2\n", "line 2: G429496730 is not supported"),
        ("a.nc", "G0 X1\nM3 G90 G91\n", "line 2: G90 and G91 in one line are two words for the distances"),
        ("a.nc", "M3 M5 G1 X1\n", "line 1: M3 and M5 in one line are two words for the laser"),
        ("a.nc", "G20 G21\n", "line 1: G20 and G21 in one line are two words for the unit"),
        ("a.nc", "G1 G80\n", "line 1: G1 and G80 in one line are two words for the motion"),
        ("a.nc", "M2 M30\n", "line 1: M2 and M30 in one line are two words for the end"),
        ("a.nc", "M8 M9\n", "line 1: M8 and M9 in one line are two words for the coolant"),
        ("a.nc", "M3\nG1 X1\nG1 X2 M5\n", "line 3: M5 and a motion in one line"),
        ("a.nc", "G4 P1.5\n", "line 1: G4 P1.5 is a wait, for which the link has no command word"),
        ("a.nc", "G4 X0\n", "line 1: G4 without P"),
        ("a.nc", "G0 G4 P0 X1\n", "line 1: G4 and coordinates in one line"),
        ("a.nc", "G1 X1 P0\n", "line 1: P is only for G4"),
        ("a.nc", "G0 X1\nG80\nX2\n", "line 3: coordinates without a preceding G0"),
        ("a.nc", "G90.1\n", "line 1: G90.1 is not supported"),
        ("a.nc", "M4 S-1\n", "line 1: S-1 is not a valid power"),
        ("a.nc", "G1 X\n", "line 1: \"X\" is not followed by a number"),
        (
            "a.nc",
            "M6\nG0 X1\nG41\nG0 Y2\n",
            "line 1: M6 is not supported; M2, M3, M4, M5, M7, M8, M9 and M30 are\nline 3: G41",
        ),
        ("a.svg", "G0 X1\n", "a.svg is not an SVG file"),
        ("a.nc", " <svg", "a.nc is not an SVG file"),
    ] {
        let (code, _, said, _) = dry_run(name, program, &NOT_CARRIED);
        assert_eq!(code, Some(2), "{program:?}: {said}");
        // The cause follows the error.
        let said = said.replace("part.nc: ", "");
        assert!(said.contains(expected), "{program:?}: {said}");
    }
}
