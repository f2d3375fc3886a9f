//! A client and a server over TCP, on a serial line, and over RTU through TCP. A job is a request.

mod any_client;
mod bank;
mod hostile;
mod lawful;

use core::time::Duration;

use fanuc_hmi_modbus::{
    Client, ClientConfig, ClientEvent, DecodeError, Failure, Frame, Reply, Request, Server, ServerConfig,
    Side, Ticket, Words,
};
use robot_session::Session as _;
use robot_session::end::End as _;

use self::any_client::AnyClient;
use self::bank::{Asked, Bank, REFUSALS, Write, is_held};
use self::lawful::{Lawful, PLANTED, planted};
use super::{Check, Ledger, Log, Peer, Reported, Row, Tally, Wire};
use crate::link::{End, Faults};
use crate::turn;
use robot_session::contract::Rng;

pub(super) const TCP: Row = Row {
    link: "fanuc-hmi-modbus",
    transport: "tcp",
    job: "requests",
    one_in: None,
    session: |seed, log| session(seed, Way::Tcp, Sabotage::None, Peer::Ours, log),
};

pub(super) const RTU: Row = Row {
    transport: "rtu",
    one_in: Some(65_536),
    session: |seed, log| session(seed, Way::Rtu, Sabotage::None, Peer::Ours, log),
    ..TCP
};

pub(super) const RTU_OVER_TCP: Row = Row {
    transport: "rtu-over-tcp",
    session: |seed, log| session(seed, Way::RtuOverTcp, Sabotage::None, Peer::Ours, log),
    ..TCP
};

// The three ways take turns.
pub(super) const ANY_SERVER: Row = Row {
    transport: "any server",
    session: |seed, log| session(seed, way(seed), Sabotage::None, Peer::Any(End::B), log),
    ..RTU
};

pub(super) const ANY_CLIENT: Row = Row {
    transport: "any client",
    session: |seed, log| session(seed, way(seed), Sabotage::None, Peer::Any(End::A), log),
    ..RTU
};

pub(super) const HOSTILE_SERVER: Row = Row {
    transport: "hostile server",
    session: |seed, log| session(seed, way(seed), Sabotage::None, Peer::Hostile(End::B), log),
    ..RTU
};

pub(super) const HOSTILE_CLIENT: Row = Row {
    transport: "hostile client",
    session: |seed, log| session(seed, way(seed), Sabotage::None, Peer::Hostile(End::A), log),
    ..RTU
};

fn way(seed: u64) -> Way {
    [Way::Tcp, Way::Rtu, Way::RtuOverTcp][(seed % 3) as usize]
}

/// Rows whose server drops an acknowledged write, and whose network repeats bytes: the soak must detect both.
pub const SABOTAGED: [Row; 2] = [
    Row { session: |seed, log| session(seed, Way::Tcp, Sabotage::Forget, Peer::Ours, log), ..TCP },
    Row { session: |seed, log| session(seed, Way::Tcp, Sabotage::Repeat, Peer::Ours, log), ..TCP },
];

