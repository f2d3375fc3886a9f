//! The client.

use core::time::Duration;

use anyhow::{Result, bail, ensure};
use fanuc_hmi_modbus::{
    Client, ClientAction, ClientConfig, ClientEvent, ClientInput, ClientLink, ClientMachine,
    ClientStatistics, Decoder, Failure, Frame, Framing, Line, PduBuf, Quiet, Reply, Rule, Side, Stage,
    Ticket,
};
use robot_session::{Decoder as _, Session};
use serde_json::{Map, Value};

use super::{Transport, places, prefix, silent_at, timed};
use crate::ends::{Do, Driven, End, Fields, Hooks, Maker, event, kind, show, unexpected};

pub(in crate::ends) const MAKER: Maker = Maker {
    make,
    rules: || {
        [
            "MatchTransaction",
            "FreshTransaction",
            "OneInFlight",
            "CheckReply",
            "DrainFirst",
            "ReadBeforeSend",
            "WaitForSilence",
            "CutAtSilence",
            "EndAtDisconnect",
            "DropQueued",
        ]
        .map(String::from)
        .to_vec()
    },
};

const RULES: [Rule; 10] = [
    Rule::MatchTransaction,
    Rule::FreshTransaction,
    Rule::OneInFlight,
    Rule::CheckReply,
    Rule::DrainFirst,
    Rule::ReadBeforeSend,
    Rule::WaitForSilence,
    Rule::CutAtSilence,
    Rule::EndAtDisconnect,
    Rule::DropQueued,
];

fn make(config: &Map<String, Value>, without: Option<usize>) -> Result<Box<dyn End>> {
    let mut fields = Fields(config.clone());
    let transport = Transport::take(&mut fields)?;
    let mut made = match transport.framing()? {
        Framing::Tcp => ClientConfig::tcp(),
        Framing::Rtu { .. } => ClientConfig::rtu(transport.baud),
        Framing::RtuOverTcp { .. } => ClientConfig::rtu_over_tcp(),
    };
    made.framing = transport.framing()?;
    fields.time("timeout", &mut made.timeout)?;
    fields.take("in_flight", &mut made.in_flight)?;
    fields.take("any_unit", &mut made.any_unit)?;
    fields.take("broadcast", &mut made.broadcast)?;
    fields.time("turnaround", &mut made.turnaround)?;
    fields.time("settle", &mut made.settle)?;
    let places = places(&mut fields)?;
    fields.end()?;
    made.without = without.and_then(|rule| RULES.get(rule)).copied();
    Ok(match places {
        2 => Box::new(Driven::<ModbusClient<2>>(Watched::new(made)?)),
        8 => Box::new(Driven::<ModbusClient<8>>(Watched::new(made)?)),
        _ => bail!("a client of the stories has 2 or 8 places"),
    })
}

struct ModbusClient<const N: usize>;

impl<const N: usize> Hooks for ModbusClient<N> {
    type Session = Watched<N>;

    fn call(
        watched: &mut Watched<N>,
        now: Duration,
        name: &str,
        argument: Value,
    ) -> Result<Result<(), String>> {
        ensure!(name == "request", "a client has no call {name}");
        let Ok(frame) = serde_json::from_value::<Frame<PduBuf>>(argument) else {
            return Ok(Err(kind("message")));
        };
        let request = frame.pdu.request()?;
        Ok(match watched.client.request(frame.unit, &request) {
            Ok(ticket) => {
                let broadcast = watched.client.config().is_broadcast(frame.unit);
                watched.requested(now, ticket, frame, broadcast);
                Ok(())
            }
            Err(error) => Err(show(&error)),
        })
    }

    fn event(watched: &Watched<N>, happened: ClientEvent) -> Result<String> {
        Ok(match happened {
            ClientEvent::Replied { ticket, unit } => {
                // Without the rule that checks it, it may be none.
                let message = watched.client.reply(ticket).map(|pdu| Frame { transaction: None, unit, pdu });
                event("replied").raw("ticket", ticket.number()).raw("message", show(&message)).end()
            }
            ClientEvent::Announced { ticket } => event("announced").raw("ticket", ticket.number()).end(),
            ClientEvent::Failed { ticket, failure } => {
                let object = event("failed").raw("ticket", ticket.number());
                match failure {
                    Failure::TimedOut => object.value("reason", "timed_out")?,
                    Failure::Disconnected => object.value("reason", "disconnected")?,
                    Failure::NotSent => object.value("reason", "not_sent")?,
                    Failure::Refused(mismatch) => {
                        object.value("reason", "mismatch")?.raw("mismatch", show(&mismatch))
                    }
                    Failure::Malformed(error) => {
                        object.value("reason", "malformed")?.raw("error", show(&error))
                    }
                    _ => bail!("a reason without a name"),
                }
                .end()
            }
            ClientEvent::Stray { transaction, unit, function, late, mismatch } => event("stray")
                .optional("transaction", transaction.as_ref())?
                .raw("unit", unit)
                .raw("function", function)
                .optional("late", late.map(Ticket::number).as_ref())?
                .optional("mismatch", mismatch.as_ref())?
                .end(),
            ClientEvent::Corrupt(error) => event("corrupt").raw("error", show(&error)).end(),
            ClientEvent::OutOfStep(error) => event("out_of_step").raw("error", show(&error)).end(),
            ClientEvent::Unexpected(what) => unexpected(what)?,
            _ => bail!("an event without a name"),
        })
    }

