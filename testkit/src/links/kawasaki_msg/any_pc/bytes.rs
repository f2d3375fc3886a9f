//! The PC's messages as bytes.

use core::time::Duration;

use kawasaki_msg::RobotEvent;
use kawasaki_msg::robot::machine::{Action, DuePacket, RecoveryStep, Rejection};
use robot_session::Session as _;

use super::super::machines::packet;
use super::super::text;
use super::AnyPc;
use super::world::{Knowledge, Letter, SentMessage, Step};
use crate::controller::{Controller as _, Native};
use crate::faults::Faults;
use crate::model::{SceneOf, Wired};

impl Wired for AnyPc {
    type Session = Native;

    const FAULTS: Faults = Faults { split: 0.5, ..Faults::NONE };

    fn session(&self) -> Native {
        Native::begin(self.robot, self.capacity, 0)
    }

    fn speak(&self, known: &Knowledge, step: Step, session: &mut Native, now: Duration) -> Vec<u8> {
        match step {
            Step::Read(count) => {
                let packet = known.down.first().into_iter().flatten().take(count.into());
                return packet.flat_map(|sent| spell(*sent)).collect();
            }
            Step::Say(letter) => return spell(self.sent(letter, known.next)),
            Step::Half { after_filler } => return text::half(after_filler),
            Step::Rest => return text::rest(),
            Step::Execute => {
                let job = session.reader.take().expect("a job that waits").complete();
                assert_eq!(known.queue.first().map(|job| i32::from(*job)), Some(job.work.start.x));
            }
            Step::Report => {
                let number = self.number(session.executed() as u8);
                session.job_done(now, number).expect("a job that was queued");
            }
            Step::Check => session.handle_timeout(now),
            Step::ClearQueue => session.clear_queue().expect("an alarm"),
            Step::Connect => session.handle_connected(now),
            Step::Break => session.handle_disconnected(now),
            Step::Again | Step::Answer(_) => {}
        }
        Vec::new()
    }

    /// A robot whose replies the model does not count sends more than the model's.
    fn is_written(&self, scene: &SceneOf<Self>, due: &DuePacket, sent: &[u8]) -> bool {
        if self.is_free() {
            let request = due.request.map(text::from_robot).unwrap_or_default();
            return !sent.is_empty() && sent.ends_with(request.as_bytes());
        }
        let (messages, _) = packet(&scene.end, &self.robot);
        messages.into_iter().map(text::from_robot).collect::<String>().as_bytes() == sent
    }

    fn reports(&self, action: &Action, reports: &mut Vec<String>) {
        match action {
            Action::Refused
            | Action::Ending
            | Action::Interrupt
            | Action::Started
            | Action::Over
            | Action::Cleared
            | Action::Drained
            | Action::NoReply
            | Action::Step(_) => reports.push(format!("{action:?}")),
            Action::Rejected(Rejection::QueueFull) => reports.extend(["Rejected".into(), "QueueFull".into()]),
            Action::Rejected(_) => reports.push("Rejected".into()),
            Action::Nothing
            | Action::Connected
            | Action::Queue
            | Action::Clear
            | Action::Discarded
            | Action::Sent
            | Action::Answered
            | Action::QueuedBefore => {}
        }
    }

    fn reported(&self, event: &RobotEvent) -> Option<String> {
        let action = match event {
            RobotEvent::OrderRefused { .. } => Action::Refused,
            RobotEvent::OrderEnding { .. } => Action::Ending,
            RobotEvent::OrderInterrupted { .. } => Action::Interrupt,
            RobotEvent::OrderStarted { .. } => Action::Started,
            RobotEvent::OrderOver { .. } => Action::Over,
            RobotEvent::QueueCleared { .. } => Action::Cleared,
            RobotEvent::QueueDrained { .. } => Action::Drained,
            RobotEvent::NoReply => Action::NoReply,
            RobotEvent::Recovery { step, .. } => Action::Step(*step),
            RobotEvent::Alarm { .. } => Action::Step(RecoveryStep::Alarm),
            RobotEvent::Rejected(_) => return Some("Rejected".into()),
            RobotEvent::QueueFull { .. } => return Some("QueueFull".into()),
            RobotEvent::Unexpected(_) => return Some(format!("{event:?}")),
            _ => return None,
        };
        Some(format!("{action:?}"))
    }

    /// A part of a read is half a message, or the filler before one.
    fn lost(&self, _: &Knowledge, _: Step) -> Vec<Vec<Step>> {
        vec![Vec::new(), vec![Step::Half { after_filler: false }], vec![Step::Say(Letter::Filler)]]
    }

    fn may_pause(&self, _: Step) -> bool {
        false
    }

    /// A read ends once.
    fn may_join(&self, step: Step) -> bool {
        !matches!(step, Step::Half { .. })
    }

    /// A read between the filler and the half would end with the filler.
    fn may_split(&self, step: Step) -> bool {
        !self.robot.datagrams && step != (Step::Half { after_filler: true })
    }
}

fn spell(SentMessage { message, job }: SentMessage) -> Vec<u8> {
    message.map_or(text::CORRUPT.into(), |message| text::from_pc(message, job)).into()
}
