//! The tool's reading of captures: as many bytes as there are, once, in order, and a line for missing ones.
#![allow(clippy::cast_possible_truncation)]

mod make;
mod text;
mod trace;
mod tshark;
mod usb;

use core::time::Duration;
use std::fs;
use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};
use std::thread;
use std::time::Instant;

use make::*;
use serde_json::Value;

/// Runs `cellwire decode fanuc-hmi-modbus --format pcap`, with these bytes on standard input; returns the lines, the status and
/// the remarks.
fn decode(capture: &[u8], args: &[&str]) -> (Vec<Value>, Option<i32>, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_cellwire"));
    command.args(["decode", "fanuc-hmi-modbus", "--format", "pcap"]).args(args);
    command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    let mut stdin = child.stdin.take().unwrap();
    let capture = capture.to_vec();
    let writer = thread::spawn(move || drop(stdin.write_all(&capture)));
    let output = child.wait_with_output().unwrap();
    writer.join().unwrap();
    let lines = output.stdout.split(|byte| *byte == b'\n').filter(|line| !line.is_empty());
    let lines = lines.map(|line| serde_json::from_slice(line).unwrap()).collect();
    (lines, output.status.code(), String::from_utf8(output.stderr).unwrap())
}

/// Returns each line as a word: `c3` is the client's message of transaction 3, `s3` the server's; an error is its kind, with
/// the number of missing bytes.
fn words(lines: &[Value]) -> Vec<String> {
    let word = |line: &Value| match line.get("error") {
        None => format!("{}{}", &line["from"].as_str().unwrap()[..1], line["message"]["transaction"]),
        Some(error) => {
            let count = ["missing", "bytes", "length"].iter().find_map(|name| error.get(*name));
            let count = count.map_or_else(String::new, |count| format!("({count})"));
            format!("{}{count}", error["kind"].as_str().unwrap())
        }
    };
    lines.iter().map(word).collect()
}

fn read(capture: &[u8]) -> String {
    words(&decode(capture, &[]).0).join(" ")
}

/// Reads as [`read`] does segments in Ethernet.
fn read_tcp(segments: impl IntoIterator<Item = Vec<u8>>) -> String {
    read(&LITTLE.pcap(1, &whole(segments.into_iter().map(|segment| ethernet(&[], &v4(TCP, &segment))))))
}

