//! The rows of both machines' tables.

use core::time::Duration;

use laser_eb90::controller::machine::{
    self as controller, Answer, Burst, ControllerMachine, Fault, LineState, Work,
};
use laser_eb90::host::machine::{self as host, Batch, FrameInFlight, HostLink, HostMachine, SendCounts};
use laser_eb90::{Class, ControllerConfig, HostConfig, Refusal};
use robot_session::end::Machine as _;

use crate::model::{NOW, Rows};

const MS: Duration = Duration::from_millis(1);
const WORD: u16 = 0x0101;
const OTHER: u16 = 0x0102;

/// The host.
#[derive(Debug)]
pub enum Host {}

impl Rows for Host {
    type Machine = HostMachine;

    fn states() -> Vec<HostMachine> {
        let (past, future) = (NOW - MS, NOW + MS);
        let (batch, tries) =
            (Batch { first: 0, count: 1, word: WORD, class: Class::Interpreted }, SendCounts::default());
        // An answer is overdue, and a "bad frame" may still refer to the first half of the frame.
        let sent = FrameInFlight {
            batch,
            tries,
            received_by: past,
            final_from: future,
            executed_by: past,
            deadline: past,
            corrupt: false,
        };
        let links = [
            HostLink::Disconnected { quiet_until: past, held: false },
            HostLink::Disconnected { quiet_until: past, held: true },
            HostLink::Idle { quiet_until: past },
            HostLink::Awaiting(sent),
            HostLink::Resending { batch, tries, not_before: past },
            HostLink::AwaitingRest { batch, tries, until: past },
            HostLink::Held { quiet_until: past },
        ];
        let mut states = links.map(|link| HostMachine { link, next: None }).to_vec();
        states.insert(3, HostMachine { link: HostLink::Idle { quiet_until: past }, next: Some(batch) });
        states
    }

    fn inputs() -> Vec<host::Input> {
        use host::Input as On;
        let error = |refusal| {
            let word = Self::config().words.errors().code(refusal);
            On::Answer { word, refusal: Some(refusal) }
        };
        vec![
            On::Connected,
            On::Disconnected,
            On::Timeout,
            On::Submit { ticket: 0, word: WORD, class: Class::Interpreted },
            On::TakeBack,
            On::Sent { line: Duration::ZERO },
            On::Transmitted,
            On::Answer { word: WORD, refusal: None },
            On::Answer { word: OTHER, refusal: None },
            error(Refusal::BadChecksum),
            error(Refusal::BadFrame),
            error(Refusal::QueueFull),
            error(Refusal::BadParameters),
            On::Corrupt,
            On::Resume,
        ]
    }

    fn config() -> HostConfig {
        HostConfig::default()
    }

    fn row(machine: &HostMachine, _now: Duration) -> String {
        let filled = matches!(machine.link, HostLink::Idle { .. }) && machine.next.is_some();
        format!("{}{}", machine.name(), if filled { ", filled" } else { "" })
    }

    fn column_at(machine: &HostMachine, _now: Duration, input: &host::Input) -> String {
        let expected = match machine.link {
            HostLink::Awaiting(sent) => sent.batch.word,
            HostLink::Resending { batch, .. } | HostLink::AwaitingRest { batch, .. } => batch.word,
            HostLink::Disconnected { .. } | HostLink::Idle { .. } | HostLink::Held { .. } => WORD,
        };
        match input {
            host::Input::Answer { refusal: Some(refusal), .. } => format!("ErrorCode {refusal:?}"),
            host::Input::Answer { word, .. } if *word == expected => "Answer, the word".into(),
            host::Input::Answer { .. } => "Answer, another word".into(),
            _ => Self::column(input),
        }
    }
}

/// The controller.
#[derive(Debug)]
pub enum Controller {}

impl Rows for Controller {
    type Machine = ControllerMachine;

    fn states() -> Vec<ControllerMachine> {
        let past = NOW - MS;
        let burst = |partial, fault| LineState::Bytes(Burst { silent_at: past, partial, fault });
        let bytes = |partial| burst(partial, None);
        let fault = |bytes, is_answered| {
            burst(bytes == Fault::MIN_BYTES, Some(Fault { refusal: Refusal::BadFrame, bytes, is_answered }))
        };
        let listening = Work::Listening { rest: false };
        let rest = Work::Listening { rest: true };
        let executing = |connected| Work::Executing { word: WORD, connected };
        let answering = Work::Answering { answer: Answer::Echo(WORD), due: past };
        [
            (listening, LineState::Disconnected),
            (executing(false), LineState::Disconnected),
            (listening, LineState::Silent),
            (listening, bytes(false)),
            (listening, fault(Fault::MIN_BYTES - 1, true)),
            (listening, fault(Fault::MIN_BYTES, true)),
            (rest, LineState::Silent),
            (rest, fault(Fault::MIN_BYTES, false)),
            (executing(true), LineState::Silent),
            (executing(true), bytes(true)),
            (executing(false), bytes(false)),
            (answering, LineState::Silent),
            (answering, bytes(false)),
            (answering, bytes(true)),
            (answering, fault(Fault::MIN_BYTES, false)),
        ]
        .map(|(work, line)| ControllerMachine { work, line })
        .to_vec()
    }

    fn inputs() -> Vec<controller::Input> {
        use controller::Input as On;
        vec![
            On::Connected,
            On::Disconnected,
            On::Timeout,
            On::Bytes,
            On::Corrupt { refusal: Refusal::BadFrame, bytes: 1, begun: false },
            On::Corrupt { refusal: Refusal::BadChecksum, bytes: Fault::MIN_BYTES, begun: true },
            On::Untrusted,
            On::Queued { word: WORD },
            On::Refused(Refusal::QueueFull),
            On::Immediate { word: WORD },
            On::Read { partial: false },
            On::Read { partial: true },
            On::Executed(Ok(())),
            On::Executed(Err(Refusal::BadParameters)),
            On::Sent,
        ]
    }

    fn config() -> ControllerConfig {
        ControllerConfig::default()
    }

    fn row(machine: &ControllerMachine, _now: Duration) -> String {
        let burst = match machine.line {
            LineState::Disconnected => return machine.name().into(),
            LineState::Silent => None,
            LineState::Bytes(burst) => Some(burst),
        };
        let line = match burst {
            None => "silent",
            Some(Burst { fault: Some(_), .. }) => "corrupt bytes",
            Some(Burst { partial: true, .. }) if matches!(machine.work, Work::Answering { .. }) => {
                "a partial frame"
            }
            Some(_) => "bytes",
        };
        match (machine.work, burst.and_then(|burst| burst.fault)) {
            (Work::Executing { connected: false, .. }, _) => "Executing for nobody".into(),
            (Work::Listening { rest: true }, _) => format!("Listening after an error code, {line}"),
            (Work::Listening { rest: false }, Some(fault)) => {
                format!("Listening, fault of {} bytes", if fault.bytes < Fault::MIN_BYTES { 7 } else { 8 })
            }
            _ => format!("{}, {line}", machine.name()),
        }
    }

    fn column(input: &controller::Input) -> String {
        use controller::Input as On;
        match input {
            On::Corrupt { begun: false, .. } => "Corrupt, without a head".into(),
            On::Corrupt { begun: true, .. } => "Corrupt, with a head".into(),
            On::Read { partial: false } => "Read, nothing left".into(),
            On::Read { partial: true } => "Read, a partial frame".into(),
            On::Executed(Err(_)) => "Executed, failed".into(),
            _ => robot_session::end::Input::name(input).into(),
        }
    }
}
