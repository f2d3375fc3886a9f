//! A controller of another maker: what is assumed and known of it, and what may happen.

use val2_alter::host::machine::{Input, Outcome};
use val2_alter::{ErrorCode, ExceptionOutcome, HostConfig, MotionPhase};

use super::world::{DONE, DecoderContents, NOT_DONE, ONCE, OUTCOME, WORDS};

/// Ticks of a cycle, and of the window within it that a whole reply can end in.
pub(super) const CYCLE: u8 = 4;
pub(super) const WINDOW: u8 = 2;
/// Ticks: a message and its reply are late by this many together, which is in time.
pub(super) const DELAY: u8 = 1;

pub(super) const RUNNING: MotionPhase = MotionPhase::Running;
pub(super) const INTERRUPTION: MotionPhase = MotionPhase::Interrupted;

/// A controller of which only this is known.
#[derive(Debug, Clone, Copy)]
pub struct AnyController {
    /// The host's configuration.
    pub config: HostConfig,
    /// It sends a message in a cycle, accepts a reply to it, and reports in the next one whether it has (AL-71 to
    /// AL-79, AL-90). Its reaction to faults is left open.
    pub keeps_rules: bool,
    /// It may accept a reply that is too late. Then the host is not restarted, and no start message is corrupt.
    pub takes_late: bool,
    /// Ticks: how late a reply may be. From a cycle on, two are on the line.
    pub delay: u8,
    /// The host's replies have any words. Otherwise its one axis follows the caller's target at once, and its values are bytes.
    pub is_free: bool,
}

/// An input of the system.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Step {
    /// The controller sends a message.
    Say(Frame),
    /// The message is lost.
    Lose,
    /// The host reads the message.
    Read {
        /// Whether it is damaged on the way.
        corrupt: bool,
    },
    /// The answer arrives.
    Arrive {
        /// Whether it is damaged on the way.
        corrupt: bool,
        /// Whether the controller uses it even if it need not.
        takes: bool,
    },
    /// The controller interrupts ALTER by itself.
    Interrupt,
    /// The subroutine returns.
    Return,
    /// The controller loses its memory.
    Restart,
    /// A message of unknown origin arrives.
    Come(Frame),
    /// The start mark of a frame comes. The next message is the rest of the frame.
    Head,
    /// Bytes come outside of any frame.
    Noise,
    /// The host answers with a word that is not zero.
    Move,
    /// The host answers with a zero, or without the word, and another axis moves.
    Brake,
    /// The caller has a target.
    Target {
        /// Whether the target is not zero.
        moves: bool,
    },
    /// The caller has an exception.
    Ask,
    /// The caller stops.
    Stop,
    /// The caller accepts ALTER again.
    Accept,
}

/// The model's knowledge of the controller, the line and the caller.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Knowledge {
    pub(super) robot: Robot,
    /// A message is on the line.
    pub(super) sending: bool,
    /// Ticks since the last message has left the line.
    pub(super) since_sent: u8,
    /// The result of the answer to that message.
    pub(super) window: Window,
    /// The word that it holds may be other than zero.
    pub(super) held: bool,
    /// Whether it has read the last reply.
    pub(super) taken: bool,
    /// On the line to the host, and to the controller with the ticks until it arrives.
    pub(super) down: Option<Frame>,
    pub(super) up: [Option<(Reply, u8)>; 2],
    /// The ticks by which the host has read the message late.
    pub(super) late: u8,
    /// The contents of the host's decoder, and the other effects of the read bytes on the host.
    pub(super) line: DecoderContents,
    pub(super) inputs: Vec<Input>,
    /// The phase in the message that the host may answer, and the ticks since it was read.
    pub(super) asked: Option<MotionPhase>,
    pub(super) started: Option<Opening>,
    pub(super) since_read: u8,
    /// Corrupt messages in a row that the host has read while no ALTER is on, and the ticks since the last.
    pub(super) corrupt: (u8, u8),
    /// The caller's exception.
    pub(super) job: Option<Job>,
    /// Ticks since the caller's target; whether it moves the arm.
    pub(super) target: u8,
    pub(super) wanted: bool,
    /// Whether the arm is off its path, by the last reply and by the previous one.
    pub(super) arm: (bool, bool),
    /// A stop was reported.
    pub(super) stopped: bool,
    /// The reply that is just sent: the words in it, and whether one moves.
    pub(super) reply: Option<(u8, bool)>,
    pub(super) wrong: Option<&'static str>,
}

