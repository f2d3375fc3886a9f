//! The effects of a peer, a line and an impatient caller on a session under each driver: every request has one
//! outcome, at its time, and nothing hangs. `cargo test -p testkit --test it drivers -- --nocapture` prints the
//! table.
#![allow(clippy::cast_possible_truncation, reason = "small numbers")]
#![allow(clippy::disallowed_methods, clippy::disallowed_types, reason = "the drivers take the time")]

mod pipe;
mod rig;

use core::mem;
use core::ops::ControlFlow;
use core::time::Duration;
use std::collections::HashMap;
use std::io;
use std::thread::{self, JoinHandle};

use fanuc_hmi_modbus::{
    Client, ClientConfig, ClientEvent, Exception, Registers, Request, Server, ServerConfig, Ticket, Words,
    WordsMut,
};
use pipe::{Pipe, line};
use rig::{KINDS, Kind, Over, Rig};
use robot_session::contract::Rng;
use robot_session::{Driver, Session as _, now};

const MS: Duration = Duration::from_millis(1);
const TIMEOUT: Duration = Duration::from_millis(200);
/// A test that takes longer hangs.
const LONG: Duration = Duration::from_secs(60);
const NEVER: [usize; 2] = [usize::MAX; 2];

/// Registers with their own numbers as values.
struct Numbers;

impl Registers for Numbers {
    fn read_holding_registers(&mut self, address: u16, out: &mut WordsMut<'_>) -> Result<(), Exception> {
        let words: Vec<u16> = (address..).take(out.len()).collect();
        out.copy_from(&words);
        Ok(())
    }

    fn write_registers(&mut self, _: u16, _: Words<'_>) -> Result<(), Exception> {
        Ok(())
    }
}

/// Requests with their outcomes, over one connection after the other.
struct Caller {
    client: Client<4>,
    /// The time of each request, and the outcomes.
    asked: HashMap<Ticket, Duration>,
    requests: u32,
    replied: u32,
    failed: u32,
    /// The number of outcomes of calls that were not made, or that have an outcome already.
    twice: u32,
    /// The longest time from a request to its outcome.
    longest: Duration,
}

impl Caller {
    fn new(timeout: Duration) -> Self {
        let config = ClientConfig { in_flight: 4, timeout, ..ClientConfig::tcp() };
        Self {
            client: Client::new(config).unwrap(),
            asked: HashMap::new(),
            requests: 0,
            replied: 0,
            failed: 0,
            twice: 0,
            longest: Duration::ZERO,
        }
    }

    /// Makes as many requests as there are free slots, of both lengths.
    fn ask(&mut self, most: u32) {
        while self.requests < most {
            let read = Request::ReadHoldingRegisters { address: 3, quantity: 40 };
            let write = Request::WriteRegisters { address: 0, values: Words::from(&[7; 30]) };
            let request = if self.requests.is_multiple_of(2) { read } else { write };
            let Ok(ticket) = self.client.request(1, &request) else { return };
            self.requests += 1;
            assert!(self.asked.insert(ticket, now()).is_none());
        }
    }

    fn take(&mut self, event: ClientEvent) {
        let Some(ticket) = event.outcome_of() else { return };
        let Some(at) = self.asked.remove(&ticket) else {
            self.twice += 1;
            return;
        };
        self.longest = self.longest.max(now() - at);
        match event {
            ClientEvent::Replied { .. } => self.replied += 1,
            _ => self.failed += 1,
        }
    }

    fn turn(&mut self, rig: &mut Rig, polls: Option<u32>) -> Result<(), Over> {
        let mut events = Vec::new();
        let turned = rig.turn(&mut self.client, polls, |_| Ok(()), |_, event| events.push(event));
        events.into_iter().for_each(|event| self.take(event));
        turned
    }

    fn end(&mut self) {
        self.client.handle_disconnected(now());
        while let Some(event) = self.client.poll_event() {
            self.take(event);
        }
    }
}

/// The effects of a fault under a driver.
struct Row {
    fault: &'static str,
    kind: Kind,
    caller: Caller,
    /// Whether it was given up: nothing has happened for [`LONG`].
    stuck: bool,
    /// The ways in which connections ended.
    over: Vec<Over>,
}

