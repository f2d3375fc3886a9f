//! Both machines, the line between them, and the caller.

use core::time::Duration;

use fanuc_hmi_modbus::client::machine::{self as client, ClientLink, ClientMachine, Places, Stage};
use fanuc_hmi_modbus::server::machine::{self as server, ServerMachine};
use robot_session::end::Machine as _;

use super::world::{
    Act, COLLISION, COSTS, ENDED_TWICE, ENDS, FOREIGN_REPLY, Fate, Flags, Frame, GIVEN_UP, Job, Line,
    OTHER_UNIT, Outcome, Record, STALE, Setup, TICK, TRUE, TWICE, UNEXPECTED, Verdict, What, World,
};
use crate::model::{Edge, Edges, System, age, drive};

impl Setup {
    fn client(&self, world: &mut World, input: client::Input, edges: &mut Edges<'_>) -> client::Action {
        drive(&mut world.client, input, &self.client, edges).unwrap_or_else(|_| {
            world.flags.unexpected = true;
            client::Action::Nothing
        })
    }

    fn server(&self, world: &mut World, input: server::Input, edges: &mut Edges<'_>) -> server::Action {
        drive(&mut world.server, input, &self.server, edges).unwrap_or_else(|_| {
            world.flags.unexpected = true;
            server::Action::Nothing
        })
    }

    /// Applies an action as the client's session does, and an outcome as its caller does.
    fn report(&self, world: &mut World, action: client::Action, edges: &mut Edges<'_>) {
        match action {
            client::Action::TimedOut { silent, returned } => {
                self.end_all(world, silent, Outcome::Unknown, edges);
                self.end_all(world, returned, Outcome::Unknown, edges);
            }
            client::Action::Reset { lost, not_sent } => {
                world.client_holds.clear();
                self.end_all(world, lost, Outcome::Unknown, edges);
                self.end_all(world, not_sent, Outcome::NotSent, edges);
            }
            // The whole frames among the decoder's bytes are found.
            client::Action::Cut => {
                let held = core::mem::take(&mut world.client_holds);
                let last = held.len().saturating_sub(1);
                for (index, frame) in held.into_iter().enumerate() {
                    if frame.what == What::Half {
                        self.client(world, client::Input::Corrupt, edges);
                    } else {
                        // The silence shows that the last one is an exception.
                        let exception =
                            if index == last { client::Fit::Whole } else { client::Fit::Exception };
                        self.take(world, frame, exception, edges);
                    }
                }
            }
            client::Action::Refused { place } => self.end(world, place, Outcome::Unknown, edges),
            client::Action::Nothing
            | client::Action::Keep { .. }
            | client::Action::Sent
            | client::Action::Announced { .. }
            | client::Action::Replied { .. }
            | client::Action::Stray { .. }
            | client::Action::Hold => {}
        }
    }

    fn end_all(&self, world: &mut World, places: Places, outcome: Outcome, edges: &mut Edges<'_>) {
        places.iter().for_each(|place| self.end(world, place, outcome, edges));
    }

    fn end(&self, world: &mut World, place: u8, outcome: Outcome, edges: &mut Edges<'_>) {
        let job = world.places[usize::from(place)];
        let record = &mut world.records[usize::from(job)];
        world.flags.ended_twice |= record.outcome != Outcome::None;
        record.outcome = outcome;
        self.client(world, client::Input::Taken { place }, edges);
    }

    fn send(&self, world: &mut World, fate: Fate, edges: &mut Edges<'_>) {
        // Bytes of another frame are arriving: on a serial line both are lost.
        let collides = self.is_serial()
            && matches!(world.client.link, ClientLink::Up { line: client::Line::Busy { silent_at }, .. } if !silent_at.is_zero());
        let Some(due) = world.client.transmit(Duration::ZERO, &self.client) else { return };
        let action = self.client(world, client::Input::Sent(due), edges);
        let client::Due { place, transaction, .. } = due;
        world.flags.collision |= collides;
        let job = world.places[usize::from(place)];
        let asked = world.records[usize::from(job)].epoch;
        world.flags.stale |= asked != 0 && asked != world.epoch;
        if let client::Action::Announced { place } = action {
            self.end(world, place, Outcome::Announced, edges);
        }
        if fate != Fate::Lost && !collides && world.line == Line::Good {
            world.down.push(Frame {
                job,
                transaction,
                ticks: u8::from(fate == Fate::Late),
                what: What::Whole,
            });
        }
    }

    fn serve(&self, world: &mut World, verdict: Verdict, edges: &mut Edges<'_>) {
        let mut frame = world.down.remove(0);
        if world.busy > 0 {
            return;
        }
        if verdict == Verdict::Exception {
            frame.what = What::Exception;
        }
        self.received(world, edges);
        if world.server.reads() {
            self.judge(world, frame, true, edges);
        } else {
            world.server_holds.push(frame);
        }
    }

