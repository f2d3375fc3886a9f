//! The line between a host and a controller of another maker: words as the host's inputs and as bytes, and the host's answers.

use core::time::Duration;

use robot_session::end::{End as _, Machine as _};
use val2_alter::controller::machine::DueMessage;
use val2_alter::host::machine::{
    Action, Answer, Draft, HostMachine, HostPhase, Input, OutputMode, PreviousReply,
};
use val2_alter::{AXES, ErrorCode, Host, HostEvent, HostMessage, Mode, Policy, Reply, timing};

use super::any_robot::{AnyController, CYCLE, Frame, Job, Knowledge, Opening, RUNNING, Step};
use super::world::{
    DecoderContents, FITS, FRESH, GRIP, MOVES, NOISE, STALE, TICK, bytes, corrupt, head, message,
};
use crate::faults::Faults;
use crate::model::{SceneOf, Wired};

const NOW: Duration = Duration::ZERO;
/// The length of a standard message.
const MOTION_LEN: usize = 12;

impl AnyController {
    /// Returns the number of ticks without a message after which the controller counts as lost.
    pub(super) fn silence(&self) -> u8 {
        CYCLE * self.config.silence_cycles as u8
    }

    /// Called when a message arrives, or the rest of it.
    pub(super) fn receive(&self, end: &HostMachine, known: &mut Knowledge, frame: Frame) {
        known.end_noise();
        let input = self.read(end, known, frame);
        known.inputs.push(input);
        known.hold(if frame == Frame::Corrupt { DecoderContents::Corrupt } else { DecoderContents::Nothing });
    }

    /// Lets the host read a message; returns the input.
    pub(super) fn read(&self, end: &HostMachine, known: &mut Knowledge, frame: Frame) -> Input {
        let is_active = matches!(end.phase, HostPhase::Active(_));
        match frame {
            Frame::Start { is_expected } => {
                let opening = if is_expected { Opening::Expected } else { Opening::Other };
                (known.started, known.asked, known.corrupt) = (Some(opening), None, (0, 0));
                Input::Start { is_expected }
            }
            Frame::Motion(phase, error) => {
                known.asked = is_active.then_some(phase);
                let follows = u32::from(known.since_read) * TICK + self.config.max_delay < timing::CYCLE * 2;
                known.since_read = 0;
                if let Some(Job { sent: Some((messages, unread)), .. }) = &mut known.job
                    && *messages < 2
                {
                    let is_unread = *messages > 0 || error != ErrorCode::None;
                    *unread &= is_unread && phase == RUNNING && follows;
                    *messages += 1;
                }
                Input::Motion { phase, error, len: MOTION_LEN }
            }
            Frame::End => {
                (known.started, known.asked, known.corrupt) = (None, None, (0, 0));
                Input::End
            }
            Frame::Corrupt => {
                known.lose_sequence();
                // It may have been a start message.
                if !is_active {
                    known.started = known.started.or(Some(Opening::Corrupt));
                    known.corrupt = ((known.corrupt.0 + 1).min(self.config.repeats + 1), 0);
                }
                Input::CorruptFrame
            }
        }
    }

    /// Returns the reaction of the host to the answer that is due.
    pub(super) fn reply(
        &self,
        end: &HostMachine,
        known: &mut Knowledge,
        moves: bool,
        at_rest: bool,
    ) -> Input {
        let Some(answer) = end.transmit(NOW, &self.config) else { return Input::Late };
        let (bare, end_by) = match &end.phase {
            HostPhase::Active(active) => (8, active.request.map(|request| request.due.end_by)),
            HostPhase::Starting { answer, .. } | HostPhase::Repeating { answer: Some(answer), .. } => {
                (7, Some(answer.end_by))
            }
            _ => (7, None),
        };
        let (moves, at_rest) = match answer {
            Answer::Reply { course, .. } if !self.is_free => {
                let moves = match course {
                    OutputMode::Target => known.wanted,
                    OutputMode::Zero => false,
                    OutputMode::Hold | OutputMode::Rest => known.arm.0,
                };
                (moves, !moves && !known.arm.0)
            }
            _ => (moves, at_rest),
        };
        let draft = Draft { bare, words: [2; AXES], moving: moves.into() };
        let Some((select, _)) = end.select(NOW, &draft, &self.config) else { return Input::Late };
        let len = usize::from(bare) + 2 * select.count_ones() as usize;
        if end_by.is_none_or(|end_by| timing::transmission_time(len, self.config.baud) > end_by) {
            known.wrong = known.wrong.or(Some(FITS));
        }
        let is_follower = matches!(answer, Answer::Reply { course: OutputMode::Target, .. });
        if is_follower && known.target >= FRESH {
            known.wrong = known.wrong.or(Some(STALE));
        }
        let moving = draft.moving & select;
        if !self.is_free && matches!(answer, Answer::Reply { .. }) {
            known.arm = if moving == draft.moving { (moves, known.arm.0) } else { (false, false) };
        }
        known.reply = Some((select, moving != 0));
        Input::Sent { moving, at_rest }
    }
}

impl Wired for AnyController {
    type Session = Host;

    // Damaged bytes, and those in pieces, are words.
    const FAULTS: Faults = Faults { split: 0.3, ..Faults::NONE };

    fn session(&self) -> Host {
        Host::new(self.config).expect("a configuration that works")
    }