impl Row {
    fn print(&self) {
        let Self { fault, kind, caller, stuck, over } = self;
        println!(
            "{fault:<44} {kind:<9?} {:>6} asked {:>6} replied {:>5} failed, lost {}, twice {}, stuck {}, {:>6.1} ms, {}",
            caller.requests,
            caller.replied,
            caller.failed,
            caller.asked.len(),
            caller.twice,
            u8::from(*stuck),
            caller.longest.as_secs_f64() * 1e3,
            over.first().map_or_else(|| "goes on".to_owned(), |over| format!("{over:?}")),
        );
    }

    /// Checks that no request is lost, arrives twice or hangs.
    fn check(&self) {
        self.print();
        let Caller { asked, twice, requests, replied, failed, .. } = &self.caller;
        assert!(asked.is_empty() && *twice == 0 && !self.stuck, "{}, {:?}", self.fault, self.kind);
        assert_eq!(*requests, replied + failed);
    }
}

/// Asks over one connection until all have outcomes or the connection is over.
fn run(
    fault: &'static str,
    kind: Kind,
    pipe: Pipe,
    requests: u32,
    polls: impl FnMut() -> Option<u32>,
) -> Row {
    run_within(TIMEOUT, fault, kind, pipe, requests, polls)
}

/// Runs the same with another timeout for each request.
fn run_within(
    timeout: Duration,
    fault: &'static str,
    kind: Kind,
    pipe: Pipe,
    requests: u32,
    mut polls: impl FnMut() -> Option<u32>,
) -> Row {
    let mut caller = Caller::new(timeout);
    let mut rig = Rig::new(kind, pipe.clone(), 300 * MS);
    caller.client.handle_connected(now());
    let (mut over, mut stuck) = (Vec::new(), false);
    let (mut outcomes, mut since) = (0, now());
    while outcomes < requests {
        caller.ask(requests);
        if let Err(why) = caller.turn(&mut rig, polls()) {
            over.push(why);
            break;
        }
        let before = mem::replace(&mut outcomes, caller.replied + caller.failed);
        if outcomes > before {
            since = now();
        }
        stuck = now() - since > LONG;
        if stuck {
            break;
        }
    }
    caller.end();
    pipe.cut();
    Row { fault, kind, caller, stuck, over }
}

/// Starts the project's server under the driver of std, in a thread.
fn serve(pipe: Pipe) -> JoinHandle<()> {
    thread::spawn(move || {
        let mut server = Server::<_>::new(ServerConfig::tcp(), Numbers).unwrap();
        let mut driver = Driver::new(pipe);
        server.handle_connected(now());
        while let Ok(ControlFlow::Continue(())) =
            driver.turn(&mut server, None, |_, _| ControlFlow::<()>::Continue(()))
        {}
    })
}

/// Starts a peer that reads this many bytes at once after each pause, and sends no bytes.
fn slow(pipe: Pipe, pause: Duration) -> JoinHandle<()> {
    thread::spawn(move || {
        while pipe.read(&mut [0]) > 0 {
            thread::sleep(pause);
        }
    })
}

#[test]
fn a_peer_that_does_not_read_ends_the_connection_and_every_request() {
    for kind in KINDS {
        let [near, _far] = line(7, NEVER);
        let row = run("does not read, a line of 7 bytes", kind, near, 20, || None);
        row.check();
        assert_eq!(row.over, [Over::Stalled]);
        // One request is on its way until its timeout, the others wait for the line until that is given up.
        assert!((TIMEOUT..1000 * MS).contains(&row.caller.longest), "{:?}", row.caller.longest);
    }
}

/// A request in flight has its timeout; the requests after it wait for the line, as long as that takes a byte now and
/// then.
#[test]
fn a_peer_that_reads_slowly_costs_replies_and_no_outcome() {
    for kind in KINDS {
        let [near, far] = line(7, NEVER);
        let reader = slow(far, 30 * MS);
        let row = run("reads a byte every 30 ms", kind, near, 4, || None);
        row.check();
        // Two reads and two writes.
        assert!(row.caller.replied == 0 && row.caller.longest < 2 * (12 + 73) * 40 * MS);
        reader.join().unwrap();
    }
}

