//! The line between a server of another maker and the client: words as bytes, the client's decoder, and its outcomes.

use core::time::Duration;

use fanuc_hmi_modbus::client::machine::{Action, DueRequest, ReplyMatch};
use fanuc_hmi_modbus::{Client, ClientEvent, Exception, Failure, Reply, Request, Words};
use robot_session::Encode as _;

use super::any_server::{AnyServer, Step};
use super::requests::{Kind, Knowledge};
use super::world::UNIT;
use crate::faults::Faults;
use crate::model::{SceneOf, Wired};

/// A frame as the client's decoder finds it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Frame {
    /// The slot of the request that the server answers with it, or [`NOBODY`], [`PROBE`], [`LINE`] or [`DATA`].
    pub(super) id: u8,
    pub(super) transaction: u16,
    pub(super) shape: Shape,
}

/// The contents of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Shape {
    /// The reply to a read.
    Read,
    /// The exception to a read.
    ReadRefused,
    /// The reply to a write, which repeats it.
    Write,
    /// The exception to a write.
    WriteRefused,
    /// The reply of another unit.
    Foreign,
}

/// The frame answers a request that has ended.
pub(super) const NOBODY: u8 = u8::MAX;
/// The line has returned the bytes sent.
pub(super) const LINE: u8 = u8::MAX - 1;
/// The frame is data of a damaged reply.
pub(super) const DATA: u8 = u8::MAX - 2;

/// The frame answers the read before a request.
pub(super) const PROBE: u8 = u8::MAX - 3;

/// Bytes in the decoder.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum Piece {
    Frame(Frame),
    /// The beginning of a reply to the request in flight, without its last bytes.
    Part(Frame),
    /// The last bytes of it.
    Rest,
    /// Bytes that are not a frame.
    Noise,
    /// The beginning of a long frame, for whose rest the decoder waits.
    Long,
}

/// The number of bytes that a [`Piece::Part`] lacks.
const LACKS: usize = 3;
/// The most pieces that are held at once.
pub(super) const MOST: usize = 2;

/// The decoder's bytes that are not decoded yet.
#[derive(Debug, Clone, Default, PartialEq, Eq, Hash)]
pub(super) struct DecoderContents {
    pieces: Vec<Piece>,
    has_ended: bool,
    /// The frame that was put back waits for more.
    waits: bool,
}

/// A result of the decoder.
#[derive(Debug, Clone, Copy)]
pub(super) enum Found {
    Corrupt,
    Frame(Frame, Follows),
}

/// The input after a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Follows {
    /// Other bytes.
    More,
    /// Nothing yet.
    Nothing,
    /// The end of the input.
    Silence,
}

impl DecoderContents {
    pub(super) fn last(&self) -> Option<Piece> {
        self.pieces.last().copied()
    }

    pub(super) fn len(&self) -> usize {
        self.pieces.len()
    }

    /// Returns whether more noise has no effect.
    pub(super) fn absorbs(&self) -> bool {
        self.last() == Some(Piece::Noise) || self.pieces == [Piece::Long]
    }

    /// The request in this place has ended.
    pub(super) fn forget(&mut self, slot: u8) {
        for piece in &mut self.pieces {
            if let Piece::Frame(frame) | Piece::Part(frame) = piece
                && frame.id == slot
            {
                frame.id = NOBODY;
            }
        }
    }

    /// The held bytes will not be continued.
    pub(super) fn end(&mut self) {
        self.has_ended = !self.pieces.is_empty();
    }

    /// Returns whether the bytes before an end are still to be decoded.
    pub(super) fn has_ended(&self) -> bool {
        self.has_ended
    }

    /// Takes the bytes back that were decoded last.
    pub(super) fn put_back(&mut self, frame: Frame) {
        self.pieces.insert(0, Piece::Frame(frame));
        self.waits = true;
    }

    pub(super) fn push(&mut self, piece: Piece) {
        self.waits = false;
        match (piece, self.last()) {
            (Piece::Noise | Piece::Long, Some(Piece::Noise)) => {}
            // With any of these bytes the frame is complete, and its check fails.
            (Piece::Noise | Piece::Long, Some(Piece::Part(_))) => {
                self.pieces.pop();
                self.push(Piece::Noise);
            }
            (Piece::Noise | Piece::Long, Some(Piece::Long)) => {}
            (Piece::Long, Some(Piece::Frame(_))) if self.pieces.first() == Some(&Piece::Long) => {
                self.pieces.push(Piece::Noise);
            }
            (Piece::Rest, Some(Piece::Part(part))) => {
                self.pieces.pop();
                self.pieces.push(Piece::Frame(part));
            }
            _ => self.pieces.push(piece),
        }
    }

    pub(super) fn next(&mut self) -> Option<Found> {
        let is_frame = |piece: &Piece| matches!(piece, Piece::Frame(_));
        match self.pieces.first()? {
            Piece::Frame(_) if self.waits && !self.has_ended => return None,
            Piece::Frame(frame) => {
                let frame = *frame;
                self.waits = false;
                self.pieces.remove(0);
                let follows = match (self.pieces.is_empty(), self.has_ended) {
                    (false, _) => Follows::More,
                    (true, false) => Follows::Nothing,
                    (true, true) => Follows::Silence,
                };
                self.has_ended &= !self.pieces.is_empty();
                return Some(Found::Frame(frame, follows));
            }
            Piece::Long if !self.has_ended => return None,
            Piece::Part(_) | Piece::Rest | Piece::Noise | Piece::Long => {}
        }
        match self.pieces.iter().position(is_frame) {
            Some(at) => drop(self.pieces.drain(..at)),
            None if self.has_ended => *self = Self::default(),
            None => return None,
        }
        Some(Found::Corrupt)
    }
}

impl Shape {
    /// Returns whether a frame can be the reply to the request in flight, if there is one.
    pub(super) fn fit(self, asked: Option<Kind>, follows: Follows) -> ReplyMatch {
        match (self, asked) {
            (_, None) | (Self::Read, Some(Kind::Read)) => ReplyMatch::Full,
            (Self::Write, Some(Kind::Write)) => ReplyMatch::Equal,
            (Self::ReadRefused, Some(Kind::Read)) | (Self::WriteRefused, Some(Kind::Write)) => {
                match follows {
                    Follows::More => ReplyMatch::Exception,
                    Follows::Nothing => ReplyMatch::OpenException,
                    Follows::Silence => ReplyMatch::Full,
                }
            }
            _ => ReplyMatch::Mismatch,
        }
    }
}

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
