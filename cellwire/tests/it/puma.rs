//! `simulate puma` against a host that shares no code with it: the source's rules for interruptions, errors, ends, restarts and
//! both kinds of values. If a busy computer delays the host's answer too long, ALTER ends and begins again, and the expected
//! events come later.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};

use crate::real_time::in_real_time;
use crate::tool::{DEADLINE, Running};
use cellwire::io::priority::{self, ThreadRole};
use serde_json::Value;

const RUNNING: u8 = 0x80;
const STARTING: u8 = 0xA0;
const INTERRUPTED: u8 = 0xC0;
const ENDED: u8 = 0xE0;
const TIMEOUT: u8 = 6;
/// X, 1 mm a cycle or off the path.
const ONE: [u8; 4] = [0, 1, 32, 0];

/// A message of the robot.
#[derive(Debug, Clone, PartialEq)]
struct Message {
    /// The control byte.
    control: u8,
    /// Everything after it.
    data: Vec<u8>,
    /// The checksum is right.
    good: bool,
}

impl Message {
    fn is_motion(&self) -> bool {
        self.good && matches!(self.control & 0xF8, RUNNING | INTERRUPTED)
    }

    /// Returns the tool's X in 1/32 mm: the tenth word of the transformation.
    fn x(&self) -> i16 {
        i16::from_le_bytes([self.data[5 + 18], self.data[5 + 19]])
    }

    /// Status, number and percentage of the segment.
    fn segment(&self) -> (u8, u16, u16) {
        let word = |at: usize| u16::from_le_bytes([self.data[at], self.data[at + 1]]);
        (self.data[0], word(1), word(3))
    }
}

struct Host {
    robot: Running,
    stream: TcpStream,
    received: Vec<u8>,
    end: Instant,
}

impl Host {
    fn new(settings: &[&str]) -> Self {
        priority::raise(ThreadRole::Reply);
        let mut command = crate::tool::cellwire("simulate puma --listen 127.0.0.1:0 --set restart=100ms");
        for setting in settings {
            command.args(["--set", setting]);
        }
        let robot = Running::start(command);
        let stream = robot.connect();
        stream.set_nodelay(true).unwrap();
        Self { robot, stream, received: Vec::new(), end: Instant::now() + DEADLINE }
    }

    /// Reads the next message.
    fn message(&mut self) -> Message {
        loop {
            if let Some((message, length)) = unframe(&self.received) {
                self.received.drain(..length);
                return message;
            }
            assert!(Instant::now() < self.end, "what is waited for does not come");
            let mut buffer = [0; 256];
            let length = self.stream.read(&mut buffer).unwrap();
            assert!(length > 0, "the robot is gone");
            self.received.extend_from_slice(&buffer[..length]);
        }
    }

    /// Returns the next message, after a reply: to a start "accepted", to a standard message `reply`, and to a corrupt message as
    /// the source states: a start is asked for again, and other messages are not answered.
    fn exchange(&mut self, reply: &[u8]) -> Message {
        let message = self.message();
        match message.control & 0xE0 {
            STARTING if message.good => self.send(&[0]),
            STARTING => self.send(&[1]),
            RUNNING | INTERRUPTED if message.good => self.send(reply),
            _ => {}
        }
        message
    }

    /// Answers so until a message is what is asked for.
    fn until(&mut self, reply: &[u8], wanted: impl Fn(&Message) -> bool) -> Message {
        loop {
            let message = self.exchange(reply);
            if wanted(&message) {
                return message;
            }
        }
    }

    fn send(&mut self, data: &[u8]) {
        let mut frame = vec![0x10, 0x10, 0x02];
        for byte in data {
            frame.extend(if *byte == 0x10 { vec![0x10, 0x10] } else { vec![*byte] });
        }
        let sum = data.iter().fold(0u8, |sum, byte| sum.wrapping_add(*byte));
        frame.extend([0x10, 0x03, sum]);
        self.stream.write_all(&frame).unwrap();
    }
}

fn unframe(bytes: &[u8]) -> Option<(Message, usize)> {
    assert!(bytes.len() < 3 || bytes.starts_with(&[0x10, 0x10, 0x02]), "{bytes:02x?}");
    let (mut data, mut at) = (Vec::new(), 3);
    loop {
        match (*bytes.get(at)?, bytes.get(at + 1)) {
            (0x10, None) => return None,
            (0x10, Some(0x10)) => at += 1,
            (0x10, Some(0x03)) => break,
            (0x10, Some(other)) => panic!("10 {other:02x} inside of {bytes:02x?}"),
            _ => {}
        }
        data.push(bytes[at]);
        at += 1;
    }
    let sum = data.iter().fold(0u8, |sum, byte| sum.wrapping_add(*byte));
    let good = *bytes.get(at + 2)? == sum;
    Some((Message { control: data[0], data: data[1..].to_vec(), good }, at + 3))
}

