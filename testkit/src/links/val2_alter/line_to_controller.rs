//! The line between a controller and a host of another maker: words as bytes, and the controller's messages.

use core::time::Duration;

use robot_session::end::{End as _, Machine as _};
use val2_alter::controller::machine::{Action, Handling, Outgoing, StartOutcome, Taken};
use val2_alter::{AXES, Controller, ControllerEvent, ErrorCode, Exception, HostMessage, Reply};

use super::any_host::{AnyHost, Known, Word};
use super::world::{GRIP, Held, MOVES, NOISE, bytes, corrupt, head, message};
use crate::faults::Faults;
use crate::model::{SceneOf, Wired};

impl Wired for AnyHost {
    type Session = Controller;

    // Damaged bytes, and those in pieces, are words.
    const FAULTS: Faults = Faults { split: 0.3, ..Faults::NONE };

    fn session(&self) -> Controller {
        Controller::new(self.config).expect("a configuration that works")
    }

    fn speak(&self, known: &Known, word: Word, session: &mut Controller, now: Duration) -> Vec<u8> {
        let reply = |exception| HostMessage::Reply(Reply { exception, ..Reply::all([MOVES; AXES]) });
        let frame = match word {
            Word::Start(code) => bytes(&HostMessage::StartReply(code)),
            Word::Reply { exception: false } => bytes(&reply(Exception::None)),
            Word::Reply { exception: true } => bytes(&reply(GRIP)),
            Word::Corrupt => corrupt(&reply(Exception::None)),
            Word::Head => return head(),
            Word::Noise => return vec![NOISE],
            Word::Begin | Word::Finish | Word::Interrupt | Word::Return => {
                // A refused call has no effect.
                let _ = match word {
                    Word::Begin => session.start(now),
                    Word::Finish => session.finish(now),
                    Word::Interrupt => session.interrupt(now),
                    _ => session.resume(now),
                };
                return Vec::new();
            }
        };
        // Held bytes are given up now.
        let held = if session.machine().expires(now) { Held::Nothing } else { known.held };
        held.rest_of(frame)
    }

    fn is_written(&self, _: &SceneOf<Self>, what: &Outgoing, sent: &[u8]) -> bool {
        sent == bytes(&message(*what, self.config.mode))
    }

    fn reports(&self, action: &Action, reports: &mut Vec<String>) {
        let bad = |code| format!("bad reply {code:?}");
        match *action {
            Action::Nothing | Action::Refuse(_) | Action::Begin | Action::Rest => {}
            Action::Sent(Outgoing::End(error)) | Action::End(error) => {
                reports.push(format!("ended {error:?}"))
            }
            Action::Sent(Outgoing::Start(_) | Outgoing::Motion(..)) => {}
            Action::Take(taken, handling) => {
                reports.push(if taken == Taken::Moves { "moves" } else { "rests" }.into());
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
            ControllerEvent::Exception(code) => format!("{:?}", Handling::Subroutine(*code)),
            ControllerEvent::Aborted(code) => format!("{:?}", Handling::Abort(*code)),
            ControllerEvent::Stray(_) => "stray".into(),
            ControllerEvent::Started => format!("{:?}", StartOutcome::Started),
            ControllerEvent::Refused => format!("{:?}", StartOutcome::Refused),
            ControllerEvent::GaveUp => format!("{:?}", StartOutcome::GaveUp),
            ControllerEvent::Ended(error) => format!("ended {error:?}"),
            other => format!("{other:?}"),
        })
    }

    /// Returns the words that the end may receive if a connection ends within a word.
    fn lost(&self, _: &Known, _: Word) -> Vec<Vec<Word>> {
        vec![vec![], vec![Word::Noise], vec![Word::Head]]
    }

    /// Returns false: a pause within a frame is a word.
    fn may_pause(&self, _: Word) -> bool {
        false
    }
}
