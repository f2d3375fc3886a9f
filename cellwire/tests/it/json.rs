//! The output of `decode` and `encode`.

use std::io::Write as _;
use std::process::{Command, Stdio};

fn cellwire(args: &[&str], input: &str) -> String {
    let (success, lines) = run(args, input);
    assert!(success);
    lines
}

fn run(args: &[&str], input: &str) -> (bool, String) {
    let mut tool = Command::new(env!("CARGO_BIN_EXE_cellwire"))
        .args(args)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    tool.stdin.take().unwrap().write_all(input.as_bytes()).unwrap();
    let output = tool.wait_with_output().unwrap();
    (output.status.success(), String::from_utf8(output.stdout).unwrap())
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

/// A stream has no flow control: recorded bytes are decoded as the reference states.
#[test]
fn xon_and_xoff_are_in_a_line_like_other_bytes() {
    let pose = cellwire(&["encode", "val2-viewer"], r#"{"count":0,"pose":[0,0,0,0,0,0,0,0,0,0,0,0]}"#);
    let (clean, lines) = run(&["decode", "val2-viewer", "--format", "hex"], &format!("05 11 13 {pose}"));
    assert!(!clean);
    let (noise, message) = lines.split_once('\n').unwrap();
    assert_eq!(noise, r#"{"offset":0,"length":3,"error":{"kind":"noise","length":3}}"#);
    assert!(message.starts_with(r#"{"offset":3,"length":36,"message":{"count":0,"#), "{message}");
}
