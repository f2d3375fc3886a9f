//! The line between a host and a controller of another maker: words as bytes, and the host's frames.

use core::time::Duration;

use laser_eb90::host::machine::{Action, Batch, DueFrame, HostLink, Outcome};
use laser_eb90::robot_session::{Encode as _, Session as _};
use laser_eb90::{Frame as Message, Host, HostEvent, Payload, Profile};

use super::CUT;
use super::any_controller::{Answer, AnyController, Knowledge, Step, word};
use crate::faults::Faults;
use crate::model::{SceneOf, Wired};

/// The values of an instruction, so that its frame takes [`LINE`] ticks.
const VALUES: [u8; 37] = [7; 37];

fn message(payload: impl FnOnce(&mut Payload<'_>)) -> Vec<u8> {
    let (mut buffer, mut out) = ([0; 64], [0; Message::MAX_LEN]);
    let mut written = Payload::new(&mut buffer, &Profile::default());
    payload(&mut written);
    let length = written.frame().expect("a frame").encode(&mut out).expect("it has a form");
    out[..length].to_vec()
}

impl Wired for AnyController {
    type Session = Host;

    const FAULTS: Faults = Faults::BAD_LINE;

    fn session(&self) -> Host {
        Host::new(self.config).expect("a configuration that works")
    }

    fn speak(&self, known: &Knowledge, said: Step, session: &mut Host, now: Duration) -> Vec<u8> {
        let answered = match said {
            Step::Submit(class) => {
                session.submit(word(class), |payload| payload.u8(&VALUES).map(drop)).expect("it has room");
                return Vec::new();
            }
            Step::Resume => {
                session.resume();
                return Vec::new();
            }
            Step::Transmitted => {
                session.handle_transmitted(now);
                return Vec::new();
            }
            Step::Read { corrupt: false } => {
                known.answers.first().map_or(Answer::Corrupt, |(answer, _)| *answer)
            }
            Step::Read { corrupt: true } => Answer::Corrupt,
            Step::Say(answer) => answer,
            Step::Lose | Step::Take(_) | Step::Finish(..) | Step::Refuse(..) | Step::Half(_) => {
                return Vec::new();
            }
        };
        let code = match answered {
            Answer::Echo(class) => word(class),
            Answer::Error(refusal) => self.config.words.errors().code(refusal),
            Answer::Corrupt => CUT,
        };
        let mut bytes = message(|payload| _ = payload.word(code));
        if answered == Answer::Corrupt {
            bytes[6] ^= 0x04;
        }
        bytes
    }

    /// Returns whether an answer may pause: the host does not accept an answer that began before its frame was sent.
    fn may_pause(&self, _: Step) -> bool {
        false
    }

    fn is_written(&self, scene: &SceneOf<Self>, due: &DueFrame, bytes: &[u8]) -> bool {
        let batch = match (due, scene.end.link) {
            (DueFrame::Next, _) => scene.end.next,
            (DueFrame::Again, HostLink::Resending { batch, .. }) => Some(batch),
            (DueFrame::Again, _) => None,
        };
        let frame =
            |batch: Batch| message(|payload| _ = payload.word(batch.word).and_then(|it| it.u8(&VALUES)));
        bytes.len() == self.config.longest_frame && batch.map(frame).is_some_and(|frame| frame == bytes)
    }

    fn reports(&self, action: &Action, reports: &mut Vec<String>) {
        match action {
            Action::Nothing | Action::Sent(_) => {}
            Action::Report(_, Outcome::Done { resends, unanswered }) => {
                reports.push(format!("done {resends} {unanswered}"))
            }
            Action::Report(_, Outcome::Refused(refusal)) => reports.push(format!("{refusal:?}")),
            Action::Report(_, Outcome::Unknown(reason)) => reports.push(format!("{reason:?}")),
            Action::Unasked { word } => reports.push(format!("unasked {word}")),
        }
    }

    fn reported(&self, event: &HostEvent) -> Option<String> {
        Some(match event {
            HostEvent::Done { resends, unanswered, .. } => format!("done {resends} {unanswered}"),
            HostEvent::Refused { refusal, .. } => format!("{refusal:?}"),
            HostEvent::Unknown { reason, .. } => format!("{reason:?}"),
            HostEvent::Unasked { word } => format!("unasked {word}"),
            HostEvent::Corrupt(_) => return None,
            other => format!("{other:?}"),
        })
    }

    fn lost(&self, _: &Knowledge, said: Step) -> Vec<Vec<Step>> {
        match said {
            Step::Read { .. } => vec![vec![Step::Read { corrupt: true }], vec![Step::Lose]],
            _ => vec![vec![Step::Say(Answer::Corrupt)], Vec::new()],
        }
    }

    fn given_up(&self) -> Option<Step> {
        Some(Step::Say(Answer::Corrupt))
    }
}
