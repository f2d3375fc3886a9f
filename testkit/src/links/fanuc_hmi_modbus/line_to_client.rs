//! The line between a server of another maker and the client: words as bytes, and the client's outcomes.

use core::time::Duration;

use fanuc_hmi_modbus::client::machine::{Action, DueRequest};
use fanuc_hmi_modbus::{Client, ClientEvent, Exception, Failure, Reply, Request, Words};
use robot_session::Encode as _;

use super::any_server::{AnyServer, Step};
use super::pieces::{DATA, Frame, NOBODY, Shape};
use super::requests::{Kind, Knowledge};
use super::world::UNIT;
use crate::faults::Faults;
use crate::model::{SceneOf, Wired};

/// The number of bytes that [`Step::Part`] lacks.
const LACKS: usize = 3;

impl Kind {
    fn unit(self) -> u8 {
        if self == Self::Broadcast { 0 } else { UNIT }
    }

    fn request(self) -> Request<'static> {
        match self {
            Self::Read => Request::ReadHoldingRegisters { address: 0, quantity: 1 },
            Self::Write | Self::Broadcast => Request::WriteRegister { address: 0, value: 7 },
        }
    }
}

impl Wired for AnyServer {
    type Session = Client<2>;

    // Damaged bytes are words.
    const FAULTS: Faults = Faults { split: 0.3, ..Faults::NONE };
    const POLL: Option<Step> = Some(Step::Poll);

    fn session(&self) -> Client<2> {
        Client::new(self.config).expect("a configuration that works")
    }

    fn speak(&self, known: &Knowledge, word: Step, client: &mut Client<2>, _: Duration) -> Vec<u8> {
        match word {
            Step::Request(kind) => {
                client.request(kind.unit(), &kind.request()).expect("there is a place");
                Vec::new()
            }
            Step::Poll => Vec::new(),
            Step::Frame(frame) => self.frame(frame),
            Step::Part(frame) => {
                let mut bytes = self.frame(frame);
                bytes.truncate(bytes.len() - LACKS);
                bytes
            }
            Step::Rest => match known.part() {
                Some(frame) => {
                    let bytes = self.frame(frame);
                    bytes[bytes.len() - LACKS..].to_vec()
                }
                None => Vec::new(),
            },
            // A frame of another protocol.
            Step::Noise if self.is_tcp() => vec![0, 0, 0, 1, 0, 6, 1, 3, 0, 0, 0, 1],
            Step::Noise => vec![0xFF; 8],
            Step::Long => vec![UNIT + 1, 3, 250],
            Step::Damaged(shape) => {
                [vec![0xFF; 3], self.frame(Frame { id: DATA, transaction: 0, shape }), vec![0xFF; 6]].concat()
            }
        }
    }

    fn is_written(&self, scene: &SceneOf<Self>, due: &DueRequest, bytes: &[u8]) -> bool {
        let job = scene.known.kind_of(due.slot);
        let kind = if due.probe { Some(Kind::Read) } else { job };
        kind.is_some_and(|kind| self.encode(due.transaction, kind.unit(), kind.request()) == bytes)
    }

    fn reports(&self, action: &Action, reports: &mut Vec<String>) {
        let mut push = |what: &str, count| reports.extend(core::iter::repeat_n(what.into(), count));
        match action {
            Action::Replied { .. } => push("replied", 1),
            Action::Announced { .. } => push("announced", 1),
            Action::Refused { .. } => push("refused", 1),
            Action::TimedOut { silent, returned } => {
                push("timed out", silent.iter().count());
                push("returned", returned.iter().count());
            }
            Action::Reset { lost, not_sent } => {
                push("lost", lost.iter().count());
                push("not sent", not_sent.iter().count());
            }
            // Notices are dropped while outcomes are not polled.
            Action::Nothing | Action::Keep { .. } | Action::Sent => {}
            Action::Stray { .. } | Action::Cut | Action::Hold => {}
        }
    }

    fn reported(&self, event: &ClientEvent) -> Option<String> {
        Some(match event {
            ClientEvent::Replied { .. } => "replied".into(),
            ClientEvent::Announced { .. } => "announced".into(),
            ClientEvent::Failed { failure, .. } => match failure {
                Failure::TimedOut => "timed out".into(),
                Failure::Returned => "returned".into(),
                Failure::Disconnected => "lost".into(),
                Failure::NotSent => "not sent".into(),
                _ => "refused".into(),
            },
            ClientEvent::Unexpected(unexpected) => unexpected.to_string(),
            _ => return None,
        })
    }

    /// The first bytes of a word, before the connection ends.
    fn lost(&self, known: &Knowledge, _: Step) -> Vec<Vec<Step>> {
        if self.is_tcp() {
            return vec![Vec::new()];
        }
        let frame = |id, shape| Frame { id, transaction: 0, shape };
        let shapes = [Shape::ReadRefused, Shape::WriteRefused];
        let data = shapes.map(|shape| vec![Step::Noise, Step::Frame(frame(DATA, shape))]);
        let mut strings = vec![vec![], vec![Step::Noise], vec![Step::Part(frame(NOBODY, Shape::Read))]];
        strings.extend(data);
        strings.extend(known.part().map(|part| vec![Step::Part(part)]));
        strings
    }

    /// Off TCP a pause within a frame is a word of its own. Over TCP the rest comes, or the connection ends.
    fn may_pause(&self, _: Step) -> bool {
        false
    }
}

impl AnyServer {
    fn frame(&self, Frame { transaction, shape, .. }: Frame) -> Vec<u8> {
        let words = [9];
        let exception = Exception::ServerDeviceBusy;
        let (unit, reply) = match shape {
            Shape::Read => (UNIT, Reply::HoldingRegisters(Words::from(&words))),
            Shape::ReadRefused => (UNIT, Reply::Exception { function: 3, exception }),
            Shape::Write => (UNIT, Reply::WriteRegister { address: 0, value: 7 }),
            Shape::WriteRefused => (UNIT, Reply::Exception { function: 6, exception }),
            Shape::Foreign => (UNIT + 1, Reply::HoldingRegisters(Words::from(&words))),
        };
        self.encode(transaction, unit, reply)
    }

    fn encode(&self, transaction: u16, unit: u8, pdu: impl fanuc_hmi_modbus::Pdu) -> Vec<u8> {
        let mut bytes = [0; fanuc_hmi_modbus::Frame::MAX_LEN];
        let transaction = self.is_tcp().then_some(transaction);
        let frame = fanuc_hmi_modbus::Frame { transaction, unit, pdu };
        let length = frame.encode(&mut bytes).expect("a frame fits");
        bytes[..length].to_vec()
    }
}