/// The progress of the controller.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Robot {
    Off,
    Starting,
    Running,
    /// The subroutine runs; `reported` if a message has reported it.
    Interrupted {
        reported: bool,
    },
}

/// A message that may be answered as a start message.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Opening {
    /// The message names the configured mode.
    Expected,
    /// The message names another mode.
    Other,
    /// The message was corrupt.
    Corrupt,
}

/// The result of a message's window.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Window {
    Nothing,
    Good,
    Fault,
}

/// A message of the controller.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Frame {
    /// A start message.
    Start {
        /// With the configured mode.
        is_expected: bool,
    },
    /// A standard message.
    Motion(MotionPhase, ErrorCode),
    /// An end message.
    End,
    /// A damaged message.
    Corrupt,
}

/// An answer of the host.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Reply {
    Accept,
    Values {
        has_word: bool,
        moves: bool,
        /// It has an exception, and whether that is still without an outcome.
        exception: Option<bool>,
    },
}

/// The caller's exception.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Job {
    /// The number of times that the controller has executed it.
    pub(super) executed: u8,
    /// The number of standard messages since it was sent, up to two, and whether they report that it was not read.
    pub(super) sent: Option<(u8, bool)>,
}

impl Knowledge {
    /// Appends the steps of a controller that keeps the rules.
    pub(super) fn robot_steps(&self, peer: &AnyController, steps: &mut Vec<Step>) {
        if self.down.is_some() {
            steps.push(Step::Lose);
        }
        if matches!(self.up, [Some((_, ticks)), _] if ticks <= self.most_late(peer)) {
            let each = [(false, false), (false, true), (true, false)];
            // Where two replies are under way, one may come in an interruption of which no message has come.
            let each = each.into_iter().filter(|(corrupt, takes)| peer.delay <= DELAY || *corrupt || *takes);
            steps.extend(each.map(|(corrupt, takes)| Step::Arrive { corrupt, takes }));
        }
        // A reply that is late by a cycle could be one of the ALTER before.
        if self.robot != Robot::Off && peer.delay <= DELAY {
            steps.push(Step::Restart);
        }
        let is_its_turn = !self.sending && (self.window == Window::Good || self.since_sent > WINDOW);
        match self.robot {
            Robot::Running if is_its_turn => steps.push(Step::Interrupt),
            Robot::Interrupted { reported: true } if is_its_turn => steps.push(Step::Return),
            _ => {}
        }
        // A message takes a tick on the line.
        if self.sending || self.since_sent + 1 < CYCLE {
            return;
        }
        let error = match self.window {
            Window::Nothing => ErrorCode::Timeout,
            Window::Good => ErrorCode::None,
            Window::Fault => ErrorCode::Checksum,
        };
        let frames: &[_] = match self.robot {
            Robot::Off | Robot::Starting => &[Frame::Start { is_expected: true }],
            Robot::Running => &[Frame::Motion(RUNNING, error), Frame::End],
            Robot::Interrupted { .. } => &[Frame::Motion(INTERRUPTION, error), Frame::End],
        };
        steps.extend(frames.iter().map(|frame| Step::Say(*frame)));
    }

    pub(super) fn say(&mut self, frame: Frame) {
        self.robot = match frame {
            Frame::Start { .. } => Robot::Starting,
            Frame::Motion(MotionPhase::Running, _) => Robot::Running,
            Frame::Motion(MotionPhase::Interrupted, _) => Robot::Interrupted { reported: true },
            Frame::End | Frame::Corrupt => Robot::Off,
        };
        self.held &= self.robot != Robot::Off && self.robot != Robot::Starting;
        (self.down, self.sending, self.window) = (Some(frame), true, Window::Nothing);
    }

    /// Ticks: the answer to the message that was read last is late by no more.
    fn most_late(&self, peer: &AnyController) -> u8 {
        if peer.delay > DELAY { peer.delay } else { DELAY - self.late }
    }

    /// Called when the host has sent an answer.
    pub(super) fn answered(&mut self, peer: &AnyController, reply: Reply) {
        if peer.keeps_rules {
            let answer = Some((reply, 1 + self.most_late(peer)));
            // Of three, the first has arrived when nothing was looked at.
            self.up = match self.up {
                [None, _] => [answer, None],
                [first, None] if peer.delay > DELAY => [first, answer],
                [_, second] if peer.delay > DELAY => [second, answer],
                _ => [answer, None],
            };
        }
        self.taken = false;
    }

