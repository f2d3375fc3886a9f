//! A server against clients of other makers, on a line with units of other makers.

use core::time::Duration;

use fanuc_hmi_modbus::server::machine::{Action, DueReply, Input, ServerLink, ServerMachine};
use fanuc_hmi_modbus::{
    Exception, Framing, Registers, Request, Server, ServerConfig, ServerEvent, Words, WordsMut,
};
use robot_session::Encode as _;
use robot_session::end::Machine as _;

use super::world::{COLLISION, TICK, UNIT};
use crate::faults::Faults;
use crate::model::{
    Actor, Cause, CauseOf, EXPECTED, InputOf, Peer, PeerAssumptions, SceneOf, WRITTEN, Wired,
};

pub(super) const ANSWERED: &str = "each request that was carried out has one reply, on its connection";
pub(super) const UNANSWERED: &str = "a broadcast is not answered";
pub(super) const REST: &str = "the rest of a request is waited for";
pub(super) const OTHER_UNIT: &str = "only the unit that was asked carries a request out";
pub(super) const GIVEN_UP: &str = "on a serial line a request that another frame follows is not answered";
pub(super) const TAKEN: &str = "through TCP every request is carried out";

const PROPERTIES: &[&str] = &[ANSWERED, UNANSWERED, TAKEN, REST, GIVEN_UP, OTHER_UNIT, COLLISION, EXPECTED];
pub(super) const RULES: PeerAssumptions = PeerAssumptions {
    keeps: "FM-2, FM-4, FM-10, FM-43",
    free: "what it asks, when it gives up, whether it waits through TCP, what other units send, what the line damages, in which pieces it arrives",
    shows: &[("FM-61", OTHER_UNIT), ("FM-64", ANSWERED), ("FM-64", WRITTEN)],
    properties: PROPERTIES,
};
pub(super) const ANYTHING: PeerAssumptions =
    PeerAssumptions { keeps: "", free: "any bytes at any time", ..RULES };

/// A client, and the other units of its line, of which only this is known.
#[derive(Debug, Clone, Copy)]
pub struct AnyClient {
    /// The server's configuration.
    pub config: ServerConfig,
    /// On a serial line it waits for its reply, or a while. Its driver may be late, and the silence unseen.
    pub keeps_rules: bool,
}

/// The model's knowledge of the line.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Knowledge {
    /// The frames that have arrived since the last silence that was seen.
    holds: Vec<Frame>,
    /// The beginning of a frame, after which a silence was seen.
    waits: Waits,
    /// The frames that the session reads now, or when it has free space for a reply.
    judging: Vec<Frame>,
    /// The frame that the session has read last, and whether nothing has followed it.
    judged: Option<(Frame, bool)>,
    /// Through TCP, RTU frames after bytes that are not a frame are lost.
    is_lost: bool,
    /// Requests that were carried out and are not answered.
    open: u8,
    /// Bytes have come since the last tick.
    is_arriving: bool,
    wrong: Option<&'static str>,
}

/// The fate of the beginning of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
enum Waits {
    Nothing,
    /// A silence was seen after it: its rest is to be waited for.
    Found,
    /// The silence was reported to the machine.
    Said,
}

/// An arrival at the server.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Frame {
    /// A request to this server.
    Own,
    /// A request to every unit.
    Broadcast,
    /// A request to another unit, or the reply of one.
    Other,
    /// Bytes that are not a frame.
    Corrupt,
    /// The beginning of a request to this server.
    Part,
    /// The rest of it.
    Rest,
}

/// Bytes come.
pub type Step = Frame;

impl AnyClient {
    fn framing(&self) -> Framing {
        self.config.framing
    }

    fn is_serial(&self) -> bool {
        matches!(self.framing(), Framing::Rtu { .. })
    }
}

impl Peer for AnyClient {
    type End = ServerMachine<2>;
    type Knowledge = Knowledge;
    type Step = Step;

    const TICK: Duration = TICK;