const MS: Duration = Duration::from_millis(1);
const LIMIT: Duration = Duration::from_secs(3600);
const UNIT: u8 = 1;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Way {
    Tcp,
    Rtu,
    RtuOverTcp,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Sabotage {
    None,
    Forget,
    Repeat,
}

/// No reply comes later after its request: request and reply pause for 10 s each, after a broadcast that did, and both ends are
/// polled 5 s late.
const SETTLE: Duration = Duration::from_secs(45);

struct Cell {
    now: Duration,
    log: Log,
    way: Way,
    sabotage: Sabotage,
    wire: Wire,
    ledger: Ledger,
    /// Written without a request.
    aliens: Vec<Write>,
    asked: Vec<Asked>,
    open: Vec<(Ticket, usize)>,
    client: Client<4>,
    server: Server<Bank>,
    /// In place of the server's replies: whatever the protocol has.
    hostile: bool,
    /// Another server, in place of the project's own and of its answers.
    lawful: Option<Lawful>,
    /// Another client, in place of the project's own.
    other: Option<AnyClient>,
    /// There are other units on the line.
    has_neighbours: bool,
    /// Nothing is refused and nothing is late any more.
    is_calm: bool,
    /// Whether, until the end of the faults, the client's reports prove nothing about the server.
    harassed: bool,
    /// The connection is lost, and the ends have noticed it.
    lost: [bool; 2],
    /// The client notices no lost connection before.
    half_open_until: Duration,
    violations: u64,
    /// There are no more faults: nothing may fail.
    healed: bool,
    stuck: bool,
}

fn session(seed: u64, way: Way, sabotage: Sabotage, peer: Peer, log: Log) -> Tally {
    let mut rng = Rng::new(!seed);
    let bad = rng.unit();
    let baud = [9600, 19_200, 115_200][rng.below(3)];
    let has_neighbours = sabotage == Sabotage::None && way != Way::Tcp && rng.chance(0.5);
    let tcp = Faults {
        disconnect: 0.08 * bad,
        max_delay: [300 * MS, 1500 * MS][rng.below(2)],
        pause: 100 * MS,
        stall: 0.1 * bad,
        ..Faults::TCP
    };
    let (mut client, server, faults) = match way {
        Way::Tcp => (ClientConfig::tcp(), ServerConfig::tcp(), tcp),
        Way::RtuOverTcp => (ClientConfig::rtu_over_tcp(), ServerConfig::rtu_over_tcp(UNIT), tcp),
        Way::Rtu => {
            let faults = Faults {
                flip: 0.003 * bad,
                lose_byte: 0.002 * bad,
                insert: 0.002 * bad,
                lose: 0.02,
                pause: [Duration::ZERO, MS, 5 * MS][rng.below(3)],
                // Two silences, right before and right after such data, would make a frame of it.
                stall: if has_neighbours { 0.0 } else { 0.1 * bad },
                ..Faults::SERIAL
            };
            (ClientConfig::rtu(baud), ServerConfig::rtu(UNIT, baud), faults.at_baud(baud))
        }
    };
    if way == Way::Tcp {
        client.in_flight = 1 + rng.below(4);
    }
    client.settle = SETTLE;
    let faults = match sabotage {
        Sabotage::Repeat => Faults { datagrams: true, repeat: 0.2, split: 0.0, merge: 0.0, ..faults },
        Sabotage::Forget | Sabotage::None => faults,
    };
    let hostile = peer == Peer::Hostile(End::B);
    let silence = server.framing.silence().unwrap_or_default();
    let other = (peer == Peer::Any(End::A)).then(|| AnyClient::new(way, silence, MS, &mut rng));
    let mut cell = Cell {
        now: MS,
        log,
        way,
        sabotage,
        wire: Wire::new(seed, faults, ["client", "server"], false, log),
        ledger: Ledger::default(),
        aliens: Vec::new(),
        asked: Vec::new(),
        open: Vec::new(),
        client: Client::new(client).expect("a configuration that works"),
        server: Server::new(server, Bank::default()).expect("a configuration that works"),
        hostile,
        lawful: (peer == Peer::Any(End::B)).then(Lawful::default),
        other,
        has_neighbours,
        is_calm: false,
        harassed: hostile,
        lost: [false; 2],
        half_open_until: Duration::ZERO,
        violations: 0,
        healed: false,
        stuck: false,
    };
    cell.wire.poll_late(0.02 * bad);
    cell.client.handle_connected(cell.now);
    cell.server.handle_connected(cell.now);
    if peer == Peer::Hostile(End::A) {
        cell.pester(&mut rng);
    }
    let jobs = 5 + rng.below(36);
    while cell.now < LIMIT && (cell.asked.len() < jobs || cell.open() > 0) {
        while cell.asked.len() < jobs && cell.ask(&mut rng) {}
        cell.restart(&mut rng, 0.002 * bad);
        cell.step(&mut rng);
    }
    cell.heal(&mut rng);
    cell.settle()
}

impl Cell {
    /// Submits a request; returns false if there is no free slot.
    fn ask(&mut self, rng: &mut Rng) -> bool {
        let n = self.asked.len() as u16;
        // Address and values show which job it is, both.
        let address = 1000 + 16 * n;
        let words = [n, !n, n.wrapping_mul(31) ^ 0x1010];
        let bits: [bool; 12] = core::array::from_fn(|bit| n >> bit & 1 == 1);
        let some = 1 + rng.below(40);
        let writes = |values: &[u16]| Asked::Write((address, values.to_vec()));
        let looks_like_requests = planted(rng);
        let (request, asked) = match rng.below(10) {
            0 => (Request::WriteRegister { address, value: n }, writes(&words[..1])),
            1 => (Request::WriteRegisters { address, values: (&words).into() }, writes(&words)),
            2 => (Request::MaskWriteRegister { address, and: 0, or: n }, writes(&words[..1])),
            3 => {
                let values = Words::from(&words);
                let (quantity, write_address) = (some as u16, address);
                let address = if self.has_neighbours { REFUSALS } else { n };
                let request = Request::ReadWriteRegisters { address, quantity, write_address, values };
                (request, writes(&words))
            }
            4 => {
                let coils: Vec<_> = bits.iter().map(|bit| u16::from(*bit)).collect();
                (Request::WriteCoils { address, values: (&bits).into() }, writes(&coils))
            }
            5 => (Request::WriteCoil { address, value: true }, writes(&[1])),
            6 => (Request::ReadCoils { address: n, quantity: some as u16 }, Asked::Coils(n, some)),
            7 => {
                let quantity = some as u16;
                (Request::ReadHoldingRegisters { address: n, quantity }, Asked::Registers(n, some))
            }
            8 if self.way != Way::Tcp && self.has_neighbours => {
                let values = &looks_like_requests[..];
                (Request::WriteRegisters { address, values: values.into() }, writes(values))
            }
            _ => (Request::ReadInputRegisters { address: n, quantity: 1 }, Asked::Refusal),
        };
        let announces = self.way != Way::Tcp && !request.reads() && rng.chance(0.05);
        let unit = if announces { 0 } else { UNIT };
        if self.other.is_some() {
            if !self.send(unit, &request, rng) {
                return false;
            }
        } else if let Ok(ticket) = self.client.request(unit, &request) {
            self.open.push((ticket, self.ledger.send(self.wire.mark())));
        } else {
            return false;
        }
        self.log.line(self.now, format_args!("job {n}: {request:?}"));
        self.asked.push(asked);
        true
    }

    /// Returns the number of requests without an outcome.
    fn open(&self) -> usize {
        self.open.len() + self.other.as_ref().map_or(0, |other| other.open.len())
    }

    /// Restarts either end, which has then lost its memory.
    fn restart(&mut self, rng: &mut Rng, chance: f64) {
        if rng.chance(chance) {
            self.log.line(self.now, format_args!("the client begins again"));
            let client = Client::new(*self.client.config()).expect("it worked before");
            self.violations += core::mem::replace(&mut self.client, client).statistics().unexpected;
            for (_, job) in core::mem::take(&mut self.open) {
                self.ledger.report(job, Reported::Unknown, self.wire.mark());
            }
            self.forget();
            let quiet_until = if self.way == Way::Rtu { self.now + SETTLE } else { self.now };
            let silence = self.server.config().framing.silence().unwrap_or_default();
            self.other = self.other.take().map(|_| AnyClient::new(self.way, silence, quiet_until, rng));
            self.begin_again(0);
        }
        if rng.chance(chance) {
            self.log.line(self.now, format_args!("the server begins again"));
            self.lawful = self.lawful.take().map(|_| Lawful::default());
            let server = Server::new(*self.server.config(), Bank::default()).expect("it worked before");
            self.violations += core::mem::replace(&mut self.server, server).statistics().unexpected;
            self.begin_again(1);
        }
        if self.way != Way::Rtu && rng.chance(chance) {
            self.half_open_until = self.now + rng.log_uniform(MS, Duration::from_secs(5));
        }
    }

    /// Restarts an end: on a serial line it opens its port again; a connection is lost, and made again when both ends have
    /// noticed the loss.
    fn begin_again(&mut self, end: usize) {
        if self.way != Way::Rtu {
            self.wire.disconnect(self.now);
            self.lost[end] = true;
        } else if end == 0 {
            self.client.handle_connected(self.now);
        } else {
            self.server.handle_connected(self.now);
        }
    }

    fn step(&mut self, rng: &mut Rng) {
        let timeouts = [self.client.poll_timeout(), self.server.poll_timeout()];
        let half_open = Some(self.half_open_until).filter(|until| *until > self.now);
        let answers = self.lawful.as_ref().and_then(|lawful| lawful.next(self));
        let other = self.other.as_ref().and_then(AnyClient::next);
        self.now = self.wire.next(self.now, timeouts.into_iter().chain([half_open, answers, other]));
        if self.has_neighbours && !self.is_calm && rng.chance(0.02) {
            self.neighbour(rng);
        }
        let now = self.now;
        let wire = &mut self.wire;
        // An end that has lost the connection, or was restarted, receives no more bytes of it.
        for (end, _) in [End::A, End::B].into_iter().zip(self.lost).filter(|(_, lost)| *lost) {
            while wire.receive(end, now).is_some() {}
        }
        if self.lost[1] {
            // It waits for the next connection.
        } else if self.hostile {
            self.harass(rng);
        } else if let Some(mut lawful) = self.lawful.take() {
            self.answer(&mut lawful, rng);
            self.lawful = Some(lawful);
        } else {
            let log = self.log;
            turn(&mut self.wire, End::B, &mut self.server, now, |_, event| {
                log.line(now, format_args!("  server: {event:?}"))
            });
            self.lost[1] |= !self.wire.is_connected() && self.wire.next_delivery().is_none();
            for write in core::mem::take(&mut self.server.registers_mut().writes) {
                self.execute(write, rng);
            }
        }
        if !self.lost[0] && self.now < self.half_open_until && !self.wire.is_connected() {
            self.client.handle_timeout(self.now); // what it sends is gone
            let mut out = [0; Frame::MAX_LEN];
            while self.client.poll_transmit(self.now, &mut out).is_some() {}
        }
        if !self.lost[0]
            && let Some(mut other) = self.other.take()
        {
            self.listen(&mut other);
            self.other = Some(other);
        }
        let mut events = Vec::new();
        if !self.lost[0] && (self.now >= self.half_open_until || self.wire.is_connected()) {
            let (asked, open) = (&self.asked, &self.open);
            turn(&mut self.wire, End::A, &mut self.client, now, |client, event| {
                let job = event.outcome_of().and_then(|it| open.iter().find(|(open, _)| *open == it));
                let reply = event.outcome_of().and_then(|ticket| client.reply(ticket));
                let right = job.zip(reply).is_some_and(|((_, job), reply)| is_held(&asked[*job], &reply));
                let refused = matches!(reply, Some(Reply::Exception { .. }));
                events.push((event, right, refused));
            });
            self.lost[0] |= !self.wire.is_connected() && self.wire.next_delivery().is_none();
        }
        for (event, right, refused) in events {
            self.note(event, right, refused);
        }
        if self.lost == [true; 2] {
            self.wire.reconnect(self.now);
            self.forget();
            self.client.handle_disconnected(self.now);
            self.client.handle_connected(self.now);
            self.server.handle_disconnected(self.now);
            self.server.handle_connected(self.now);
            self.lost = [false; 2];
        }
    }

    fn execute(&mut self, write: Write, rng: &mut Rng) {
        self.log.line(self.now, format_args!("  written: {} {:?}", write.0, write.1));
        if write.1 == [PLANTED] {
            self.log.line(self.now, format_args!("!!! it was data"));
            self.violations += 1;
        }
        if self.sabotage == Sabotage::Forget && rng.chance(0.05) {
            return;
        }
        let job = self.asked.iter().position(|asked| matches!(asked, Asked::Write(asked) if *asked == write));
        if !job.is_some_and(|job| self.ledger.execute(job)) {
            self.aliens.push(write);
        }
    }

    fn note(&mut self, event: ClientEvent, right: bool, refused: bool) {
        self.log.line(self.now, format_args!("  client: {event:?}"));
        self.stuck |= self.healed && matches!(event, ClientEvent::Failed { .. });
        let harassed = self.harassed && !self.healed;
        let outcome = match event {
            _ if harassed => Reported::Unknown,
            ClientEvent::Replied { .. } if refused => Reported::NotDone,
            ClientEvent::Replied { .. } => Reported::Done,
            ClientEvent::Failed { failure: Failure::NotSent, .. } => Reported::NotDone,
            ClientEvent::Corrupt(_) | ClientEvent::OutOfStep(_) if self.way == Way::Tcp => {
                self.log.line(self.now, format_args!("!!! TCP corrupts nothing"));
                self.violations += 1;
                return;
            }
            _ => Reported::Unknown,
        };
        let Some(ticket) = event.outcome_of() else { return };
        match self.open.iter().position(|(open, _)| *open == ticket) {
            Some(place) => {
                let (_, job) = self.open.remove(place);
                // The result of a read is right if it equals the registers.
                if right {
                    self.ledger.execute(job);
                }
                self.ledger.report(job, outcome, self.wire.mark());
            }
            None => {
                self.log.line(self.now, format_args!("!!! it has ended before"));
                self.violations += 1;
            }
        }
    }

    /// Ends all faults: open requests end, and then four requests must be done within a minute.
    fn heal(&mut self, rng: &mut Rng) {
        self.wire.heal(self.now);
        self.is_calm = true;
        if core::mem::take(&mut self.hostile) && self.way != Way::Rtu {
            // A good server takes its place, on a connection of its own.
            self.begin_again(1);
        }
        self.wait(self.client.config().timeout + SETTLE + Duration::from_secs(10), rng);
        let (first, end) = (self.asked.len(), self.now + Duration::from_secs(60));
        let open = self.open();
        self.healed = true;
        while self.now < end && (self.asked.len() < first + 4 || self.open() > 0) {
            while self.asked.len() < first + 4 && self.ask(rng) {}
            self.step(rng);
        }
        self.stuck |= open > 0 || self.asked.len() < first + 4 || self.open() > 0;
        // A write that is still in flight may happen within this time.
        self.wait(2 * Duration::from_secs(1), rng);
    }

    fn wait(&mut self, time: Duration, rng: &mut Rng) {
        let end = self.now + time;
        while self.now < end {
            let idle = [self.client.poll_timeout(), self.server.poll_timeout(), self.wire.next_delivery()];
            if idle == [None; 3] {
                self.now = end;
            }
            self.step(rng);
        }
    }

    fn settle(self) -> Tally {
        let unexpected = self.client.statistics().unexpected + self.server.statistics().unexpected;
        let invented = self.violations + unexpected;
        let mut tally = Tally { invented, stuck: self.stuck.into(), ..Tally::default() };
        let side = |from| if from == End::A { Side::Client } else { Side::Server };
        let unseen =
            self.wire.settle(
                self.now,
                &mut tally,
                Frame::MAX_RTU_LEN,
                |from, bytes| match Frame::decode_rtu(bytes, side(from)) {
                    // Data that looks like a frame was not made by corruption.
                    Ok(Some((frame, _))) if lawful::is_planted(frame.pdu) => Check::Nothing,
                    Ok(Some((_, len))) => Check::Good(len),
                    Err(DecodeError::Crc { .. }) => Check::Refused,
                    Ok(None) | Err(_) => Check::Nothing,
                },
            );
        for alien in &self.aliens {
            let made = |bytes: &[u8]| {
                let mut bank = Bank::default();
                let mut out = [0; Frame::MAX_LEN];
                let frame = Frame::decode_rtu(bytes, Side::Client).ok().flatten();
                frame.and_then(|(frame, _)| frame.serve(&mut bank, &mut out));
                bank.writes.contains(alien)
            };
            if !unseen.iter().any(|unseen| unseen.from == End::A && made(&unseen.bytes)) {
                self.log.line(self.now, format_args!("!!! unsolicited: {alien:?}"));
                tally.invented += 1;
            }
        }
        self.ledger.settle(self.now, self.log, &mut tally, |job| {
            unseen.iter().any(|unseen| unseen.is_between(job.from, job.to))
        });
        tally
    }
}
