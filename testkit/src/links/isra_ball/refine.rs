//! The sessions over bytes do what the machines do: every path of the model is walked by both.

use core::time::Duration;

use isra_ball::ball::machine::BallMachine;
use isra_ball::{Ball, Host, HostEvent, Keys};
use robot_session::Session as _;
use robot_session::end::{End as _, Machine as _};

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
    ball: Ball,
    /// The bytes of each packet of the model's line.
    up: Vec<[u8; 12]>,
    measured: i8,
    /// What the host has reported, by kind.
    reported: Reports,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
struct Reports {
    open: i32,
    using: bool,
}

impl<'a> Sessions<'a> {
    fn new(exchange: &'a Exchange) -> Self {
        let now = Duration::from_secs(1);
        let mut host = Host::new(exchange.config.0).expect("a configuration that works");
        let mut ball = Ball::new(exchange.ball).expect("a configuration that works");
        host.handle_connected(now);
        ball.handle_connected(now);
        Self { exchange, now, host, ball, up: Vec::new(), measured: 0, reported: Reports::default() }
    }

    fn walk(&mut self, act: Act, before: &State, after: &State, walk: &[Act]) {
        let mut out = [0; 12];
        let now = self.now;
        match act {
            Act::Timer => self.host.handle_timeout(now),
            Act::Poll { arrives } => {
                assert_eq!(self.host.poll_transmit(now, &mut out), Some(1), "{walk:?}");
                self.reported.open += 1;
                if arrives {
                    self.ball.handle_input(now, &out[..1]);
                }
            }
            Act::Noise => self.ball.handle_input(now, &[isra_ball::ENQ]),
            Act::Reply(fate) => {
                assert_eq!(self.ball.poll_transmit(now, &mut out), Some(12), "{walk:?}");
                match fate {
                    Fate::Late(_) => self.up.push(out),
                    Fate::Lost => {}
                    // It is corrupt whenever it comes: a host that is not called does not read it.
                    Fate::Corrupt if before.is_asleep() => {}
                    Fate::Corrupt => {
                        out[11] ^= 0x04;
                        self.host.handle_input(now, &out);
                    }
                }
            }
            Act::Receive => {
                let bytes = self.up.remove(0);
                let (head, tail) = bytes.split_at(walk.len() % 13);
                self.host.handle_input(now, head);
                self.host.handle_input(now, tail);
            }
            Act::Tick { measures } => {
                self.now += TICK;
                if measures {
                    self.measure();
                }
            }
            Act::Measure => self.measure(),
            Act::Sleep | Act::Wake => {}
            Act::RestartHost => {
                self.host = Host::new(self.exchange.config.0).expect("a configuration that works");
                self.host.handle_connected(now);
                self.reported = Reports::default();
            }
            Act::ReopenHost => self.reopen_host(),
            Act::RestartBall => {
                self.ball = Ball::new(self.exchange.ball).expect("a configuration that works");
                self.ball.handle_connected(now);
            }
            Act::ReopenBall => {
                self.ball.handle_disconnected(now);
                self.ball.handle_connected(now);
            }
            Act::OtherBall => {
                self.up.clear();
                self.ball = Ball::new(self.exchange.ball).expect("a configuration that works");
                self.ball.measure([1; 3], [1; 3], Keys::NONE);
                self.ball.handle_connected(now);
                self.host.handle_connected(now);
            }
        }
        while let Some(event) = self.host.poll_event() {
            match event {
                HostEvent::Packet(_) => {
                    self.reported.open -= 1;
                    self.reported.using = true;
                }
                HostEvent::Old(_) | HostEvent::Missed => self.reported.open -= 1,
                HostEvent::Stale => self.reported.using = false,
                HostEvent::Unexpected(unexpected) => panic!("{unexpected}: {walk:?}"),
                _ => {}
            }
        }
        while self.ball.poll_event().is_some() {}
        assert_eq!(self.up.len(), after.up.len(), "{walk:?}");
    }

    fn measure(&mut self) {
        self.measured = self.measured.wrapping_add(1);
        self.ball.measure([self.measured; 3], [0; 3], Keys::NONE);
    }

    fn reopen_host(&mut self) {
        self.host.handle_disconnected(self.now);
        self.host.handle_connected(self.now);
    }

    /// The sessions' machines are the model's, and what is reported and sent is what the model has.
    fn compare(&mut self, state: &State, walk: &[Act]) {
        let (now, mut host) = (self.now, *self.host.machine());
        age(&mut host, now);
        assert_eq!(host, state.host, "{walk:?}");
        let ball: BallMachine = *self.ball.machine();
        assert_eq!(ball, state.ball, "{walk:?}");
        let expected = Reports { open: state.is_open().into(), using: state.is_using() };
        assert_eq!(self.reported, expected, "{walk:?}");
        if !state.is_asleep() {
            let due = self.host.poll_timeout().map(|at| at.saturating_sub(now));
            assert_eq!(due, state.host.deadline(), "{walk:?}");
        }
        if state.ball.transmit(now, &self.exchange.ball).is_none() {
            assert_eq!(self.ball.poll_transmit(now, &mut [0; 12]), None, "{walk:?}");
        }
    }
}
