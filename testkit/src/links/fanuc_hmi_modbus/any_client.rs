//! A server against clients that are not ours, on a line with units that are not ours.

use core::time::Duration;

use fanuc_hmi_modbus::ServerConfig;
use fanuc_hmi_modbus::server::machine::{Action, Due, Input, ServerLink, ServerMachine};
use robot_session::end::Machine as _;

use super::world::{COLLISION, GIVEN_UP, OTHER_UNIT, TICK, UNIT};
use crate::model::{By, Cause, CauseOf, EXPECTED, InputOf, Peer, Terms};

pub(super) const ANSWERED: &str = "each request that was carried out has one reply, on its connection";
pub(super) const UNANSWERED: &str = "a broadcast is not answered";
pub(super) const REST: &str = "the rest of a request is waited for";
pub(super) const TAKEN: &str = "through TCP every request is carried out";

const PROPERTIES: &[&str] = &[ANSWERED, UNANSWERED, TAKEN, REST, GIVEN_UP, OTHER_UNIT, COLLISION, EXPECTED];
pub(super) const RULES: Terms = Terms {
    keeps: "FM-2, FM-4, FM-10, FM-43",
    free: "what it asks, when it gives up, whether it waits through TCP, what other units send, what the line damages, in which pieces it arrives",
    shows: &[],
    properties: PROPERTIES,
};
pub(super) const ANYTHING: Terms =
    Terms { keeps: "", free: "any bytes at any time", shows: &[], properties: PROPERTIES };

/// A client, and the other units of its line, of which only this is known.
#[derive(Debug, Clone, Copy)]
pub struct AnyClient {
    /// The server's configuration.
    pub config: ServerConfig,
    /// On a serial line it waits for its reply, or a while. Its driver may be late, and the silence unseen.
    pub keeps_rules: bool,
}

/// What is known of the line.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Known {
    /// What has come since the last silence that was seen.
    holds: Vec<Frame>,
    /// A silence was seen after the beginning of a frame, which is to be waited for.
    is_partial: bool,
    /// What the session reads now.
    judging: Vec<Frame>,
    /// What it has read last, and whether nothing has followed it.
    judged: Option<(Frame, bool)>,
    /// Requests that were carried out and are not answered.
    open: u8,
    /// Bytes have come since the last tick.
    is_arriving: bool,
    wrong: Option<&'static str>,
}

/// What comes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Frame {
    /// A request to this server.
    Own,
    /// A request to every unit.
    Broadcast,
    /// A request to another unit, or the reply of one.
    Other,
    /// What is no frame.
    Corrupt,
    /// The beginning of a request to this server.
    Part,
    /// The rest of it.
    Rest,
}

/// What happens.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Word {
    /// Bytes come.
    Bytes(Frame),
    /// The session reads the next of them.
    Read,
    /// It has found that the last of them is the beginning of a frame.
    Partial,
}

impl AnyClient {
    fn is_serial(&self) -> bool {
        matches!(self.config.framing, fanuc_hmi_modbus::Framing::Rtu { .. })
    }
}

impl Peer for AnyClient {
    type End = ServerMachine<2>;
    type Known = Known;
    type Word = Word;

    const TICK: Duration = TICK;

    fn config(&self) -> &ServerConfig {
        &self.config
    }

    fn end(&self) -> ServerMachine<2> {
        ServerMachine::NEW
    }

    fn known(&self) -> Known {
        Known {
            holds: vec![],
            is_partial: false,
            judging: vec![],
            judged: None,
            open: 0,
            is_arriving: false,
            wrong: None,
        }
    }

    fn words(&self, end: &ServerMachine<2>, known: &Known, words: &mut Vec<Word>) {
        if end.link == ServerLink::Down {
            return;
        }
        if known.is_partial {
            words.push(Word::Partial);
        } else if !known.judging.is_empty() {
            words.push(Word::Read);
        } else if self.is_serial() && known.holds.last() == Some(&Frame::Part) {
            words.push(Word::Bytes(Frame::Rest));
        } else if known.holds.len() < 3 {
            let waits = self.is_serial() && self.keeps_rules && (known.is_arriving || known.open > 0);
            let frames = [Frame::Corrupt, Frame::Other, Frame::Broadcast, Frame::Own, Frame::Part];
            let count = if waits { 2 } else { 4 + usize::from(self.is_serial()) };
            words.extend(frames.into_iter().take(count).map(Word::Bytes));
        }
    }