/// Captures of the same connection with every kind of file, link and network, and of what happens to segments on their way.
/// Nothing is missing in any, and all are read in the same way by others.
fn complete() -> Vec<(&'static str, Vec<u8>)> {
    let plain = || connection(1..=3);
    let v4s = || plain().iter().map(|segment| v4(TCP, segment)).collect::<Vec<_>>();
    let v6s = || plain().iter().map(|segment| v6(TCP, segment)).collect::<Vec<_>>();
    let framed = |header: &[u8]| whole(v4s().iter().map(|ip| [header, ip].concat()));
    let ether = |tags: &[u16], ips: Vec<Vec<u8>>| whole(ips.iter().map(|ip| ethernet(tags, ip)));
    let ng = |form: Form| {
        let packets = ether(&[], v4s()).iter().flat_map(|frame| form.enhanced(0, frame)).collect();
        [form.section(), form.interface(1, 0), packets].concat()
    };
    let big = Form { is_big: true, is_nano: false };
    let mut swapped = ether(&[], v4s());
    swapped.swap(2, 4);
    let again: Vec<Vec<u8>> = v4s().iter().flat_map(|ip| [ip.clone(), ip.clone()]).collect();
    let (fragments, fragments_6) = (fragmented(false), fragmented(true));
    vec![
        ("Ethernet", LITTLE.pcap(1, &ether(&[], v4s()))),
        ("big-endian", big.pcap(1, &ether(&[], v4s()))),
        ("nanoseconds", Form { is_nano: true, ..LITTLE }.pcap(1, &ether(&[], v4s()))),
        ("nanoseconds, big-endian", Form { is_nano: true, is_big: true }.pcap(1, &ether(&[], v4s()))),
        ("IPv6", LITTLE.pcap(1, &ether(&[], v6s()))),
        ("802.1Q", LITTLE.pcap(1, &ether(&[0x8100], v4s()))),
        ("QinQ", LITTLE.pcap(1, &ether(&[0x88A8, 0x8100], v6s()))),
        ("RAW", LITTLE.pcap(101, &whole(v4s()))),
        ("RAW IPv6", LITTLE.pcap(229, &whole(v6s()))),
        ("NULL", LITTLE.pcap(0, &framed(&2u32.to_le_bytes()))),
        ("NULL, big-endian", big.pcap(0, &framed(&2u32.to_be_bytes()))),
        ("LOOP", LITTLE.pcap(108, &framed(&2u32.to_be_bytes()))),
        ("PPP", LITTLE.pcap(9, &framed(&[0xFF, 3, 0, 0x21]))),
        ("PPP, compressed", LITTLE.pcap(9, &framed(&[0x21]))),
        ("PPP in HDLC", LITTLE.pcap(50, &framed(&[0xFF, 3, 0, 0x21]))),
        ("Cisco HDLC", LITTLE.pcap(104, &framed(&[0x0F, 0, 8, 0]))),
        ("LINUX_SLL", LITTLE.pcap(113, &framed(&[0, 0, 0, 1, 0, 6, 2, 0, 0, 0, 0, 1, 0, 0, 8, 0]))),
        (
            "LINUX_SLL2",
            LITTLE.pcap(276, &framed(&[8, 0, 0, 0, 0, 0, 0, 2, 0, 1, 0, 6, 2, 0, 0, 0, 0, 1, 0, 0])),
        ),
        ("pcapng", ng(LITTLE)),
        ("pcapng, big-endian", ng(big)),
        ("pcapng, simple packets", {
            let packets = ether(&[], v4s()).iter().flat_map(|frame| LITTLE.simple(frame)).collect();
            [LITTLE.section(), LITTLE.interface(1, 0), packets].concat()
        }),
        ("pcapng, packets of the drafts", {
            let packets = ether(&[], v4s()).iter().flat_map(|frame| LITTLE.obsolete(0, frame)).collect();
            [LITTLE.section(), LITTLE.interface(1, 0), packets].concat()
        }),
        ("a second section of another byte order and link type", {
            let (first, second) = (ether(&[], v4s()[..4].to_vec()), whole(v4s()[4..].to_vec()));
            let first = first.iter().flat_map(|frame| LITTLE.enhanced(0, frame)).collect();
            let second = second.iter().flat_map(|frame| big.enhanced(0, frame)).collect();
            [LITTLE.section(), LITTLE.interface(1, 0), first, big.section(), big.interface(101, 0), second]
                .concat()
        }),
        ("interfaces of two link types", {
            let frames = v4s();
            let packets = frames.iter().enumerate().flat_map(|(index, ip)| match index % 2 {
                0 => LITTLE.enhanced(0, &(ethernet(&[], ip), ethernet(&[], ip).len())),
                _ => LITTLE.enhanced(1, &(ip.clone(), ip.len())),
            });
            [LITTLE.section(), LITTLE.interface(1, 0), LITTLE.interface(101, 0), packets.collect()].concat()
        }),
        ("retransmissions", LITTLE.pcap(1, &ether(&[], again))),
        ("reordering", LITTLE.pcap(1, &swapped)),
        ("fragments", LITTLE.pcap(1, &ether(&[], fragments))),
        ("fragments of IPv6", LITTLE.pcap(1, &ether(&[], fragments_6))),
    ]
}

/// Returns the requests in one segment, whose packet is in three fragments that come in another order; then the replies.
fn fragmented(is_v6: bool) -> Vec<Vec<u8>> {
    let ip = |segment: &[u8]| if is_v6 { v6(TCP, segment) } else { v4(TCP, segment) };
    let segment = tcp(CLIENT, SERVER, 1000, ACK, &requests(1..=3));
    let fragment = |at: usize, end: usize| {
        let (part, offset, more) = (&segment[at..end], (at / 8) as u16, end < segment.len());
        match is_v6 {
            true => v6_fragment(TCP, part, CLIENT, 77, offset, more),
            false => v4_fragment(TCP, part, CLIENT, 77, offset, more),
        }
    };
    let opened = connection([]);
    let replies: Vec<u8> = (1..=3).flat_map(reply).collect();
    vec![
        ip(&opened[0]),
        ip(&opened[1]),
        fragment(16, 40),
        fragment(40, segment.len()),
        fragment(0, 16),
        ip(&tcp(SERVER, CLIENT, 5000, ACK, &replies)),
    ]
}

