//! What the model knows of a cell: both machines, the line between them, and what is known of every exception.

use core::time::Duration;

use robot_session::end::Machine as _;
use val2_alter::controller::machine::{
    self as controller, ControllerMachine, ControllerPhase, Handling, Outgoing, Progress, StartOutcome,
    Taken, Turn,
};
use val2_alter::host::machine::{self as host, Answer, Course, Draft, HostMachine, HostPhase, Pending};
use val2_alter::{AXES, ErrorCode, Exception, ExceptionOutcome, MotionPhase, Policy, StartCode, timing};

use super::setup::{Alter, TICK};
use crate::model::{Edges, drive};

pub(super) const ONCE: &str = "an exception is executed once at most";
pub(super) const DONE: &str = "what is reported done was executed";
pub(super) const NOT_DONE: &str = "what is reported not done was not executed";
pub(super) const OUTCOME: &str = "one outcome for each exception";
pub(super) const NESTED: &str = "the exception subroutine is not started while it runs";
pub(super) const INFORMED: &str = "a message reports every interruption";
pub(super) const WORDS: &str = "a word that is left out is zero in the controller";
pub(super) const STALE: &str = "the arm follows only a fresh target";
pub(super) const FITS: &str = "a reply ends in the window that the host knows";
pub(super) const ZEROS: &str = "a stop is done when the arm was sent to rest";
pub(super) const SILENT: &str = "after a stop no message is answered";
pub(super) const UNASKED: &str = "the arm does not move in an interruption";
pub(super) const INVENTED_MODE: &str = "only the configured mode runs";
pub(super) const REFUSED: &str = "a start is refused only when it was corrupt too often, without a pause";
pub(super) const TRIES: &str = "a start is given up only after its attempts";
pub(super) const SILENCE: &str = "a controller that sends nothing is reported as lost";
pub(super) const EXPECTED: &str = "no input is unexpected";

/// The exception of every job.
pub(super) const GRIP: Exception = Exception::CloseGripper;

/// Everything that decides what happens next.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct World {
    /// The host.
    pub host: HostMachine,
    /// The controller.
    pub controller: ControllerMachine,
    /// What the controller has sent, the oldest first, and for how many ticks each is on its way.
    pub down: Vec<(Message, u8)>,
    /// What the host has sent.
    pub up: Vec<(Reply, u8)>,
    /// The message that was sent last is late, where that counts.
    pub late: bool,
    /// Faults that may still happen.
    pub faults: u8,
    /// The caller's exceptions.
    pub jobs: Vec<Job>,
    /// The caller's target: bit *i*, axis *i* moves. Its age in ticks, up to the most that count.
    pub target: (u8, u8),
    /// The offset of the host's limiter, and the one that it comes from (non-cumulative).
    pub offset: (u8, u8),
    /// How far a stop is.
    pub stop: Stop,
    /// The words that a controller holds which keeps what is left out.
    pub held: u8,
    /// Ticks since the host received a message, while it expects one.
    pub quiet: u8,
    /// Corrupt messages in a row that the host received while no ALTER was on, and the ticks since the last.
    pub corrupt: (u8, u8),
    /// Start messages sent in this ALTER.
    pub attempts: u8,
    /// A subroutine was started, and no message has said so.
    pub unreported: bool,
    /// The first property that does not hold.
    pub broken: Option<&'static str>,
}

/// A message of the controller.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Message {
    /// A start message.
    Start(ErrorCode),
    /// A standard message.
    Motion(MotionPhase, ErrorCode),
    /// An end message.
    End(ErrorCode),
    /// What was one.
    Corrupt,
}

/// An answer of the host.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Reply {
    /// To a start message.
    Start(StartCode),
    /// To a standard message: which words it has, which are not zero, and the exception's job.
    Values {
        /// The words.
        select: u8,
        /// Those that are not zero.
        moving: u8,
        /// Whose exception it carries.
        job: Option<u8>,
    },
    /// What was one.
    Corrupt,
}

/// An exception of the caller.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct Job {
    /// How often the subroutine was started by it, up to twice.
    pub executed: u8,
    /// What was reported.
    pub outcome: Option<ExceptionOutcome>,
    /// The host has lost its memory of it.
    pub abandoned: bool,
}

/// How far a stop is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Stop {
    /// Not asked for.
    NotYet,
    /// Asked for.
    Asked,
    /// Done.
    Reported,
    /// Overtaken by the end of ALTER, or ALTER was taken up again.
    Over,
}

