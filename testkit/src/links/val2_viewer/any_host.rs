//! A workstation against hosts of other makers.

use core::time::Duration;

use robot_session::Encode as _;
use val2_viewer::workstation::machine::{Action, Display, Enquiry, Input, Request, WorkstationMachine};
use val2_viewer::{ENQ, PosePacket, Workstation, WorkstationConfig, WorkstationEvent, XOFF, XON};

use super::hold::{HELD, Hold, RESUMED};
use super::world::{ASKS, CLAIMED, CREDIT, FAULTS, ONE_OUTCOME, STALE, TICK};
use crate::faults::Faults;
use crate::model::{
    Actor, Cause, CauseOf, EXPECTED, InputOf, Peer, PeerAssumptions, SceneOf, WRITTEN, Wired,
};

/// Ticks. A pause is shorter than the time of an answer, so that a request ends by either.
pub(super) const PAUSE: u8 = 3;
pub(super) const STALE_AFTER: u8 = 4;
/// The requests that the line and the host hold at most.
const REQUESTS: u8 = 2;
/// Ticks of a display cycle and of an answer, where nothing goes wrong.
const CYCLE: u8 = 2;
const ANSWER: u8 = 1;

pub(super) const MISSED: &str = "a request is missed when no answer has come in time, and not before";
pub(super) const ENDED: &str = "a line ends the request, or the wait for a late answer; nothing shorter does";
pub(super) const PAIRED: &str = "a pose answers the request that is open";

const SHOWS: &[(&str, &str)] = &[("VV-1", WRITTEN), ("VV-8", WRITTEN), ("VV-25", CREDIT), ("VV-27", ASKS)];
const PROPERTIES: &[&str] = &[ONE_OUTCOME, CREDIT, ASKS, MISSED, ENDED, STALE, HELD, RESUMED, EXPECTED];
pub(super) const RULES: PeerAssumptions = PeerAssumptions {
    keeps: "VV-1, VV-3",
    free: "when it answers, how many requests with one packet, what the line corrupts, when it holds the line",
    shows: SHOWS,
    properties: PROPERTIES,
};
pub(super) const PROMPT: PeerAssumptions = PeerAssumptions {
    keeps: "VV-1, VV-3, an answer within a display cycle, no faults",
    free: "when it answers",
    shows: &[],
    properties: &[CLAIMED, ONE_OUTCOME, CREDIT, ASKS, MISSED, ENDED, STALE, EXPECTED],
};
pub(super) const ANYTHING: PeerAssumptions = PeerAssumptions {
    keeps: "",
    free: "packets, noise, XOFF and XON at any time",
    shows: SHOWS,
    properties: PROPERTIES,
};

/// A host of which only this is known.
#[derive(Debug, Clone, Copy)]
pub struct AnyHost {
    /// The workstation's configuration.
    pub config: WorkstationConfig,
    /// It sends nothing unasked (VV-3), and sends XON after XOFF (VV-1). The line may lose and corrupt anything.
    pub keeps_rules: bool,
    /// Holds the ends to the pairing of requests and packets, which nothing in the protocol can give.
    pub is_paired: bool,
    /// Whether it answers each request in time, nothing goes wrong, and the display continues.
    pub is_prompt: bool,
}

/// The model's knowledge of the requests, the picture and the line.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Knowledge {
    /// Requests that the host may still answer: of before, and the last one.
    earlier: u8,
    last: bool,
    /// The last request has no outcome.
    open: bool,
    /// No line has come since it was sent.
    awaited: bool,
    /// The workstation may ask: first, after an answer, after a pause.
    credit: bool,
    /// This display cycle asks again, after a pause.
    asks: bool,
    /// Ticks since it was sent, and since the last display cycle.
    since_asked: u8,
    since_drawn: u8,
    /// Ticks since the pose that is shown has come.
    shown: Option<u8>,
    hold: Hold,
    wrong: Option<&'static str>,
}