#[test]
fn every_kind_of_capture_is_read_whole() {
    for (name, capture) in complete() {
        let (lines, code, said) = decode(&capture, &[]);
        let mut found = words(&lines);
        let of = |side: &str| found.iter().filter(|word| word.starts_with(side)).cloned().collect::<Vec<_>>();
        assert_eq!(of("c"), ["c1", "c2", "c3"], "{name}: {found:?} {said}");
        assert_eq!(of("s"), ["s1", "s2", "s3"], "{name}: {found:?} {said}");
        found.sort();
        assert_eq!((found.len(), code, said.as_str()), (6, Some(0), ""), "{name}: {found:?}");
    }
}

#[test]
fn what_overlaps_is_read_once() {
    let [a, b] = [requests(1..=2), requests(2..=3)];
    let segments = [tcp(CLIENT, SERVER, 1000, ACK, &a), tcp(CLIENT, SERVER, 1012, ACK, &b)];
    assert_eq!(read_tcp(segments), "c1 c2 c3");
    // The later part of a frame comes first, then more than what was missing.
    let all = requests(1..=3);
    let segment = |from: usize, to: usize| tcp(CLIENT, SERVER, 1000 + from as u32, ACK, &all[from..to]);
    assert_eq!(read_tcp([segment(0, 5), segment(20, 30), segment(3, 25), segment(28, 36)]), "c1 c2 c3");
}

/// A packet of one byte before the next one, of a connection whose beginning the capture lacks.
#[test]
fn a_keep_alive_before_the_first_data_is_not_data() {
    const PUSH: u8 = 8;
    let data = |n: u8| tcp(CLIENT, SERVER, 1000, ACK | PUSH, &request(n));
    let keep_alive = |flags| tcp(CLIENT, SERVER, 999, ACK | flags, &[0]);
    assert_eq!(read_tcp([keep_alive(0), keep_alive(0), data(1)]), "c1");
    let acknowledges = |next: u32| {
        let mut segment = tcp(SERVER, CLIENT, 5000, ACK, &[]);
        segment[8..12].copy_from_slice(&next.to_be_bytes());
        segment
    };
    assert_eq!(read_tcp([acknowledges(1000), keep_alive(PUSH), data(1)]), "c1");
    // A byte that is sent alone.
    let [first, rest] = [&request(1)[..1], &request(1)[1..]].map(<[u8]>::to_vec);
    let rest = tcp(CLIENT, SERVER, 1001, ACK | PUSH, &rest);
    for flags in [0, PUSH] {
        let first = tcp(CLIENT, SERVER, 1000, ACK | flags, &first);
        assert_eq!(read_tcp([acknowledges(1000), first, rest.clone()]), "c1");
    }
    let first = tcp(CLIENT, SERVER, 1000, ACK | PUSH, &first);
    assert_eq!(read_tcp([first, rest]), "c1");
}

#[test]
fn what_is_missing_is_a_line() {
    let mut segments = connection(1..=3);
    segments.remove(4); // the client's second
    let found = read_tcp(segments);
    assert_eq!(found, "c1 s1 s2 s3 gap(12) c3");
    // The rest of a frame is missing: its beginning and the next bytes are not one frame.
    let all = requests(1..=3);
    let segment = |from: usize, to: usize| tcp(CLIENT, SERVER, 1000 + from as u32, ACK, &all[from..to]);
    assert_eq!(read_tcp([segment(0, 17), segment(20, 36)]), "c1 cut gap(3) ".to_owned() + &resync());
    let late = [segment(0, 12), segment(24, 36)].into_iter().chain((0..300).map(|_| segment(24, 36)));
    assert_eq!(read_tcp(late), "c1 gap(12) c3");
    // Bytes from before the first that was captured.
    assert_eq!(read_tcp([segment(12, 24), segment(0, 12), segment(24, 36)]), "c2 before_start(12) c3");
}

