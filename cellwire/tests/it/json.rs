//! The output of `decode` and `encode`.

use std::io::Write as _;
use std::process::{Command, Stdio};

fn cellwire(args: &[&str], input: &str) -> String {
    let mut tool = Command::new(env!("CARGO_BIN_EXE_cellwire"))
        .args(args)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    tool.stdin.take().unwrap().write_all(input.as_bytes()).unwrap();
    let output = tool.wait_with_output().unwrap();
    assert!(output.status.success());
    String::from_utf8(output.stdout).unwrap()
}

/// The shortest text that is this float and no other of its type: not the digits of a wider type.
#[test]
fn a_float_is_printed_as_short_as_its_type_allows() {
    let floats = "1.7842632e-38,100.1,3.4028235e+38,1e-45,-0.0,16777216.0";
    let message = format!(r#"{{"items":[{{"i16":[257]}},{{"f32":[{floats}]}}]}}"#);
    let bytes = cellwire(&["encode", "laser-eb90"], &message);
    let lines = cellwire(&["decode", "laser-eb90"], &bytes);
    let length = bytes.split_whitespace().count();
    assert_eq!(lines, format!("{{\"offset\":0,\"length\":{length},\"message\":{message}}}\n"));
    assert_eq!(cellwire(&["encode", "laser-eb90"], &message), bytes);
}