    fn by(&self, _: Word) -> By {
        By::Others
    }

    fn hear(&self, end: &ServerMachine<2>, known: &mut Known, word: Word) -> Option<InputOf<Self>> {
        match word {
            Word::Partial => {
                known.is_partial = false;
                Some(Input::Partial)
            }
            Word::Bytes(Frame::Rest) => {
                known.is_arriving = true;
                known.holds.pop();
                known.holds.push(Frame::Own);
                Some(Input::Received)
            }
            Word::Bytes(frame) => {
                known.is_arriving = true;
                if self.is_serial() { &mut known.holds } else { &mut known.judging }.push(frame);
                Some(Input::Received)
            }
            Word::Read if !end.reads() => None,
            Word::Read => {
                let frame = known.judging.remove(0);
                let is_last = !self.is_serial() || known.judging.is_empty();
                known.judged = Some((frame, is_last));
                let unit = match frame {
                    Frame::Own => UNIT,
                    Frame::Broadcast => 0,
                    Frame::Other => UNIT + 1,
                    Frame::Corrupt | Frame::Part | Frame::Rest => return None,
                };
                Some(Input::Request { unit, is_last })
            }
        }
    }

    fn sent(&self, Due: &Due) -> InputOf<Self> {
        Input::Sent
    }

    fn acted(&self, _: &ServerMachine<2>, known: &mut Known, cause: CauseOf<Self>, action: Action) {
        match (cause, action) {
            (Cause::Connected | Cause::Disconnected, _) => self.restarted(known),
            // Whole frames, or nothing, or the rest is to come.
            (Cause::Due, Action::Cut) if known.holds.contains(&Frame::Corrupt) => known.holds.clear(),
            (Cause::Due, Action::Cut) if known.holds.last() == Some(&Frame::Part) => known.is_partial = true,
            (Cause::Due, Action::Cut) => known.judging = core::mem::take(&mut known.holds),
            (Cause::Due, Action::GiveUp) => known.holds.clear(),
            (Cause::Word(Word::Partial), Action::GiveUp) => known.wrong = Some(REST),
            (Cause::Word(Word::Read), Action::Serve) => {
                known.open += 1;
                match known.judged {
                    Some((Frame::Own, true)) => {}
                    Some((Frame::Own, false)) => known.wrong = Some(GIVEN_UP),
                    Some((Frame::Broadcast, _)) => known.wrong = Some(UNANSWERED),
                    _ => known.wrong = Some(OTHER_UNIT),
                }
            }
            (Cause::Word(Word::Read), Action::Refuse) if !self.is_serial() => known.wrong = Some(TAKEN),
            (Cause::Sent(Due), _) => {
                match known.open.checked_sub(1) {
                    Some(open) => known.open = open,
                    None => known.wrong = Some(ANSWERED),
                }
                if self.is_serial() && known.is_arriving {
                    known.wrong = Some(COLLISION);
                }
            }
            _ => {}
        }
        known.judged = None;
    }

    fn tick(&self, known: &mut Known) {
        known.is_arriving = false;
    }

    fn restarted(&self, known: &mut Known) {
        *known = Known { wrong: known.wrong, ..self.known() };
    }

    fn broken(&self, _: &ServerMachine<2>, known: &Known, broken: &mut Vec<&'static str>) {
        broken.extend(known.wrong);
    }

    fn is_over(&self, _: &ServerMachine<2>, known: &Known) -> bool {
        known.open == 0 && known.holds.is_empty() && known.judging.is_empty()
    }

    fn benign(&self, _: &ServerMachine<2>, known: &Known) -> Option<Word> {
        let read = (!known.judging.is_empty()).then_some(Word::Read);
        if known.is_partial { Some(Word::Partial) } else { read }
    }
}