    fn config(&self) -> &ServerConfig {
        &self.config
    }

    fn end(&self) -> ServerMachine<2> {
        ServerMachine::NEW
    }

    fn known(&self) -> Knowledge {
        Knowledge {
            holds: vec![],
            waits: Waits::Nothing,
            judging: vec![],
            judged: None,
            is_lost: false,
            open: 0,
            is_arriving: false,
            wrong: None,
        }
    }

    fn steps(&self, end: &ServerMachine<2>, known: &Knowledge, steps: &mut Vec<Step>) {
        if end.link == ServerLink::Down {
            return;
        }
        if self.is_serial() && known.holds.last() == Some(&Frame::Part) {
            steps.push(Frame::Rest);
        } else if known.holds.len() + known.judging.len() < 3 {
            let waits = self.is_serial() && self.keeps_rules && (known.is_arriving || known.open > 0);
            let frames = [Frame::Corrupt, Frame::Other, Frame::Broadcast, Frame::Own, Frame::Part];
            let count = if waits { 2 } else { 4 + usize::from(self.is_serial()) };
            steps.extend(frames.into_iter().take(count));
        }
    }

    /// Returns the actor of a word: clients do not wait for the server to read.
    fn by(&self, _: Step) -> Actor {
        Actor::Others
    }

    fn apply(&self, _: &ServerMachine<2>, known: &mut Knowledge, frame: Step) -> Option<InputOf<Self>> {
        known.is_arriving = true;
        let frames = if self.is_serial() { &mut known.holds } else { &mut known.judging };
        if frame == Frame::Rest {
            frames.pop();
            frames.push(Frame::Own);
        } else {
            frames.push(frame);
        }
        Some(Input::Received)
    }

    fn next(&self, end: &ServerMachine<2>, known: &mut Knowledge) -> Option<InputOf<Self>> {
        if known.waits == Waits::Found {
            known.waits = Waits::Said;
            return Some(Input::Partial);
        }
        while end.reads() && !known.judging.is_empty() {
            let frame = known.judging.remove(0);
            let is_last = !self.is_serial() || known.judging.is_empty();
            known.judged = Some((frame, is_last));
            let unit = match frame {
                _ if known.is_lost => continue,
                Frame::Own => UNIT,
                Frame::Broadcast => 0,
                Frame::Other => UNIT + 1,
                // After bytes that are not a frame nothing is read before a stall.
                Frame::Corrupt => {
                    known.is_lost = matches!(self.framing(), Framing::RtuOverTcp { .. });
                    continue;
                }
                Frame::Part | Frame::Rest => continue,
            };
            return Some(Input::Request { unit, is_last });
        }
        None
    }

    fn sent(&self, DueReply: &DueReply) -> InputOf<Self> {
        Input::Sent
    }

