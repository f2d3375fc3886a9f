//! Numbers of any length are read as Rust reads them, and are written in the columns of controllers.

use fanuc_ls::{Axis, AxisName, AxisUnit, Document, Group, Operation, Position, Program, Rules};

/// Returns the value of a position's only joint, with this text before its unit.
fn read(columns: &str) -> Option<f64> {
    let text =
        format!("/PROG  A\n/MN\n/POS\nP[1]{{\n   GP1:\n\tUF : 0, UT : 1,\t\n\tJ1={columns} deg\n}};\n/END\n");
    Document::decode(&text).unwrap().positions().next()?.groups[0].axes[0].value
}

/// Returns the same for the decimal numbers that a position may have: an optional sign, digits, and a point somewhere.
fn expected(columns: &str) -> Option<f64> {
    let text = columns.trim_matches(' ');
    let digits = text.strip_prefix(['-', '+']).unwrap_or(text);
    let is_number = digits.bytes().all(|byte| byte.is_ascii_digit() || byte == b'.');
    text.parse().ok().filter(|_| is_number)
}

#[test]
fn a_number_of_every_length_is_the_nearest_one() {
    let digits = "9007199254740993";
    for sign in ["", "-", "+"] {
        for whole in 0..=10 {
            for decimals in 0..=16 {
                for point in ["", "."] {
                    let decimals = if point.is_empty() { "" } else { &digits[..decimals] };
                    let text = format!("{sign}{}{point}{decimals}", &digits[..whole]);
                    for columns in [format!("{text:>10}"), format!(" {text}"), text] {
                        assert_eq!(read(&columns), expected(&columns), "{columns:?}");
                    }
                }
            }
        }
    }
    // Sixteen digits are more than are exact.
    for last in 0..1000 {
        let text = format!("9.007199254740{last:03}");
        assert_eq!(read(&text), expected(&text), "{text}");
    }
}

#[test]
fn every_number_of_a_controllers_columns_is_read_and_nothing_else() {
    let columns =
        ["  1234.567", "  2246.802", "   -12.345", "      .500", "     -.125", "     0.000", "  ABCD.EFG"];
    for columns in columns {
        assert_eq!(read(columns), expected(columns), "{columns:?}");
        for at in 0..columns.len() {
            for other in (0x20..0x7F).map(char::from).filter(|it| !"{}[]';*".contains(*it)) {
                let mut text = columns.to_owned();
                text.replace_range(at..=at, other.encode_utf8(&mut [0; 4]));
                assert_eq!(read(&text), expected(&text), "{text:?}");
            }
        }
    }
}

#[test]
fn no_control_character_is_a_point() {
    assert!(Operation::decode("R[1]=1.5+R[200]").is_some());
    for control in (0x00..0x20).map(char::from).filter(|it| !it.is_whitespace()) {
        assert_eq!(Operation::decode(&format!("R[1]=1{control}5+R[200]")), None, "{control:?}");
    }
}

/// Returns the text of a joint's value.
fn written(value: f64) -> String {
    let axis = Axis { name: AxisName::J(1), value: Some(value), unit: AxisUnit::Deg };
    let group =
        Group { number: 1, user_frame: Some(0), user_tool: Some(1), configuration: None, axes: vec![axis] };
    let position = Position { number: 1, name: None, groups: vec![group] };
    let program = Program { name: "A".into(), positions: vec![position], ..Program::default() };
    let text = program.to_text(&Rules::default()).unwrap();
    let (_, behind) = text.split_once("J1=").unwrap();
    behind.split_once(" deg").unwrap().0.to_owned()
}

#[test]
fn a_value_has_three_decimals_in_ten_columns_and_no_zero_before_its_point() {
    for (value, text) in [
        (0.0, "     0.000"),
        (0.5, "      .500"),
        (-0.125, "     -.125"),
        (7.0, "     7.000"),
        (-1234.567, " -1234.567"),
        (12345.678, " 12345.678"),
        (-12345.678, "-12345.678"),
        (123_456.789, "123456.789"),
        (-123_456.789, "-123456.789"),
        (1e12, "1000000000000.000"),
        (1e15 + 0.125, "1000000000000000.125"),
        (0.0625, "     .0625"),
    ] {
        assert_eq!(written(value), text);
    }
    for thousandths in 1..2000 {
        let value = f64::from(thousandths) / 1000.0;
        let text = format!("{value:.3}");
        let text = text.strip_prefix('0').unwrap_or(&text);
        assert_eq!(written(value), format!("{text:>10}"));
        assert_eq!(written(-value), format!("{:>10}", format!("-{text}")));
    }
}
