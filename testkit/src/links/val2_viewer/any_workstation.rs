//! A host against workstations of other makers.

use core::time::Duration;

use val2_viewer::host::machine::{Action, HostMachine, Input, Link, Pose};
use val2_viewer::{ENQ, Host, HostConfig, HostEvent, PosePacket, XOFF, XON};

use super::hold::{HELD, Hold, RESUMED};
use super::world::{ASKED, FAULTS, FRESH, PACED, PILED, TICK};
use crate::faults::Faults;
use crate::model::{
    Actor, Cause, CauseOf, EXPECTED, InputOf, Peer, PeerAssumptions, SceneOf, TransmitOf, WRITTEN, Wired,
};

/// Ticks.
pub(super) const INTERVAL: u8 = 2;
pub(super) const MAX_AGE: u8 = 2;
const PAUSE: u8 = 5;

const SHOWS: &[(&str, &str)] = &[("VV-1", WRITTEN), ("VV-3", ASKED)];
const PROPERTIES: &[&str] = &[ASKED, PACED, PILED, FRESH, HELD, RESUMED, EXPECTED];
pub(super) const RULES: PeerAssumptions = PeerAssumptions {
    keeps: "VV-1, VV-8, VV-25, VV-27",
    free: "when it asks, pauses and holds the line, and for how long",
    shows: SHOWS,
    properties: PROPERTIES,
};
pub(super) const ANYTHING: PeerAssumptions = PeerAssumptions {
    keeps: "",
    free: "ENQ, XOFF and XON at any time",
    shows: SHOWS,
    properties: PROPERTIES,
};

/// A workstation of which only this is known.
#[derive(Debug, Clone, Copy)]
pub struct AnyWorkstation {
    /// The host's configuration.
    pub config: HostConfig,
    /// It asks first, after a packet, or after a pause (VV-25, VV-27), and sends XON after XOFF (VV-1).
    pub keeps_rules: bool,
}

/// The model's knowledge of the requests, the packets and the pose.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Knowledge {
    /// The workstation may ask.
    credit: bool,
    /// A request has come on this connection, and no packet was sent since.
    asked: bool,
    hold: Hold,
    /// Ticks since the connection, the last request, the last packet and the pose.
    connected: u8,
    since_asked: u8,
    since_sent: u8,
    age: u8,
    wrong: Option<&'static str>,
}

/// A step of the model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Step {
    /// ENQ comes.
    Enquiry,
    /// XOFF comes.
    Xoff,
    /// XON comes.
    Xon,
    /// The caller has a new pose.
    Pose,
}

impl Peer for AnyWorkstation {
    type End = HostMachine;
    type Knowledge = Knowledge;
    type Step = Step;

    const TICK: Duration = TICK;

    fn config(&self) -> &HostConfig {
        &self.config
    }

    fn end(&self) -> HostMachine {
        HostMachine::NEW
    }

    fn known(&self) -> Knowledge {
        Knowledge {
            credit: true,
            asked: false,
            hold: Hold(None),
            connected: 0,
            since_asked: PAUSE,
            since_sent: INTERVAL,
            age: MAX_AGE,
            wrong: None,
        }
    }

    fn steps(&self, end: &HostMachine, known: &Knowledge, steps: &mut Vec<Step>) {
        steps.push(Step::Pose);
        if end.link == Link::Disconnected {
            return;
        }
        steps.push(Step::Xoff);
        if known.credit || known.since_asked >= PAUSE || !self.keeps_rules {
            steps.push(Step::Enquiry);
        }
        if known.hold.0.is_some() || !self.keeps_rules {
            steps.push(Step::Xon);
        }
    }

    fn by(&self, step: Step) -> Actor {
        if step == Step::Pose { Actor::User } else { Actor::Line }
    }

    fn apply(&self, _: &HostMachine, known: &mut Knowledge, step: Step) -> Option<InputOf<Self>> {
        Some(match step {
            Step::Enquiry => {
                (known.asked, known.credit, known.since_asked) = (true, false, 0);
                Input::Enquiry
            }
            Step::Xoff => {
                known.hold = Hold(Some(0));
                Input::Xoff
            }
            Step::Xon => {
                known.hold = Hold(None);
                Input::Xon
            }
            Step::Pose => {
                known.age = 0;
                Input::Pose
            }
        })
    }

