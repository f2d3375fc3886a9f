//! The tolerance of the host for wrong assumptions about its ball: its session on a virtual clock, with the default
//! settings.

use core::time::Duration;
use std::collections::VecDeque;

use isra_ball::{Host, HostConfig, HostEvent, Keys, Packet, Status, timing};
use robot_session::Session as _;
use robot_session::end::{End as _, Machine as _};

use super::world::{AGE, CLAIMED};
use crate::model::{Margin, Step};
use robot_session::contract::Rng;

const MS: Duration = Duration::from_millis(1);
const END: &str = "isra-ball host";
const FRESH: &str = "values do not become stale";

/// Returns the assumptions of the host about time.
pub fn margins() -> Vec<Margin> {
    let HostConfig { period, max_delay, .. } = HostConfig::default();
    let late = |property: &'static str, varies: bool| -> Vec<Step> {
        let step = |n: u32| {
            let reality = Reality { delay: MS * n, varies, ..Reality::GOOD };
            Step::new(max_delay, MS * n, move || reality.breaks(property))
        };
        (0..300).map(step).collect()
    };
    // All packets are as late as they may be.
    let latest = Reality { delay: max_delay - MS / 10, ..Reality::GOOD };
    let aged = |assumed: Duration, unit: Duration, to: u32, reality: &dyn Fn(u32) -> Reality| -> Vec<Step> {
        let step = |n: u32| {
            let reality = reality(n);
            Step::new(assumed, unit * n, move || reality.breaks(FRESH))
        };
        (0..to).map(step).collect()
    };
    [
        ("max_delay", "every packet is so late; no packet is missed", late(CLAIMED, false)),
        ("max_delay", "every packet is so late; no value in use is older than max_age", late(AGE, false)),
        ("max_delay", "packets are up to so late; no value in use is older than max_age", late(AGE, true)),
        (
            "max_age",
            "so long without a packet, all others as late as may be; one may be lost",
            aged(period, period, 8, &|lost| Reality { lost, ..latest }),
        ),
        (
            "max_age",
            "so long old packets, all as late as may be; two may be old",
            aged(2 * period, period, 8, &|old| Reality { old, ..latest }),
        ),
        (
            "max_age",
            "after a lost packet the host waits this long",
            aged(Duration::ZERO, MS, 150, &|n| Reality { lost: 1, pause: MS * n, ..latest }),
        ),
        (
            "period",
            "the ball measures every so often",
            aged(period, MS, 200, &|n| Reality { measures: MS * n.max(1), ..Reality::GOOD }),
        ),
    ]
    .map(|(setting, real, steps)| Margin { end: END, setting, real, steps })
    .into()
}

/// A ball, its line, and how the host is called.
#[derive(Debug, Clone, Copy)]
struct Reality {
    /// The delay of packets; with `varies`, the longest delay.
    delay: Duration,
    varies: bool,
    /// Of twenty packets this many in succession are lost, or old.
    lost: u32,
    old: u32,
    /// The time for which the host is not called when the poll after a lost one is due.
    pause: Duration,
    /// The interval between the ball's measurements.
    measures: Duration,
}

/// A packet on the line: when it arrives, and when its values were measured.
struct PacketOnLine {
    arrives: Duration,
    measured: Duration,
    status: Status,
}

impl Reality {
    const GOOD: Self =
        Self { delay: Duration::ZERO, varies: false, lost: 0, old: 0, pause: Duration::ZERO, measures: MS };

    /// Returns the broken property, if there is one, in half a minute; several times if delays differ.
    fn breaks(&self, property: &'static str) -> Option<&'static str> {
        let seeds = if self.varies { 10 } else { 1 };
        (0..seeds).find_map(|seed| self.breaks_in(Rng::new(seed), property))
    }

    /// Returns the delay of a packet. If it varies, it is often as small or as large as possible.
    fn late(&self, rng: &mut Rng) -> Duration {
        match rng.below(4) {
            _ if !self.varies => self.delay,
            0 => Duration::ZERO,
            1 => self.delay,
            _ => self.delay.mul_f64(rng.unit()),
        }
    }

    fn breaks_in(&self, mut rng: Rng, property: &'static str) -> Option<&'static str> {
        let config = HostConfig::default();
        let mut host = Host::new(config).expect("the default can work");
        let (mut now, mut line) = (Duration::ZERO, VecDeque::<PacketOnLine>::new());
        let (mut polls, mut paused, mut last) = (0, 0, Duration::ZERO);
        let mut out = [0; Packet::LEN];
        host.handle_connected(now);
        while now < 30_000 * MS {
            let mut measured = None;
            if line.front().is_some_and(|sent| sent.arrives <= now) {
                let Some(sent) = line.pop_front() else { break };
                let packet = Packet {
                    sensor_type: 0,
                    sensor: 0,
                    status: sent.status,
                    force: [1; 3],
                    moment: [1; 3],
                    keys: Keys::NONE,
                };
                host.handle_input(now, &packet.to_bytes().expect("it is a packet"));
                measured = Some(sent.measured);
            }
            host.handle_timeout(now);
            while let Some(event) = host.poll_event() {
                let until = host.live_until().unwrap_or_default();
                let is_broken = match event {
                    HostEvent::Packet(_) if property == AGE => {
                        measured.is_some_and(|at| at + config.max_age < until)
                    }
                    HostEvent::Stale => property != AGE,
                    HostEvent::Missed | HostEvent::Unasked(_) => property == CLAIMED,
                    _ => false,
                };
                if is_broken {
                    return Some(property);
                }
            }
            let place = polls % 20;
            let is_due = host.machine().transmit(now, &config).is_some();
            if is_due && polls > 20 && place == self.lost && paused != polls && self.pause > Duration::ZERO {
                (now, paused) = (now + self.pause, polls);
                continue;
            }
            if host.poll_transmit(now, &mut out).is_some() {
                polls += 1;
                let asked = now + timing::exchange_time(config.baud) / 13;
                let nanos = asked.as_nanos() / self.measures.as_nanos() * self.measures.as_nanos();
                let measured = Duration::from_nanos(u64::try_from(nanos).unwrap_or(u64::MAX));
                let is_fresh = measured > last;
                last = measured;
                if polls <= 20 || place >= self.lost {
                    let arrives = now + timing::exchange_time(config.baud) + self.late(&mut rng);
                    let arrives =
                        line.back().map_or(arrives, |before: &PacketOnLine| arrives.max(before.arrives));
                    let is_old = polls > 20 && place < self.old;
                    let status = if is_fresh && !is_old { Status::Fresh } else { Status::Old };
                    line.push_back(PacketOnLine { arrives, measured, status });
                }
            }
            let next = host.poll_timeout().into_iter().chain(line.front().map(|sent| sent.arrives)).min();
            now = next.unwrap_or(Duration::MAX).max(now);
        }
        None
    }
}
