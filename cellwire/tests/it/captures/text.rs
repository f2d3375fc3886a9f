//! Captures that are texts: hex dumps and what strace writes.

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};

use super::make::{reply, request};

/// Returns the output of `cellwire`, its status, and its remarks.
fn cellwire(arguments: &str, file: &Path) -> (String, Option<i32>, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_cellwire"));
    command.args(arguments.split_whitespace()).arg(file).stdin(Stdio::null());
    let output = command.output().unwrap();
    let text = |bytes| String::from_utf8(bytes).unwrap();
    (text(output.stdout), output.status.code(), text(output.stderr))
}

/// Returns `c1` for the client's first message, `s1` for the server's.
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

/// Returns a dump of bytes, 16 per line, from this offset.
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
    assert!(table.contains("It is fanuc:"), "{table}");
    write("nothing of the kind\n");
    let (_, code, said) = cellwire("decode isra-ball --format hexdump", &file);
    assert!(code == Some(2) && said.contains("the input is not a hex dump"), "{said}");
}

#[test]
fn the_output_of_socat_is_read_in_both_directions() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("socat.txt");
    let block = |n: u8, way: &str, bytes: &[u8]| {
        let hex: String = bytes.iter().map(|byte| format!(" {byte:02x}")).collect();
        let length = bytes.len();
        format!("{way} 2026/11/29 10:00:0{n}.000206370  length={length} from=0 to={}\n{hex}\n", length - 1)
    };
    let blocks: String =
        (1..=3).flat_map(|n| [block(n, ">", &request(n)), block(n, "<", &reply(n))]).collect();
    let turned = blocks.replace('<', "-").replace('>', "<").replace("-", ">");
    fs::write(&file, turned).unwrap();
    assert_eq!(words("--from server", &file), "c1 s1 c2 s2 c3 s3");
    fs::write(&file, blocks).unwrap();
    assert_eq!(words("", &file), "c1 s1 c2 s2 c3 s3");
    let (table, code, said) = cellwire("identify", &file);
    assert_eq!(code, Some(0), "{table} {said}");
    assert!(table.contains("It is fanuc:"), "{table}");
}

/// The dumps of `hexdump`, `od` and `xxd`: read as the same bytes, or refused.
#[test]
fn the_dumps_of_other_programs_are_read_or_refused() {
    let folder = tempfile::tempdir().unwrap();
    let [data, text] = ["data", "dump.txt"].map(|name| folder.path().join(name));
    // The squeezed line of `*` is 16 bytes of three registers.
    fs::write(&data, [request(1), request(2), request(3), request(4), request(5)].concat()).unwrap();
    let bytes = "dump bytes with";
    for (program, refused) in [
        ("hexdump -C", None),
        ("od -t x1", None),
        ("od -A d -t x1", None),
        ("od -A x -t x1z", None),
        ("xxd", None),
        ("xxd -g 1 -c 8", None),
        ("hexdump", Some("line 1: words of two or four bytes, whose byte order the dump does not show")),
        ("hexdump -x", Some("line 1: words of two")),
        ("hexdump -b", Some("line 1: a dump of octal or decimal numbers or of characters")),
        ("hexdump -c", Some("line 1: a dump of octal")),
        ("hexdump -d", Some("line 1: a dump of octal")),
        ("od", Some("line 1: a dump of octal")),
        ("od -x", Some("line 1: words of two")),
        ("od -t x4", Some("line 1: words of two")),
        ("od -t u1", Some("line 1: a dump of octal")),
        ("xxd -b", Some("line 1: a dump of bits")),
        ("xxd -e", Some("line 1: words of two")),
    ] {
        let mut words_of = program.split(' ');
        let mut command = Command::new(words_of.next().unwrap());
        let Ok(output) = command.args(words_of).arg(&data).output() else {
            eprintln!("skipped: there is no {program}");
            continue;
        };
        fs::write(&text, output.stdout).unwrap();
        match refused {
            None => assert_eq!(words("", &text), "c1 c2 c3 c4 c5", "{program}"),
            Some(why) => {
                for command in
                    ["decode fanuc-hmi-modbus", "identify", "decode fanuc-hmi-modbus --format hexdump"]
                {
                    let (lines, code, said) = cellwire(command, &text);
                    assert_eq!((lines.as_str(), code), ("", Some(2)), "{program}: {said}");
                    assert!(said.contains(why) && said.contains(bytes), "{program}: {said}");
                }
            }
        }
    }
    fs::write(&text, "12:00:00.5 IP 10.0.0.1.5 > 10.0.0.2.502: Flags [P.]\n\t0x0000:  4500 0028\n").unwrap();
    let (_, code, said) = cellwire("decode fanuc-hmi-modbus", &text);
    assert!(code == Some(2) && said.contains("write them to a file with `tcpdump -w`"), "{said}");
}

#[test]
fn a_compressed_capture_is_refused_with_the_command_that_unpacks_it() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("day.pcap.gz");
    fs::write(&file, b"\x1F\x8B\x08\0\0\0\0\0\0\x03packed").unwrap();
    for command in ["decode fanuc-hmi-modbus", "decode fanuc-hmi-modbus --format pcap", "identify"] {
        let (_, code, said) = cellwire(command, &file);
        assert!(
            code == Some(2) && said.contains("compressed with gzip: unpack it first, as in `gzip -dc"),
            "{said}"
        );
    }
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
    for notation in ["-xx -y", "-x", "-tt -f", "-ttt -xx", "-f -tt -xx -yy", "-i -y", "-n -r"] {
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
        // Only the pseudo-terminal is likely to be a line, and its other end, which sends as a client.
        if notation.contains("-y") {
            let (lines, _, said) = cellwire("decode fanuc-hmi-modbus --format strace", &trace);
            let is_of_line = |line: &&str| {
                line.contains(&format!("descriptor {port}\""))
                    || line.contains(&format!("descriptor {port} "))
            };
            assert_eq!(lines.lines().filter(is_of_line).count(), 6, "{notation}: {lines} {said}");
            assert!(lines.lines().count() < 12, "{notation}: {lines}");
        }
    }
}
