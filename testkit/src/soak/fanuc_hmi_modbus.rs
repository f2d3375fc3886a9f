//! A client and a server over TCP, on a serial line, and over RTU through TCP. A job is a request.

use core::time::Duration;

use fanuc_hmi_modbus::client::{self, Client, Event, Failure, Ticket};
use fanuc_hmi_modbus::server::{self, Server};
use fanuc_hmi_modbus::{
    Bits, BitsMut, DecodeError, Exception, Frame, Registers, Reply, Request, Side, Words, WordsMut,
};

use super::{Check, Ledger, Log, Row, Tally, Told, Wire};
use crate::link::{Delivery, End, Faults};
use crate::rng::Rng;

pub(super) const TCP: Row = Row {
    link: "fanuc-hmi-modbus",
    transport: "tcp",
    job: "requests",
    one_in: None,
    session: |seed, log| session(seed, Way::Tcp, Sabotage::None, log),
};

pub(super) const RTU: Row = Row {
    transport: "rtu",
    one_in: Some(65_536),
    session: |seed, log| session(seed, Way::Rtu, Sabotage::None, log),
    ..TCP
};

pub(super) const RTU_OVER_TCP: Row = Row {
    transport: "rtu-over-tcp",
    session: |seed, log| session(seed, Way::RtuOverTcp, Sabotage::None, log),
    ..TCP
};

/// Rows whose server forgets what it has acknowledged, and whose network repeats what was sent: the soak must see both.
pub const SABOTAGED: [Row; 2] = [
    Row { session: |seed, log| session(seed, Way::Tcp, Sabotage::Forget, log), ..TCP },
    Row { session: |seed, log| session(seed, Way::Tcp, Sabotage::Repeat, log), ..TCP },
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

/// What a request writes: to which address, and what. Coils are 0 and 1.
type Write = (u16, Vec<u16>);

/// Every register holds what [`held`] says; what is written is kept as a list.
#[derive(Debug, Default)]
struct Bank {
    writes: Vec<Write>,
}

fn held(address: u16, index: usize) -> u16 {
    (address as usize + index) as u16 * 7 + 3
}

impl Registers for Bank {
    fn read_coils(&mut self, address: u16, out: &mut BitsMut<'_>) -> Result<(), Exception> {
        out.fill_with(|i| held(address, i) & 4 != 0);
        Ok(())
    }
    fn read_holding_registers(&mut self, address: u16, out: &mut WordsMut<'_>) -> Result<(), Exception> {
        out.fill_with(|i| held(address, i));
        Ok(())
    }
    fn write_coils(&mut self, address: u16, values: Bits<'_>) -> Result<(), Exception> {
        self.writes.push((address, values.iter().map(u16::from).collect()));
        Ok(())
    }
    fn write_registers(&mut self, address: u16, values: Words<'_>) -> Result<(), Exception> {
        self.writes.push((address, values.iter().collect()));
        Ok(())
    }
}

/// What a request asks for.
#[derive(Debug, Clone)]
enum Asked {
    Write(Write),
    Coils(u16, usize),
    Registers(u16, usize),
    /// What this server does not have.
    Refusal,
}

struct Cell {
    now: Duration,
    log: Log,
    way: Way,
    sabotage: Sabotage,
    wire: Wire,
    ledger: Ledger,
    /// Written, and nobody asked for it.
    aliens: Vec<Write>,
    asked: Vec<Asked>,
    open: Vec<(Ticket, usize)>,
    client: Client<4>,
    server: Server,
    bank: Bank,
    gone: [bool; 2],
    violations: u64,
}

fn session(seed: u64, way: Way, sabotage: Sabotage, log: Log) -> Tally {
    let mut rng = Rng::new(!seed);
    let bad = rng.unit();
    let baud = [9600, 19_200, 115_200][rng.below(3)];
    let tcp = Faults {
        disconnect: 0.08 * bad,
        max_delay: [300 * MS, 1500 * MS][rng.below(2)],
        pause: 100 * MS,
        ..Faults::TCP
    };
    let (mut client, server, faults) = match way {
        Way::Tcp => (client::Config::tcp(), server::Config::tcp(), tcp),
        Way::RtuOverTcp => {
            // A pause is no end of a frame before the stall, and no reply may be later than its time and the settling.
            let faults = Faults { max_delay: 300 * MS, ..tcp };
            (client::Config::rtu_over_tcp(), server::Config::rtu_over_tcp(UNIT), faults)
        }
        Way::Rtu => {
            let faults = Faults {
                flip: 0.003 * bad,
                lose_byte: 0.002 * bad,
                insert: 0.002 * bad,
                lose: 0.02,
                pause: [Duration::ZERO, MS, 5 * MS][rng.below(3)],
                ..Faults::SERIAL
            };
            (client::Config::rtu(baud), server::Config::rtu(UNIT, baud), faults.at_baud(baud))
        }
    };
    client.in_flight = 1 + rng.below(4);
    let faults = match sabotage {
        Sabotage::Repeat => Faults { datagrams: true, repeat: 0.2, split: 0.0, merge: 0.0, ..faults },
        Sabotage::Forget | Sabotage::None => faults,
    };
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
        client: Client::new(client),
        server: Server::new(server),
        bank: Bank::default(),
        gone: [false; 2],
        violations: 0,
    };
    let jobs = 5 + rng.below(36);
    while cell.now < LIMIT && (cell.asked.len() < jobs || !cell.open.is_empty()) {
        while cell.asked.len() < jobs && cell.gone == [false; 2] && cell.ask(&mut rng) {}
        cell.step(&mut rng);
    }
    // What is still under way may be written by now, though nobody hears of it.
    let end = cell.now + 2 * Duration::from_secs(1);
    while cell.now < end {
        cell.step(&mut rng);
        cell.now = cell.wire.next(cell.now, [cell.server.poll_timeout(), Some(end)]);
    }
    cell.settle()
}

