//! The line between a controller and a host of another maker: words as bytes, and the controller's messages.

use core::time::Duration;

use robot_session::end::{End as _, Machine as _};
use val2_alter::controller::machine::{Action, DueMessage, ExceptionHandling, ReplyEffect, StartOutcome};
use val2_alter::{AXES, Controller, ControllerEvent, ErrorCode, Exception, HostMessage, Reply};

use super::any_host::{AnyHost, Knowledge, Step};
use super::world::{DecoderContents, GRIP, MOVES, NOISE, bytes, corrupt, head, message};
use crate::faults::Faults;
use crate::model::{SceneOf, Wired};

impl Wired for AnyHost {
    type Session = Controller;

    // Damaged bytes, and those in pieces, are words.
    const FAULTS: Faults = Faults { split: 0.3, ..Faults::NONE };

    fn session(&self) -> Controller {
        Controller::new(self.config).expect("a configuration that works")
    }

    fn speak(&self, known: &Knowledge, word: Step, session: &mut Controller, now: Duration) -> Vec<u8> {
        let reply = |exception| HostMessage::Reply(Reply { exception, ..Reply::all([MOVES; AXES]) });
        let frame = match word {
            Step::Start(code) => bytes(&HostMessage::StartReply(code)),
            Step::Reply { exception: false } => bytes(&reply(Exception::None)),
            Step::Reply { exception: true } => bytes(&reply(GRIP)),
            Step::Corrupt => corrupt(&reply(Exception::None)),
            Step::Head => return head(),
            Step::Noise => return vec![NOISE],
            Step::Begin | Step::Finish | Step::Interrupt | Step::Return => {
                // A refused call has no effect.
                let _ = match word {
                    Step::Begin => session.start(now),
                    Step::Finish => session.finish(now),
                    Step::Interrupt => session.interrupt(now),
                    _ => session.resume(now),
                };
                return Vec::new();
            }
        };
        // Held bytes are given up now.
        let held = if session.machine().expires(now) { DecoderContents::Nothing } else { known.held };
        held.rest_of(frame)
    }

    fn is_written(&self, _: &SceneOf<Self>, what: &DueMessage, sent: &[u8]) -> bool {
        sent == bytes(&message(*what, self.config.mode))
    }

    fn reports(&self, action: &Action, reports: &mut Vec<String>) {
        let bad = |code| format!("bad reply {code:?}");
        match *action {
            Action::Nothing | Action::Refuse(_) | Action::Begin | Action::Rest => {}
            Action::Sent(DueMessage::End(error)) | Action::End(error) => {
                reports.push(format!("ended {error:?}"))
            }
            Action::Sent(DueMessage::Start(_) | DueMessage::Motion(..)) => {}
            Action::Take(taken, handling) => {
                reports.push(if taken == ReplyEffect::Moves { "moves" } else { "rests" }.into());
                reports.extend(handling.map(|handling| format!("{handling:?}")));
            }
            Action::Start(outcome) => reports.push(format!("{outcome:?}")),
            Action::BadStart(code, outcome) => {
                reports.push(bad(code));
                reports.extend(outcome.map(|outcome| format!("{outcome:?}")));
            }
            Action::BadReply(code) => reports.push(bad(code)),
            Action::Missing => reports.push(bad(ErrorCode::Timeout)),
            Action::Stray => reports.push("stray".into()),
        }
    }

    fn reported(&self, event: &ControllerEvent) -> Option<String> {
        Some(match event {
            ControllerEvent::Reply { values, .. } if *values == [MOVES; AXES] => "moves".into(),
            ControllerEvent::Reply { values: [0, 0, 0, 0, 0, 0], .. } => "rests".into(),
            ControllerEvent::BadReply(code) => format!("bad reply {code:?}"),
            ControllerEvent::Exception(code) => format!("{:?}", ExceptionHandling::Subroutine(*code)),
            ControllerEvent::Aborted(code) => format!("{:?}", ExceptionHandling::Abort(*code)),
            ControllerEvent::Stray(_) => "stray".into(),
            ControllerEvent::Started => format!("{:?}", StartOutcome::Started),
            ControllerEvent::Refused => format!("{:?}", StartOutcome::Refused),
            ControllerEvent::GaveUp => format!("{:?}", StartOutcome::GaveUp),
            ControllerEvent::Ended(error) => format!("ended {error:?}"),
            other => format!("{other:?}"),
        })
    }

    /// Returns the words that the end may receive if a connection ends within a word.
    fn lost(&self, _: &Knowledge, _: Step) -> Vec<Vec<Step>> {
        vec![vec![], vec![Step::Noise], vec![Step::Head]]
    }

    /// Returns false: a pause within a frame is a word.
    fn may_pause(&self, _: Step) -> bool {
        false
    }
}
