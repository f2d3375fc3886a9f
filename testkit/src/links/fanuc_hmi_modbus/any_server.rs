//! A client against servers of other makers.

use core::time::Duration;

use fanuc_hmi_modbus::client::machine::{
    Action, ClientLink, ClientMachine, Due, Fit, Held as Request, Input, Line, Stage,
};
use fanuc_hmi_modbus::{ClientConfig, Framing};

use super::line_to_client::{DATA, Found, Frame, Held, LINE, MOST, NOBODY, PROBE, Piece, Shape};
use super::requests::{ENDED_TWICE, Job, Kind, Known, SENT, Stale};
use super::world::{COLLISION, TICK, TURNAROUND};
use crate::model::{By, Cause, CauseOf, EXPECTED, InputOf, Peer, Terms, WRITTEN};

pub(super) const FOREIGN_REPLY: &str = "a reply is never taken for that of another request";
pub(super) const STALE: &str = "what waited when the connection was lost is not sent";
pub(super) const ENDS: &str = "a lost connection ends every request in flight";
pub(super) const FITS: &str = "a reply that does not fit is not taken";
pub(super) const DATA_IS_NONE: &str = "data of a damaged reply is not taken for an exception";
pub(super) const REST: &str = "the rest of a reply is waited for until the timeout";
pub(super) const CUT: &str = "bytes after a silence do not continue those before it";
pub(super) const HEARD: &str = "on a serial line a request after a broadcast is heard";
pub(super) const PROVEN: &str =
    "a request that can equal its reply is not sent before another reply has come, or was waited for";
pub(super) const RETURNED: &str =
    "a frame that equals its request is no reply before another reply has come on the connection";

const PROPERTIES: &[&str] = &[
    FOREIGN_REPLY,
    FITS,
    DATA_IS_NONE,
    REST,
    CUT,
    HEARD,
    PROVEN,
    RETURNED,
    ENDED_TWICE,
    SENT,
    STALE,
    ENDS,
    COLLISION,
    EXPECTED,
];
pub(super) const RULES: Terms = Terms {
    keeps: "FM-61, FM-64, replies no later than settle (FM-57)",
    free: "whether it answers, when, in which order, with what; replies in pieces with silences between them, noise on a line, what the line returns, and damaged replies whose data looks like an exception",
    shows: &[("FM-2", WRITTEN), ("FM-4", COLLISION), ("FM-10", WRITTEN), ("FM-43", HEARD)],
    properties: PROPERTIES,
};
pub(super) const ANYTHING: Terms = Terms {
    keeps: "",
    free: "any frame at any time",
    // A server that does anything may answer other requests.
    properties: match PROPERTIES {
        [_, rest @ ..] => rest,
        [] => PROPERTIES,
    },
    ..RULES
};

/// A server of which only this is known.
#[derive(Debug, Clone, Copy)]
pub struct AnyServer {
    /// The client's configuration.
    pub config: ClientConfig,
    /// It answers a request at most once, with its transaction. The delay is left open, within the assumptions of the
    /// client's configuration.
    pub keeps_rules: bool,
    /// A reply is on its way no longer: over TCP than this many later requests, off TCP than this many ticks.
    pub memory: u8,
}

/// A step of the model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Word {
    /// The caller makes a request.
    Request(Kind),
    /// The caller polls the oldest outcome.
    Poll,
    /// A frame comes whole.
    Frame(Frame),
    /// The beginning of a reply to the request in flight comes.
    Part(Frame),
    /// The rest of it comes.
    Rest,
    /// Bytes come that are not a frame.
    Noise,
    /// The beginning of a long frame comes.
    Long,
    /// A damaged reply comes whose data looks like an exception.
    Damaged(Shape),
}

impl AnyServer {
    fn is_serial(&self) -> bool {
        matches!(self.config.framing, Framing::Rtu { .. })
    }

    pub(super) fn is_tcp(&self) -> bool {
        self.config.framing == Framing::Tcp
    }

    /// Nothing of a connection reaches the next; on a serial line nobody notices.
    fn reconnected(&self, known: &mut Known) {
        (known.held, known.awaits, known.judged) = (Held::default(), false, None);
        known.arriving.clear();
        if !self.is_serial() {
            known.stale.clear();
        }
    }

