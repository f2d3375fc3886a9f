//! The contract tests themselves, of a session with its stories: one that keeps the contract passes, and each broken rule is
//! found. `robot-session` has those of decoders.

#[path = "../../../robot-session/tests/it/common/mod.rs"]
mod toy;

use core::any::Any;
use core::time::Duration;
use std::panic::catch_unwind;

use cellwire_links::end::{Act, CallResult, End, PairedItem, PendingLimit};
use robot_session::{Session as _, contract};
use serde_json::{Map, Value, json};
use testkit::contract::{Story, TestedEnd};
use toy::Asker;

/// A session around the toy's that breaks one rule.
struct Sloppy<const FAULT: u8> {
    asker: Asker,
    connected: bool,
    last: Duration,
    timeouts: u32,
    /// An event that is repeated.
    again: Option<String>,
}

const SPINS: u8 = 1;
const FORGETS_WHEN_POLLED_OFTEN: u8 = 2;
const WRITES_NOTHING: u8 = 3;
const TAKES_A_SMALL_BUFFER: u8 = 4;
const PANICS_AT_THE_END_OF_TIME: u8 = 5;
const READS_WHOLE_INPUT_ONLY: u8 = 6;
const SENDS_ALONE: u8 = 7;
const ANSWERS_TWICE: u8 = 8;

const ONCE: &[PairedItem] = &[PairedItem {
    begins: Act::Sent,
    ends: &[Act::Event("Answer"), Act::Event("NoAnswer")],
    room: PendingLimit::Most(1),
}];

impl<const FAULT: u8> End for Sloppy<FAULT> {
    fn handle_connected(&mut self, now: Duration) {
        self.connected = true;
        self.asker.handle_connected(now);
    }

    fn handle_disconnected(&mut self, now: Duration) {
        self.connected = false;
        self.asker.handle_disconnected(now);
    }

    fn handle_input(&mut self, now: Duration, bytes: &[u8]) {
        if FAULT != READS_WHOLE_INPUT_ONLY || bytes.ends_with(b"\n") && bytes.len() > 1 {
            self.asker.handle_input(now, bytes);
        }
    }

    fn handle_timeout(&mut self, now: Duration) {
        self.timeouts += 1;
        if FAULT == FORGETS_WHEN_POLLED_OFTEN && self.timeouts > 1 {
            self.asker.requests.clear();
        }
        self.last = if FAULT == PANICS_AT_THE_END_OF_TIME { now + Duration::from_secs(1) } else { now };
        self.asker.handle_timeout(now);
    }

    fn handle_transmitted(&mut self, _: Duration) {}

    fn wants_input(&self) -> bool {
        true
    }

    fn poll_event(&mut self) -> Option<String> {
        self.timeouts = 0;
        if let Some(again) = self.again.take() {
            return Some(again);
        }
        let text = format!("{:?}", self.asker.poll_event()?);
        let name = text.split('(').next();
        let event = json!({"event": name, "text": text}).to_string();
        self.again = (FAULT == ANSWERS_TWICE).then(|| event.clone());
        Some(event)
    }

    fn poll_transmit(&mut self, now: Duration, out: &mut [u8]) -> Option<usize> {
        match FAULT {
            SENDS_ALONE if !out.is_empty() => self.asker.poll_transmit(now, out),
            _ if !self.connected => None,
            WRITES_NOTHING if self.asker.requests.len() > 3 => Some(0),
            TAKES_A_SMALL_BUFFER if out.is_empty() => {
                self.asker.requests.pop_front();
                None
            }
            _ if out.is_empty() => None,
            _ => self.asker.poll_transmit(now, out),
        }
    }

    fn poll_timeout(&self) -> Option<Duration> {
        if FAULT == SPINS { Some(self.last) } else { self.asker.poll_timeout() }
    }

    fn max_input(&self) -> usize {
        65536
    }

    fn max_transmit(&self) -> usize {
        Asker::MAX_TRANSMIT
    }

    fn statistics(&self) -> String {
        json!({"asked": self.asker.statistics()}).to_string()
    }

    fn call(&mut self, _: Duration, _: &str, argument: &Value) -> CallResult {
        self.asker.requests.push_back(argument.to_string());
        Ok(Ok(()))
    }

    fn state(&self) -> &'static str {
        "toy"
    }

    fn machine(&self) -> &dyn Any {
        &()
    }

    fn moves(&mut self) -> &mut dyn Any {
        &mut self.timeouts
    }
}

fn make<const FAULT: u8>(config: &Map<String, Value>, _: Option<usize>) -> anyhow::Result<Box<dyn End>> {
    let mut asker = Asker::new(&[]);
    asker.timeout = if config.contains_key("timeout") { Duration::MAX } else { asker.timeout };
    Ok(Box::new(Sloppy::<FAULT> { asker, connected: false, last: Duration::ZERO, timeouts: 0, again: None }))
}

#[test]
fn each_broken_rule_of_a_session_is_found() {
    fn check<const FAULT: u8>() -> bool {
        let story = Story {
            config: Map::new(),
            inputs: (0..100).map(|number| format!("{number}\n").into_bytes()).collect(),
            calls: (0..100).map(|number| ("ask".into(), json!(number))).collect(),
        };
        let times = vec!["timeout".into()];
        let held =
            TestedEnd { name: "toy".into(), make: make::<FAULT>, once: ONCE, stories: vec![story], times };
        catch_unwind(|| contract::session(&held, 60)).is_ok()
    }
    assert!(check::<0>());
    assert!(!check::<SPINS>());
    assert!(!check::<FORGETS_WHEN_POLLED_OFTEN>());
    assert!(!check::<WRITES_NOTHING>());
    assert!(!check::<TAKES_A_SMALL_BUFFER>());
    assert!(!check::<PANICS_AT_THE_END_OF_TIME>());
    assert!(!check::<READS_WHOLE_INPUT_ONLY>());
    assert!(!check::<SENDS_ALONE>());
    assert!(!check::<ANSWERS_TWICE>());
}
