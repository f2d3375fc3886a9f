//! The contents of the screen: counts, rates, times and the last messages.

use std::collections::{BTreeMap, VecDeque};
use std::time::{Duration, SystemTime};

use super::super::decoding::{DecodedEvent, Entry, UNKNOWN, hex};
use crate::io::samples::Samples;
use crate::io::tap::ConnectionTransport;
use cellwire_io::output::{self, counted};
use cellwire_links::shadow::{Complaint, Kind};

/// The number of the last lines that are kept.
const LINES: usize = 200;

/// A rate is that of the last this many seconds.
const WINDOW: usize = 5;

/// The limits of the bars, in microseconds: three for each factor of ten.
pub(super) const BARS: [u64; 16] = [
    100, 200, 500, 1000, 2000, 5000, 10_000, 20_000, 50_000, 100_000, 200_000, 500_000, 1_000_000, 2_000_000,
    5_000_000, 10_000_000,
];

/// Everything that is shown.
#[derive(Debug)]
pub(super) struct Board {
    pub(super) title: String,
    pub(super) began: SystemTime,
    pub(super) now: SystemTime,
    /// The connection that was opened last.
    pub(super) place: String,
    pub(super) open: u32,
    /// The state of the end's conversation.
    pub(super) state: String,
    pub(super) ends: BTreeMap<&'static str, EndBoard>,
    pub(super) errors: BTreeMap<String, u64>,
    /// The number of complaints, by kind, and the last one.
    pub(super) complaints: BTreeMap<&'static str, u64>,
    pub(super) complaint: Option<LineBoard>,
    /// The reason why messages are no longer decoded.
    pub(super) failure: Option<String>,
    /// The remarks of the tap itself, oldest first.
    pub(super) remarks: VecDeque<String>,
    pub(super) missed: u64,
    pub(super) lines: VecDeque<LineBoard>,
    /// The sender of the last message of a connection, and its time.
    last: BTreeMap<u32, (&'static str, SystemTime)>,
}

/// One end.
#[derive(Debug)]
pub(super) struct EndBoard {
    pub(super) messages: u64,
    pub(super) corrupt: u64,
    pub(super) bytes: u64,
    /// Messages of each of the last seconds, the newest last.
    seconds: VecDeque<u64>,
    /// The times from the other end's message to this end's.
    pub(super) answers: Samples,
    /// The numbers of answer times that are at most each of [`BARS`], and not below.
    pub(super) bars: [u64; BARS.len()],
}

/// A line of the last ones.
#[derive(Debug)]
pub(super) struct LineBoard {
    pub(super) at: SystemTime,
    pub(super) end: &'static str,
    pub(super) text: String,
    pub(super) is_wrong: bool,
}

impl Board {
    pub(super) fn new(title: &str, now: SystemTime) -> Self {
        Self {
            title: title.into(),
            began: now,
            now,
            place: "not connected".into(),
            open: 0,
            state: String::new(),
            ends: BTreeMap::new(),
            errors: BTreeMap::new(),
            complaints: BTreeMap::new(),
            complaint: None,
            failure: None,
            remarks: VecDeque::new(),
            missed: 0,
            lines: VecDeque::new(),
            last: BTreeMap::new(),
        }
    }