#[test]
fn both_write_more_than_the_line_holds() {
    for kind in KINDS {
        let [near, far] = line(7, NEVER);
        let server = serve(far);
        let row = run("a line of 7 bytes both ways, four in flight", kind, near, 400, || None);
        row.check();
        assert_eq!(row.caller.replied, 400);
        server.join().unwrap();
    }
}

#[test]
fn a_dropped_future_loses_nothing() {
    let mut rng = Rng::new(1);
    for kind in [Kind::Tokio, Kind::Embedded] {
        let [near, far] = line(7, NEVER);
        let server = serve(far);
        let mut count = 0;
        // However busy the machine is, every reply comes.
        let row = run_within(LONG, "its future dropped after 1 to 3 polls", kind, near, 5_000, || {
            count += 1;
            Some(1 + rng.below(3) as u32)
        });
        row.check();
        println!("{count} dropped");
        assert!(count >= 25_000 && row.caller.failed == 0, "{count} dropped");
        server.join().unwrap();
    }
}

/// After each number of bytes, of the requests and of the replies.
#[test]
fn a_cut_in_each_phase_leaves_one_outcome() {
    for kind in KINDS {
        for way in [0, 1] {
            for at in 1..=300 {
                let mut until_cut = NEVER;
                until_cut[way] = at;
                let [near, far] = line(64, until_cut);
                let server = serve(far);
                let row = run("cut after each byte, each way", kind, near, 20, || None);
                if at == 300 {
                    row.print();
                }
                let Caller { asked, twice, .. } = &row.caller;
                assert!(asked.is_empty() && *twice == 0 && !row.stuck, "{kind:?}, {way}, {at}");
                server.join().unwrap();
            }
        }
    }
}

/// A program that keeps the number of each request before it is sent is killed at any moment: the peer has nothing that was
/// not kept.
#[test]
fn a_kill_between_keeping_and_writing_leaves_nothing_unknown() {
    let mut rng = Rng::new(7);
    for kind in KINDS {
        let (mut sent_unkept, mut kills) = (0, 0);
        for _ in 0..300 {
            let [near, far] = line(64, NEVER);
            let mut rig = Rig::new(kind, near, LONG);
            let mut caller = Caller::new(TIMEOUT);
            caller.client.handle_connected(now());
            caller.ask(1 + rng.below(4) as u32);
            let (mut kept, mut before, mut fails) = (0, 0, rng.below(4));
            for _ in 0..rng.below(6) {
                let keep = |client: &mut Client<4>| {
                    if fails > 0 {
                        fails -= 1;
                        return Err(io::ErrorKind::StorageFull.into());
                    }
                    kept = before + client.in_flight();
                    Ok(())
                };
                let polls = Some(1 + rng.below(2) as u32);
                if rig.turn(&mut caller.client, polls, keep, |_, _| {}).is_err() {
                    before = kept;
                    caller.end();
                    caller.client.handle_connected(now());
                    caller.ask(caller.requests + 2);
                }
            }
            // After a kill, only the arrived bytes are there.
            drop(rig);
            kills += 1;
            let arrived = requests_in(&far);
            sent_unkept += arrived.saturating_sub(kept);
        }
        println!(
            "{:<44} {kind:<9?} {kills} kills, {sent_unkept} sent and not kept",
            "killed between store and write"
        );
        assert_eq!(sent_unkept, 0);
    }
}

/// Returns the number of requests of which the peer has the beginning.
fn requests_in(pipe: &Pipe) -> usize {
    pipe.cut();
    let (mut bytes, mut buffer) = (Vec::<u8>::new(), [0; 64]);
    loop {
        match pipe.read(&mut buffer) {
            0 => break,
            length => bytes.extend(&buffer[..length]),
        }
    }
    let (mut at, mut count) = (0, 0);
    while at < bytes.len() {
        count += 1;
        let length =
            bytes.get(at + 4..at + 6).map_or(usize::MAX, |it| usize::from(it[0]) << 8 | usize::from(it[1]));
        at = at.saturating_add(6).saturating_add(length);
    }
    count
}