    /// The request that a frame with this transaction seems to answer.
    fn asked(&self, end: &ClientMachine<2>, known: &Known, transaction: u16) -> Option<Kind> {
        let Request { place, stage } = end.expects(transaction, &self.config)?;
        if matches!(stage, Stage::Probing { .. }) { Some(Kind::Read) } else { known.kind_of(*place) }
    }

    /// The frames that may come.
    fn frames(&self, known: &Known) -> Vec<Frame> {
        if !self.keeps_rules {
            let shapes = [Shape::Read, Shape::ReadRefused, Shape::Write, Shape::WriteRefused, Shape::Foreign];
            let shapes = if self.is_tcp() {
                vec![Shape::Read, Shape::ReadRefused, Shape::Foreign]
            } else {
                shapes.into()
            };
            let transactions = 0..if self.is_tcp() { 4 } else { 1 };
            let each = |transaction| {
                shapes.clone().into_iter().map(move |shape| Frame { id: NOBODY, transaction, shape })
            };
            return transactions.flat_map(each).collect();
        }
        let replies = known.jobs.iter().zip(0..).filter_map(|(job, place)| {
            let Job { kind, transaction, .. } = job.filter(|job| job.reply.is_some())?;
            Some((place, Some(kind), transaction))
        });
        let probe = known.probing.filter(|(_, reply)| reply.is_some());
        let replies = replies.chain(probe.map(|_| (PROBE, Some(Kind::Read), 0)));
        let stale = known.stale.iter().map(|stale| (NOBODY, stale.kind, stale.transaction));
        let each = |(id, kind, transaction): (u8, Option<Kind>, u16)| {
            let reads = [Shape::Read, Shape::ReadRefused].map(|shape| (Kind::Read, shape));
            let writes = [Shape::Write, Shape::WriteRefused].map(|shape| (Kind::Write, shape));
            let may_be = move |(found, _): &(Kind, Shape)| kind.is_none_or(|kind| kind == *found);
            let shapes = reads.into_iter().chain(writes).filter(may_be);
            shapes.map(move |(_, shape)| Frame { id, transaction, shape })
        };
        replies.chain(stale).flat_map(each).collect()
    }
}

impl Peer for AnyServer {
    type End = ClientMachine<2>;
    type Known = Known;
    type Word = Word;

    const TICK: Duration = TICK;

    fn config(&self) -> &ClientConfig {
        &self.config
    }

    fn end(&self) -> ClientMachine<2> {
        ClientMachine::NEW
    }

    fn known(&self) -> Known {
        let before = Stale { kind: None, transaction: 0, left: self.memory };
        let stale = if self.is_serial() { vec![before] } else { Vec::new() };
        Known {
            jobs: [None; 2],
            outcomes: Vec::new(),
            stale,
            is_up: false,
            is_arriving: false,
            arriving: Vec::new(),
            ends: false,
            is_first: false,
            held: Held::default(),
            awaits: false,
            judged: None,
            probing: None,
            is_proven: false,
            deaf: 0,
            wrong: None,
        }
    }

    fn words(&self, end: &ClientMachine<2>, known: &Known, words: &mut Vec<Word>) {
        if end.free_place().is_some() {
            let kinds = [Kind::Read, Kind::Write, Kind::Broadcast];
            words.extend(kinds.into_iter().take(if self.is_tcp() { 1 } else { 3 }).map(Word::Request));
        }
        if !known.outcomes.is_empty() {
            words.push(Word::Poll);
        }
        if end.link == ClientLink::Down {
            return;
        }
        let absorbs = known.held.absorbs() && (known.is_arriving || self.is_tcp());
        if !absorbs && !(self.is_tcp() && self.keeps_rules) {
            words.push(Word::Noise);
        }
        if known.part().is_some() {
            words.push(Word::Rest);
        }
        if known.held.len() >= MOST {
            return;
        }
        let frames = self.frames(known);
        words.extend(frames.iter().copied().map(Word::Frame));
        if self.is_tcp() {
            return;
        }
        // Through TCP, which loses nothing, a server does not begin what it does not end.
        if !absorbs && (self.is_serial() || !self.keeps_rules) {
            words.push(Word::Long);
        }
        let Some(asked) = self.asked(end, known, 0) else { return };
        words.push(Word::Damaged(if asked == Kind::Read { Shape::ReadRefused } else { Shape::WriteRefused }));
        let whole = if asked == Kind::Read { Shape::Read } else { Shape::Write };
        words.extend(frames.into_iter().filter(|frame| frame.shape == whole).map(Word::Part));
        // A line that returns what is sent is found by the probe, if that comes back whole: then it does so no more.
        if end.awaited().is_some() && asked == Kind::Write && !known.is_proven {
            words.push(Word::Frame(Frame { id: LINE, transaction: 0, shape: Shape::Write }));
        }
    }