    pub(super) fn take(&mut self, entry: &Entry) {
        let Entry { at, connection, end, what } = entry;
        let (text, is_wrong) = match what {
            DecodedEvent::Opened(place) => {
                self.open += 1;
                self.place = match place {
                    ConnectionTransport::Tcp(a, b) | ConnectionTransport::Udp(a, b) => format!("{a} to {b}"),
                    ConnectionTransport::Ports([a, b]) => format!("{a} and {b}"),
                    ConnectionTransport::Line(port) => port.clone(),
                };
                return self.say(*at, UNKNOWN, format!("connection {connection}: {}", self.place), false);
            }
            DecodedEvent::Message { length, content, .. } => {
                self.count_message(*at, *connection, end, *length);
                (output::message(content), false)
            }
            DecodedEvent::Corrupt { error, clause, bytes, .. } => {
                let kind = error.get("kind").and_then(|kind| kind.as_str()).unwrap_or("?");
                let name = clause.map_or_else(|| kind.into(), |clause| format!("{kind} ({clause})"));
                *self.errors.entry(format!("{end}: {name}")).or_default() += 1;
                let board = self.end(end);
                board.corrupt += 1;
                board.bytes += bytes.len() as u64;
                (format!("{name} {}", hex(bytes)), true)
            }
            DecodedEvent::Wrong(Complaint { kind, clause, text, .. }) => {
                let name = match kind {
                    Kind::Rule => "rules broken",
                    Kind::Budget => "budgets missed",
                    Kind::Assumption => "assumptions wrong",
                };
                *self.complaints.entry(name).or_default() += 1;
                let text = format!("{text} ({clause})");
                self.complaint = Some(LineBoard { at: *at, end, text: text.clone(), is_wrong: true });
                (text, true)
            }
            DecodedEvent::Bytes(bytes) => {
                self.end(end).bytes += bytes.len() as u64;
                self.answer(*at, *connection, end);
                (hex(bytes), false)
            }
            DecodedEvent::Missed(missing) => {
                self.missed += missing;
                (format!("not captured: {}", counted(*missing, "byte")), true)
            }
            DecodedEvent::Closed(why) => {
                (format!("closed {}", why.as_deref().unwrap_or_default()), why.is_some())
            }
        };
        self.say(*at, end, text, is_wrong);
    }

    /// Messages can no longer be decoded.
    pub(super) fn fail(&mut self, why: &str) {
        self.failure = Some(format!("{why}: decoding stopped; bytes are still forwarded"));
    }

    /// Shows a remark about the tap itself, such as a server that does not answer, or a full disk.
    pub(super) fn remark(&mut self, text: String) {
        self.say(self.now, UNKNOWN, text.clone(), true);
        if self.remarks.len() == LINES {
            self.remarks.pop_front();
        }
        self.remarks.push_back(text);
    }

    pub(super) fn pass_time(&mut self, now: SystemTime) {
        let second = |at: SystemTime| at.duration_since(self.began).unwrap_or_default().as_secs();
        for _ in 0..(second(now) - second(self.now).min(second(now))).min(WINDOW as u64 + 1) {
            for end in self.ends.values_mut() {
                end.seconds.push_back(0);
                if end.seconds.len() > WINDOW + 1 {
                    end.seconds.pop_front();
                }
            }
        }
        self.now = now.max(self.now);
    }

    fn end(&mut self, name: &'static str) -> &mut EndBoard {
        self.ends.entry(name).or_insert_with(EndBoard::new)
    }

    fn count_message(&mut self, at: SystemTime, connection: u32, end: &'static str, length: u64) {
        let board = self.end(end);
        board.messages += 1;
        board.bytes += length;
        if let Some(second) = board.seconds.back_mut() {
            *second += 1;
        }
        self.answer(at, connection, end);
    }

    /// Treats the first message after one of the other end as its answer.
    fn answer(&mut self, at: SystemTime, connection: u32, end: &'static str) {
        let before = self.last.insert(connection, (end, at));
        if let Some((other, since)) = before
            && other != end
        {
            self.end(end).note_answer(at.duration_since(since).unwrap_or_default());
        }
    }

    fn say(&mut self, at: SystemTime, end: &'static str, text: String, is_wrong: bool) {
        if self.lines.len() == LINES {
            self.lines.pop_front();
        }
        self.lines.push_back(LineBoard { at, end, text, is_wrong });
    }
}

impl EndBoard {
    fn new() -> Self {
        let (answers, bars) = (Samples::default(), [0; BARS.len()]);
        Self { messages: 0, corrupt: 0, bytes: 0, seconds: VecDeque::from([0]), answers, bars }
    }

    fn note_answer(&mut self, time: Duration) {
        self.answers.add(time);
        let bar =
            BARS.iter().position(|limit| time.as_micros() <= u128::from(*limit)).unwrap_or(BARS.len() - 1);
        if let Some(bar) = self.bars.get_mut(bar) {
            *bar += 1;
        }
    }

    /// Messages a second, of the whole seconds of the window.
    pub(super) fn rate(&self) -> f64 {
        let whole = self.seconds.len() - 1;
        match whole {
            0 => 0.0,
            _ => self.seconds.iter().take(whole).sum::<u64>() as f64 / whole as f64,
        }
    }
}
