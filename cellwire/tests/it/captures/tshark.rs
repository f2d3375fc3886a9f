//! The same captures read by tshark: the bytes of each direction, put together by another program.

use std::fs;
use std::process::Command;

use super::make::{reply, requests};

/// Returns the bytes that tshark puts together of the first TCP connection: the client's and the server's.
fn followed(file: &std::path::Path) -> [Vec<u8>; 2] {
    let output = Command::new("tshark")
        .args(["-n", "-q", "-o", "ip.defragment:TRUE", "-z", "follow,tcp,raw,0", "-r"])
        .arg(file)
        .output()
        .unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    let client = text.lines().any(|line| line.starts_with("Node 0: ") && line.ends_with(":40000"));
    let mut sides = [Vec::new(), Vec::new()];
    for line in text.lines() {
        let digits = line.trim();
        if digits.is_empty() || !digits.bytes().all(|byte| byte.is_ascii_hexdigit()) {
            continue;
        }
        let side = usize::from(line.starts_with('\t') == client);
        let pairs = digits.as_bytes().chunks(2).map(|pair| core::str::from_utf8(pair).unwrap());
        sides[side].extend(pairs.map(|pair| u8::from_str_radix(pair, 16).unwrap()));
    }
    sides
}

#[test]
fn tshark_puts_the_same_bytes_together() {
    if Command::new("tshark").arg("--version").output().is_err() {
        eprintln!("skipped: there is no tshark (apt-get install tshark)");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    for (name, capture) in super::complete() {
        let file = folder.path().join("capture");
        fs::write(&file, capture).unwrap();
        let [client, server] = followed(&file);
        assert_eq!(client, requests(1..=3), "{name}");
        assert_eq!(server, (1..=3).flat_map(reply).collect::<Vec<u8>>(), "{name}");
    }
}
