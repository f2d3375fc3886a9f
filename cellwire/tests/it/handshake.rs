//! The software handshake of the graphics workstation, over a real pseudo-terminal, with a reader that shares no code with
//! the crates.

use std::time::{Duration, Instant};

use crate::real_time::in_real_time;
use crate::rig::pty::Pty;
use crate::rig::{FAST, Rig};

const ENQ: &[u8] = &[0x05];
const XON: &[u8] = &[0x11];
const XOFF: &[u8] = &[0x13];
/// Longer than a packet and an interval of requests take, on any machine.
const LONG: Duration = Duration::from_millis(1500);

struct Workstation {
    port: Pty,
    received: Vec<u8>,
}

impl Workstation {
    /// Takes what comes in that time.
    fn listen(&mut self, time: Duration) -> usize {
        let (before, end) = (self.received.len(), Instant::now() + time);
        while Instant::now() < end {
            let mut buffer = [0; 256];
            let length = self.port.read(Duration::from_millis(5), &mut buffer).unwrap_or(0);
            self.received.extend_from_slice(&buffer[..length]);
        }
        self.received.len() - before
    }

    /// Asks until this many requests were sent and the last packet is whole.
    fn ask(&mut self, least: usize) {
        for count in 1.. {
            self.port.write(ENQ);
            self.listen(Duration::from_millis(200));
            if self.received.ends_with(b"\n") && count >= least {
                return;
            }
        }
    }

    /// Takes what comes until it is so long; whole lines.
    fn wait(&mut self, enough: impl Fn(&[u8]) -> bool) {
        let end = Instant::now() + Duration::from_secs(30);
        while !enough(&self.received) {
            assert!(Instant::now() < end, "{:?}", String::from_utf8_lossy(&self.received));
            self.listen(Duration::from_millis(5));
        }
    }

    /// Returns the counts of the lines, each with a valid sum.
    fn counts(&self) -> Vec<u16> {
        let text = std::str::from_utf8(&self.received).unwrap();
        let line = |line: &str| {
            let (body, sum) = line.strip_prefix('$').unwrap().split_once('*').unwrap();
            let found = body.bytes().fold(0, |sum, byte| sum ^ byte);
            assert_eq!(format!("{found:02X}"), sum, "{line}");
            body.split(',').nth(1).unwrap().parse().unwrap()
        };
        assert!(text.is_empty() || text.ends_with("\r\n"), "{text:?}");
        text.split_terminator("\r\n").map(line).collect()
    }
}

#[test]
fn xoff_holds_a_packet_xon_lets_it_go_on_and_nothing_is_lost() {
    in_real_time(|| {
        let (port, path) = Pty::new();
        let mut workstation = Workstation { port: port.raw(), received: Vec::new() };
        let rig = Rig::with_input(23, &["--ball", "BALL"], &["--viewer", &path]);
        rig.controller.start(23);
        rig.arm();
        workstation.ask(3);
        // In the middle of a packet: a chip's worth follows at most, and one that is being written. On a busy machine the
        // whole packet may have left before the XOFF is seen: then the next one.
        let (mut before, mut whole) = (Vec::new(), 0);
        let is_cut = (0..10).any(|_| {
            before = workstation.counts();
            whole = workstation.received.len();
            workstation.port.write(ENQ);
            workstation.wait(|bytes| bytes.len() > whole);
            workstation.port.write(XOFF);
            let follows = workstation.listen(LONG);
            let is_cut = !workstation.received.ends_with(b"\n");
            assert!(!is_cut || follows <= 32, "{follows} bytes after XOFF");
            if !is_cut {
                workstation.port.write(XON);
            }
            is_cut
        });
        assert!(is_cut, "no packet stops at an XOFF");
        assert!((0..).zip(&before).all(|(count, seen)| count == *seen), "{before:?}");
        let part = workstation.received.len() - whole;
        rig.terminal.wait_for("viewer: XOFF");
        assert_eq!(workstation.listen(LONG), 0, "it holds");

        // Another XOFF holds it for longer. It asks again and again meanwhile, and is given the rest and one packet.
        workstation.port.write(XOFF);
        for _ in 0..100 {
            workstation.port.write(ENQ);
            workstation.listen(Duration::from_millis(5));
        }
        assert_eq!(workstation.received.len(), whole + part);
        workstation.port.write(XON);
        workstation.listen(LONG);
        let end = Instant::now() + Duration::from_secs(30);
        while rig.terminal.text().contains("XOFF") {
            assert!(Instant::now() < end, "{}", rig.terminal.text());
            workstation.listen(Duration::from_millis(20));
        }
        let after = workstation.counts();
        assert!((0..).zip(&after).all(|(count, seen)| count == *seen), "none is lost: {after:?}");
        let more = after.len() - before.len();
        assert!((2..=3).contains(&more), "the rest, and one for all requests: {more}");

        // Bytes of the handshake around requests are not requests.
        workstation.port.write(&[0x13, 0x05, 0x11]);
        workstation.wait(|bytes| bytes.iter().filter(|byte| **byte == b'\n').count() > after.len());
        workstation.counts();
    });
}

/// An XON that is lost silences the workstation for no longer than five seconds.
#[test]
fn an_xoff_without_an_xon_holds_for_five_seconds() {
    in_real_time(|| {
        let (port, path) = Pty::new();
        let mut workstation = Workstation { port: port.raw(), received: Vec::new() };
        let rig = Rig::with_input(23, &["--ball", "BALL"], &["--viewer", &path]);
        rig.controller.start(23);
        rig.arm();
        workstation.ask(1);
        let (before, since) = (workstation.received.len(), Instant::now());
        workstation.port.write(&[0x13, 0x05]);
        rig.terminal.wait_for("viewer: XOFF");
        workstation.wait(|bytes| bytes.len() > before && bytes.ends_with(b"\n"));
        let held = since.elapsed();
        assert!(held >= Duration::from_secs(5) && held < Duration::from_secs(10), "{held:?}");
        assert_eq!(
            workstation.counts().len(),
            workstation.counts().last().map_or(0, |last| usize::from(*last) + 1)
        );
    });
}

/// A workstation that never releases the line does not block the program: the arm stops, and the program ends.
#[test]
fn a_workstation_that_holds_its_line_delays_nothing() {
    in_real_time(|| {
        let (port, path) = Pty::new();
        let mut workstation = Workstation { port: port.raw(), received: Vec::new() };
        let mut rig = Rig::with_input(23, &["--ball", "BALL"], &["--viewer", &path]);
        workstation.port.write(&[0x13, 0x05, 0x05]);
        rig.controller.start(23);
        rig.push_until(FAST);
        rig.terminal.wait_for("viewer: XOFF");
        rig.terminal.press(b"q");
        let (status, took) = rig.wait_for_exit();
        assert_eq!(status.code(), Some(0));
        assert!(took < Duration::from_secs(10), "{took:?}");
        rig.terminal.assert_restored();
        assert_eq!(workstation.received, b"");
    });
}
