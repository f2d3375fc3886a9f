//! The end of a capture: of one that Wireshark reads, and of one that is written more slowly than bytes come.

use std::fs::File;
use std::io::{Read as _, Write as _};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::process::Command;
use std::thread;
use std::time::{Duration, Instant};

use cellwire::io::capture::{self, CaptureItem, Flow, Reading};

use crate::tool::{DEADLINE, Running, cellwire};

#[test]
fn a_tap_of_wireshark_ends_with_its_reader_and_frees_its_port() {
    for has_client in [false, true] {
        let (server, folder) = (TcpListener::bind("127.0.0.1:0").unwrap(), tempfile::tempdir().unwrap());
        let pipe = folder.path().join("pipe");
        assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
        let port = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
        let mut tap = cellwire(&format!(
            "extcap --extcap-interface cellwire --capture --fifo {} --listen {port} --connect {}",
            pipe.display(),
            server.local_addr().unwrap()
        ))
        .spawn()
        .unwrap();
        let mut reader = File::open(&pipe).unwrap();
        reader.read_exact(&mut [0; 28]).unwrap();
        let _client = has_client.then(|| {
            let client = TcpStream::connect(("127.0.0.1", port)).unwrap();
            server.accept().unwrap();
            client
        });
        drop(reader);
        let end = Instant::now() + DEADLINE;
        let status = loop {
            if let Some(status) = tap.try_wait().unwrap() {
                break status;
            }
            assert!(Instant::now() < end, "the tap outlives its reader");
            thread::sleep(Duration::from_millis(20));
        };
        let mut error = String::new();
        tap.stderr.take().unwrap().read_to_string(&mut error).unwrap();
        assert_eq!(
            (status.code(), error.contains("the capture has ended, and the tap with it")),
            (Some(0), true)
        );
        assert!(TcpStream::connect(("127.0.0.1", port)).is_err());
    }
}

/// How many bytes go through.
const FLOOD: u64 = 160 << 20;

#[test]
fn what_a_capture_lacks_is_a_gap_in_it_and_said_also_at_the_end() {
    let (server, folder) = (TcpListener::bind("127.0.0.1:0").unwrap(), tempfile::tempdir().unwrap());
    let file = folder.path().join("it.pcapng");
    let mut tap = Running::start(cellwire(&format!(
        "tap laser-eb90 --listen 127.0.0.1:0 --connect {} --capture {}",
        server.local_addr().unwrap(),
        file.display()
    )));
    let mut client = tap.connect();
    let mut device = server.accept().unwrap().0;
    let taken = thread::spawn(move || std::io::copy(&mut device, &mut std::io::sink()).unwrap());
    let piece = vec![0xEB; 1 << 20];
    for _ in 0..FLOOD >> 20 {
        client.write_all(&piece).unwrap();
    }
    client.shutdown(Shutdown::Write).unwrap();
    assert_eq!(taken.join().unwrap(), FLOOD);
    assert_eq!(tap.signal("-INT"), Some(130));
    let said = tap.rest().iter().rev().find_map(|line| {
        let (_, lacks) = line.split_once(" lacks ")?;
        lacks.split_once(" bytes so far").and_then(|(count, _)| count.parse::<u64>().ok())
    });
    let (mut kept, mut first, mut next) = (0, 0, 0);
    capture::read(Box::new(File::open(&file).unwrap()), &Reading::default(), |found| {
        if let CaptureItem::Packet(packet) = found
            && matches!(packet.flow, Flow::Tcp(_, to) if to == server.local_addr().unwrap())
        {
            let segment = packet.segment.unwrap();
            if segment.opens {
                first = segment.sequence;
            }
            kept += packet.payload.len() as u64;
            next = segment.sequence.wrapping_add(u32::try_from(packet.payload.len()).unwrap());
        }
        Ok(())
    })
    .unwrap();
    assert_eq!(kept + said.unwrap_or_default(), FLOOD);
    // The last packet has the number of the end, even if the packets before it are missing.
    assert!(matches!(u64::from(next.wrapping_sub(first)) - FLOOD, 0 | 1), "{first} {next}");
}