/// A step of the model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Step {
    /// A packet comes: it answers the oldest request, or all of them.
    Pose {
        /// All of them.
        all: bool,
    },
    /// Bytes arrive that are not a packet.
    Corrupt {
        /// Whether they are a whole line, which was the answer to the oldest request.
        line: bool,
    },
    /// A request, or the answer to it, is lost.
    Lose,
    /// XOFF comes.
    Xoff,
    /// XON comes.
    Xon,
    /// A display cycle.
    Draw,
}

impl Peer for AnyHost {
    type End = WorkstationMachine;
    type Knowledge = Knowledge;
    type Step = Step;

    const TICK: Duration = TICK;

    fn config(&self) -> &WorkstationConfig {
        &self.config
    }

    fn end(&self) -> WorkstationMachine {
        WorkstationMachine::Disconnected
    }

    fn known(&self) -> Knowledge {
        Knowledge {
            earlier: 0,
            last: false,
            open: false,
            awaited: false,
            credit: false,
            asks: false,
            since_asked: STALE_AFTER,
            since_drawn: PAUSE,
            shown: None,
            hold: Hold(None),
            wrong: None,
        }
    }

    fn steps(&self, end: &WorkstationMachine, known: &Knowledge, steps: &mut Vec<Step>) {
        let requests = known.requests();
        if self.is_prompt {
            if *end != WorkstationMachine::Disconnected && known.since_drawn >= CYCLE {
                steps.push(Step::Draw);
            }
            steps.extend((requests > 0).then_some(Step::Pose { all: false }));
            return;
        }
        if requests > 0 {
            steps.push(Step::Lose);
        }
        if *end == WorkstationMachine::Disconnected {
            return;
        }
        steps.extend([Step::Draw, Step::Xoff, Step::Corrupt { line: false }]);
        if requests > 0 || !self.keeps_rules {
            steps.extend([Step::Pose { all: false }, Step::Corrupt { line: true }]);
        }
        if requests > 1 {
            steps.push(Step::Pose { all: true });
        }
        if known.hold.0.is_some() || !self.keeps_rules {
            steps.push(Step::Xon);
        }
    }

    fn by(&self, step: Step) -> Actor {
        match step {
            Step::Pose { .. } | Step::Corrupt { .. } | Step::Xoff | Step::Xon => Actor::Line,
            Step::Draw => Actor::User,
            Step::Lose => Actor::Others,
        }
    }

    fn apply(&self, end: &WorkstationMachine, known: &mut Knowledge, step: Step) -> Option<InputOf<Self>> {
        Some(match step {
            Step::Lose => {
                known.answer(false);
                return None;
            }
            Step::Pose { all } => {
                let is_earlier = known.earlier > 0 && !all;
                if self.is_paired && is_earlier && request(end).is_some_and(is_waiting) {
                    known.wrong = Some(PAIRED);
                }
                known.answer(all);
                Input::Pose
            }
            Step::Corrupt { line } => {
                if line {
                    known.answer(false);
                }
                Input::Corrupt { line }
            }
            Step::Xoff => {
                known.hold = Hold(Some(0));
                Input::Xoff
            }
            Step::Xon => {
                known.hold = Hold(None);
                Input::Xon
            }
            Step::Draw => {
                let is_paused = known.since_drawn >= PAUSE;
                known.asks =
                    is_paused && known.since_asked >= PAUSE && *end != WorkstationMachine::Disconnected;
                known.credit |= is_paused;
                known.since_drawn = 0;
                Input::Draw
            }
        })
    }

    fn sent(&self, _: &Enquiry) -> InputOf<Self> {
        Input::Sent
    }

