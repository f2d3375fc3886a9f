//! A ball against hosts of other makers.

use core::time::Duration;

use isra_ball::ball::machine::{Action, BallMachine, Input, Link, Reply};
use isra_ball::{Ball, BallConfig, BallEvent, ENQ, Frame, Keys};

use super::world::{ASKED, LINE, TICK};
use crate::faults::Faults;
use crate::model::{
    Actor, Cause, CauseOf, EXPECTED, InputOf, Peer, PeerAssumptions, STANDSTILL, SceneOf, Wired,
};

/// Ticks after which a host that keeps the rules polls again, if no reply has come.
const WINDOW: u8 = LINE + 2;

pub(super) const MARKED: &str = "values are new if they were measured after what was sent last";
pub(super) const IGNORED: &str = "a poll is ignored if one is not answered, and only then";

const PROPERTIES: &[&str] = &[ASKED, MARKED, IGNORED, STANDSTILL, EXPECTED];
const SHOWS: &[(&str, &str)] = &[("IB-3", ASKED), ("IB-33", MARKED), ("IB-34", ASKED), ("IB-35", IGNORED)];
pub(super) const RULES: PeerAssumptions = PeerAssumptions {
    keeps: "IB-9, IB-25",
    free: "when it polls, what is lost, when the sensor measures",
    shows: SHOWS,
    properties: PROPERTIES,
};
pub(super) const ANYTHING: PeerAssumptions =
    PeerAssumptions { keeps: "", free: "polls at any time", shows: SHOWS, properties: PROPERTIES };

/// A host of which only this is known.
#[derive(Debug, Clone, Copy)]
pub struct AnyHost {
    /// The ball's configuration.
    pub config: BallConfig,
    /// It polls when the reply to its last poll has come, or can no longer come (IB-25).
    pub keeps_rules: bool,
}

/// The model's knowledge of the polls and the values.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Knowledge {
    /// A poll of this connection is not answered.
    asked: bool,
    /// There are values that were not sent.
    measured: bool,
    /// Ticks since the last poll, up to when the host gives it up or has its reply.
    waits: u8,
    wrong: Option<&'static str>,
}

/// A step of the model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Step {
    /// ENQ comes.
    Enquiry,
    /// The sensor has new values.
    Measured,
}

impl Peer for AnyHost {
    type End = BallMachine;
    type Knowledge = Knowledge;
    type Step = Step;

    const TICK: Duration = TICK;

    fn config(&self) -> &BallConfig {
        &self.config
    }

    fn end(&self) -> BallMachine {
        BallMachine::NEW
    }

    fn known(&self) -> Knowledge {
        Knowledge { asked: false, measured: false, waits: WINDOW, wrong: None }
    }

    fn steps(&self, end: &BallMachine, known: &Knowledge, steps: &mut Vec<Step>) {
        steps.push(Step::Measured);
        if end.link != Link::Disconnected && (known.waits == WINDOW || !self.keeps_rules) {
            steps.push(Step::Enquiry);
        }
    }

    fn by(&self, step: Step) -> Actor {
        if step == Step::Measured { Actor::User } else { Actor::Line }
    }

    fn apply(&self, _: &BallMachine, known: &mut Knowledge, step: Step) -> Option<InputOf<Self>> {
        Some(match step {
            Step::Enquiry => {
                known.waits = 0;
                Input::Enquiry
            }
            Step::Measured => {
                known.measured = true;
                Input::Measured
            }
        })
    }

    fn sent(&self, _: &Reply) -> InputOf<Self> {
        Input::Sent
    }

    fn acted(&self, _: &BallMachine, known: &mut Knowledge, cause: CauseOf<Self>, action: Action) {
        let mut must = |holds: bool, what| {
            if !holds {
                known.wrong = Some(what);
            }
        };
        match (cause, action) {
            (Cause::Sent(reply), Action::Sent { fresh }) => {
                must(known.asked, ASKED);
                must(fresh == known.measured && reply.fresh == fresh, MARKED);
                (known.asked, known.measured, known.waits) = (false, false, WINDOW);
            }
            (_, Action::Sent { .. }) => must(false, ASKED),
            (Cause::Step(Step::Enquiry), action) => {
                must((action == Action::Ignore) == known.asked, IGNORED);
                known.asked = true;
            }
            (_, Action::Ignore) => must(false, IGNORED),
            (Cause::Connected | Cause::Disconnected, _) => known.asked = false,
            (Cause::Due | Cause::Sent(_) | Cause::Step(Step::Measured), _) => {}
        }
    }

    fn tick(&self, known: &mut Knowledge) {
        known.waits = (known.waits + 1).min(WINDOW);
    }

    fn restarted(&self, known: &mut Knowledge) {
        *known = Knowledge { waits: known.waits, wrong: known.wrong, ..self.known() };
    }

    fn broken(&self, _: &BallMachine, known: &Knowledge, broken: &mut Vec<&'static str>) {
        broken.extend(known.wrong);
    }

    /// Returns whether each poll is answered.
    fn is_over(&self, _: &BallMachine, known: &Knowledge) -> bool {
        !known.asked
    }
}

impl Wired for AnyHost {
    type Session = Ball;

    const FAULTS: Faults = Faults::BAD_LINE;

    fn session(&self) -> Ball {
        Ball::new(self.config).expect("a configuration that works")
    }

    fn speak(&self, _: &Knowledge, step: Step, session: &mut Ball, now: Duration) -> Vec<u8> {
        match step {
            Step::Enquiry => vec![ENQ],
            Step::Measured => {
                let [a, b, c, ..] = now.as_micros().to_le_bytes().map(u8::cast_signed);
                session.measure([a, b, c], [c, b, a], Keys::NONE);
                Vec::new()
            }
        }
    }

    fn is_written(&self, _: &SceneOf<Self>, what: &Reply, bytes: &[u8]) -> bool {
        let Ok(Some((frame, length))) = Frame::decode(bytes) else { return false };
        length == bytes.len() && frame.packet().is_ok_and(|packet| packet.status.is_fresh() == what.fresh)
    }

    fn reports(&self, action: &Action, reports: &mut Vec<String>) {
        match action {
            Action::Nothing => {}
            Action::Ignore => reports.push("ignored".into()),
            Action::Sent { fresh } => reports.push(format!("reply {fresh}")),
        }
    }

    fn reported(&self, event: &BallEvent) -> Option<String> {
        match event {
            BallEvent::Reply(packet) => Some(format!("reply {}", packet.status.is_fresh())),
            BallEvent::Ignored => Some("ignored".into()),
            BallEvent::Unknown(_) => None,
            other => Some(format!("{other:?}")),
        }
    }
}
