//! Captures that are texts: hex dumps and what strace writes.

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};

use super::make::{reply, request};

/// What `cellwire` prints, its status, and what it said.
fn cellwire(arguments: &str, file: &Path) -> (String, Option<i32>, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_cellwire"));
    command.args(arguments.split_whitespace()).arg(file).stdin(Stdio::null());
    let output = command.output().unwrap();
    let text = |bytes| String::from_utf8(bytes).unwrap();
    (text(output.stdout), output.status.code(), text(output.stderr))
}

/// `c1` for the client's first message, `s1` for the server's.
fn words(arguments: &str, file: &Path) -> String {
    let (lines, code, said) = cellwire(&format!("decode fanuc-hmi-modbus {arguments}"), file);
    let word = |line: &str| {
        let line: serde_json::Value = serde_json::from_str(line).unwrap();
        match line.get("error") {
            None => format!("{}{}", &line["from"].as_str().unwrap()[..1], line["message"]["transaction"]),
            Some(error) => error["kind"].as_str().unwrap().to_owned(),
        }
    };
    let words: Vec<String> = lines.lines().map(word).collect();
    let is_clean = words.iter().all(|word| word.len() == 2);
    assert_eq!(code, Some(if is_clean { 0 } else { 1 }), "{words:?} {said}");
    words.join(" ")
}

/// A dump of bytes, 16 a line, from this offset.
fn dump(offset: usize, indent: &str, bytes: &[u8]) -> String {
    let line = |(n, line): (usize, &[u8])| {
        let hex: Vec<String> = line.iter().map(|byte| format!("{byte:02x}")).collect();
        format!("{indent}{:08x}  {:<48}  ........\n", offset + 16 * n, hex.join(" "))
    };
    bytes.chunks(16).enumerate().map(line).collect()
}

#[test]
fn a_dump_is_read_in_both_directions() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("dump.txt");
    let write = |text: &str| fs::write(&file, text).unwrap();
    // As Wireshark writes a stream that it follows.
    let stream: String = (0..3_usize)
        .flat_map(|n| {
            let transaction = n as u8 + 1;
            [dump(12 * n, "", &request(transaction)), dump(11 * n, "    ", &reply(transaction))]
        })
        .collect();
    write(&stream);
    assert_eq!(words("--format hexdump", &file), "c1 s1 c2 s2 c3 s3");
    // As text2pcap takes packets with their direction.
    let packets: String = (1..=3)
        .flat_map(|n| {
            [format!("O\n{}", dump(0, "", &request(n))), format!("I 10:00:0{n}\n{}", dump(0, "", &reply(n)))]
        })
        .collect();
    write(&packets);
    assert_eq!(words("--format hexdump", &file), "c1 s1 c2 s2 c3 s3");
    // The end that was recorded is the server.
    let turned = packets.replace('O', "o").replace('I', "O").replace('o', "I");
    write(&turned);
    assert_eq!(words("--format hexdump --from server", &file), "c1 s1 c2 s2 c3 s3");
    write(&dump(0, "", &[request(1), request(2)].concat()));
    assert_eq!(words("--format hexdump", &file), "c1 c2");
    write(&stream);
    let (table, code, said) = cellwire("identify --format hexdump", &file);
    assert_eq!(code, Some(0), "{table} {said}");
    assert!(table.contains("fanuc-hmi-modbus"), "{table}");
    write("nothing of the kind\n");
    let (_, code, said) = cellwire("decode isra-ball --format hexdump", &file);
    assert!(code == Some(2) && said.contains("the input is not a hex dump"), "{said}");
}

#[test]
fn text2pcap_reads_the_same_of_a_dump() {
    if Command::new("text2pcap").arg("--version").output().is_err() {
        eprintln!("skipped: there is no text2pcap (apt-get install tshark)");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let [text, pcap] = ["dump.txt", "dump.pcap"].map(|name| folder.path().join(name));
    let packets: String = (1..=9).map(|n| format!("# packet {n}\n{}", dump(0, "", &request(n)))).collect();
    fs::write(&text, packets).unwrap();
    let status = Command::new("text2pcap").args(["-q", "-l", "147"]).args([&text, &pcap]).status().unwrap();
    assert!(status.success());
    let messages = |arguments: &str, file| {
        let (lines, ..) = cellwire(&format!("decode fanuc-hmi-modbus {arguments}"), file);
        let message = |line: &str| serde_json::from_str::<serde_json::Value>(line).unwrap()["message"].take();
        lines.lines().map(message).collect::<Vec<_>>()
    };
    let theirs = messages("--format pcap", &pcap);
    assert_eq!((theirs.len(), &theirs), (9, &messages("--format hexdump", &text)));
}

/// A program that is traced while it reads a pseudo-terminal.
#[test]
fn a_program_is_read_through_strace() {
    let is_there =
        Command::new("strace").args(["-o", "/dev/null", "true"]).status().is_ok_and(|it| it.success());
    if !is_there {
        eprintln!("skipped: there is no strace, or it may not trace");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let trace = folder.path().join("trace.txt");
    let script = "import os, tty\n\
        (end, port) = os.openpty(); tty.setraw(port)\n\
        port = os.open(os.ttyname(port), os.O_RDWR)\n\
        for n in range(1, 4):\n    \
            os.write(port, bytes([0, n, 0, 0, 0, 6, 1, 3, 0, 0, 0, 1]))\n    \
            os.write(end, bytes([0, n, 0, 0, 0, 5, 1, 3, 2, 0, n]))\n    \
            os.read(port, 5)\n    \
            os.read(port, 100)\n";
    for notation in ["-xx -y", "-x", "-tt -f", "-ttt -xx"] {
        let mut command = Command::new("strace");
        command.args(notation.split(' ')).args(["-s", "4096", "-e", "trace=read,write,openat,close", "-o"]);
        let status = command.arg(&trace).args(["python3", "-c", script]).status().unwrap();
        assert!(status.success());
        let text = fs::read_to_string(&trace).unwrap();
        // The pseudo-terminal that the script reads is opened last.
        let opened = text.lines().rfind(|line| line.contains("openat(")).unwrap();
        let port = opened.rsplit("= ").next().unwrap();
        let port: String = port.chars().take_while(char::is_ascii_digit).collect();
        let read = words(&format!("--format strace --fd {port}"), &trace);
        assert_eq!(read, "c1 s1 c2 s2 c3 s3", "{notation}: {text}");
    }
}