    fn acted(&self, end: &WorkstationMachine, known: &mut Knowledge, cause: CauseOf<Self>, action: Action) {
        let mut wrong = None;
        match action {
            Action::Nothing | Action::Sent | Action::Unasked => {}
            Action::Pose => {
                wrong = known.end();
                known.shown = Some(0);
            }
            Action::Missed => {
                let is_early = cause == Cause::Due && known.since_asked < STALE_AFTER;
                wrong = known.end().or(is_early.then_some(MISSED));
            }
            Action::Stale => known.shown = None,
            Action::HoldEnded => wrong = known.hold.ended(),
            Action::Closed { missed, stale } => {
                wrong = if missed { known.end() } else { None };
                known.shown = known.shown.filter(|_| !stale);
            }
        }
        match cause {
            Cause::Connected => {
                (known.credit, known.awaited, known.hold) = (true, false, Hold(None));
            }
            Cause::Disconnected => {
                (known.credit, known.awaited, known.hold) = (false, false, Hold(None));
            }
            Cause::Sent(Enquiry) => {
                let has_credit = core::mem::take(&mut known.credit);
                wrong = wrong.or(known.hold.sent()).or((!has_credit).then_some(CREDIT));
                known.earlier = known.requests().min(REQUESTS - 1);
                (known.last, known.open, known.awaited, known.since_asked) = (true, true, true, 0);
            }
            Cause::Step(Step::Pose { .. } | Step::Corrupt { line: true }) if known.awaited => {
                (known.awaited, known.credit) = (false, true);
                let goes_on = matches!(request(end), Some(Request::Waiting { .. } | Request::Overdue { .. }));
                wrong = wrong.or(goes_on.then_some(ENDED));
            }
            Cause::Step(Step::Corrupt { line: false }) if known.awaited => {
                wrong = wrong.or((request(end) == Some(Request::Allowed)).then_some(ENDED));
            }
            Cause::Step(Step::Draw) => {
                let asks = core::mem::take(&mut known.asks);
                wrong = wrong.or((asks && request(end) != Some(Request::Due)).then_some(ASKS));
            }
            Cause::Due | Cause::Step(_) => {}
        }
        let is_alarm = matches!(
            action,
            Action::Unasked | Action::Missed | Action::Stale | Action::HoldEnded | Action::Closed { .. }
        );
        wrong = wrong.or((self.is_prompt && is_alarm).then_some(CLAIMED));
        known.wrong = known.wrong.or(wrong);
    }

    fn tick(&self, known: &mut Knowledge) {
        let older = |ticks: &mut u8, most: u8| *ticks = (*ticks + 1).min(most);
        older(&mut known.since_asked, STALE_AFTER + 1);
        older(&mut known.since_drawn, PAUSE);
        if let Some(shown) = &mut known.shown {
            older(shown, STALE_AFTER + 1);
        }
        known.hold.tick();
    }

    fn restarted(&self, known: &mut Knowledge) {
        *known = Knowledge { earlier: known.earlier, last: known.last, wrong: known.wrong, ..self.known() };
    }

    fn broken(&self, end: &WorkstationMachine, known: &Knowledge, broken: &mut Vec<&'static str>) {
        broken.extend(known.wrong);
        let is_due = robot_session::end::Machine::expires(end, Duration::ZERO);
        if request(end).is_some_and(is_waiting) != known.open {
            broken.push(ONE_OUTCOME);
        }
        if known.open && known.since_asked > STALE_AFTER && !is_due {
            broken.push(MISSED);
        }
        let is_late = known.shown > Some(STALE_AFTER) && !is_due;
        if end.live_until().is_some() != known.shown.is_some() || is_late {
            broken.push(STALE);
        }
    }

    fn is_urgent(&self, end: &WorkstationMachine, known: &Knowledge) -> bool {
        self.fault_free_step(end, known).is_some()
    }

    fn fault_free_step(&self, end: &WorkstationMachine, known: &Knowledge) -> Option<Step> {
        if !self.is_prompt {
            return None;
        }
        if known.requests() > 0 && known.since_asked >= ANSWER {
            return Some(Step::Pose { all: false });
        }
        let draws = *end != WorkstationMachine::Disconnected && known.since_drawn >= CYCLE;
        draws.then_some(Step::Draw)
    }