    fn by(&self, word: Word) -> By {
        if matches!(word, Word::Request(_) | Word::Poll) { By::User } else { By::Line }
    }

    fn hear(&self, end: &ClientMachine<2>, known: &mut Known, word: Word) -> Option<InputOf<Self>> {
        known.arriving = match word {
            Word::Request(kind) => {
                let (broadcast, mirrored) = (kind == Kind::Broadcast, kind != Kind::Read);
                return Some(Input::Request { broadcast, mirrored });
            }
            Word::Poll => {
                let place = known.outcomes.remove(0);
                known.jobs[usize::from(place)] = None;
                return Some(Input::Taken { place });
            }
            Word::Frame(frame) => vec![Piece::Frame(frame)],
            Word::Part(frame) => vec![Piece::Part(frame)],
            Word::Rest => vec![Piece::Rest],
            Word::Noise => vec![Piece::Noise],
            Word::Long => vec![Piece::Long],
            Word::Damaged(shape) => {
                vec![Piece::Noise, Piece::Frame(Frame { id: DATA, transaction: 0, shape }), Piece::Noise]
            }
        };
        match word {
            Word::Frame(frame) => known.answer(frame),
            Word::Rest => known.part().into_iter().for_each(|frame| known.answer(frame)),
            _ => {}
        }
        let waits = matches!(end.link, ClientLink::Up { line: Line::Partial { .. }, .. });
        known.is_first = !self.is_tcp() && !known.is_arriving && !waits;
        (known.is_arriving, known.ends) = (true, true);
        Some(Input::Received)
    }

    fn next(&self, end: &ClientMachine<2>, known: &mut Known) -> Option<InputOf<Self>> {
        loop {
            let is_new = !known.held.has_ended() && !known.arriving.is_empty();
            if is_new {
                core::mem::take(&mut known.arriving).into_iter().for_each(|piece| known.held.push(piece));
            }
            match known.held.next() {
                Some(Found::Corrupt) => return Some(Input::Corrupt),
                Some(Found::Frame(frame, follows)) => {
                    let Frame { transaction, shape, .. } = frame;
                    let fit = shape.fit(self.asked(end, known, transaction), follows);
                    known.judged = Some((frame, fit));
                    return Some(Input::Reply { transaction, fit });
                }
                None if known.arriving.is_empty() => break,
                None => {}
            }
        }
        if !core::mem::take(&mut known.ends) {
            return None;
        }
        if core::mem::take(&mut known.is_first) && known.held.len() > 1 {
            known.wrong = Some(CUT);
        }
        known.awaits = known.part().is_some() && self.asked(end, known, 0).is_some();
        known.awaits.then_some(Input::Partial)
    }

    fn sent(&self, due: &Due) -> InputOf<Self> {
        Input::Sent(*due)
    }