    fn acted(&self, _: &ServerMachine<2>, known: &mut Knowledge, cause: CauseOf<Self>, action: Action) {
        let (judged, waits) = (known.judged.take(), core::mem::replace(&mut known.waits, Waits::Nothing));
        match (cause, action) {
            (Cause::Connected | Cause::Disconnected, _) => self.restarted(known),
            // Whole frames, or nothing, or the rest is to come.
            (Cause::Due, Action::Cut) => {
                known.is_lost = false;
                if known.holds.contains(&Frame::Corrupt) {
                    known.holds.clear();
                } else if known.holds.last() == Some(&Frame::Part) {
                    known.waits = Waits::Found;
                } else {
                    known.judging.append(&mut known.holds);
                }
            }
            (_, Action::GiveUp) if waits == Waits::Said => known.wrong = Some(REST),
            (_, Action::GiveUp) => known.holds.clear(),
            (_, Action::Serve) => {
                known.open += 1;
                match judged {
                    Some((Frame::Own, true)) => {}
                    Some((Frame::Own, false)) => known.wrong = Some(GIVEN_UP),
                    Some((Frame::Broadcast, _)) => known.wrong = Some(UNANSWERED),
                    _ => known.wrong = Some(OTHER_UNIT),
                }
            }
            (_, Action::Refuse) if !self.is_serial() => known.wrong = Some(TAKEN),
            (Cause::Sent(DueReply), Action::Sent) => {
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
    }

    fn tick(&self, known: &mut Knowledge) {
        known.is_arriving = false;
    }

    fn restarted(&self, known: &mut Knowledge) {
        *known = Knowledge { wrong: known.wrong, ..self.known() };
    }

    fn broken(&self, _: &ServerMachine<2>, known: &Knowledge, broken: &mut Vec<&'static str>) {
        broken.extend(known.wrong);
    }

    fn is_over(&self, _: &ServerMachine<2>, known: &Knowledge) -> bool {
        known.open == 0 && known.holds.is_empty() && known.judging.is_empty()
    }
}

impl Wired for AnyClient {
    type Session = Server<Bank, 2>;

    // Damaged bytes are words.
    const FAULTS: Faults = Faults { split: 0.3, ..Faults::NONE };

    fn session(&self) -> Server<Bank, 2> {
        Server::new(self.config, Bank).expect("a configuration that works")
    }

    fn speak(&self, _: &Knowledge, frame: Step, _: &mut Server<Bank, 2>, _: Duration) -> Vec<u8> {
        let read = |unit| self.encode(unit, Request::ReadHoldingRegisters { address: 0, quantity: 1 });
        match frame {
            Frame::Own => read(UNIT),
            Frame::Other => read(UNIT + 1),
            Frame::Broadcast => self.encode(0, Request::WriteRegister { address: 0, value: 7 }),
            // As long as a frame of its function: nothing is waited for.
            Frame::Corrupt if self.framing() == Framing::Tcp => vec![0, 0, 0, 1, 0, 6, 1, 3, 0, 0, 0, 1],
            Frame::Corrupt => vec![0xFF, 6, 0, 0, 0, 0, 0, 0],
            Frame::Part => read(UNIT).get(..4).unwrap_or_default().to_vec(),
            Frame::Rest => read(UNIT).get(4..).unwrap_or_default().to_vec(),
        }
    }

    fn is_written(&self, _: &SceneOf<Self>, _: &DueReply, bytes: &[u8]) -> bool {
        bytes.get(if self.framing() == Framing::Tcp { 6 } else { 0 }) == Some(&UNIT)
    }

    fn reports(&self, action: &Action, reports: &mut Vec<String>) {
        match action {
            Action::Serve | Action::ServeBroadcast => reports.push("served".into()),
            Action::Refuse => reports.push("refused".into()),
            _ => {}
        }
    }

    fn reported(&self, event: &ServerEvent) -> Option<String> {
        match event {
            ServerEvent::Served { .. } => Some("served".into()),
            ServerEvent::Refused { .. } => Some("refused".into()),
            ServerEvent::Unexpected(unexpected) => Some(unexpected.to_string()),
            _ => None,
        }
    }
}

impl AnyClient {
    fn encode(&self, unit: u8, request: Request<'_>) -> Vec<u8> {
        let transaction = (self.framing() == Framing::Tcp).then_some(7);
        let mut bytes = [0; fanuc_hmi_modbus::Frame::MAX_LEN];
        let frame = fanuc_hmi_modbus::Frame { transaction, unit, pdu: request };
        let length = frame.encode(&mut bytes).expect("a request fits");
        bytes.get(..length).unwrap_or_default().to_vec()
    }
}

/// Registers of which all are zero.
#[derive(Debug, Clone, Copy)]
pub struct Bank;

impl Registers for Bank {
    fn read_holding_registers(&mut self, _: u16, out: &mut WordsMut<'_>) -> Result<(), Exception> {
        out.fill_with(|_| 0);
        Ok(())
    }

    fn write_registers(&mut self, _: u16, _: Words<'_>) -> Result<(), Exception> {
        Ok(())
    }
}
