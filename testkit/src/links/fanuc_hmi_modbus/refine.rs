//! The sessions over bytes follow the machines: every path of the model is walked by both.

use core::time::Duration;
use std::collections::BTreeSet;

use fanuc_hmi_modbus::client::machine::Due;
use fanuc_hmi_modbus::{
    Client, ClientEvent, Exception, Failure, Frame, Registers, Reply, Request, Server, ServerEvent, Ticket,
    Words, WordsMut,
};
use robot_session::end::{End as _, Machine as _};
use robot_session::{Encode as _, Session as _};

use super::world::{Act, Fate, Job, Outcome, Setup, TICK, Verdict, World};
use crate::model::{self, Refined, age};

/// Walks every state and every transition of a system with real sessions.
///
/// # Panics
/// If a session differs from its machine.
pub(super) fn refine(setup: &Setup) -> Refined {
    model::refine(setup, || Sessions::new(setup), Sessions::walk, Sessions::compare)
}

/// The address of a request is its job.
#[derive(Debug, Default)]
struct Bank {
    refuses: BTreeSet<u8>,
    executed: Vec<u8>,
}

impl Bank {
    fn execute(&mut self, address: u16) -> Result<(), Exception> {
        let job = address as u8;
        if self.refuses.remove(&job) {
            return Err(Exception::ServerDeviceBusy);
        }
        self.executed[usize::from(job)] += 1;
        Ok(())
    }
}

impl Registers for Bank {
    fn read_holding_registers(&mut self, address: u16, out: &mut WordsMut<'_>) -> Result<(), Exception> {
        self.execute(address)?;
        out.fill_with(|_| address);
        Ok(())
    }

    fn write_registers(&mut self, address: u16, _: Words<'_>) -> Result<(), Exception> {
        self.execute(address)
    }
}

struct Sessions<'a> {
    setup: &'a Setup,
    now: Duration,
    client: Client<2>,
    server: Server<Bank, 2>,
    /// The bytes of each frame on the line.
    down: Vec<Vec<u8>>,
    up: Vec<Vec<u8>>,
    /// Of each job, as long as the client that gave it lives.
    tickets: Vec<Option<Ticket>>,
    outcomes: Vec<Outcome>,
}

impl<'a> Sessions<'a> {
    fn new(setup: &'a Setup) -> Self {
        let now = Duration::from_secs(1);
        let bank = Bank { executed: vec![0; setup.jobs.len()], ..Bank::default() };
        let mut sessions = Self {
            setup,
            now,
            client: Client::new(setup.client).expect("a configuration that works"),
            server: Server::new(setup.server, bank).expect("a configuration that works"),
            down: Vec::new(),
            up: Vec::new(),
            tickets: Vec::new(),
            outcomes: vec![Outcome::None; setup.jobs.len()],
        };
        sessions.client.handle_connected(now);
        sessions.server.handle_connected(now);
        sessions
    }

    fn walk(&mut self, act: Act, before: &World, after: &World, walk: &[Act]) {
        let now = self.now;
        match act {
            Act::Ask => self.ask(before.next),
            Act::ClientSend(_) => self.send(before, after, walk),
            Act::ServerRead(verdict) => {
                let bytes = self.down.remove(0);
                if before.busy == 0 {
                    if verdict == Verdict::Exception {
                        self.server.registers_mut().refuses.insert(before.down[0].job);
                    }
                    let (head, tail) = bytes.split_at(walk.len() % bytes.len());
                    self.server.handle_input(now, head);
                    self.server.handle_input(now, tail);
                }
            }
            Act::ServerTimer => self.server.handle_timeout(now),
            Act::ServerSend(fate) => self.reply(fate, before, after, walk),
            Act::ClientRead => {
                let bytes = self.up.remove(0);
                let (head, tail) = bytes.split_at(walk.len() % bytes.len());
                self.client.handle_input(now, head);
                self.client.handle_input(now, tail);
            }
            Act::ClientTimer => self.client.handle_timeout(now),
            Act::Lose => {}
            Act::Noise => {
                if before.busy == 0 {
                    // As long as a frame of its function: nothing is waited for.
                    self.server.handle_input(now, &[0xFF, 6, 0, 0, 0, 0, 0, 0]);
                }
            }
            Act::ClientNotices => self.client.handle_disconnected(now),
            Act::ServerNotices => self.server.handle_disconnected(now),
            Act::Connect => {
                self.client.handle_connected(now);
                self.server.handle_connected(now);
            }
            Act::RestartClient => {
                for (outcome, _) in self.outcomes.iter_mut().zip(&self.tickets) {
                    if *outcome == Outcome::None {
                        *outcome = Outcome::Abandoned;
                    }
                }
                self.tickets.fill(None);
                self.client = Client::new(self.setup.client).expect("a configuration that works");
                if self.setup.is_serial() {
                    self.client.handle_connected(now);
                }
            }
            Act::RestartServer => {
                let bank = core::mem::take(self.server.registers_mut());
                let bank = Bank { refuses: BTreeSet::new(), ..bank };
                self.server = Server::new(self.setup.server, bank).expect("a configuration that works");
                if self.setup.is_serial() {
                    self.server.handle_connected(now);
                }
            }
            Act::Tick => self.now += TICK,
        }
        self.down.truncate(after.down.len());
        self.up.truncate(after.up.len());
        self.drain(walk);
    }