    fn acted(&self, end: &ClientMachine<2>, known: &mut Known, cause: CauseOf<Self>, action: Action) {
        let judged = known.judged.take();
        match cause {
            Cause::Sent(due) => self.was_sent(known, due, action),
            Cause::Due if !self.is_tcp() => known.read(),
            _ => {}
        }
        if let Some((place, reply)) = known.probing
            && !end.held().any(|held| matches!(held.stage, Stage::Probing { .. }))
        {
            known.probing = None;
            known.is_proven |= judged.is_some();
            known.grow_stale(Some(Kind::Read), 0, reply);
            known.jobs[usize::from(place)].iter_mut().for_each(|job| job.was_probed = true);
        }
        match action {
            Action::Keep { place } => {
                let Cause::Word(Word::Request(kind)) = cause else { return };
                known.jobs[usize::from(place)] = Some(Job {
                    kind,
                    transaction: 0,
                    was_sent: false,
                    reply: None,
                    was_probed: false,
                    is_stale: false,
                    has_ended: false,
                });
            }
            Action::Replied { place } => self.replied(known, place, judged),
            Action::Refused { place } => drop(known.end(place, true)),
            Action::Announced { place } => {
                known.end(place, true);
                known.deaf = if self.is_serial() { TURNAROUND } else { 0 };
            }
            Action::TimedOut { silent, returned } => {
                known.end_all(silent, true);
                known.end_all(returned, true);
            }
            Action::Reset { lost, not_sent } => {
                known.end_all(lost, true);
                known.end_all(not_sent, false);
            }
            Action::Cut => {
                // Time is counted from now: a deadline at zero has come.
                let waits = |held: &Request| match held.stage {
                    Stage::Probing { deadline, .. } | Stage::InFlight { deadline, .. } => !deadline.is_zero(),
                    _ => false,
                };
                if core::mem::take(&mut known.awaits) && end.held().any(waits) {
                    known.wrong = Some(REST);
                }
                known.held.end();
            }
            Action::Hold => judged.into_iter().for_each(|(frame, _)| known.held.put_back(frame)),
            Action::Nothing | Action::Sent | Action::Stray { .. } => {}
        }
        if matches!(cause, Cause::Connected | Cause::Disconnected) {
            for job in known.jobs.iter_mut().flatten().filter(|job| !job.has_ended && known.is_up) {
                job.is_stale = true;
                if job.was_sent {
                    known.wrong = Some(ENDS);
                }
            }
            known.is_up = cause == Cause::Connected;
            (known.probing, known.is_proven) = (None, self.is_tcp());
            self.reconnected(known);
        }
    }

    fn tick(&self, known: &mut Known) {
        known.is_arriving = false;
        known.deaf = known.deaf.saturating_sub(1);
        if !self.is_tcp() {
            known.age();
        }
    }

    fn restarted(&self, known: &mut Known) {
        for place in [0, 1] {
            known.forget(place);
            known.jobs[usize::from(place)] = None;
        }
        let probe = known.probing.take();
        known.grow_stale(Some(Kind::Read), 0, probe.and_then(|(_, reply)| reply));
        known.outcomes.clear();
        (known.is_up, known.is_proven) = (false, false);
        self.reconnected(known);
    }

    fn broken(&self, _: &ClientMachine<2>, known: &Known, broken: &mut Vec<&'static str>) {
        broken.extend(known.wrong);
    }

    /// Each request has an outcome in the end, whatever the server does.
    fn is_over(&self, _: &ClientMachine<2>, known: &Known) -> bool {
        known.jobs.iter().flatten().all(|job| job.has_ended)
    }
}

impl AnyServer {
    fn replied(&self, known: &mut Known, place: u8, judged: Option<(Frame, Fit)>) {
        let job = known.end(place, true);
        let (Some((Frame { id, .. }, fit)), true) = (judged, job) else { return };
        match fit {
            Fit::Equal if !known.is_proven => known.wrong = Some(RETURNED),
            Fit::Misfit => known.wrong = Some(FITS),
            _ if id == DATA => known.wrong = Some(DATA_IS_NONE),
            _ if self.keeps_rules && id != LINE && id != place => known.wrong = Some(FOREIGN_REPLY),
            _ => {}
        }
        known.is_proven |= fit != Fit::Equal;
    }

    fn was_sent(&self, known: &mut Known, due: Due, action: Action) {
        if self.is_serial() && known.is_arriving {
            known.wrong = Some(COLLISION);
        }
        if known.deaf > 0 {
            known.wrong = Some(HEARD);
        }
        if self.is_tcp() {
            known.age();
            known.read();
        }
        let reply = Some(self.memory).filter(|_| self.keeps_rules);
        if due.probe {
            known.probing = Some((due.place, reply));
            return;
        }
        let Some(job) = &mut known.jobs[usize::from(due.place)] else { return };
        if job.kind == Kind::Write && !known.is_proven && !job.was_probed {
            known.wrong = Some(PROVEN);
        }
        if job.is_stale {
            known.wrong = Some(STALE);
        }
        if core::mem::replace(&mut job.was_sent, true) || job.has_ended {
            known.wrong = Some(SENT);
        }
        if action == Action::Sent {
            (job.transaction, job.reply) = (due.transaction, reply);
        }
    }
}