    /// Called when bytes come to the server.
    fn received(&self, world: &mut World, edges: &mut Edges<'_>) {
        self.server(world, server::Input::Received, edges);
    }

    fn server_timer(&self, world: &mut World, edges: &mut Edges<'_>) {
        while world.server.expires(Duration::ZERO) {
            if self.server(world, server::Input::Timeout, edges) == server::Action::Cut {
                self.judge_held(world, edges);
            }
        }
    }

    fn judge_held(&self, world: &mut World, edges: &mut Edges<'_>) {
        let held = core::mem::take(&mut world.server_holds);
        if self.strict && held.len() > 1 || held.iter().any(|frame| frame.what == What::Noise) {
            return;
        }
        let Some((last, before)) = held.split_last() else { return };
        before.iter().for_each(|frame| self.judge(world, *frame, false, edges));
        self.judge(world, *last, true, edges);
    }

    fn judge(&self, world: &mut World, frame: Frame, is_last: bool, edges: &mut Edges<'_>) {
        let unit = self.unit(frame.job);
        let action = self.server(world, server::Input::Request { unit, is_last }, edges);
        if !matches!(action, server::Action::Serve | server::Action::ServeBroadcast) {
            return;
        }
        world.flags.other_unit |= self.jobs[usize::from(frame.job)] == Job::Absent;
        if frame.what != What::Exception {
            let executed = &mut world.records[usize::from(frame.job)].executed;
            *executed = (*executed + 1).min(2);
        }
        if unit == 0 {
            world.busy = 2;
        }
        if action == server::Action::Serve {
            world.flags.given_up |= !is_last;
            world.replies.push(frame);
        }
    }

    fn reply(&self, world: &mut World, fate: Fate, edges: &mut Edges<'_>) {
        let collides = self.is_serial() && world.server.deadline().is_some_and(|at| !at.is_zero());
        if self.server(world, server::Input::Sent, edges) != server::Action::Sent {
            return;
        }
        world.flags.collision |= collides;
        let mut frame = world.replies.remove(0);
        frame.ticks = u8::from(fate == Fate::Late);
        match fate {
            Fate::Half => frame.what = What::Half,
            Fate::OtherUnit => frame.what = What::OtherUnit,
            Fate::Good | Fate::Lost | Fate::Late | Fate::Twice => {}
        }
        if fate != Fate::Lost && !collides && world.line == Line::Good {
            world.up.push(frame);
            if fate == Fate::Twice {
                world.up.push(frame);
            }
        }
    }

    fn read(&self, world: &mut World, edges: &mut Edges<'_>) {
        let frame = world.up.remove(0);
        let action = self.client(world, client::Input::Received, edges);
        self.report(world, action, edges);
        // Something follows an exception that was in doubt.
        if let [held] = *world.client_holds
            && held.what == What::Exception
        {
            world.client_holds.clear();
            self.take(world, held, client::Fit::Exception, edges);
        }
        if frame.what == What::Half || !world.client_holds.is_empty() {
            // A frame that follows without a silence may be the rest.
            world.client_holds.push(frame);
        } else {
            self.take(world, frame, client::Fit::OpenException, edges);
        }
    }

    /// Reads a frame; `exception` is the fit of a frame that is an exception.
    fn take(&self, world: &mut World, frame: Frame, exception: client::Fit, edges: &mut Edges<'_>) {
        let transaction = frame.transaction;
        let expects = world.client.expects(transaction, &self.client);
        let asked = expects.map(|held| self.unit(world.places[usize::from(held.place)]));
        let fits =
            frame.what != What::OtherUnit && asked.is_none_or(|unit| unit == self.unit(frame.job).max(1));
        let fit = match frame.what {
            _ if !fits => client::Fit::Misfit,
            What::Exception => exception,
            _ => client::Fit::Whole,
        };
        let action = self.client(world, client::Input::Reply { transaction, fit }, edges);
        if let client::Action::Replied { place } = action {
            world.flags.foreign_reply |=
                world.places[usize::from(place)] != frame.job || frame.what == What::OtherUnit;
            let outcome = if frame.what == What::Exception { Outcome::Refused } else { Outcome::Done };
            self.end(world, place, outcome, edges);
        }
        if action == client::Action::Hold {
            world.client_holds.push(frame);
        }
        self.report(world, action, edges);
    }