    fn ask(&mut self, job: u8) {
        let address = u16::from(job);
        let request = match self.setup.jobs[usize::from(job)] {
            Job::Broadcast => Request::WriteRegister { address, value: 7 },
            Job::Unicast | Job::Absent => Request::ReadHoldingRegisters { address, quantity: 1 },
        };
        let ticket = self.client.request(self.setup.unit(job), &request).expect("a free place");
        self.tickets.push(Some(ticket));
    }

    fn send(&mut self, before: &World, after: &World, walk: &[Act]) {
        let due = before.client.transmit(Duration::ZERO, &self.setup.client);
        let Due { place, transaction, .. } = due.unwrap_or_else(|| panic!("nothing is due: {walk:?}"));
        let job = before.places[usize::from(place)];
        let mut out = [0; Frame::MAX_LEN];
        let length = self.client.poll_transmit(self.now, &mut out).expect("a request is to be sent");
        let unit = if self.setup.has_transactions() { out[6] } else { out[0] };
        assert_eq!(unit, self.setup.unit(job), "{walk:?}");
        if self.setup.has_transactions() {
            assert_eq!(out[..2], transaction.to_be_bytes(), "{walk:?}");
        }
        if after.down.len() > before.down.len() {
            self.down.push(out[..length].to_vec());
        }
    }

    fn reply(&mut self, fate: Fate, before: &World, after: &World, walk: &[Act]) {
        let mut out = [0; Frame::MAX_LEN];
        let length = self.server.poll_transmit(self.now, &mut out).expect("a reply is to be sent");
        let transaction = self.setup.has_transactions().then(|| u16::from_be_bytes([out[0], out[1]]));
        if let Some(transaction) = transaction {
            assert_eq!(transaction, before.replies[0].transaction, "{walk:?}");
        }
        let mut bytes = out[..length].to_vec();
        match fate {
            // The reply of a device that reports another function's result, and of which no more comes.
            Fate::Half => bytes = vec![out[0], 3, 250],
            Fate::OtherUnit => {
                let pdu = Reply::HoldingRegisters((&[9u16]).into());
                let length = Frame { transaction, unit: 9, pdu }.encode(&mut out).expect("it fits");
                bytes = out[..length].to_vec();
            }
            Fate::Good | Fate::Lost | Fate::Late | Fate::Twice => {}
        }
        for _ in before.up.len()..after.up.len() {
            self.up.push(bytes.clone());
        }
    }

    fn drain(&mut self, walk: &[Act]) {
        while let Some(event) = self.server.poll_event() {
            if let ServerEvent::Unexpected(unexpected) = event {
                panic!("{unexpected}: {walk:?}");
            }
        }
        while let Some(event) = self.client.poll_event() {
            let outcome = match event {
                ClientEvent::Replied { ticket, .. } => match self.client.reply(ticket) {
                    Some(Reply::Exception { .. }) => Outcome::Refused,
                    Some(Reply::HoldingRegisters(words)) => {
                        let job = self.tickets.iter().position(|asked| *asked == Some(ticket));
                        assert_eq!(words.get(0).map(usize::from), job, "its own reply: {walk:?}");
                        Outcome::Done
                    }
                    other => panic!("{other:?}: {walk:?}"),
                },
                ClientEvent::Announced { .. } => Outcome::Announced,
                ClientEvent::Failed { failure: Failure::NotSent, .. } => Outcome::NotSent,
                ClientEvent::Failed { .. } => Outcome::Unknown,
                ClientEvent::Unexpected(unexpected) => panic!("{unexpected}: {walk:?}"),
                _ => continue,
            };
            let job = self.tickets.iter().position(|ticket| event.outcome_of() == *ticket);
            let before = core::mem::replace(&mut self.outcomes[job.expect("a request")], outcome);
            assert_eq!(before, Outcome::None, "one outcome for each request: {walk:?}");
        }
    }

    /// Asserts that the sessions' machines, reports and messages are the model's.
    fn compare(&mut self, world: &World, walk: &[Act]) {
        let (now, mut client, mut server) = (self.now, self.client.machine().clone(), *self.server.machine());
        age(&mut client, now);
        age(&mut server, now);
        assert_eq!(client, world.client, "{walk:?}");
        assert_eq!(server, world.server, "{walk:?}");
        let outcomes: Vec<_> = world.records.iter().map(|record| record.outcome).collect();
        assert_eq!(self.outcomes, outcomes, "{walk:?}");
        let executed: Vec<_> = world.records.iter().map(|record| record.executed).collect();
        assert_eq!(self.server.registers().executed, executed, "{walk:?}");
        assert_eq!((self.down.len(), self.up.len()), (world.down.len(), world.up.len()), "{walk:?}");
        assert_eq!((self.client.statistics().unexpected, self.server.statistics().unexpected), (0, 0));
    }
}
