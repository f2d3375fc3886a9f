//! The rows of both machines' tables.

use core::time::Duration;

use isra_ball::ball::machine::{self as ball, BallMachine};
use isra_ball::host::machine::{self as host, HostMachine, Poll, PollingState, Values};
use isra_ball::{BallConfig, HostConfig};
use robot_session::end::Machine as _;

use crate::model::{DrawnMachine, NOW, Rows};

const MS: Duration = Duration::from_millis(1);

/// The host.
#[derive(Debug)]
pub enum Host {}

impl Rows for Host {
    type Machine = HostMachine;

    fn states() -> Vec<HostMachine> {
        let (past, future) = (NOW - MS, NOW + MS);
        let waiting = |from, until| Poll::Waiting { from, until, due: future, proof_until: future + 9 * MS };
        let polls = [
            Poll::Idle { due: future },
            Poll::Idle { due: past },
            waiting(future, future + MS),
            waiting(past, future),
            waiting(past, past),
        ];
        let values = [Values::Stale, Values::Live { until: future + 5 * MS }, Values::Live { until: past }];
        let mut states = vec![HostMachine::Disconnected];
        for poll in polls {
            for values in values {
                for proof_until in [past, future] {
                    let state = HostMachine::Connected(PollingState { poll, values, proof_until });
                    // The proof matters to a packet that can be the reply.
                    if proof_until < NOW || Self::row(&state, NOW).ends_with("proof") {
                        states.push(state);
                    }
                }
            }
        }
        states
    }

    fn inputs() -> Vec<host::Input> {
        use host::Input as On;
        let packets = [true, false].map(|fresh| On::Packet { fresh });
        [&[On::Connected, On::Disconnected, On::Timeout, On::Sent], &packets[..]].concat()
    }

    fn config() -> HostConfig {
        HostConfig::default()
    }

    fn row(machine: &HostMachine, now: Duration) -> String {
        let HostMachine::Connected(polling) = machine else { return machine.name().into() };
        let (poll, in_window) = match polling.poll {
            Poll::Idle { due } if now >= due => (", due", false),
            Poll::Idle { .. } => ("", false),
            Poll::Waiting { from, .. } if now < from => (", early", false),
            Poll::Waiting { until, .. } if now >= until => (", late", false),
            Poll::Waiting { .. } => ("", true),
        };
        let values = match polling.values {
            Values::Live { until } if now >= until => ", too old",
            Values::Live { .. } | Values::Stale => "",
        };
        let proof = if in_window && now < polling.proof_until { ", proof" } else { "" };
        format!("{}{poll}{values}{proof}", machine.name())
    }
}

/// The ball.
#[derive(Debug)]
pub enum Ball {}

impl Rows for Ball {
    type Machine = BallMachine;

    fn states() -> Vec<BallMachine> {
        let links = [ball::Link::Disconnected, ball::Link::Ready, ball::Link::Replying];
        let with = |link| [ball::Values::Old, ball::Values::New].map(|values| BallMachine { link, values });
        links.into_iter().flat_map(with).collect()
    }

    fn inputs() -> Vec<ball::Input> {
        use ball::Input as On;
        vec![On::Connected, On::Disconnected, On::Timeout, On::Measured, On::Enquiry, On::Sent]
    }

    fn config() -> BallConfig {
        BallConfig::default()
    }
}

impl DrawnMachine for HostMachine {}
impl DrawnMachine for BallMachine {}