/// Returns the decoder's lines for the last 4 bytes of a request and the next request.
fn resync() -> String {
    let bytes = [&request(2)[8..], &request(3)].concat();
    read_tcp([tcp(CLIENT, SERVER, 1, ACK, &bytes)])
}

#[test]
fn what_the_capture_cut_off_is_a_line() {
    let segments = connection(1..=3);
    let frames: Vec<Frame> = segments
        .iter()
        .enumerate()
        .map(|(index, segment)| {
            let frame = ethernet(&[], &v4(TCP, segment));
            let captured = if index == 4 { 54 + 7 } else { frame.len() };
            (frame, captured)
        })
        .collect();
    let (lines, code, _) = decode(&LITTLE.pcap(1, &frames), &[]);
    assert_eq!(words(&lines), ["c1", "s1", "cut", "cut_off(5)", "s2", "c3", "s3"]);
    assert_eq!(code, Some(1));
    assert_eq!(
        (&lines[3]["flow"], &lines[3]["offset"]),
        (&"10.0.0.2:40000 > 10.0.0.1:502".into(), &19.into())
    );
    // In the header, and in UDP.
    let frame = ethernet(&[], &v4(TCP, &segments[2]));
    let (lines, ..) = decode(&LITTLE.pcap(1, &[(frame, 40)]), &[]);
    assert_eq!(words(&lines), ["unreadable(26)"]);
    let frame = ethernet(&[], &v4(UDP, &udp(CLIENT, SERVER, &requests(1..=2))));
    let captured = frame.len() - 6;
    let (lines, ..) = decode(&LITTLE.pcap(1, &[(frame, captured)]), &[]);
    assert_eq!(words(&lines), ["c1", "cut", "cut_off(6)"]);
}

#[test]
fn fragments_without_the_rest_are_a_line() {
    let frames = fragmented(false);
    let without = |which: usize| {
        let mut frames = frames.clone();
        frames.remove(which);
        LITTLE.pcap(1, &whole(frames.iter().map(|ip| ethernet(&[], ip))))
    };
    for which in 2..=4 {
        let (lines, code, _) = decode(&without(which), &[]);
        let found = words(&lines);
        assert_eq!((found.join(" "), code), ("s1 s2 s3 fragments".into(), Some(1)));
        let error = &lines[3]["error"];
        assert_eq!((&error["source"], &error["identification"]), (&"10.0.0.2".into(), &77.into()));
        assert_eq!(error["why"], "the rest is not in the capture");
    }
    // One is cut off; more than are kept are begun.
    let mut cut = whole(frames.iter().map(|ip| ethernet(&[], ip)));
    cut[2].1 = 14 + 20 + 8;
    let (lines, ..) = decode(&LITTLE.pcap(1, &cut), &[]);
    assert_eq!(lines[0]["error"]["why"], "a fragment was cut off by the capture");
    let part = tcp(CLIENT, SERVER, 1000, ACK, &requests(1..=3));
    let begun = (0..200).map(|id| ethernet(&[], &v4_fragment(TCP, &part[..16], CLIENT, id, 0, true)));
    let (lines, ..) = decode(&LITTLE.pcap(1, &whole(begun)), &[]);
    assert_eq!(lines.len(), 200);
    assert_eq!(lines[0]["error"]["why"], "too many incomplete datagrams");
}

#[test]
fn a_second_connection_between_the_same_ports_is_another_one() {
    let first = connection(1..=2);
    let second: Vec<Vec<u8>> = connection(3..=4)
        .into_iter()
        .map(|mut segment| {
            segment[4] = 0x70; // far away
            segment
        })
        .collect();
    let frames = first.into_iter().chain(second).map(|segment| ethernet(&[], &v4(TCP, &segment)));
    let (lines, code, _) = decode(&LITTLE.pcap(1, &whole(frames)), &[]);
    assert_eq!(words(&lines), ["c1", "s1", "c2", "s2", "c3", "s3", "c4", "s4"]);
    assert_eq!(code, Some(0));
    assert_eq!((lines[3].get("connection"), &lines[4]["connection"]), (None, &2.into()));
    assert_eq!(lines[4]["offset"], 0);
}