    /// Returns whether each request was sent and has an outcome, which must happen whatever the host does.
    fn is_over(&self, end: &WorkstationMachine, known: &Knowledge) -> bool {
        !known.open && request(end) != Some(Request::Due)
    }
}

impl Wired for AnyHost {
    type Session = Workstation;

    const FAULTS: Faults = FAULTS;

    fn session(&self) -> Workstation {
        Workstation::new(self.config).expect("a configuration that works")
    }

    fn speak(&self, _: &Knowledge, step: Step, session: &mut Workstation, now: Duration) -> Vec<u8> {
        match step {
            Step::Pose { .. } => {
                let pose = [now.as_millis() as i16; 12];
                let mut line = vec![0; PosePacket::MAX_LEN];
                let length = PosePacket { count: 0, pose }.encode(&mut line).expect("a buffer of a packet");
                line.truncate(length);
                line
            }
            Step::Corrupt { line: true } => b"\n".into(),
            Step::Corrupt { line: false } => b"x$".into(),
            Step::Xoff => vec![XOFF],
            Step::Xon => vec![XON],
            Step::Lose => Vec::new(),
            Step::Draw => {
                session.draw(now);
                Vec::new()
            }
        }
    }

    fn is_written(&self, _: &SceneOf<Self>, _: &Enquiry, bytes: &[u8]) -> bool {
        bytes == [ENQ]
    }

    fn reports(&self, action: &Action, reports: &mut Vec<String>) {
        match action {
            Action::Nothing | Action::Sent => {}
            Action::Closed { missed, stale } => {
                reports.extend(missed.then(|| "Missed".into()));
                reports.extend(stale.then(|| "Stale".into()));
            }
            action => reports.push(format!("{action:?}")),
        }
    }

    fn reported(&self, event: &WorkstationEvent) -> Option<String> {
        match event {
            WorkstationEvent::Corrupt(_) => None,
            WorkstationEvent::Pose(_) => Some("Pose".into()),
            WorkstationEvent::Unasked(_) => Some("Unasked".into()),
            event => Some(format!("{event:?}")),
        }
    }

    /// Returns false for XON and XOFF, which are removed from a line.
    fn is_last(&self, step: Step) -> bool {
        !matches!(step, Step::Xon | Step::Xoff)
    }

    /// Returns the words that the end may receive in place of a damaged one: one bit turns a digit into XON or XOFF.
    fn lost(&self, known: &Knowledge, step: Step) -> Vec<Vec<Step>> {
        let lines = [true, false].map(|line| vec![Step::Corrupt { line }]);
        match step {
            Step::Xoff => vec![vec![], vec![Step::Xon]],
            Step::Xon => vec![vec![], vec![Step::Xoff]],
            Step::Pose { .. } | Step::Corrupt { .. } => {
                let held = [Step::Xoff, Step::Xon].map(|step| vec![step, Step::Corrupt { line: true }]);
                let lost = (known.requests() > 0).then(|| vec![Step::Lose]);
                [vec![]].into_iter().chain(lost).chain(lines).chain(held).collect()
            }
            Step::Lose | Step::Draw => vec![vec![]],
        }
    }
}

impl Knowledge {
    fn requests(&self) -> u8 {
        self.earlier + u8::from(self.last)
    }

    /// Lets the host answer; the answer may be lost.
    fn answer(&mut self, all: bool) {
        if all || self.earlier == 0 {
            (self.earlier, self.last) = (0, false);
        } else {
            self.earlier -= 1;
        }
    }

    /// Called when the request has an outcome; returns the broken property, if the request has another outcome already.
    fn end(&mut self) -> Option<&'static str> {
        (!core::mem::take(&mut self.open)).then_some(ONE_OUTCOME)
    }
}

fn request(end: &WorkstationMachine) -> Option<Request> {
    match end {
        WorkstationMachine::Connected(Display { request, .. }) => Some(*request),
        WorkstationMachine::Disconnected => None,
    }
}

fn is_waiting(request: Request) -> bool {
    matches!(request, Request::Waiting { .. })
}
