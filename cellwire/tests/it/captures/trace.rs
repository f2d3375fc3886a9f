//! The tool reads what `--trace` has written.

use core::time::Duration;
use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::process::{Command, Stdio};
use std::thread;
use std::time::Instant;

use serde_json::Value;

use super::make::request;

fn decode(link: &str, args: &[&str], text: &str) -> (Vec<Value>, Option<i32>, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_cellwire"));
    command.args(["decode", link, "--format", "trace"]).args(args);
    let mut child =
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    // A trace that is refused is not read to its end.
    let _ = child.stdin.take().unwrap().write_all(text.as_bytes());
    let output = child.wait_with_output().unwrap();
    let lines = output.stdout.split(|byte| *byte == b'\n').filter(|line| !line.is_empty());
    let lines = lines.map(|line| serde_json::from_slice(line).unwrap()).collect();
    (lines, output.status.code(), String::from_utf8(output.stderr).unwrap())
}

#[test]
fn a_trace_of_a_simulator_has_both_directions() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().to_str().unwrap();
    let mut device = Command::new(env!("CARGO_BIN_EXE_cellwire"))
        .args(["simulate", "fanuc", "--listen", "127.0.0.1:0", "--trace", "--trace-dir", path])
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut ready = String::new();
    BufReader::new(device.stdout.as_mut().unwrap()).read_line(&mut ready).unwrap();
    let ready: Value = serde_json::from_str(&ready).unwrap();
    let mut stream = TcpStream::connect(ready["listen"].as_str().unwrap()).unwrap();
    for transaction in 1..=2 {
        stream.write_all(&request(transaction)).unwrap();
        stream.read_exact(&mut [0; 11]).unwrap();
    }
    drop(stream);
    let (file, begin) = (folder.path().join("fanuc.trace"), Instant::now());
    while !file.exists() && begin.elapsed() < Duration::from_secs(60) {
        thread::sleep(Duration::from_millis(5));
    }
    thread::sleep(Duration::from_millis(50));
    let text = fs::read_to_string(&file).unwrap();
    device.kill().unwrap();
    device.wait().unwrap();
    let (lines, code, said) = decode("fanuc-hmi-modbus", &[], &text);
    assert_eq!((lines.len(), code, said.as_str()), (4, Some(0), ""), "{text}{lines:?}");
    for (line, (from, transaction)) in
        lines.iter().zip([("client", 1), ("server", 1), ("client", 2), ("server", 2)])
    {
        assert_eq!((&line["from"], &line["message"]["transaction"]), (&from.into(), &transaction.into()));
    }
    assert!(lines[0]["at"].as_f64().unwrap() <= lines[3]["at"].as_f64().unwrap());
    assert_eq!(lines[3]["offset"], 11);
}

#[test]
fn who_kept_it_is_its_name_or_told() {
    let text = "# x: the end\n00 01 00 00 00 06 01 03 # 0.001000 s sent\n00 00 00 01 # 0.002500 s sent\n";
    let (_, code, said) = decode("fanuc-hmi-modbus", &[], text);
    assert_eq!(code, Some(2));
    assert!(said.contains("give the end that wrote the trace, --from client or server"), "{said}");
    let (lines, code, _) = decode("fanuc-hmi-modbus", &["--from", "client"], text);
    assert_eq!((lines.len(), code), (1, Some(0)));
    assert_eq!((&lines[0]["from"], &lines[0]["at"]), (&"client".into(), &0.0025.into()));
    // The ball's poll is not a message.
    let ball = "# ball: the end\n05 # 0.001000 s received\n";
    let (lines, code, said) = decode("isra-ball", &[], ball);
    assert_eq!((lines.len(), code), (0, Some(0)));
    assert_eq!(said, "skipped 1 byte of the end that sends no messages\n");
}

#[test]
fn what_is_no_trace_names_the_line() {
    let said = |text: &str| {
        let (_, code, said) = decode("fanuc-hmi-modbus", &[], text);
        assert_eq!(code, Some(2), "{said}");
        said
    };
    assert!(said("EB 90\n").contains("line 1: not a trace"));
    for line in ["0 # 0.1 s sent", "00 01", "00 # 0.1 s both", "zz # 0.1 s sent", "00 # soon s sent"] {
        let said = said(&format!("# fanuc: the end\n\n{line}\n"));
        assert!(said.contains(&format!("line 3: not a line of a trace: {line}")), "{said}");
    }
}