    fn state(watched: &Watched<N>) -> String {
        let machine = watched.client.machine();
        let stages: Vec<&str> = machine.held().map(|held| stage(held.stage)).collect();
        let list = if stages.is_empty() { String::new() } else { format!(" ({})", stages.join(", ")) };
        format!("{}{list}", machine.name())
    }

    fn cells(_: &Watched<N>, after: &Watched<N>, _: Duration, _: &Do, _: bool) -> Vec<String> {
        after.cells.clone()
    }

    fn transmit_cells(before: &Watched<N>, now: Duration, _: bool) -> Vec<String> {
        let mut copy = before.clone();
        copy.reaches(&timed(copy.machine.deadline(), now, "transmit", "transmit, late"));
        copy.cells
    }
}

fn stage(stage: Stage) -> &'static str {
    match stage {
        Stage::Queued => "queued",
        Stage::QueuedBroadcast => "queued broadcast",
        Stage::InFlight { .. } => "in flight",
        Stage::Ended => "ended",
        Stage::TimedOut { .. } => "timed out",
        Stage::Expired { .. } => "expired",
    }
}

/// A client, and a copy of its machine with what that is given.
#[derive(Clone)]
struct Watched<const N: usize> {
    client: Client<N>,
    machine: ClientMachine<N>,
    decoder: Decoder,
    requests: [Option<(Ticket, Frame<PduBuf>)>; N],
    cells: Vec<String>,
}

impl<const N: usize> Watched<N> {
    fn new(config: ClientConfig) -> Result<Self> {
        Ok(Self {
            client: Client::new(config)?,
            machine: ClientMachine::NEW,
            decoder: Decoder::new(config.framing, Side::Server),
            requests: [None; N],
            cells: Vec::new(),
        })
    }

    /// The names of the machine's state in the matrix.
    fn states(&self) -> Vec<&'static str> {
        let framing = self.client.config().framing;
        let stages: Vec<&str> = self.machine.held().map(|held| stage(held.stage)).collect();
        let ClientLink::Up { line, quiet } = self.machine.link else {
            return match stages.as_slice() {
                [] => vec!["without a connection"],
                ["queued"] => vec!["without a connection, a request"],
                _ => Vec::new(),
            };
        };
        let (over, silent) = (quiet == Quiet::Over, line == Line::Silent);
        // Over TCP bytes do not make the line busy: two states of the matrix are one.
        let arriving = !silent || framing == Framing::Tcp;
        // Only a serial line is left alone first.
        let fresh = over != matches!(framing, Framing::Rtu { .. });
        // What has timed out makes a line without transactions quiet.
        let settles = over == (framing == Framing::Tcp);
        let all = [
            ("just connected", stages.is_empty() && silent && fresh),
            ("idle", stages.is_empty() && silent && over),
            ("bytes are arriving", stages.is_empty() && arriving && over),
            ("a request", stages == ["queued"] && silent && over),
            ("two requests", stages == ["queued"; 2] && silent && over && N == 2),
            ("a broadcast", stages == ["queued broadcast"] && silent && over),
            ("in flight", stages == ["in flight"] && silent && over),
            ("in flight, bytes are arriving", stages == ["in flight"] && arriving && over),
            ("replied", stages == ["ended"] && silent && over),
            ("timed out", stages == ["timed out"] && silent && settles),
            ("timed out, and taken", stages == ["expired"] && silent && settles),
            ("broadcast sent", stages == ["ended"] && silent && !over),
        ];
        all.into_iter().filter_map(|(name, is)| is.then_some(name)).collect()
    }

    fn reaches(&mut self, inputs: &[&str]) {
        let prefix = prefix(self.client.config().framing);
        for state in self.states() {
            self.cells.extend(inputs.iter().map(|input| format!("{prefix}, {state}: {input}")));
        }
    }

    /// The machine must take the input, and the copy is then as the original, once the session is done.
    fn gives(&mut self, now: Duration, inputs: &[&str], input: ClientInput) -> ClientAction {
        self.reaches(inputs);
        self.machine.on(now, input, self.client.config()).unwrap_or(ClientAction::Nothing)
    }

    fn is_equal(&self) {
        assert!(self.machine == *self.client.machine(), "{:?}, {:?}", self.machine, self.client.machine());
    }

    fn requested(&mut self, now: Duration, ticket: Ticket, frame: Frame<PduBuf>, broadcast: bool) {
        let name = if broadcast { "broadcast" } else { "request" };
        let action = self.gives(now, &[name], ClientInput::Request { broadcast });
        if let ClientAction::Keep { place } = action
            && let Some(slot) = self.requests.get_mut(usize::from(place))
        {
            *slot = Some((ticket, frame));
        }
        self.is_equal();
    }

    /// What a client makes of a frame: FM-44.
    fn fits(&self, transaction: u16, frame: Frame<&[u8]>) -> bool {
        let place = self.machine.expects(transaction, self.client.config()).map(usize::from);
        let Some(Some((_, request))) = place.and_then(|place| self.requests.get(place)) else { return true };
        let is_unit = request.unit == frame.unit || self.client.config().any_unit;
        let answers = |reply: Reply<'_>| request.pdu.request().is_ok_and(|it| reply.answers(&it).is_ok());
        is_unit && Reply::decode(frame.pdu).is_ok_and(answers)
    }

    fn decode(&mut self, now: Duration) {
        let mut decoder = self.decoder.clone();
        while let Some(found) = decoder.next_frame() {
            let Ok(frame) = found else { continue };
            let transaction = frame.transaction.unwrap_or(0);
            let fits = self.fits(transaction, frame);
            let known = self.machine.held().filter_map(|held| match held.stage {
                Stage::InFlight { transaction, .. }
                | Stage::TimedOut { transaction }
                | Stage::Expired { transaction } => Some(transaction),
                Stage::Queued | Stage::QueuedBroadcast | Stage::Ended => None,
            });
            let known: Vec<u16> = known.collect();
            let names: &[&str] = match (frame.transaction, fits) {
                (_, false) => &["a reply that does not fit"],
                (Some(_), true) if known.is_empty() => &["its reply", "a reply of another transaction"],
                (Some(it), true) if !known.contains(&it) => &["a reply of another transaction"],
                (_, true) => &["its reply"],
            };
            self.gives(now, names, ClientInput::Reply { transaction, fits });
        }
        self.decoder = decoder;
    }
}