impl World {
    pub(super) fn fail(&mut self, property: &'static str) {
        self.broken.get_or_insert(property);
    }

    pub(super) fn host(&mut self, system: &Alter, input: host::Input, edges: &mut Edges<'_>) -> host::Action {
        use host::Action;
        let Ok(action) = drive(&mut self.host, input, &system.host, edges) else {
            self.fail(EXPECTED);
            return Action::Nothing;
        };
        let (missed, rejected, outcome) = match action {
            Action::Missed => (true, false, None),
            Action::Asked(judged) | Action::Stopped(judged) => {
                (judged.missed, judged.rejected.is_some(), judged.outcome)
            }
            Action::Exception(exception, outcome) => (false, false, Some((exception, outcome))),
            Action::Ended(outcome) => (false, false, outcome),
            Action::Lost { missed, outcome, .. } => (missed, false, outcome),
            Action::Nothing
            | Action::Refuse(_)
            | Action::EndFrame
            | Action::Stale
            | Action::SentStart(_)
            | Action::SentReply(_) => (false, false, None),
        };
        if let Some((_, outcome)) = outcome {
            match self.jobs.last_mut() {
                Some(job) if job.outcome.is_none() => job.outcome = Some(outcome),
                _ => self.fail(OUTCOME),
            }
        }
        if missed {
            self.offset.1 = self.offset.0;
        }
        if rejected {
            self.offset.0 = self.offset.1;
        }
        if matches!(action, Action::Stopped(_)) {
            if self.held != 0 && system.is_in_time() {
                self.fail(ZEROS);
            }
            self.stop = Stop::Reported;
        } else if self.stop == Stop::Asked && matches!(action, Action::Ended(_) | Action::Lost { .. }) {
            self.stop = Stop::Over;
        }
        action
    }

    pub(super) fn controller(
        &mut self,
        system: &Alter,
        input: controller::Input,
        edges: &mut Edges<'_>,
    ) -> controller::Action {
        use controller::Action;
        let Ok(action) = drive(&mut self.controller, input, &system.controller, edges) else {
            self.fail(EXPECTED);
            return Action::Nothing;
        };
        match action {
            Action::Begin => (self.held, self.attempts, self.unreported) = (0, 0, false),
            Action::Start(StartOutcome::GaveUp) | Action::BadStart(_, Some(StartOutcome::GaveUp))
                if self.attempts < system.controller.attempts =>
            {
                self.fail(TRIES);
            }
            Action::Sent(Outgoing::Start(_)) => self.attempts += 1,
            Action::Sent(Outgoing::Motion(MotionPhase::Running, _)) if self.unreported => self.fail(INFORMED),
            Action::Sent(Outgoing::Motion(..) | Outgoing::End(_)) => {
                (self.attempts, self.unreported) = (0, false);
            }
            _ => {}
        }
        action
    }

    /// What comes of itself at the controller.
    pub(super) fn expire_controller(&mut self, system: &Alter, edges: &mut Edges<'_>) {
        while self.controller.expires(Duration::ZERO) {
            self.controller(system, controller::Input::Timeout, edges);
        }
    }

    /// What comes of itself at the host.
    pub(super) fn expire_host(&mut self, system: &Alter, edges: &mut Edges<'_>) {
        while self.host.expires(Duration::ZERO) {
            self.host(system, host::Input::Timeout, edges);
        }
    }

    /// The host reads a message.
    pub(super) fn read(&mut self, system: &Alter, message: Message, edges: &mut Edges<'_>) {
        let input = match message {
            Message::Start(_) => host::Input::Start { is_expected: !system.other_mode },
            Message::Motion(phase, error) => {
                host::Input::Motion { phase, error, len: Message::MOTION_LEN.into() }
            }
            Message::End(_) => host::Input::End,
            Message::Corrupt => host::Input::CorruptFrame,
        };
        if system.repeats && message == Message::Corrupt && !matches!(self.host.phase, HostPhase::Active(_)) {
            let (count, ticks) = self.corrupt;
            let count = if ticks < system.silence() { count } else { 0 };
            self.corrupt = ((count + 1).min(system.host.repeats + 1), 0);
        }
        self.host(system, input, edges);
        if message != Message::Corrupt {
            self.quiet = 0;
        }
    }