#[test]
fn what_carries_no_bytes_is_counted() {
    let mut arp = ethernet(&[], &[0; 46]);
    arp[12..14].copy_from_slice(&[8, 6]);
    let ping = ethernet(&[], &v4(1, &[8, 0, 0, 0, 0, 0, 0, 0]));
    let mut frames: Vec<Vec<u8>> =
        connection([1]).iter().map(|segment| ethernet(&[], &v4(TCP, segment))).collect();
    frames.extend([arp.clone(), arp.clone(), ping]);
    let (lines, code, said) = decode(&LITTLE.pcap(1, &whole(frames)), &[]);
    assert_eq!((words(&lines).join(" "), code), ("c1 s1".into(), Some(0)));
    assert_eq!(said, "3 of 7 packets are neither TCP nor UDP: 2 ARP, 1 ICMP\n");
    let (lines, code, said) = decode(&LITTLE.pcap(1, &whole([arp])), &[]);
    assert_eq!((lines.len(), code), (0, Some(2)));
    assert!(said.contains("the capture has no TCP, UDP or serial bytes for fanuc"), "{said}");
}

#[test]
fn a_link_type_that_is_not_known_does_not_hide_the_others() {
    let frame = |segment: &[u8]| {
        let frame = ethernet(&[], &v4(TCP, segment));
        let length = frame.len();
        (frame, length)
    };
    let segments = connection([1]);
    let mut capture = [LITTLE.section(), LITTLE.interface(127, 0), LITTLE.interface(1, 0)].concat();
    for segment in &segments {
        capture.extend(LITTLE.enhanced(0, &frame(segment)));
        capture.extend(LITTLE.enhanced(1, &frame(segment)));
    }
    capture.extend(LITTLE.enhanced(5, &frame(&segments[0])));
    let (lines, code, said) = decode(&capture, &[]);
    assert_eq!((words(&lines).join(" "), code), ("link_type c1 s1 no_interface".into(), Some(1)));
    assert_eq!((&lines[0]["error"]["number"], &lines[0]["packet"]), (&127.into(), &1.into()));
    assert!(said.contains("4 link type 127"), "{said}");
}

#[test]
fn a_capture_that_ends_early_or_is_corrupt_keeps_what_was_read() {
    let frames = whole(connection(1..=2).iter().map(|segment| ethernet(&[], &v4(TCP, segment))));
    let capture = LITTLE.pcap(1, &frames);
    let (lines, code, _) = decode(&capture[..capture.len() - 10], &[]);
    assert_eq!(words(&lines), ["c1", "s1", "c2", "truncated(71)"]);
    assert_eq!(code, Some(1));
    let mut corrupt = capture.clone();
    let last = corrupt.len() - frames[5].0.len() - 16;
    corrupt[last + 8..last + 12].copy_from_slice(&[0xFF; 4]);
    assert_eq!(words(&decode(&corrupt, &[]).0), ["c1", "s1", "c2", "corrupt"]);
    let good = [LITTLE.section(), LITTLE.interface(1, 0), LITTLE.enhanced(0, &frames[2])].concat();
    for bad in [LITTLE.block(6, &[]), LITTLE.block(1, &[]), vec![6, 0, 0, 0, 13, 0, 0, 0, 0, 0, 0, 0, 0]] {
        assert_eq!(read(&[&good[..], &bad].concat()), "c1 corrupt");
    }
    let (_, code, said) = decode(b"this is not a capture, is it?", &[]);
    assert_eq!(code, Some(2));
    assert!(said.contains("the input is not a capture: neither pcap nor pcapng"), "{said}");
}

#[test]
fn a_port_reads_its_connections_only() {
    let other = tcp(CLIENT, 80, 1, ACK, b"GET / HTTP/1.1\r\n");
    let frames = connection([1]).into_iter().chain([other]).map(|segment| ethernet(&[], &v4(TCP, &segment)));
    let capture = LITTLE.pcap(1, &whole(frames));
    assert_ne!(decode(&capture, &[]).1, Some(0));
    let (lines, code, _) = decode(&capture, &["--port", "502"]);
    assert_eq!((words(&lines).join(" "), code), ("c1 s1".into(), Some(0)));
    let (_, code, said) = decode(&capture, &["--port", "503"]);
    assert_eq!(code, Some(2));
    assert!(said.contains("on port 503"), "{said}");
}

