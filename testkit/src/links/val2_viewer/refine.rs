//! The sessions over bytes do what the machines do: every path of the model is walked by both.

use core::time::Duration;

use robot_session::Session;
use robot_session::end::{End as _, Machine as _};
use val2_viewer::{ENQ, Host, HostEvent, PosePacket, Workstation, WorkstationEvent};

use super::world::{Act, Exchange, Fate, State, TICK};
use crate::model::{self, Refined, age};

/// Walks every state and every transition of a system with real sessions.
///
/// # Panics
/// Where a session differs from its machine.
pub(super) fn refine(exchange: &Exchange) -> Refined {
    model::refine(exchange, || Sessions::new(exchange), Sessions::walk, Sessions::compare)
}

struct Sessions<'a> {
    exchange: &'a Exchange,
    now: Duration,
    host: Host,
    workstation: Workstation,
    /// The bytes of each packet of the model's line.
    up: Vec<Vec<u8>>,
    /// The host's newest pose.
    pose: [i16; 12],
    /// What the workstation has reported: requests without an outcome, and whether a pose is shown.
    open: i32,
    is_shown: bool,
}

impl<'a> Sessions<'a> {
    fn new(exchange: &'a Exchange) -> Self {
        let now = Duration::from_secs(1);
        let mut host = Host::new(exchange.host).expect("a configuration that works");
        let mut workstation = Workstation::new(exchange.workstation).expect("a configuration that works");
        host.handle_connected(now);
        workstation.handle_connected(now);
        Self { exchange, now, host, workstation, up: Vec::new(), pose: [0; 12], open: 0, is_shown: false }
    }

    fn walk(&mut self, act: Act, before: &State, after: &State, walk: &[Act]) {
        let mut out = [0; <Host as Session>::MAX_TRANSMIT];
        let now = self.now;
        match act {
            Act::HostTimer => self.host.handle_timeout(now),
            Act::Enquire => self.host.handle_input(now, &[ENQ]),
            Act::Answer(fate) => {
                let length = self.host.poll_transmit(now, &mut out).expect("a packet is to be sent");
                let mut bytes = out[..length].to_vec();
                let (packet, _) = PosePacket::decode(&bytes).unwrap().expect("a whole line");
                assert_eq!(packet.pose, self.pose, "the newest: {walk:?}");
                if fate == Fate::Corrupt {
                    bytes[9] ^= 0x04;
                }
                if after.up.len() > before.up.len() {
                    self.up.push(bytes);
                }
            }
            Act::Timer => self.workstation.handle_timeout(now),
            Act::Draw => self.workstation.draw(now),
            Act::Ask { .. } => {
                assert_eq!(self.workstation.poll_transmit(now, &mut out), Some(1), "{walk:?}");
                assert_eq!(out[0], ENQ);
                self.open += 1;
            }
            Act::Receive => {
                let bytes = self.up.remove(0);
                let (head, tail) = bytes.split_at(walk.len() % bytes.len());
                if before.is_workstation_open() {
                    self.workstation.handle_input(now, head);
                    self.workstation.handle_input(now, tail);
                }
            }
            Act::NoiseAtWorkstation { line } => {
                self.workstation.handle_input(now, if line { b"\n" } else { b"x$" });
            }
            Act::Tick => {
                self.now += TICK;
                if before.is_alter() && !before.is_host_asleep() {
                    self.pose = self.pose.map(|word| word.wrapping_add(1));
                    self.host.set_pose(self.now, self.pose);
                }
            }
            Act::RestartHost => {
                self.host = Host::new(self.exchange.host).expect("a configuration that works");
                self.host.handle_connected(now);
            }
            Act::CloseHost => self.host.handle_disconnected(now),
            Act::OpenHost | Act::ReopenHost => self.host.handle_connected(now),
            Act::RestartWorkstation => {
                self.workstation =
                    Workstation::new(self.exchange.workstation).expect("a configuration that works");
                self.workstation.handle_connected(now);
                (self.open, self.is_shown) = (0, false);
            }
            Act::CloseWorkstation => self.workstation.handle_disconnected(now),
            Act::OpenWorkstation | Act::ReopenWorkstation => self.workstation.handle_connected(now),
            // They come to the host when it reads them.
            Act::NoiseAtHost => {}
            Act::Alter
            | Act::HostSleeps
            | Act::HostWakes
            | Act::WorkstationSleeps
            | Act::WorkstationWakes
            | Act::Unplug
            | Act::Plug => {}
            Act::SendUnasked => panic!("our host sends nothing unasked: {walk:?}"),
        }
        while let Some(event) = self.workstation.poll_event() {
            match event {
                WorkstationEvent::Pose(_) => {
                    self.open -= 1;
                    self.is_shown = true;
                }
                WorkstationEvent::Missed => self.open -= 1,
                WorkstationEvent::Stale => self.is_shown = false,
                WorkstationEvent::Unexpected(unexpected) => panic!("{unexpected}: {walk:?}"),
                _ => {}
            }
        }
        while let Some(event) = self.host.poll_event() {
            if let HostEvent::Unexpected(unexpected) = event {
                panic!("{unexpected}: {walk:?}");
            }
        }
        assert_eq!(self.up.len(), after.up.len(), "{walk:?}");
    }

    /// The sessions' machines are the model's, and what is reported and sent is what the model has.
    fn compare(&mut self, state: &State, walk: &[Act]) {
        let (now, mut host) = (self.now, *self.host.machine());
        age(&mut host, now);
        assert_eq!(host, state.host, "{walk:?}");
        let mut workstation = *self.workstation.machine();
        age(&mut workstation, now);
        assert_eq!(workstation, state.workstation, "{walk:?}");
        let expected = (i32::from(state.is_open()), state.is_shown());
        assert_eq!((self.open, self.is_shown), expected, "{walk:?}");
        if !state.is_workstation_asleep() {
            let due = self.workstation.poll_timeout().map(|at| at.saturating_sub(now));
            assert_eq!(due, state.workstation.deadline(), "{walk:?}");
            if state.workstation.transmit(now, &self.exchange.workstation).is_none() {
                assert_eq!(self.workstation.poll_transmit(now, &mut [0]), None, "{walk:?}");
            }
        }
        if !state.is_host_asleep() {
            let due = self.host.poll_timeout().map(|at| at.saturating_sub(now));
            assert_eq!(due, state.host.deadline(), "{walk:?}");
            // A session that is asked for bytes meets what is due first: the model has that to come.
            let is_due = state.host.deadline().is_some_and(|at| at.is_zero());
            if !is_due && state.host.transmit(Duration::ZERO, &self.exchange.host).is_none() {
                assert_eq!(
                    self.host.poll_transmit(now, &mut [0; <Host as Session>::MAX_TRANSMIT]),
                    None,
                    "{walk:?}"
                );
            }
        }
    }
}
