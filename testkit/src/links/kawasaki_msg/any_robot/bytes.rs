//! The robot's messages as bytes.

use core::time::Duration;

use kawasaki_msg::pc::machine::{Action, Answer, Outcome, Reaction, Rejection};
use kawasaki_msg::{
    Dialect, Entry, Field, FromPc, FromRobot, JobKind, JobSource, LargePc, Line, MessageError, PcEvent,
    Point, Role, Supply,
};
use robot_session::Session as _;

use super::super::text::{self, CORRUPT, FILLER};
use super::{AnyRobot, Knowledge, OURS, Step};
use crate::faults::Faults;
use crate::model::{SceneOf, Wired};

/// The jobs of an order, each a line that encodes its number.
#[derive(Debug, Clone, Copy)]
pub struct Drawing(u32);

impl JobSource for Drawing {
    type Work = Line;

    fn job(&mut self, index: u32) -> Supply<Line> {
        let start = Point::new(index as i32, 0);
        let line = Line { kind: JobKind::Draw, start, end: Point::new(0, 0) };
        if index < self.0 { Supply::Job(line) } else { Supply::End }
    }
}

impl Wired for AnyRobot {
    type Session = LargePc<Drawing>;

    const FAULTS: Faults = Faults { split: 0.5, ..Faults::NONE };

    fn session(&self) -> LargePc<Drawing> {
        LargePc::with_ranges(self.pc, Default::default()).expect("a configuration that works")
    }

    fn speak(&self, _: &Knowledge, step: Step, session: &mut LargePc<Drawing>, now: Duration) -> Vec<u8> {
        match step {
            Step::Start => session.start(OURS, Drawing(self.jobs)).expect("no order"),
            Step::Interrupt => session.interrupt().expect("an order"),
            Step::End => session.end().expect("an order"),
            Step::Command => session.command(COMMAND, VALUE).expect("a command of the table"),
            Step::Close => session.handle_disconnected(now),
            Step::Connect => session.handle_connected(now),
            Step::Say(report) => return text::from_robot(report).into(),
            Step::Corrupt => return CORRUPT.into(),
            Step::Half { after_filler } => return text::half(after_filler),
            Step::Rest => return text::rest(),
        }
        Vec::new()
    }

    /// The model does not count whether the status is in the answer.
    fn is_written(&self, _: &SceneOf<Self>, answer: &Answer, sent: &[u8]) -> bool {
        let (answer, contents) = self.written(answer);
        let commands =
            (0..contents.commands).map(|_| format!("<Nopeus${}#{VALUE}#>", VALUE.to_string().len()));
        let from = answer.jobs.map_or(0, |(from, _)| from);
        let jobs = (from..from + contents.jobs).map(|index| {
            let number = self.number(index);
            text::from_pc(FromPc::Job { order: answer.order, number, good: true }, index as u8)
        });
        let request = answer.request.map(|request| text::from_pc(request, 0));
        let expected: String = request.into_iter().chain(commands).chain(jobs).collect();
        let sent = String::from_utf8_lossy(sent);
        let has_status = sent.starts_with("<Tila$");
        let rest = if has_status { sent.split_once("#>").map_or("", |(_, rest)| rest) } else { &sent };
        rest == if expected.is_empty() && !has_status { FILLER } else { &expected }
    }

    fn reports(&self, Reaction { commands: (count, fate), action }: &Reaction, reports: &mut Vec<String>) {
        reports.extend((0..*count).map(|_| format!("{fate:?}")));
        match action {
            Action::Rejected(why) => reports.push(format!("{why:?}")),
            Action::Started | Action::Refused { .. } | Action::Paused | Action::ExecutedAhead { .. } => {
                reports.push(format!("{action:?}"));
            }
            Action::Outcome { outcome, .. } => reports.push(format!("{outcome:?}")),
            Action::Nothing | Action::Sent => {}
        }
    }

    fn reported(&self, event: &PcEvent) -> Option<String> {
        Some(match *event {
            PcEvent::OrderStarted { .. } => format!("{:?}", Action::Started),
            PcEvent::OrderRefused { active, given_up: false, .. } => {
                format!("{:?}", Action::Refused { active })
            }
            PcEvent::OrderRefused { active, .. } => format!("{:?}", Outcome::GivenUp { active }),
            PcEvent::Paused { .. } => format!("{:?}", Action::Paused),
            PcEvent::ExecutedAhead { index } => format!("{:?}", Action::ExecutedAhead { index }),
            PcEvent::OrderOver { executed, complete, .. } => {
                format!("{:?}", Outcome::Over { executed, complete })
            }
            PcEvent::OutcomeUnknown { executed, sent, .. } => {
                format!("{:?}", Outcome::Unknown { executed, sent })
            }
            PcEvent::Command { outcome, .. } => format!("{outcome:?}"),
            PcEvent::Rejected(MessageError::WrongOrder { .. }) => format!("{:?}", Rejection::WrongOrder),
            PcEvent::Rejected(MessageError::OutOfOrder { .. }) => format!("{:?}", Rejection::OutOfOrder),
            PcEvent::Unexpected(_) | PcEvent::JobUnfit { .. } => format!("{event:?}"),
            _ => return None,
        })
    }

    /// A part of a read is half a message, or the filler before one.
    fn lost(&self, _: &Knowledge, _: Step) -> Vec<Vec<Step>> {
        vec![Vec::new(), vec![Step::Half { after_filler: false }], vec![Step::Say(FromRobot::Filler)]]
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
        !self.pc.datagrams && step != (Step::Half { after_filler: true })
    }
}

const COMMAND: u8 = 1;
const VALUE: i32 = 7;

/// Returns the source's table and a command.
pub(in super::super) fn with_command() -> Dialect {
    let mut table = Dialect::DEFAULT.entries().to_vec();
    table.push(Entry { role: Role::Command(COMMAND), name: "Nopeus", header: &[], fields: &[Field::Value] });
    Dialect::new(table.leak()).expect("a table that works")
}