    fn ready(&self, world: &World, ready: &mut Vec<Act>) {
        let arrived = |frames: &[Frame]| frames.first().is_some_and(|frame| frame.ticks == 0);
        if arrived(&world.up) {
            ready.push(Act::ClientRead);
        }
        let reads = arrived(&world.down) && !world.server.is_full();
        if reads {
            ready.push(Act::ServerRead(Verdict::CarryOut));
        }
        // A driver first reads the bytes that have arrived.
        if world.client_due() && !arrived(&world.up) {
            ready.push(Act::ClientTimer);
        }
        if world.server.deadline().is_some_and(|at| at.is_zero()) && !reads {
            ready.push(Act::ServerTimer);
        }
        match world.line {
            Line::Good => {}
            Line::Lost { client: false, .. } => ready.push(Act::ClientNotices),
            Line::Lost { server: false, .. } => ready.push(Act::ServerNotices),
            Line::Lost { .. } => ready.push(Act::Connect),
        }
        if world.client.transmit(Duration::ZERO, &self.client).is_some() {
            ready.push(Act::ClientSend(Fate::Good));
        }
        if world.server.transmit(Duration::ZERO, &self.server).is_some() {
            ready.push(Act::ServerSend(Fate::Good));
        }
        let mut next = world.client.clone();
        if usize::from(world.next) < self.jobs.len()
            && next
                .on(
                    Duration::ZERO,
                    client::Input::Request { broadcast: false, mirrored: false },
                    &self.client,
                )
                .is_ok()
        {
            ready.push(Act::Ask);
        }
    }
}

impl System for Setup {
    type State = World;
    type Act = Act;

    fn init(&self) -> World {
        let mut world = World {
            client: ClientMachine::NEW,
            server: ServerMachine::NEW,
            places: [0; 2],
            replies: Vec::new(),
            down: Vec::new(),
            up: Vec::new(),
            line: Line::Good,
            client_holds: Vec::new(),
            server_holds: Vec::new(),
            busy: 0,
            records: vec![Record { executed: 0, outcome: Outcome::None, epoch: 0 }; self.jobs.len()],
            next: 0,
            epoch: 1,
            faults: self.faults,
            flags: Flags::default(),
        };
        self.client(&mut world, client::Input::Connected, &mut None);
        self.server(&mut world, server::Input::Connected, &mut None);
        world
    }

    fn acts(&self, world: &World, acts: &mut Vec<Act>) {
        self.ready(world, acts);
        if acts.is_empty() || world.faults > 0 {
            acts.push(Act::Tick);
        }
        if world.faults == 0 {
            return;
        }
        if acts.contains(&Act::ClientSend(Fate::Good)) {
            acts.extend([Act::ClientSend(Fate::Lost), Act::ClientSend(Fate::Late)]);
        }
        if acts.contains(&Act::ServerRead(Verdict::CarryOut)) {
            acts.push(Act::ServerRead(Verdict::Exception));
        }
        if acts.contains(&Act::ServerSend(Fate::Good)) {
            acts.extend([Fate::Lost, Fate::Late, Fate::OtherUnit].map(Act::ServerSend));
            if !self.has_transactions() {
                acts.push(Act::ServerSend(Fate::Half));
            }
            // Neither a transaction nor a silence would show that it comes again.
            if self.has_transactions() || self.is_serial() {
                acts.push(Act::ServerSend(Fate::Twice));
            }
        }
        if !self.is_serial() && world.line == Line::Good {
            acts.push(Act::Lose);
        }
        if self.is_serial() {
            acts.push(Act::Noise);
        }
        acts.extend([Act::RestartClient, Act::RestartServer]);
    }