    fn speak(&self, known: &Knowledge, word: Step, session: &mut Host, now: Duration) -> Vec<u8> {
        let frame = match word {
            Step::Read { corrupt: false } => known.down,
            Step::Read { corrupt: true } => Some(Frame::Corrupt),
            Step::Come(frame) => Some(frame),
            Step::Head => return head(),
            Step::Noise => return vec![NOISE],
            Step::Target { moves } => {
                session.set_target(now, values(moves));
                None
            }
            Step::Ask => {
                session.exception(now, GRIP).expect("it runs, and none is pending");
                None
            }
            Step::Stop => {
                session.stop(now);
                None
            }
            Step::Accept => {
                session.set_policy(now, Policy::Accept);
                None
            }
            Step::Move | Step::Brake | Step::Say(_) | Step::Lose | Step::Arrive { .. } => None,
            Step::Interrupt | Step::Return | Step::Restart => None,
        };
        // A frame that is given up now has no rest.
        let is_over = session.machine().gap_at.is_some_and(|at| at <= now);
        let held = if is_over { DecoderContents::Nothing } else { known.line };
        frame.map(|frame| held.rest_of(self.frame(frame))).unwrap_or_default()
    }

    fn is_written(&self, scene: &SceneOf<Self>, what: &Answer, sent: &[u8]) -> bool {
        let mut known = scene.known.clone();
        let answer = match (what, self.reply(&scene.end, &mut known, false, true)) {
            (Answer::Nothing, _) | (_, Input::Late) => return sent.is_empty(),
            (Answer::Start(code), _) => HostMessage::StartReply(*code),
            (Answer::Reply { exception, .. }, _) => {
                let (select, _) = known.reply.unwrap_or_default();
                let sent = values(known.arm.0);
                let values = core::array::from_fn(|axis| (select >> axis & 1 != 0).then(|| sent[axis]));
                HostMessage::Reply(Reply { exception: *exception, values })
            }
        };
        sent == bytes(&answer)
    }

    fn reports(&self, action: &Action, reports: &mut Vec<String>) {
        let ended = |outcome| PreviousReply { outcome, ..PreviousReply::default() };
        let (judged, other) = match *action {
            Action::Nothing | Action::Refuse(_) | Action::EndFrame => return,
            Action::SentStart(_) | Action::SentReply(_) => return,
            Action::Missed => (PreviousReply { missed: true, ..PreviousReply::default() }, None),
            Action::Stale => (PreviousReply::default(), Some("stale".into())),
            Action::Asked(judged) => (judged, None),
            Action::Stopped(judged) => (judged, Some("stopped".into())),
            Action::Exception(exception, outcome) => (ended(Some((exception, outcome))), None),
            Action::Ended(outcome) => (ended(outcome), None),
            Action::Lost { missed, outcome, reason } => {
                (PreviousReply { missed, ..ended(outcome) }, Some(format!("lost {reason:?}")))
            }
        };
        reports.extend(judged.missed.then(|| "missed".into()));
        reports.extend(judged.delayed.then(|| "delayed".into()));
        reports.extend(judged.rejected.map(|(error, _)| format!("rejected {error:?}")));
        reports.extend(judged.outcome.map(|(exception, outcome)| format!("{exception:?} {outcome:?}")));
        reports.extend(other);
    }

    fn reported(&self, event: &HostEvent) -> Option<String> {
        Some(match event {
            HostEvent::Missed => "missed".into(),
            HostEvent::Delayed => "delayed".into(),
            HostEvent::Rejected(error) => format!("rejected {error:?}"),
            HostEvent::Exception { exception, outcome } => format!("{exception:?} {outcome:?}"),
            HostEvent::TargetStale => "stale".into(),
            HostEvent::Stopped => "stopped".into(),
            HostEvent::Lost(reason) => format!("lost {reason:?}"),
            HostEvent::Start(_) | HostEvent::Motion(_) | HostEvent::End(_) | HostEvent::Corrupt(_) => {
                return None;
            }
            other => format!("{other:?}"),
        })
    }

    /// Returns the words that the end may receive if a connection ends within a word.
    fn lost(&self, _: &Knowledge, word: Step) -> Vec<Vec<Step>> {
        let gone = if matches!(word, Step::Read { .. }) { vec![Step::Lose] } else { Vec::new() };
        let with = |word| [gone.as_slice(), &[word]].concat();
        vec![with(Step::Noise), with(Step::Head), gone]
    }

    /// Returns false: a pause within a frame is a word.
    fn may_pause(&self, _: Step) -> bool {
        false
    }
}

impl AnyController {
    fn frame(&self, frame: Frame) -> Vec<u8> {
        let Mode(mode) = self.config.mode;
        match frame {
            Frame::Start { is_expected } => {
                bytes(&message(DueMessage::Start(ErrorCode::None), Mode(mode ^ u8::from(!is_expected))))
            }
            Frame::Motion(phase, error) => bytes(&message(DueMessage::Motion(phase, error), Mode(mode))),
            Frame::End => bytes(&message(DueMessage::End(ErrorCode::None), Mode(mode))),
            Frame::Corrupt => corrupt(&message(DueMessage::Motion(RUNNING, ErrorCode::None), Mode(mode))),
        }
    }
}

/// Returns the values of a target or a reply.
fn values(moves: bool) -> [i16; AXES] {
    let mut values = [0; AXES];
    values[0] = if moves { MOVES } else { 0 };
    values
}