    fn sent(&self, _: &TransmitOf<Self>) -> InputOf<Self> {
        Input::Sent
    }

    fn acted(&self, _: &HostMachine, known: &mut Knowledge, cause: CauseOf<Self>, action: Action) {
        if action == Action::HoldEnded {
            known.wrong = known.wrong.or(known.hold.ended());
        }
        match cause {
            Cause::Connected | Cause::Disconnected => {
                (known.asked, known.hold, known.connected) = (false, Hold(None), 0);
            }
            Cause::Sent(_) => {
                let wrong = [
                    (!known.asked).then_some(ASKED),
                    (known.since_sent < INTERVAL).then_some(PACED),
                    (known.connected < INTERVAL).then_some(PILED),
                    (known.age >= MAX_AGE).then_some(FRESH),
                    known.hold.sent(),
                ];
                known.wrong = wrong.into_iter().flatten().next().or(known.wrong);
                (known.asked, known.credit, known.since_sent) = (false, true, 0);
            }
            Cause::Due | Cause::Step(_) => {}
        }
    }

    fn tick(&self, known: &mut Knowledge) {
        let older = |ticks: &mut u8, most: u8| *ticks = (*ticks + 1).min(most);
        older(&mut known.connected, INTERVAL);
        older(&mut known.since_asked, PAUSE);
        older(&mut known.since_sent, INTERVAL);
        older(&mut known.age, MAX_AGE);
        known.hold.tick();
    }

    fn restarted(&self, known: &mut Knowledge) {
        (known.asked, known.hold, known.age) = (false, Hold(None), MAX_AGE);
    }

    fn broken(&self, _: &HostMachine, known: &Knowledge, broken: &mut Vec<&'static str>) {
        broken.extend(known.wrong);
    }

    /// Returns whether each request is answered if there are poses, even if no XON comes.
    fn is_over(&self, _: &HostMachine, known: &Knowledge) -> bool {
        !known.asked
    }

    fn fault_free_step(&self, end: &HostMachine, _: &Knowledge) -> Option<Step> {
        (end.pose == Pose::Unknown).then_some(Step::Pose)
    }
}

impl Wired for AnyWorkstation {
    type Session = Host;

    const FAULTS: Faults = FAULTS;

    fn session(&self) -> Host {
        Host::new(self.config).expect("a configuration that works")
    }

    fn speak(&self, _: &Knowledge, step: Step, session: &mut Host, now: Duration) -> Vec<u8> {
        vec![match step {
            Step::Enquiry => ENQ,
            Step::Xoff => XOFF,
            Step::Xon => XON,
            Step::Pose => {
                session.set_pose(now, [now.as_millis() as i16; 12]);
                return Vec::new();
            }
        }]
    }

    fn is_written(&self, _: &SceneOf<Self>, _: &TransmitOf<Self>, bytes: &[u8]) -> bool {
        matches!(PosePacket::decode(bytes), Ok(Some((_, length))) if length == bytes.len())
    }

    fn reports(&self, action: &Action, reports: &mut Vec<String>) {
        match action {
            Action::Nothing => {}
            Action::Accept => reports.push("Asked".into()),
            Action::Ignore => reports.push("Ignored".into()),
            action => reports.push(format!("{action:?}")),
        }
    }

    fn reported(&self, event: &HostEvent) -> Option<String> {
        match event {
            HostEvent::Unknown(_) => None,
            HostEvent::Sent(_) => Some("Sent".into()),
            event => Some(format!("{event:?}")),
        }
    }

    /// Returns the words that the end may receive in place of a damaged one: one bit turns XON into XOFF.
    fn lost(&self, _: &Knowledge, step: Step) -> Vec<Vec<Step>> {
        match step {
            Step::Xoff => vec![vec![], vec![Step::Xon]],
            Step::Xon => vec![vec![], vec![Step::Xoff]],
            Step::Enquiry | Step::Pose => vec![vec![]],
        }
    }
}
