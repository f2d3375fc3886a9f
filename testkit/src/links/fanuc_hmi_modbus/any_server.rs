//! A client against servers of other makers.

use core::time::Duration;

use fanuc_hmi_modbus::client::machine::{
    Action, ClientLink, ClientMachine, Due, Fit, Held, Input, Line, Places, Stage,
};
use fanuc_hmi_modbus::{ClientConfig, Framing};

use super::world::{COLLISION, ENDED_TWICE, ENDS, FOREIGN_REPLY, STALE, TICK};
use crate::model::{By, Cause, CauseOf, EXPECTED, InputOf, Peer, Terms};

pub(super) const FITS: &str = "a reply that does not fit is not taken";
pub(super) const DATA: &str = "data of a damaged reply is not taken for an exception";
pub(super) const REST: &str = "the rest of a reply is waited for until the timeout";
pub(super) const PROVEN: &str =
    "a request that can equal its reply is not sent before another reply has come, or was waited for";
pub(super) const RETURNED: &str =
    "a frame that equals its request is no reply before another reply has come on the connection";
pub(super) const SENT: &str = "not sent was not sent, everything else was; nothing is sent twice";

pub(super) const RULES: Terms = Terms {
    keeps: "FM-44, FM-57",
    free: "whether it answers, when, in which order, with what; replies in pieces with silences between them, noise on a line, what the line returns, and damaged replies whose data looks like an exception",
    shows: &[],
    properties: &[
        FOREIGN_REPLY,
        FITS,
        DATA,
        REST,
        PROVEN,
        RETURNED,
        ENDED_TWICE,
        SENT,
        STALE,
        ENDS,
        COLLISION,
        EXPECTED,
    ],
};
pub(super) const ANYTHING: Terms = Terms {
    keeps: "",
    free: "any frame at any time",
    shows: &[],
    properties: &[FITS, DATA, REST, PROVEN, RETURNED, ENDED_TWICE, SENT, STALE, ENDS, COLLISION, EXPECTED],
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

/// The model's knowledge of the requests.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Known {
    /// In each place.
    jobs: [Option<Job>; 2],
    /// Replies that may still come, oldest first.
    outstanding: Vec<Outstanding>,
    is_up: bool,
    /// Bytes have come since the last tick.
    is_arriving: bool,
    /// The last of the bytes were not a frame.
    is_damaged: bool,
    /// Whether they are the beginning of a reply.
    is_partial: bool,
    /// The place of the request before which a read is in flight.
    probing: Option<u8>,
    /// A reply has come on this connection that the line cannot have returned.
    is_proven: bool,
    wrong: Option<&'static str>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
struct Job {
    id: u8,
    is_mirrored: bool,
    was_sent: bool,
    /// The read before it has ended.
    was_probed: bool,
    /// Whether it waited when a connection was lost.
    is_stale: bool,
    has_ended: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
struct Outstanding {
    id: u8,
    transaction: u16,
    left: u8,
}

/// A step of the model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Word {
    /// The caller makes a request.
    Request {
        /// To every unit.
        broadcast: bool,
        /// Whether its reply can equal it.
        mirrored: bool,
    },
    /// The caller takes the outcome of the request in this place.
    Take(u8),
    /// Bytes come.
    Bytes,
    /// The bytes are a reply, to this request if the server keeps the rules.
    Reply {
        /// The request.
        id: u8,
        /// The transaction of the request.
        transaction: u16,
        /// Whether it fits.
        fit: Fit,
    },
    /// The bytes are the beginning of a reply to the request in flight.
    Partial,
    /// The bytes are those that were sent, and so may be a reply.
    Returned,
    /// The bytes are not a frame: noise, or a damaged reply.
    Corrupt,
    /// Within the damaged reply, data that looks like an exception; more comes, or has come already.
    Data(Fit),
}

/// Of no request: before the client, another may have asked.
const NOBODY: u8 = u8::MAX;

impl AnyServer {
    fn is_serial(&self) -> bool {
        matches!(self.config.framing, Framing::Rtu { .. })
    }

    fn is_tcp(&self) -> bool {
        self.config.framing == Framing::Tcp
    }

    /// Called when the connection is replaced: nothing of it reaches the next one; on a serial line no end notices the
    /// change.
    fn reconnected(&self, known: &mut Known) {
        known.is_partial = false;
        if !self.is_serial() {
            known.outstanding.clear();
        }
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
        let before = Outstanding { id: NOBODY, transaction: 0, left: self.memory };
        let outstanding = if self.is_serial() { vec![before] } else { Vec::new() };
        Known {
            jobs: [None; 2],
            outstanding,
            is_up: false,
            is_arriving: false,
            is_damaged: false,
            is_partial: false,
            probing: None,
            is_proven: false,
            wrong: None,
        }
    }

    fn words(&self, end: &ClientMachine<2>, known: &Known, words: &mut Vec<Word>) {
        if end.free_place().is_some() {
            words.push(Word::Request { broadcast: false, mirrored: false });
            if !self.is_tcp() {
                words.push(Word::Request { broadcast: false, mirrored: true });
                words.push(Word::Request { broadcast: true, mirrored: false });
            }
        }
        let ended = |place: &u8| known.jobs[usize::from(*place)].is_some_and(|job| job.has_ended);
        words.extend((0..2).filter(ended).map(Word::Take));
        if end.link == ClientLink::Down {
            return;
        }
        if !self.is_tcp() {
            words.push(Word::Bytes);
            // The rest of a reply comes in later bytes than its beginning.
            if !known.is_arriving || known.is_partial {
                return;
            }
            words.push(Word::Corrupt);
            if end.in_flight() > 0 && matches!(end.link, ClientLink::Up { line: Line::Busy { .. }, .. }) {
                words.push(Word::Partial);
            }
            if known.is_damaged {
                words.extend([Fit::Exception, Fit::OpenException].map(Word::Data));
            }
            // A line that returns the sent bytes is detected by the probe, if that comes back whole: from then on the echo
            // is known.
            if known.awaits_mirror(end) && !known.is_proven {
                words.push(Word::Returned);
            }
        }
        let equal = known.awaits_mirror(end).then_some(Fit::Equal);
        if self.keeps_rules {
            let reply = |outstanding: &Outstanding| {
                let Outstanding { id, transaction, .. } = *outstanding;
                let fits = [Fit::Whole, Fit::Exception, Fit::OpenException].into_iter().chain(equal);
                fits.map(move |fit| Word::Reply { id, transaction, fit })
            };
            words.extend(known.outstanding.iter().flat_map(reply));
        } else {
            for transaction in 0..if self.is_tcp() { 4 } else { 1 } {
                let fits = [Fit::Whole, Fit::Exception, Fit::OpenException, Fit::Misfit];
                words.extend(fits.into_iter().chain(equal).map(|fit| Word::Reply {
                    id: NOBODY,
                    transaction,
                    fit,
                }));
            }
        }
    }

    fn by(&self, word: Word) -> By {
        match word {
            Word::Request { .. } | Word::Take(_) => By::User,
            Word::Bytes
            | Word::Partial
            | Word::Reply { .. }
            | Word::Returned
            | Word::Corrupt
            | Word::Data(_) => By::Line,
        }
    }

    fn hear(&self, end: &ClientMachine<2>, known: &mut Known, word: Word) -> Option<InputOf<Self>> {
        Some(match word {
            Word::Request { broadcast, mirrored } => Input::Request { broadcast, mirrored },
            Word::Take(place) => Input::Taken { place },
            Word::Bytes => {
                known.is_arriving = true;
                known.is_partial = false;
                Input::Received
            }
            Word::Partial => {
                known.is_partial = true;
                Input::Partial
            }
            Word::Corrupt => {
                (known.is_damaged, known.is_partial) = (true, false);
                Input::Corrupt
            }
            Word::Data(fit) => Input::Reply { transaction: 0, fit },
            Word::Returned => {
                (known.is_damaged, known.is_partial) = (false, false);
                Input::Reply { transaction: 0, fit: Fit::Equal }
            }
            Word::Reply { id, transaction, fit } => {
                (known.is_damaged, known.is_partial) = (false, false);
                let is_doubtful = |held: &Held| match held.stage {
                    Stage::Probing { doubtful, .. } | Stage::InFlight { doubtful, .. } => doubtful,
                    _ => false,
                };
                // Otherwise it stays in the decoder, and is read again.
                if fit != Fit::OpenException || !end.held().any(is_doubtful) {
                    let is_it = |outstanding: &Outstanding| {
                        (outstanding.id, outstanding.transaction) == (id, transaction)
                    };
                    known.outstanding.retain(|outstanding| !is_it(outstanding));
                }
                // A fitting frame is compared with the request to which it seems to belong.
                let is_expected = end.expects(transaction, &self.config).is_some();
                Input::Reply { transaction, fit: if is_expected { fit } else { Fit::Whole } }
            }
        })
    }

    fn sent(&self, due: &Due) -> InputOf<Self> {
        Input::Sent(*due)
    }

    fn acted(&self, end: &ClientMachine<2>, known: &mut Known, cause: CauseOf<Self>, action: Action) {
        if let Cause::Sent(due) = cause {
            self.was_sent(known, due, action);
        }
        if let Some(place) = known.probing
            && !end.held().any(|held| matches!(held.stage, Stage::Probing { .. }))
        {
            known.probing = None;
            known.is_proven |= matches!(cause, Cause::Word(Word::Reply { .. }));
            known.jobs[usize::from(place)].iter_mut().for_each(|job| job.was_probed = true);
        }
        match action {
            Action::Keep { place } => {
                let id = (0..).find(|id| !known.has(*id)).unwrap_or(NOBODY);
                let is_mirrored = matches!(cause, Cause::Word(Word::Request { mirrored: true, .. }));
                known.jobs[usize::from(place)] = Some(Job {
                    id,
                    is_mirrored,
                    was_sent: false,
                    was_probed: false,
                    is_stale: false,
                    has_ended: false,
                });
            }
            Action::Replied { place } => {
                if let Cause::Word(Word::Returned | Word::Reply { fit: Fit::Equal, .. }) = cause {
                    if !known.is_proven {
                        known.wrong = Some(RETURNED);
                    }
                } else {
                    known.is_proven = true;
                }
                let job = known.end(place, true);
                if let (Cause::Word(Word::Reply { id, fit, .. }), Some(job)) = (cause, job) {
                    if self.keeps_rules && job.id != id {
                        known.wrong = Some(FOREIGN_REPLY);
                    }
                    if fit == Fit::Misfit {
                        known.wrong = Some(FITS);
                    }
                }
                if matches!(cause, Cause::Word(Word::Data(_))) {
                    known.wrong = Some(DATA);
                }
            }
            Action::Refused { place } | Action::Announced { place } => {
                known.end(place, true);
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
                let waits = |held: &Held| match held.stage {
                    Stage::Probing { deadline, .. } | Stage::InFlight { deadline, .. } => !deadline.is_zero(),
                    _ => false,
                };
                if known.is_partial && end.held().any(waits) {
                    known.wrong = Some(REST);
                }
                known.is_partial = false;
            }
            Action::Nothing | Action::Sent | Action::Stray { .. } | Action::Hold => {}
        }
        match cause {
            Cause::Word(Word::Take(place)) => known.jobs[usize::from(place)] = None,
            Cause::Connected | Cause::Disconnected => {
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
            _ => {}
        }
    }

    fn tick(&self, known: &mut Known) {
        (known.is_arriving, known.is_damaged) = (false, false);
        if !self.is_tcp() {
            known.age();
        }
    }

    fn restarted(&self, known: &mut Known) {
        (known.jobs, known.is_up) = ([None; 2], false);
        (known.probing, known.is_proven) = (None, false);
        self.reconnected(known);
    }

    fn broken(&self, _: &ClientMachine<2>, known: &Known, broken: &mut Vec<&'static str>) {
        broken.extend(known.wrong);
    }

    /// Returns whether each request has an outcome, which must happen whatever the server does.
    fn is_over(&self, _: &ClientMachine<2>, known: &Known) -> bool {
        known.jobs.iter().flatten().all(|job| job.has_ended)
    }
}

impl AnyServer {
    fn was_sent(&self, known: &mut Known, due: Due, action: Action) {
        if self.is_serial() && known.is_arriving {
            known.wrong = Some(COLLISION);
        }
        known.is_damaged = false;
        if self.is_tcp() {
            known.age();
        }
        if due.probe {
            known.probing = Some(due.place);
            if self.keeps_rules {
                // Of several of these reads the last is answered last.
                known.outstanding.retain(|outstanding| outstanding.id != NOBODY);
                known.outstanding.push(Outstanding { id: NOBODY, transaction: 0, left: self.memory });
            }
            return;
        }
        let Some(job) = &mut known.jobs[usize::from(due.place)] else { return };
        if job.is_mirrored && !known.is_proven && !job.was_probed {
            known.wrong = Some(PROVEN);
        }
        if job.is_stale {
            known.wrong = Some(STALE);
        }
        if core::mem::replace(&mut job.was_sent, true) || job.has_ended {
            known.wrong = Some(SENT);
        }
        if action == Action::Sent && self.keeps_rules {
            known.outstanding.push(Outstanding {
                id: job.id,
                transaction: due.transaction,
                left: self.memory,
            });
        }
    }
}

impl Known {
    /// Returns whether a request is in flight whose reply can equal it.
    fn awaits_mirror(&self, end: &ClientMachine<2>) -> bool {
        end.held().any(|held| {
            let job = self.jobs[usize::from(held.place)];
            matches!(held.stage, Stage::InFlight { .. }) && job.is_some_and(|job| job.is_mirrored)
        })
    }

    fn has(&self, id: u8) -> bool {
        self.jobs.iter().flatten().any(|job| job.id == id)
            || self.outstanding.iter().any(|outstanding| outstanding.id == id)
    }

    /// Removes a request with an outcome; `was_sent` is whether the request was sent.
    fn end(&mut self, place: u8, was_sent: bool) -> Option<Job> {
        let job = self.jobs[usize::from(place)].as_mut().filter(|job| !job.has_ended);
        let Some(job) = job else {
            self.wrong = Some(ENDED_TWICE);
            return None;
        };
        if job.was_sent != was_sent {
            self.wrong = Some(SENT);
        }
        job.has_ended = true;
        Some(*job)
    }

    fn end_all(&mut self, places: Places, was_sent: bool) {
        for place in places.iter() {
            self.end(place, was_sent);
        }
    }

    fn age(&mut self) {
        self.outstanding.iter_mut().for_each(|outstanding| outstanding.left -= 1);
        self.outstanding.retain(|outstanding| outstanding.left > 0);
    }
}
