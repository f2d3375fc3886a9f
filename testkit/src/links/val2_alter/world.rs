//! What the model knows of a cell: both machines, the line between them, and what is known of every exception.

use val2_alter::machine::{
    ControllerActions, ControllerInput, ControllerMachine, ControllerPhase, Course, Draft, Handling,
    HostActions, HostInput, HostMachine, HostPhase, Outgoing, Pending, Progress, StartOutcome, Taken, Turn,
    Wanted,
};
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

    pub(super) fn host(&mut self, system: &Alter, input: HostInput, edges: &mut Edges<'_>) -> HostActions {
        let Ok(actions) = drive(&mut self.host, input, &system.host, edges) else {
            self.fail(EXPECTED);
            return HostActions::default();
        };
        if let Some((_, outcome)) = actions.outcome {
            match self.jobs.last_mut() {
                Some(job) if job.outcome.is_none() => job.outcome = Some(outcome),
                _ => self.fail(OUTCOME),
            }
        }
        if actions.missed {
            self.offset.1 = self.offset.0;
        }
        if actions.rejected.is_some() {
            self.offset.0 = self.offset.1;
        }
        if actions.stopped {
            if self.held != 0 && system.is_in_time() {
                self.fail(ZEROS);
            }
            self.stop = Stop::Reported;
        } else if self.stop == Stop::Asked && (actions.ended || actions.lost.is_some()) {
            self.stop = Stop::Over;
        }
        actions
    }

    pub(super) fn controller(
        &mut self,
        system: &Alter,
        input: ControllerInput,
        edges: &mut Edges<'_>,
    ) -> ControllerActions {
        let Ok(actions) = drive(&mut self.controller, input, &system.controller, edges) else {
            self.fail(EXPECTED);
            return ControllerActions::default();
        };
        if actions.restart {
            (self.held, self.attempts, self.unreported) = (0, 0, false);
        }
        if actions.start == Some(StartOutcome::GaveUp) && self.attempts < system.controller.attempts {
            self.fail(TRIES);
        }
        match actions.send {
            Some(Outgoing::Start(_)) => self.attempts += 1,
            Some(Outgoing::Motion(MotionPhase::Running, _)) if self.unreported => self.fail(INFORMED),
            Some(Outgoing::Motion(..) | Outgoing::End(_)) => (self.attempts, self.unreported) = (0, false),
            None => {}
        }
        if actions.close_window {
            self.controller(system, ControllerInput::WindowClosed, edges);
        }
        actions
    }

    /// The host reads a message.
    pub(super) fn read(&mut self, system: &Alter, message: Message, edges: &mut Edges<'_>) {
        let input = match message {
            Message::Start(_) => {
                HostInput::Start { is_expected: !system.other_mode, len: Message::START_LEN }
            }
            Message::Motion(phase, error) => HostInput::Motion { phase, error, len: Message::MOTION_LEN },
            Message::End(_) => HostInput::End,
            Message::Corrupt => HostInput::CorruptFrame,
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
            Reply::Start(code) => (ControllerInput::StartReply(code), None),
            Reply::Corrupt => (ControllerInput::Corrupt(ErrorCode::Checksum), None),
            Reply::Values { select, moving, job } => {
                let exception = if job.is_some() { GRIP } else { Exception::None };
                (ControllerInput::Reply { exception, has_room: true }, Some((select, moving, job)))
            }
        };
        let actions = self.controller(system, input, edges);
        let Some((select, moving, job)) = values else { return };
        match actions.taken {
            Some(Taken::Moves) => {
                self.held = self.held & !select | moving;
                if self.held != moving && system.is_in_time() {
                    self.fail(WORDS);
                }
                if interrupted {
                    self.fail(UNASKED);
                }
            }
            Some(Taken::Rests) if system.takes_all => self.held = self.held & !select | moving,
            Some(Taken::Rests) | None => {}
        }
        if let (Some(Handling::Subroutine(_)), Some(job)) = (actions.exception, job)
            && let Some(job) = self.jobs.get_mut(usize::from(job))
        {
            job.executed = (job.executed + 1).min(2);
            self.unreported = true;
            if interrupted {
                self.fail(NESTED);
            }
        }
    }

    /// The draft of the answer that is due, and whether its values follow the target.
    pub(super) fn draft(&self, system: &Alter, wanted: Wanted) -> (Draft, (u8, u8)) {
        let none = Draft { bare: 7, words: [2; AXES], moving: 0, at_rest: true, has_room: true };
        let Wanted::Reply { course, .. } = wanted else {
            let at_rest = !system.is_offset() || self.offset.0 == self.offset.1;
            return (Draft { at_rest, ..none }, self.offset);
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
        (Draft { bare: 8, words, moving, at_rest, ..none }, offset)
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

/// How many ticks so many bytes are on the line.
pub(super) fn on_the_line(bytes: usize, baud: u32) -> u8 {
    timing::transmission_time(bytes, baud).as_nanos().div_ceil(TICK.as_nanos()) as u8
}
