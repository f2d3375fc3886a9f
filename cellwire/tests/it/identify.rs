//! `cellwire identify`: every format that `decode` reads, its output and files, and its errors.

use std::fs;
use std::path::Path;

use crate::tool::{cellwire, run};
use serde_json::Value;

/// Messages of ALTER with one DLE and a negated sum, as hex.
fn alter(count: u16) -> String {
    let message = |segment: u16| {
        let data = [0x80, 2, u8::try_from(segment % 13).unwrap() + 1, 0, 0, 0x20];
        let sum = data.iter().fold(0_u8, |sum, byte| sum.wrapping_sub(*byte));
        let hex = |bytes: &[u8]| bytes.iter().map(|byte| format!("{byte:02X} ")).collect::<String>();
        format!("10 02 {}10 03 {sum:02X}\n", hex(&data))
    };
    (0..count).map(message).collect()
}

fn raw(hex: &str) -> Vec<u8> {
    hex.split_whitespace().map(|pair| u8::from_str_radix(pair, 16).unwrap()).collect()
}

fn identify(arguments: &str, file: &Path) -> (Option<i32>, String, String) {
    run(cellwire(&format!("identify {arguments} {}", file.display())))
}

fn option<'a>(line: &'a Value, name: &str) -> &'a Value {
    let options = line["findings"][0]["options"].as_array().unwrap();
    options.iter().find(|option| option["name"] == name).unwrap_or_else(|| panic!("{line}"))
}

#[test]
fn every_format_gives_the_same_options() {
    let folder = tempfile::tempdir().unwrap();
    let (hex, bytes) = (alter(20), raw(&alter(20)));
    let lines: String =
        hex.lines().enumerate().map(|(at, line)| format!("{line} # {at}.000 s sent\n")).collect();
    let trace = format!("# robot: interrupted\n{lines}").into_bytes();
    let mut capture: Vec<u8> =
        [0xA1B2_C3D4_u32, 0x0004_0002, 0, 0, 65_535, 147].iter().flat_map(|it| it.to_le_bytes()).collect();
    for line in hex.lines() {
        let data = raw(line);
        let length = u32::try_from(data.len()).unwrap();
        capture.extend([0, 0, length, length].iter().flat_map(|it| it.to_le_bytes()));
        capture.extend(data);
    }
    for (format, contents) in
        [("hex", hex.clone().into_bytes()), ("raw", bytes), ("pcap", capture), ("trace", trace)]
    {
        let file = folder.path().join(format);
        fs::write(&file, contents).unwrap();
        let (code, out, said) = identify(&format!("--format {format} --json"), &file);
        assert_eq!((code, said.as_str()), (Some(0), ""), "{format}: {out}");
        let line: Value = serde_json::from_str(&out).unwrap();
        assert_eq!(line["findings"][0]["link"], "alter", "{format}");
        assert_eq!(line["findings"][0]["messages"], 20, "{format}");
        assert_eq!(option(&line, "leading_dle")["value"], 1, "{format}");
        assert_eq!(option(&line, "negated_sum")["decided"], "bytes", "{format}");
        assert_eq!(
            option(&line, "stuffed_checksum")["message"],
            "a message whose checksum is 10h",
            "{format}"
        );
    }
}

#[test]
fn what_is_written_decodes_the_capture() {
    let folder = tempfile::tempdir().unwrap();
    let (file, settings) = (folder.path().join("a.hex"), folder.path().join("a.toml"));
    fs::write(&file, alter(20)).unwrap();
    let (code, out, said) = identify(&format!("--rust --write {}", settings.display()), &file);
    let written =
        format!("{} has the settings of alter: 2 settings undecided, see the comments\n", settings.display());
    assert_eq!((code, said), (Some(0), written));
    let module = "\
//! alter: the options that explain a capture.
//! stuffed_checksum is undecided: true explains the same; a message whose checksum is 10h would decide
//! ignore_spare_select is undecided: true explains the same; a reply whose select byte has bit 6 or 7 would decide

use val2_alter::{Framing, LeadingDle};

pub fn framing() -> Framing {
    Framing { leading_dle: LeadingDle::One, negated_sum: true, stuffed_checksum: false, ignore_spare_select: false }
}
";
    assert_eq!(out, module);
    let text = fs::read_to_string(&settings).unwrap();
    let undecided = "# stuffed_checksum is undecided: true explains the same; a message whose checksum is 10h would decide";
    assert!(text.contains(undecided) && text.contains("leading_dle = 1\n"), "{text}");
    let decode = format!("decode val2-alter --settings {} {}", settings.display(), file.display());
    let (code, out, _) = run(cellwire(&decode));
    assert_eq!((code, out.lines().count()), (Some(0), 20));
}

#[test]
fn what_no_link_explains_is_described() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("a.raw");
    let message = |at: u8| {
        let data = [0xAA, 0x55, at, at.wrapping_mul(37), at.wrapping_mul(91) ^ 0x35];
        let xor = data.iter().fold(0, |xor, byte| xor ^ byte);
        [data.as_slice(), &[xor]].concat()
    };
    fs::write(&file, (0..40).flat_map(message).collect::<Vec<u8>>()).unwrap();
    let (code, out, _) = identify("--format raw", &file);
    assert_eq!(code, Some(1));
    for text in
        ["messages of 6 bytes, begin with AA 55", "checked by: xor of 1 byte, at the end", "counter: byte 2"]
    {
        assert!(out.contains(text), "{text}: {out}");
    }
}

#[test]
fn what_is_asked_wrongly_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("a.hex");
    fs::write(&file, "").unwrap();
    let (code, _, said) = identify("", &file);
    assert_eq!((code, said.as_str()), (Some(2), "error: the input is empty\n"));
    fs::write(&file, alter(1)).unwrap();
    let settings = folder.path().join("x.toml");
    let (code, _, said) = identify(&format!("--write {}", settings.display()), &file);
    let why = format!("error: no result is certain enough to write {}\n", settings.display());
    assert_eq!((code, said, settings.exists()), (Some(2), why, false));
    let (code, _, said) = identify(&format!("--write {0} --draft {0}", settings.display()), &file);
    assert_eq!((code, said.as_str()), (Some(2), "error: --write and --draft name one file: give two\n"));
    let (code, out, said) = identify("--rust", &file);
    let why = "error: no result is certain enough to print as Rust\n";
    assert_eq!((code, out.as_str(), said.as_str()), (Some(2), "", why));
    let (code, _, said) = identify("--link val2-alter --from nobody", &file);
    assert_eq!(code, Some(2));
    assert!(said.contains("use --from robot or --from host"), "{said}");
}