#[test]
fn more_connections_than_are_kept_lose_nothing() {
    // Each begins with half a request, and ends with the other half once all have begun: those that were forgotten say so.
    let half = |port: u16, from: usize, to: usize| {
        ethernet(&[], &v4(TCP, &tcp(port, SERVER, 1000 + from as u32, ACK, &request(1)[from..to])))
    };
    let capture = LITTLE.pcap(1, &whole((10_000..15_000).map(|port| half(port, 0, 12))));
    let (lines, code, _) = decode(&capture, &[]);
    assert_eq!((lines.len(), code), (5000, Some(0)));
    let all =
        (10_000..15_000).map(|port| half(port, 0, 5)).chain((10_000..15_000).map(|port| half(port, 5, 12)));
    let (lines, ..) = decode(&LITTLE.pcap(1, &whole(all)), &[]);
    let bytes: u64 = lines.iter().map(|line| line["length"].as_u64().unwrap()).sum();
    assert_eq!(bytes, 5000 * 12, "every byte is in a line");
}

#[test]
fn a_pipe_shows_each_line_at_once_however_it_is_cut() {
    let capture =
        LITTLE.pcap(1, &whole(connection([1]).iter().map(|segment| ethernet(&[], &v4(TCP, segment)))));
    let mut command = Command::new(env!("CARGO_BIN_EXE_cellwire"));
    command.args(["decode", "fanuc-hmi-modbus", "--format", "pcap"]);
    let mut child = command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
    let mut stdin = child.stdin.take().unwrap();
    let (sender, lines) = std::sync::mpsc::channel();
    let stdout = child.stdout.take().unwrap();
    let reader = thread::spawn(move || {
        use std::io::BufRead;
        std::io::BufReader::new(stdout).lines().for_each(|line| sender.send(line.unwrap()).unwrap());
    });
    for piece in capture.chunks(7) {
        stdin.write_all(piece).unwrap();
        stdin.flush().unwrap();
        thread::sleep(Duration::from_millis(1));
    }
    // The pipe stays open: both lines come nevertheless.
    for from in ["client", "server"] {
        let line: Value =
            serde_json::from_str(&lines.recv_timeout(Duration::from_secs(60)).unwrap()).unwrap();
        assert_eq!(line["from"], from);
    }
    drop(stdin);
    assert!(child.wait().unwrap().success());
    reader.join().unwrap();
}

#[test]
fn memory_does_not_grow_with_the_capture() {
    let peak = |packets: u32| {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("long.pcap");
        write_long(&file, packets);
        let mut child = Command::new(env!("CARGO_BIN_EXE_cellwire"))
            .args(["decode", "fanuc-hmi-modbus", "--format", "pcap", file.to_str().unwrap()])
            .stdout(Stdio::null())
            .spawn()
            .unwrap();
        let mut peak = 0;
        let begin = Instant::now();
        loop {
            let status = fs::read_to_string(format!("/proc/{}/status", child.id())).unwrap_or_default();
            let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:")).unwrap_or("0 kB");
            peak = peak.max(line.trim().trim_end_matches(" kB").parse::<u64>().unwrap());
            if let Some(status) = child.try_wait().unwrap() {
                assert!(status.success());
                return peak;
            }
            assert!(begin.elapsed() < Duration::from_secs(240));
            thread::sleep(Duration::from_millis(2));
        }
    };
    let (short, long) = (peak(20_000), peak(200_000));
    assert!(long < short + 4096, "{short} kB, then {long} kB");
}

/// Writes a capture of this many packets of one connection.
fn write_long(file: &Path, packets: u32) {
    let mut out = std::io::BufWriter::new(fs::File::create(file).unwrap());
    out.write_all(&LITTLE.pcap(1, &[])).unwrap();
    for n in 0..packets {
        let frame = ethernet(&[], &v4(TCP, &tcp(CLIENT, SERVER, 1000 + 12 * n, ACK, &request(n as u8))));
        let length = (frame.len() as u32).to_le_bytes();
        out.write_all(&[&[0; 8], &length[..], &length, &frame].concat()).unwrap();
    }
}
