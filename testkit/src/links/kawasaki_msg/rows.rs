//! The rows of the PC's table.

use core::time::Duration;

use kawasaki_msg::pc::{Config, Input, Machine, Order, Sent};
use kawasaki_msg::{FromRobot, PcConfig, Phase, Status};
use robot_session::Machine as _;

use crate::model::{NOW, Rows};

/// The order of the table.
const OURS: u16 = 50;

/// The PC, which can tell so many job numbers apart, by 64.
#[derive(Debug)]
pub struct Pc<const WORDS: usize = 1>;

const fn status(order: u16, phase: Phase, queued: Option<u16>, executed: Option<u16>) -> FromRobot {
    FromRobot::Status(Status { order, phase, queued, executed, ended: 0 })
}

const IDLE: FromRobot = status(0, Phase::Idle, None, None);

impl<const WORDS: usize> Rows for Pc<WORDS> {
    type Machine = Machine<WORDS>;

    fn states() -> Vec<Machine<WORDS>> {
        let config = Self::config();
        let after = |machine: &Machine<WORDS>, inputs: &[Input]| {
            let mut machine = machine.clone();
            for input in inputs {
                machine.on(NOW, *input, &config).expect("a state that can be reached");
            }
            machine
        };
        // What comes is answered.
        let hear = |machine: &Machine<WORDS>, message, sent| {
            let mut machine = after(
                machine,
                &[
                    Input::Received,
                    Input::Message(message),
                    Input::ReadEnd { whole: true },
                    Input::Sent(sent),
                ],
            );
            while machine.report().is_some() {
                machine = after(&machine, &[Input::Reported]);
            }
            machine
        };
        let nothing = Sent::default();
        let listening = Machine::new();
        let idle = after(&listening, &[Input::Connected]);
        let starting = after(&idle, &[Input::Start { order: OURS }]);
        let start_sent = hear(&starting, IDLE, Sent { request: true, ..nothing });
        let start_lost = after(&start_sent, &[Input::Disconnected]);
        let other = after(&start_sent, &[Input::Message(FromRobot::OrderAck { active: OURS + 1 })]);
        let cancelled = after(&start_sent, &[Input::Interrupt]);
        let taken = hear(&start_sent, FromRobot::OrderAck { active: OURS }, nothing);
        let active = hear(&taken, FromRobot::Request { order: OURS, number: 1 }, Sent { jobs: 4, ..nothing });
        let ending = after(&active, &[Input::End]);
        let interrupted = after(&active, &[Input::Interrupt]);
        let mut executed = active.clone();
        executed.count.executed = executed.count.sent;
        executed.count.queued = executed.count.sent;
        let quiet = [
            listening,
            idle,
            starting,
            start_sent,
            start_lost,
            other,
            cancelled,
            active,
            executed,
            ending,
            interrupted,
        ];
        let mut states = Vec::new();
        for state in quiet {
            states.push(state.clone());
            if !state.is_connected() {
                continue;
            }
            let heard = [Input::Received, Input::ReadEnd { whole: true }];
            states.push(after(&state, &heard));
            let mut overdue = state.clone();
            overdue.each_time(|at| *at = NOW - Duration::from_millis(1));
            states.push(overdue);
            let mut news = state;
            news.count.is_news = true;
            states.push(news);
        }
        states
    }

    fn inputs() -> Vec<Input> {
        let messages = [
            FromRobot::JobAck { order: OURS, number: 2 },
            FromRobot::OrderAck { active: OURS },
            FromRobot::OrderAck { active: 0 },
            FromRobot::OrderAck { active: OURS + 1 },
            FromRobot::EndAck { ended: OURS, active: 0, executed: Some(4) },
            IDLE,
            status(OURS, Phase::Active, Some(3), Some(1)),
            status(OURS + 1, Phase::Active, None, None),
            FromRobot::Pause { order: OURS, queued: Some(3) },
            FromRobot::Request { order: OURS, number: 1 },
            FromRobot::Filler,
            FromRobot::WrongSide,
            FromRobot::Unusable,
        ];
        let mut inputs = vec![Input::Connected, Input::Disconnected, Input::Timeout, Input::Received];
        inputs.extend(messages.map(Input::Message));
        inputs.extend([
            Input::Corrupt,
            Input::ReadEnd { whole: true },
            Input::ReadEnd { whole: false },
            Input::Start { order: OURS },
            Input::Resume { order: OURS, executed: 2, sent: 4 },
            Input::Ahead { index: 3 },
            Input::End,
            Input::Interrupt,
            Input::Command,
            Input::Exhausted,
            Input::Sent(Sent { request: true, ..Sent::default() }),
            Input::Reported,
        ]);
        inputs
    }

    fn config() -> Config {
        PcConfig { max_number: 63, reply_delay: Duration::ZERO, ..PcConfig::TCP }.machine()
    }

    fn column_at(machine: &Machine<WORDS>, now: Duration, input: &Input) -> String {
        let ours = machine.order.number();
        let is_ours = |order: u16| order != 0 && (machine.order == Order::Idle || order == ours);
        let name = match *input {
            Input::ReadEnd { whole: false } => "ReadEnd(partial)",
            Input::Message(FromRobot::OrderAck { active: 0 }) => "Message(OrderAck of none)",
            Input::Message(FromRobot::OrderAck { active }) if !is_ours(active) => {
                "Message(OrderAck of another)"
            }
            Input::Message(FromRobot::EndAck { ended, .. }) if !is_ours(ended) => "",
            Input::Message(FromRobot::Status(Status { order: 0, .. })) => "Message(Status of none)",
            Input::Message(FromRobot::Status(Status { order, .. })) if !is_ours(order) => {
                "Message(Status of another)"
            }
            Input::Message(FromRobot::Status(Status { queued: None, .. })) => "",
            // Nothing is sent before it is due, and nothing reported that did not happen.
            Input::Sent(_) if machine.transmit(now, &Self::config()).is_none() => "",
            Input::Exhausted => match machine.transmit(now, &Self::config()) {
                Some(answer) if answer.last.is_some() => "Exhausted",
                _ => "",
            },
            Input::Ahead { .. } if machine.name() != "Active" => "",
            Input::Reported if machine.report().is_none() => "",
            _ => robot_session::Input::name(input),
        };
        name.into()
    }
}