/// Returns a script that repeats an incident so often that it happens at least once on a busy computer.
fn often(what: &str) -> String {
    let texts: Vec<String> = (1..20).map(|n| format!("\"{}ms {what}\"", 1500 * n - 1200)).collect();
    format!("script=[{}]", texts.join(","))
}

/// "10: ALTER unterbrochen" (§3.2.2): replies move nothing until the subroutine has returned, and then they do again.
#[test]
fn an_interruption_is_reported_and_the_arm_rests_in_it() {
    in_real_time(|| {
        let mut host = Host::new(&[&often("interrupt 250ms")]);
        loop {
            let before = host.until(&ONE, |message| message.control == INTERRUPTED);
            let mut rests = vec![before];
            let after = loop {
                let message = host.exchange(&ONE);
                if message.control != INTERRUPTED {
                    break message;
                }
                rests.push(message);
            };
            if after.control != RUNNING {
                continue;
            }
            // 250 ms are nine cycles.
            assert!((8..=10).contains(&rests.len()), "{}", rests.len());
            for rest in &rests {
                assert_eq!((rest.x(), rest.segment()), (rests[0].x(), rests[0].segment()));
            }
            assert_eq!(after.x(), rests[0].x());
            // The reply to the first message of a running ALTER.
            let next = host.exchange(&ONE);
            if next.control == RUNNING {
                assert_eq!(next.x(), after.x() + 32);
                break;
            }
        }
        let line = host.robot.line("\"script\"");
        assert!(line.contains("\"what\":\"interrupt 250ms\""), "{line}");
    });
}

/// §3: "Name einer Subroutine, die im Falle einer … Ausnahmebedingung abgearbeitet wird. Ist kein Name angegeben wird das
/// Programm … abgebrochen."
#[test]
fn an_exception_runs_the_subroutine_or_aborts_the_program() {
    in_real_time(|| {
        let mut host = Host::new(&["subroutine_time=250ms"]);
        loop {
            host.until(&[0, 0], |message| message.control == RUNNING);
            let first = host.exchange(&[0xFD, 0]);
            // The exception was in the reply to a running ALTER.
            let interrupted = host.exchange(&ONE);
            if (first.control, interrupted.control) != (RUNNING, INTERRUPTED) {
                continue;
            }
            let mut count = 1;
            let after = loop {
                let message = host.exchange(&ONE);
                if message.control != INTERRUPTED {
                    break message;
                }
                count += 1;
            };
            if after.control == RUNNING {
                assert!((8..=10).contains(&count), "{count}");
                assert_eq!(after.x(), interrupted.x());
                break;
            }
        }
        host.robot.line("\"closed\"");

        let mut host = Host::new(&["subroutine=false"]);
        loop {
            host.until(&[0, 0], |message| message.control == RUNNING);
            if host.exchange(&[0xFD, 0]).control == RUNNING {
                let end = host.message();
                assert!(end.good && end.data.is_empty(), "{end:?}");
                if end.control == ENDED {
                    break;
                }
                assert_eq!(end.control, ENDED | TIMEOUT);
            }
        }
        host.robot.line("\"code\":253");
        // The operator starts the program again.
        host.until(&[0, 0], |message| message.control == STARTING);
    });
}

/// §3.2.2: each code is in the message after the reply that had the error, and the arm has not moved by that. A reply that does
/// not come ends ALTER (§3.3.3).
#[test]
fn each_error_is_reported_in_the_next_message() {
    in_real_time(|| {
        let names = ["checksum", "format", "overflow", "incomplete", "mark"];
        for (code, name) in (1u8..).zip(names) {
            let mut host = Host::new(&[&often(&format!("misread {name}"))]);
            let mut before = host.until(&ONE, Message::is_motion);
            loop {
                let message = host.exchange(&ONE);
                if message.control == RUNNING | code {
                    assert_eq!(message.x(), before.x(), "{name}: the arm has moved");
                    break;
                }
                before = message;
            }
            let line = host.robot.line(&format!("\"error\":{code}"));
            assert!(line.contains("\"bad_reply\""), "{line}");
            // The next reply is good again.
            let next = host.exchange(&ONE);
            assert!(matches!(next.control & !7, RUNNING | ENDED), "{next:?}");
        }
        let mut host = Host::new(&[&often("misread timeout")]);
        let begin = Instant::now();
        while begin.elapsed() < Duration::from_secs(2) {
            let end = host.until(&ONE, |message| message.control & 0xE0 == ENDED);
            assert_eq!(end.control, ENDED | TIMEOUT);
        }
        host.robot.line("misread timeout");
        host.until(&ONE, |message| message.control == STARTING);
    });
}