impl Cell {
    /// False: there is no place.
    fn ask(&mut self, rng: &mut Rng) -> bool {
        let n = self.asked.len() as u16;
        // Address and values say which job it is, both.
        let address = 1000 + 16 * n;
        let words = [n, !n, n.wrapping_mul(31) ^ 0x1010];
        let bits: [bool; 12] = core::array::from_fn(|bit| n >> bit & 1 == 1);
        let some = 1 + rng.below(40);
        let writes = |values: &[u16]| Asked::Write((address, values.to_vec()));
        let (request, asked) = match rng.below(9) {
            0 => (Request::WriteRegister { address, value: n }, writes(&words[..1])),
            1 => (Request::WriteRegisters { address, values: (&words).into() }, writes(&words)),
            2 => (Request::MaskWriteRegister { address, and: 0, or: n }, writes(&words[..1])),
            3 => {
                let values = Words::from(&words);
                let (quantity, write_address) = (some as u16, address);
                let request = Request::ReadWriteRegisters { address: n, quantity, write_address, values };
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
            _ => (Request::ReadInputRegisters { address: n, quantity: 1 }, Asked::Refusal),
        };
        let announces = self.way != Way::Tcp && !request.reads() && rng.chance(0.05);
        let Ok(ticket) = self.client.request(if announces { 0 } else { UNIT }, &request) else {
            return false;
        };
        self.log.say(self.now, format_args!("job {n}: {request:?}"));
        self.open.push((ticket, self.ledger.send(self.wire.mark())));
        self.asked.push(asked);
        true
    }

    fn step(&mut self, rng: &mut Rng) {
        let mut out = [0; Frame::MAX_LEN];
        while let Some(len) = self.client.poll_transmit(self.now, &mut out) {
            self.wire.send(End::A, self.now, &out[..len]);
        }
        while let Some(len) = self.server.poll_transmit(self.now, &mut self.bank, &mut out) {
            self.wire.send(End::B, self.now, &out[..len]);
        }
        while let Some(event) = self.server.poll_event() {
            self.log.say(self.now, format_args!("  server: {event:?}"));
        }
        for write in std::mem::take(&mut self.bank.writes) {
            self.execute(write, rng);
        }
        self.now = self.wire.next(self.now, [self.client.poll_timeout(), self.server.poll_timeout()]);
        while let Some(delivery) = self.wire.receive(End::B, self.now) {
            match delivery {
                Delivery::Bytes(bytes) => {
                    let mut rest = bytes.as_slice();
                    while !rest.is_empty() {
                        rest = &rest[self.server.handle_input(self.now, rest)..];
                        while let Some(len) = self.server.poll_transmit(self.now, &mut self.bank, &mut out) {
                            self.wire.send(End::B, self.now, &out[..len]);
                        }
                    }
                }
                Delivery::Closed => {
                    self.server.reset();
                    self.gone[1] = true;
                }
            }
        }
        while let Some(delivery) = self.wire.receive(End::A, self.now) {
            match delivery {
                Delivery::Bytes(bytes) => {
                    let mut rest = bytes.as_slice();
                    while !rest.is_empty() {
                        rest = &rest[self.client.handle_input(self.now, rest)..];
                        self.hear();
                    }
                }
                Delivery::Closed => {
                    self.client.handle_disconnect();
                    self.gone[0] = true;
                }
            }
        }
        self.client.handle_timeout(self.now);
        self.server.handle_timeout(self.now);
        self.hear();
        if self.gone == [true; 2] {
            self.wire.reconnect(self.now);
            self.gone = [false; 2];
        }
    }

    fn execute(&mut self, write: Write, rng: &mut Rng) {
        self.log.say(self.now, format_args!("  written: {} {:?}", write.0, write.1));
        if self.sabotage == Sabotage::Forget && rng.chance(0.05) {
            return;
        }
        let job = self.asked.iter().position(|asked| matches!(asked, Asked::Write(asked) if *asked == write));
        if !job.is_some_and(|job| self.ledger.execute(job)) {
            self.aliens.push(write);
        }
    }

    fn hear(&mut self) {
        while let Some(event) = self.client.poll_event() {
            self.log.say(self.now, format_args!("  client: {event:?}"));
            let (ticket, told) = match event {
                Event::Reply { ticket, reply: Reply::Exception { .. }, .. } => (ticket, Told::NotDone),
                Event::Reply { ticket, reply, .. } => {
                    let job = self.open.iter().find(|(open, _)| *open == ticket).map(|(_, job)| *job);
                    // What was read is right if it is what the registers hold.
                    if let Some(job) = job.filter(|job| is_held(&self.asked[*job], &reply)) {
                        self.ledger.execute(job);
                    }
                    (ticket, Told::Done)
                }
                Event::Announced { ticket } => (ticket, Told::Unknown),
                Event::Failed { ticket, failure: Failure::NotSent } => (ticket, Told::NotDone),
                Event::Failed { ticket, .. } => (ticket, Told::Unknown),
                Event::Damaged(_) if self.way != Way::Rtu => {
                    self.log.say(self.now, format_args!("!!! TCP damages nothing"));
                    self.violations += 1;
                    continue;
                }
                _ => continue,
            };
            match self.open.iter().position(|(open, _)| *open == ticket) {
                Some(place) => {
                    let (_, job) = self.open.remove(place);
                    self.ledger.tell(job, told, self.wire.mark());
                }
                None => {
                    self.log.say(self.now, format_args!("!!! it has ended before"));
                    self.violations += 1;
                }
            }
        }
    }

    fn settle(self) -> Tally {
        let mut tally = Tally { invented: self.violations, ..Tally::default() };
        let side = |from| if from == End::A { Side::Client } else { Side::Server };
        let unseen =
            self.wire.settle(
                self.now,
                &mut tally,
                Frame::MAX_RTU_LEN,
                |from, bytes| match Frame::decode_rtu(bytes, side(from)) {
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
                self.log.say(self.now, format_args!("!!! nobody asked for {alien:?}"));
                tally.invented += 1;
            }
        }
        self.ledger.settle(self.now, self.log, &mut tally, |job| {
            unseen.iter().any(|unseen| unseen.is_between(job.from, job.to))
        });
        tally
    }
}

fn is_held(asked: &Asked, reply: &Reply<'_>) -> bool {
    match (asked, reply) {
        (Asked::Coils(address, count), Reply::Coils(bits)) => {
            bits.len() == *count
                && bits.iter().enumerate().all(|(i, bit)| bit == (held(*address, i) & 4 != 0))
        }
        (Asked::Registers(address, count), Reply::HoldingRegisters(words)) => {
            words.len() == *count && words.iter().enumerate().all(|(i, word)| word == held(*address, i))
        }
        _ => false,
    }
}