    /// Lets the answer arrive at the controller.
    pub(super) fn arrive(&mut self, takes_late: bool, corrupt: bool, takes: bool) {
        let Some((reply, _)) = self.up[0].take() else { return };
        self.up.swap(0, 1);
        self.late = 0;
        let in_window = !self.sending && self.since_sent <= WINDOW && self.window == Window::Nothing;
        if corrupt {
            self.window = if in_window { Window::Fault } else { self.window };
            return;
        }
        self.taken |= in_window && matches!(reply, Reply::Values { .. });
        match (reply, self.robot) {
            (Reply::Accept, Robot::Starting) if in_window => {
                (self.robot, self.window, self.held) = (Robot::Running, Window::Good, false);
            }
            (Reply::Values { has_word, moves, exception }, Robot::Running)
                if in_window || takes && takes_late =>
            {
                self.window = if in_window { Window::Good } else { self.window };
                if self.held && !has_word {
                    self.wrong = Some(WORDS);
                }
                self.held = if has_word { moves } else { self.held };
                if let Some(is_open) = exception {
                    self.robot = Robot::Interrupted { reported: false };
                    if is_open {
                        self.execute();
                    }
                }
            }
            (Reply::Values { has_word, moves, .. }, Robot::Interrupted { .. })
                if in_window || takes && takes_late =>
            {
                self.window = if in_window { Window::Good } else { self.window };
                self.held = if has_word && takes { moves } else { self.held };
            }
            (Reply::Accept | Reply::Values { .. }, _) => {}
        }
    }

    /// Returns whether the host attributes an error code to the last reply although that was read.
    pub(super) fn is_misjudged(&self, peer: &AnyController, rejected: Option<(ErrorCode, bool)>) -> bool {
        peer.keeps_rules && !peer.takes_late && self.taken && matches!(rejected, Some((_, true)))
    }

    pub(super) fn execute(&mut self) {
        let Some(job) = &mut self.job else { return };
        job.executed += 1;
        if job.executed > 1 {
            self.wrong = Some(ONCE);
            job.executed = 1;
        }
    }

    /// Appends the input of read bytes, and stores the part of them that the host's decoder buffers.
    pub(super) fn hold(&mut self, held: DecoderContents) {
        self.line = held;
        self.inputs.push(Input::Bytes { partial: held != DecoderContents::Nothing });
    }

    pub(super) fn next_input(&mut self) -> Option<Input> {
        (!self.inputs.is_empty()).then(|| self.inputs.remove(0))
    }

    /// Sets the arm's state after the host has read a message's report about its replies.
    pub(super) fn rest(&mut self, missed: bool, rejected: Option<(ErrorCode, bool)>) {
        if missed {
            self.arm.1 = self.arm.0;
        }
        match rejected {
            Some((_, true)) => self.arm.0 = self.arm.1,
            Some((_, false)) => self.arm.1 = self.arm.0,
            None => {}
        }
    }

    /// Called when the exception is no longer awaited.
    pub(super) fn forget_exception(&mut self) {
        for (reply, _) in self.up.iter_mut().flatten() {
            if let Reply::Values { exception: Some(is_open), .. } = reply {
                *is_open = false;
            }
        }
    }

    /// Reads the bytes before the frame that begins.
    pub(super) fn end_noise(&mut self) {
        if self.line == DecoderContents::Noise {
            self.lose_noise();
        }
    }

    pub(super) fn lose_noise(&mut self) {
        self.lose_sequence();
        self.inputs.push(Input::Noise);
    }

    pub(super) fn lose_sequence(&mut self) {
        if let Some(Job { sent: Some((0 | 1, unread)), .. }) = &mut self.job {
            *unread = false;
        }
    }

    /// Called when the exception has an outcome.
    pub(super) fn end_job(
        &mut self,
        peer: &AnyController,
        outcome: Outcome,
        must: &mut impl FnMut(bool, &'static str),
    ) {
        let Some((_, outcome)) = outcome else { return };
        let Some(job) = self.job.take() else { return must(false, OUTCOME) };
        self.forget_exception();
        match outcome {
            ExceptionOutcome::Done => must(job.executed > 0 || !peer.keeps_rules, DONE),
            ExceptionOutcome::NotDone => must(job.executed == 0, NOT_DONE),
            ExceptionOutcome::Unknown(_) => {}
        }
    }
}