    /// An answer arrives at the controller.
    pub(super) fn arrive(&mut self, system: &Alter, reply: Reply, edges: &mut Edges<'_>) {
        let interrupted = self.is_interrupted();
        let (input, values) = match reply {
            Reply::Start(code) => (controller::Input::StartReply(code), None),
            Reply::Corrupt => (controller::Input::Corrupt(ErrorCode::Checksum), None),
            Reply::Values { select, moving, job } => {
                let exception = if job.is_some() { GRIP } else { Exception::None };
                (controller::Input::Reply { exception, has_room: true }, Some((select, moving, job)))
            }
        };
        let controller::Action::Take(taken, handling) = self.controller(system, input, edges) else { return };
        let Some((select, moving, job)) = values else { return };
        match taken {
            Taken::Moves => {
                self.held = self.held & !select | moving;
                if self.held != moving && system.is_in_time() {
                    self.fail(WORDS);
                }
                if interrupted {
                    self.fail(UNASKED);
                }
            }
            Taken::Rests if system.takes_all => self.held = self.held & !select | moving,
            Taken::Rests => {}
        }
        if let (Some(Handling::Subroutine(_)), Some(job)) = (handling, job)
            && let Some(job) = self.jobs.get_mut(usize::from(job))
        {
            job.executed = (job.executed + 1).min(2);
            self.unreported = true;
            if interrupted {
                self.fail(NESTED);
            }
        }
    }

    /// The draft of the answer that is due, whether no axis moves, and the offset after it.
    pub(super) fn draft(&self, system: &Alter, wanted: Answer) -> (Draft, bool, (u8, u8)) {
        let none = Draft { bare: 7, words: [2; AXES], moving: 0 };
        let Answer::Reply { course, .. } = wanted else {
            let at_rest = !system.is_offset() || self.offset.0 == self.offset.1;
            return (none, at_rest, self.offset);
        };
        let moving = match course {
            Course::Target => self.target.0,
            Course::Rest if !system.is_offset() => 0,
            Course::Zero => 0,
            Course::Hold | Course::Rest => self.offset.0,
        };
        let offset = if system.is_offset() { (moving, self.offset.0) } else { (0, 0) };
        let at_rest = if system.is_offset() { offset.0 == offset.1 } else { moving == 0 };
        // Both bytes of a word that is not zero are doubled.
        let words = core::array::from_fn(|axis| if moving >> axis & 1 != 0 { 4 } else { 2 });
        (Draft { bare: 8, words, moving }, at_rest, offset)
    }

    /// The host refuses a start.
    pub(super) fn refuse(&mut self, system: &Alter) {
        if system.repeats
            && self.host.policy == Policy::Accept
            && !system.other_mode
            && self.corrupt.0 <= system.host.repeats
        {
            self.fail(REFUSED);
        }
    }

    pub(super) fn is_interrupted(&self) -> bool {
        matches!(&self.controller.phase, ControllerPhase::On(alter) if matches!(alter.progress, Progress::Interrupted { .. }))
    }

    pub(super) fn in_window(&self) -> bool {
        matches!(&self.controller.phase, ControllerPhase::On(alter) if alter.turn != Turn::Controller)
    }

    pub(super) fn open_job(&self) -> bool {
        self.jobs.last().is_some_and(|job| job.outcome.is_none() && !job.abandoned)
    }

    /// Whether the host knows of an exception.
    pub(super) fn has_pending(&self) -> bool {
        matches!(&self.host.phase, HostPhase::Active(active) if active.exception != Pending::None)
    }

    pub(super) fn is_running(&self) -> bool {
        self.host.name() == "running"
    }
}

impl Message {
    pub(super) const START_LEN: u8 = 8;
    pub(super) const MOTION_LEN: u8 = 12;

    pub(super) fn len(self) -> u8 {
        match self {
            Self::Start(_) => Self::START_LEN,
            Self::Motion(..) | Self::Corrupt => Self::MOTION_LEN,
            Self::End(_) => 7,
        }
    }
}

impl From<Outgoing> for Message {
    fn from(message: Outgoing) -> Self {
        match message {
            Outgoing::Start(error) => Self::Start(error),
            Outgoing::Motion(phase, error) => Self::Motion(phase, error),
            Outgoing::End(error) => Self::End(error),
        }
    }
}

/// How many ticks this many bytes are on the line.
pub(super) fn on_the_line(bytes: usize, baud: u32) -> u8 {
    timing::transmission_time(bytes, baud).as_nanos().div_ceil(TICK.as_nanos()) as u8
}