impl<const N: usize> Session for Watched<N> {
    type Event = ClientEvent;
    type Statistics = ClientStatistics;

    const MAX_INPUT: usize = 65536;
    const MAX_TRANSMIT: usize = Frame::MAX_LEN;

    fn handle_connected(&mut self, now: Duration) {
        self.gives(now, &["connected"], ClientInput::Connected);
        self.decoder.clear();
        self.client.handle_connected(now);
        self.is_equal();
    }

    fn handle_disconnected(&mut self, now: Duration) {
        self.gives(now, &["disconnected"], ClientInput::Disconnected);
        self.decoder.clear();
        self.client.handle_disconnected(now);
        self.is_equal();
    }

    fn handle_input(&mut self, now: Duration, bytes: &[u8]) {
        if let (ClientLink::Up { line, .. }, false) = (self.machine.link, bytes.is_empty()) {
            let names = timed(silent_at(line), now, "bytes", "bytes after a silence");
            if self.gives(now, &names, ClientInput::Received) == ClientAction::Cut {
                self.decoder.finish();
            }
            let mut rest = bytes;
            while !rest.is_empty() {
                let taken = self.decoder.push(rest);
                rest = rest.get(taken..).unwrap_or_default();
                self.decode(now);
            }
        }
        self.client.handle_input(now, bytes);
        self.is_equal();
    }

    fn handle_timeout(&mut self, now: Duration) {
        loop {
            let names = timed(self.machine.deadline(), now, "timer, early", "timer");
            match self.gives(now, &names, ClientInput::Timer) {
                ClientAction::Cut => {
                    self.decoder.finish();
                    self.decode(now);
                }
                ClientAction::TimedOut(_) => {}
                _ => break,
            }
        }
        self.client.handle_timeout(now);
        self.is_equal();
    }

    fn poll_event(&mut self) -> Option<ClientEvent> {
        let event = self.client.poll_event()?;
        let of = |request: &Option<(Ticket, _)>| request.map(|(ticket, _)| ticket) == event.outcome_of();
        if event.outcome_of().is_some()
            && let Some((place, _)) = (0..).zip(&self.requests).find(|(_, request)| of(request))
        {
            self.gives(Duration::ZERO, &["outcome taken"], ClientInput::Taken { place });
        }
        self.is_equal();
        Some(event)
    }

    fn poll_transmit(&mut self, now: Duration, out: &mut [u8]) -> Option<usize> {
        // Its cell is known before: `transmit_cells`.
        let _ = self.machine.on(now, ClientInput::Transmit, self.client.config());
        let length = self.client.poll_transmit(now, out);
        self.is_equal();
        length
    }

    fn poll_timeout(&self) -> Option<Duration> {
        self.client.poll_timeout()
    }

    fn statistics(&self) -> ClientStatistics {
        self.client.statistics()
    }
}
