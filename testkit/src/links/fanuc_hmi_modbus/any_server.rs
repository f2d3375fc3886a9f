//! A client against servers of other makers.

use core::time::Duration;

use fanuc_hmi_modbus::client::machine::{
    Action, ClientLink, ClientMachine, DueRequest, Input, Line, ReplyMatch, RequestState as Request, Stage,
};
use fanuc_hmi_modbus::{ClientConfig, Framing};

use super::pieces::{DATA, DecoderContents, Found, Frame, LINE, MOST, NOBODY, PROBE, Piece, Shape};
use super::requests::{ENDED_TWICE, Job, Kind, Knowledge, SENT, Stale};
use super::world::{COLLISION, TICK, TURNAROUND};
use crate::model::{Actor, Cause, CauseOf, EXPECTED, InputOf, Peer, PeerAssumptions, WRITTEN};

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
pub(super) const RULES: PeerAssumptions = PeerAssumptions {
    keeps: "FM-61, FM-64, replies no later than settle (FM-57)",
    free: "whether it answers, when, in which order, with what; replies in pieces with silences between them, noise on a line, what the line returns, and damaged replies whose data looks like an exception",
    shows: &[("FM-2", WRITTEN), ("FM-4", COLLISION), ("FM-10", WRITTEN), ("FM-43", HEARD)],
    properties: PROPERTIES,
};
pub(super) const ANYTHING: PeerAssumptions = PeerAssumptions {
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
pub enum Step {
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
    fn reconnected(&self, known: &mut Knowledge) {
        (known.held, known.awaits, known.judged) = (DecoderContents::default(), false, None);
        known.arriving.clear();
        if !self.is_serial() {
            known.stale.clear();
        }
    }

    /// The request that a frame with this transaction seems to answer.
    fn asked(&self, end: &ClientMachine<2>, known: &Knowledge, transaction: u16) -> Option<Kind> {
        let Request { slot, stage } = end.expects(transaction, &self.config)?;
        if matches!(stage, Stage::Probing { .. }) { Some(Kind::Read) } else { known.kind_of(*slot) }
    }

    /// The frames that may come.
    fn frames(&self, known: &Knowledge) -> Vec<Frame> {
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
        let replies = known.jobs.iter().zip(0..).filter_map(|(job, slot)| {
            let Job { kind, transaction, .. } = job.filter(|job| job.reply.is_some())?;
            Some((slot, Some(kind), transaction))
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
    type Knowledge = Knowledge;
    type Step = Step;

    const TICK: Duration = TICK;

    fn config(&self) -> &ClientConfig {
        &self.config
    }

    fn end(&self) -> ClientMachine<2> {
        ClientMachine::NEW
    }

    fn known(&self) -> Knowledge {
        let before = Stale { kind: None, transaction: 0, left: self.memory };
        let stale = if self.is_serial() { vec![before] } else { Vec::new() };
        Knowledge {
            jobs: [None; 2],
            outcomes: Vec::new(),
            stale,
            is_up: false,
            is_arriving: false,
            arriving: Vec::new(),
            ends: false,
            is_first: false,
            held: DecoderContents::default(),
            awaits: false,
            judged: None,
            probing: None,
            is_proven: false,
            deaf: 0,
            wrong: None,
        }
    }

    fn steps(&self, end: &ClientMachine<2>, known: &Knowledge, steps: &mut Vec<Step>) {
        if end.free_slot().is_some() {
            let kinds = [Kind::Read, Kind::Write, Kind::Broadcast];
            steps.extend(kinds.into_iter().take(if self.is_tcp() { 1 } else { 3 }).map(Step::Request));
        }
        if !known.outcomes.is_empty() {
            steps.push(Step::Poll);
        }
        if end.link == ClientLink::Down {
            return;
        }
        let absorbs = known.held.absorbs() && (known.is_arriving || self.is_tcp());
        if !(absorbs || self.is_tcp() && self.keeps_rules) {
            steps.push(Step::Noise);
        }
        if known.part().is_some() {
            steps.push(Step::Rest);
        }
        if known.held.len() >= MOST {
            return;
        }
        let frames = self.frames(known);
        steps.extend(frames.iter().copied().map(Step::Frame));
        if self.is_tcp() {
            return;
        }
        // Through TCP, which loses nothing, a server does not begin what it does not end.
        if !absorbs && (self.is_serial() || !self.keeps_rules) {
            steps.push(Step::Long);
        }
        let Some(asked) = self.asked(end, known, 0) else { return };
        steps.push(Step::Damaged(if asked == Kind::Read { Shape::ReadRefused } else { Shape::WriteRefused }));
        let whole = if asked == Kind::Read { Shape::Read } else { Shape::Write };
        steps.extend(frames.into_iter().filter(|frame| frame.shape == whole).map(Step::Part));
        // A line that returns what is sent is found by the probe, if that comes back whole: then it does so no more.
        if end.awaited().is_some() && asked == Kind::Write && !known.is_proven {
            steps.push(Step::Frame(Frame { id: LINE, transaction: 0, shape: Shape::Write }));
        }
    }

    fn by(&self, step: Step) -> Actor {
        if matches!(step, Step::Request(_) | Step::Poll) { Actor::User } else { Actor::Line }
    }

    fn apply(&self, end: &ClientMachine<2>, known: &mut Knowledge, step: Step) -> Option<InputOf<Self>> {
        known.arriving = match step {
            Step::Request(kind) => {
                let (broadcast, mirrored) = (kind == Kind::Broadcast, kind != Kind::Read);
                return Some(Input::Request { broadcast, mirrored });
            }
            Step::Poll => {
                let slot = known.outcomes.remove(0);
                known.jobs[usize::from(slot)] = None;
                return Some(Input::Taken { slot });
            }
            Step::Frame(frame) => vec![Piece::Frame(frame)],
            Step::Part(frame) => vec![Piece::Part(frame)],
            Step::Rest => known.part().into_iter().map(|frame| Piece::Rest(frame.shape)).collect(),
            Step::Noise => vec![Piece::Noise],
            Step::Long => vec![Piece::Long],
            Step::Damaged(shape) => {
                vec![Piece::Noise, Piece::Frame(Frame { id: DATA, transaction: 0, shape }), Piece::Noise]
            }
        };
        match step {
            Step::Frame(frame) => known.answer(frame),
            Step::Rest => known.part().into_iter().for_each(|frame| known.answer(frame)),
            _ => {}
        }
        let waits = matches!(end.link, ClientLink::Up { line: Line::Partial { .. }, .. });
        known.is_first = !self.is_tcp() && !known.is_arriving && !waits;
        (known.is_arriving, known.ends) = (true, true);
        Some(Input::Received)
    }

    fn next(&self, end: &ClientMachine<2>, known: &mut Knowledge) -> Option<InputOf<Self>> {
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

    fn sent(&self, due: &DueRequest) -> InputOf<Self> {
        Input::Sent(*due)
    }

    fn acted(&self, end: &ClientMachine<2>, known: &mut Knowledge, cause: CauseOf<Self>, action: Action) {
        let judged = known.judged.take();
        match cause {
            Cause::Sent(due) => self.was_sent(known, due, action),
            Cause::Due if !self.is_tcp() => known.read(),
            _ => {}
        }
        if let Some((slot, reply)) = known.probing
            && !end.held().any(|held| matches!(held.stage, Stage::Probing { .. }))
        {
            known.probing = None;
            known.is_proven |= judged.is_some();
            known.grow_stale(Some(Kind::Read), 0, reply);
            known.jobs[usize::from(slot)].iter_mut().for_each(|job| job.was_probed = true);
        }
        match action {
            Action::Keep { slot } => {
                let Cause::Step(Step::Request(kind)) = cause else { return };
                known.jobs[usize::from(slot)] = Some(Job {
                    kind,
                    transaction: 0,
                    was_sent: false,
                    reply: None,
                    was_probed: false,
                    is_stale: false,
                    has_ended: false,
                });
            }
            Action::Replied { slot } => self.replied(known, slot, judged),
            Action::Refused { slot } => drop(known.end(slot, true)),
            Action::Announced { slot } => {
                known.end(slot, true);
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

    fn tick(&self, known: &mut Knowledge) {
        known.is_arriving = false;
        known.deaf = known.deaf.saturating_sub(1);
        if !self.is_tcp() {
            known.age();
        }
    }

    fn restarted(&self, known: &mut Knowledge) {
        for slot in [0, 1] {
            known.forget(slot);
            known.jobs[usize::from(slot)] = None;
        }
        let probe = known.probing.take();
        known.grow_stale(Some(Kind::Read), 0, probe.and_then(|(_, reply)| reply));
        known.outcomes.clear();
        (known.is_up, known.is_proven) = (false, false);
        self.reconnected(known);
    }

    fn broken(&self, _: &ClientMachine<2>, known: &Knowledge, broken: &mut Vec<&'static str>) {
        broken.extend(known.wrong);
    }

    /// Each request has an outcome in the end, whatever the server does.
    fn is_over(&self, _: &ClientMachine<2>, known: &Knowledge) -> bool {
        known.jobs.iter().flatten().all(|job| job.has_ended)
    }
}

impl AnyServer {
    fn replied(&self, known: &mut Knowledge, slot: u8, judged: Option<(Frame, ReplyMatch)>) {
        let job = known.end(slot, true);
        let (Some((Frame { id, .. }, fit)), true) = (judged, job) else { return };
        match fit {
            ReplyMatch::Equal if !known.is_proven => known.wrong = Some(RETURNED),
            ReplyMatch::Mismatch => known.wrong = Some(FITS),
            _ if id == DATA => known.wrong = Some(DATA_IS_NONE),
            _ if self.keeps_rules && id != LINE && id != slot => known.wrong = Some(FOREIGN_REPLY),
            _ => {}
        }
        known.is_proven |= fit != ReplyMatch::Equal;
    }

    fn was_sent(&self, known: &mut Knowledge, due: DueRequest, action: Action) {
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
            known.probing = Some((due.slot, reply));
            return;
        }
        let Some(job) = &mut known.jobs[usize::from(due.slot)] else { return };
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