/// A message that the host cannot read is not answered: that ends ALTER; a start message is asked for again (§3.3.1).
#[test]
fn a_corrupt_message_is_sent_again_at_the_start_and_ends_a_running_alter() {
    in_real_time(|| {
        let mut host = Host::new(&[&often("corrupt")]);
        host.until(&ONE, |message| !message.good && message.control == RUNNING);
        assert_eq!(host.message().control, ENDED | TIMEOUT);

        let texts: Vec<String> = (1..20).map(|n| format!("\"{n}s restart\",\"{n}s corrupt\"")).collect();
        let mut host = Host::new(&[&format!("script=[{}]", texts.join(","))]);
        host.until(&ONE, |message| !message.good && message.control == STARTING);
        let again = host.message();
        assert_eq!((again.control, again.good), (STARTING, true));
    });
}

#[test]
fn a_program_that_ends_says_so_and_one_that_is_restarted_does_not() {
    in_real_time(|| {
        let mut host = Host::new(&[&often("finish")]);
        host.until(&ONE, |message| message.control == ENDED);
        let measured: Value = serde_json::from_str(&host.robot.line("\"measured\"")).unwrap();
        let time = |name| measured["turn_around_ms"][name].as_f64().unwrap();
        // Ten bytes at 38400 baud take 2.6 ms; all of them kept the window.
        assert!(
            2.6 <= time("p50") && time("p50") <= time("p99") && time("p99") <= time("longest"),
            "{measured}"
        );
        assert!(time("longest") <= measured["window_ms"].as_f64().unwrap(), "{measured}");
        assert!(measured["replies"].as_u64().unwrap() > 0, "{measured}");
        host.until(&ONE, |message| message.control == STARTING);

        let mut host = Host::new(&[&often("restart")]);
        loop {
            let message = host.until(&ONE, |message| message.control & 0xE0 != STARTING);
            // The end that a busy machine has caused is one.
            if message.control == RUNNING && host.exchange(&ONE).control == STARTING {
                break;
            }
        }
        let first = host.until(&ONE, Message::is_motion);
        assert_eq!(first.segment(), (1, 1, 0), "no motion instruction yet, segments from 1");
    });
}

#[test]
fn the_segment_begins_with_1_and_has_the_status_that_is_set() {
    in_real_time(|| {
        let mut host = Host::new(&["script=[\"200ms status 9\"]"]);
        let first = host.until(&ONE, Message::is_motion);
        assert_eq!(first.segment(), (1, 1, 0));
        let second = host.exchange(&ONE);
        assert!(second.control & 0xE0 != RUNNING || second.segment().0 == 2, "{second:?}");
        let panic_stop = host.until(&ONE, |message| message.is_motion() && message.segment().0 == 9);
        assert!(panic_stop.segment().2 > 0);
        // A second has 36 cycles.
        host.until(&ONE, |message| message.is_motion() && message.segment().1 == 2);
    });
}

/// §3.1: "eine Auslenkung *auf* den gesendeten Wert. Ein Nullwert bewirkt die Rückkehr … auf die programmierte Bahn."
#[test]
fn a_value_of_the_non_cumulative_mode_is_an_offset_from_the_path() {
    in_real_time(|| {
        let mut host = Host::new(&["mode=22", &often("interrupt 150ms")]);
        // The path of an ALTER is where the arm was at its start.
        let (mut path, mut offset, mut held, mut kept) = (0, 0, 0, 0);
        let mut seen = [false; 4];
        let mut replies = [[0, 1, 64, 1].as_slice(), &[0, 0], &[0, 1, 0, 0]].into_iter().cycle();
        let mut reply: &[u8] = &[0, 0];
        while seen != [true; 4] {
            let sent = reply;
            let message = host.exchange(sent);
            match message.control {
                STARTING => (path, offset, held, reply) = (i16::MIN, 0, 0, &[0, 0]),
                RUNNING if path == i16::MIN => path = message.x(),
                RUNNING | INTERRUPTED => {
                    assert_eq!(message.x(), path + offset, "{message:?}");
                    let interrupted = message.control == INTERRUPTED;
                    seen[3] |= interrupted && offset == 320;
                    // Some cycles with each reply: to the offset, nothing selected, back.
                    held += i32::from(!interrupted);
                    if held % 5 == 0 {
                        reply = replies.next().unwrap();
                    }
                    seen[0] |= offset == 320;
                    // The second such message is after a reply that selects nothing.
                    kept = if !interrupted && offset == 320 && sent == [0, 0] { kept + 1 } else { 0 };
                    seen[1] |= kept == 2;
                    seen[2] |= seen[1] && offset == 0;
                }
                _ => {}
            }
            // The next message shows the effect of the reply to this one.
            if message.control == RUNNING {
                offset = match sent {
                    [_, 1, low, high] => i16::from_le_bytes([*low, *high]),
                    _ => offset,
                };
            }
        }
    });
}

#[test]
fn an_operator_who_never_starts_again_is_no_error() {
    in_real_time(|| {
        let mut host = Host::new(&["restart=never", "script=[\"100ms finish\"]"]);
        host.until(&ONE, |message| message.control & 0xE0 == ENDED);
        host.robot.line("\"ended\"");
        // It is still there.
        assert_eq!(host.robot.signal("-TERM"), Some(130));
    });
}