    fn step(&self, world: &World, act: Act, edges: Option<&mut Vec<Edge>>) -> World {
        let mut ready = Vec::new();
        self.ready(world, &mut ready);
        let mut world = world.clone();
        let (world_mut, edges) = (&mut world, &mut { edges });
        let harmless = ready.contains(&act) || (act == Act::Tick && ready.is_empty());
        if !harmless {
            world_mut.faults -= 1;
            world_mut.flags.used += 1;
        }
        match act {
            Act::Ask => {
                let job = world_mut.next;
                let broadcast = self.jobs[usize::from(job)] == Job::Broadcast;
                if let client::Action::Keep { place } =
                    self.client(world_mut, client::Input::Request { broadcast, mirrored: false }, edges)
                {
                    world_mut.places[usize::from(place)] = job;
                    let up = world_mut.client.link != ClientLink::Down;
                    world_mut.records[usize::from(job)].epoch = if up { world_mut.epoch } else { 0 };
                    world_mut.next += 1;
                }
            }
            Act::ClientSend(fate) => self.send(world_mut, fate, edges),
            Act::ServerRead(verdict) => self.serve(world_mut, verdict, edges),
            Act::ServerTimer => self.server_timer(world_mut, edges),
            Act::ServerSend(fate) => self.reply(world_mut, fate, edges),
            Act::ClientRead => self.read(world_mut, edges),
            Act::ClientTimer => {
                while world_mut.client.expires(Duration::ZERO) {
                    let action = self.client(world_mut, client::Input::Timeout, edges);
                    self.report(world_mut, action, edges);
                }
            }
            Act::Lose => world_mut.lose(false, false),
            Act::Noise => {
                let frame = Frame { job: 0, transaction: 0, ticks: 0, what: What::Noise };
                if world_mut.busy == 0 {
                    self.received(world_mut, edges);
                    world_mut.server_holds.push(frame);
                }
            }
            Act::ClientNotices => {
                let action = self.client(world_mut, client::Input::Disconnected, edges);
                self.report(world_mut, action, edges);
                if let Line::Lost { client, .. } = &mut world_mut.line {
                    *client = true;
                }
            }
            Act::ServerNotices => {
                if self.server(world_mut, server::Input::Disconnected, edges) == server::Action::Reset {
                    world_mut.replies.clear();
                }
                world_mut.server_holds.clear();
                if let Line::Lost { server, .. } = &mut world_mut.line {
                    *server = true;
                }
            }
            Act::Connect => {
                world_mut.line = Line::Good;
                world_mut.epoch += 1;
                let action = self.client(world_mut, client::Input::Connected, edges);
                self.report(world_mut, action, edges);
                if self.server(world_mut, server::Input::Connected, edges) == server::Action::Reset {
                    world_mut.replies.clear();
                }
                world_mut.server_holds.clear();
            }
            Act::RestartClient => {
                for record in world_mut.records.iter_mut().take(world_mut.next.into()) {
                    if record.outcome == Outcome::None {
                        record.outcome = Outcome::Abandoned;
                    }
                }
                world_mut.client = ClientMachine::NEW;
                world_mut.client_holds.clear();
                if self.is_serial() {
                    self.client(world_mut, client::Input::Connected, edges);
                } else {
                    world_mut.lose(true, false);
                }
            }
            Act::RestartServer => {
                world_mut.server = ServerMachine::NEW;
                world_mut.replies.clear();
                world_mut.server_holds.clear();
                if self.is_serial() {
                    self.server(world_mut, server::Input::Connected, edges);
                } else {
                    world_mut.lose(false, true);
                }
            }
            Act::Tick => {
                age(&mut world_mut.client, TICK);
                age(&mut world_mut.server, TICK);
                world_mut.busy = world_mut.busy.saturating_sub(1);
                for frame in world_mut.down.iter_mut().chain(&mut world_mut.up) {
                    frame.ticks = frame.ticks.saturating_sub(1);
                }
            }
        }
        world
    }

    fn broken(&self, world: &World, broken: &mut Vec<&'static str>) {
        let flags = &world.flags;
        let mut unless = |holds: bool, name| {
            if !holds {
                broken.push(name)
            }
        };
        unless(!flags.foreign_reply, FOREIGN_REPLY);
        unless(!flags.collision, COLLISION);
        unless(!flags.other_unit, OTHER_UNIT);
        unless(!flags.given_up, GIVEN_UP);
        unless(!flags.ended_twice, ENDED_TWICE);
        unless(!flags.stale, STALE);
        unless(!flags.unexpected, UNEXPECTED);
        unless(world.records.iter().all(|record| record.executed < 2), TWICE);
        let is_true = |record: &Record| match record.outcome {
            Outcome::Done => record.executed > 0,
            Outcome::Refused | Outcome::NotSent => record.executed == 0,
            Outcome::None | Outcome::Unknown | Outcome::Announced | Outcome::Abandoned => true,
        };
        unless(world.records.iter().all(is_true), TRUE);
        let failed =
            |(record, job): &(&Record, &Job)| record.outcome == Outcome::Unknown && **job == Job::Unicast;
        let failed = world.records.iter().zip(&self.jobs).filter(failed).count();
        unless(failed <= usize::from(flags.used) * self.client.in_flight, COSTS);
        let waits = world.client.held().any(|held| matches!(held.stage, Stage::InFlight { .. }));
        unless(world.client.link != ClientLink::Down || !waits, ENDS);
    }

    fn benign(&self, world: &World) -> Option<Act> {
        let mut ready = Vec::new();
        self.ready(world, &mut ready);
        ready.first().copied().or(Some(Act::Tick))
    }

    fn is_over(&self, world: &World) -> bool {
        usize::from(world.next) == self.jobs.len()
            && world.records.iter().all(|record| record.outcome != Outcome::None)
    }

    fn ticks(&self, act: Act) -> u32 {
        u32::from(act == Act::Tick)
    }
}
