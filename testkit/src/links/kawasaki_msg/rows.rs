//! The rows of both machines' tables.

use core::time::Duration;

use kawasaki_msg::pc::machine::{Input, Machine, Order, SentAnswer, UnsentJobs};
use kawasaki_msg::robot::machine as robot;
use kawasaki_msg::{FromPc, FromRobot, Numbering, PcConfig, Phase, RobotConfig, Status};
use robot_session::end::Machine as _;

use crate::model::{NOW, Rows};

/// The order of the table.
const OURS: u16 = 50;

/// The PC.
#[derive(Debug)]
pub struct Pc;

const fn status(order: u16, phase: Phase, queued: Option<u16>, executed: Option<u16>) -> FromRobot {
    FromRobot::Status(Status { order, phase, queued, executed, ended: 0 })
}

const IDLE: FromRobot = status(0, Phase::Idle, None, None);

impl Rows for Pc {
    type Machine = Machine;

    fn states() -> Vec<Machine> {
        let config = Self::config();
        let after = |machine: &Machine, inputs: &[Input]| {
            let mut machine = machine.clone();
            for input in inputs {
                machine.on(NOW, *input, &config).expect("a state that can be reached");
            }
            machine
        };
        // Each message is answered.
        let hear = |machine: &Machine, message, sent| {
            let mut machine =
                after(machine, &[Input::Message(message), Input::ReadEnd { whole: true }, Input::Sent(sent)]);
            while machine.report().is_some() {
                machine = after(&machine, &[Input::Reported]);
            }
            machine
        };
        let nothing = SentAnswer::default();
        let listening = Machine::default();
        let idle = after(&listening, &[Input::Connected]);
        let starting = after(&idle, &[Input::Start { order: OURS }]);
        let start_sent = hear(&starting, IDLE, SentAnswer { request: true, ..nothing });
        let start_lost = after(&start_sent, &[Input::Disconnected]);
        let other = after(&start_sent, &[Input::Message(FromRobot::OrderAck { active: OURS + 1 })]);
        let cancelled = after(&start_sent, &[Input::Interrupt]);
        let taken = hear(&start_sent, FromRobot::OrderAck { active: OURS }, nothing);
        let active =
            hear(&taken, FromRobot::Request { order: OURS, number: 1 }, SentAnswer { jobs: 4, ..nothing });
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
            let heard = [Input::Message(FromRobot::Filler), Input::ReadEnd { whole: true }];
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
        let mut inputs = vec![Input::Connected, Input::Disconnected, Input::Timeout];
        inputs.extend(messages.map(Input::Message));
        inputs.extend([
            Input::Corrupt,
            Input::ReadEnd { whole: true },
            Input::ReadEnd { whole: false },
            Input::Start { order: OURS },
            Input::Resume { order: OURS, executed: 2, sent: 4, total: None },
            Input::Ahead { index: 3 },
            Input::End,
            Input::Interrupt,
            Input::Command,
            Input::Sent(SentAnswer { request: true, ..SentAnswer::default() }),
            Input::Sent(SentAnswer { request: true, rest: UnsentJobs::End, ..SentAnswer::default() }),
            Input::Reported,
        ]);
        inputs
    }

    fn config() -> PcConfig {
        PcConfig { max_number: 63, reply_delay: Duration::ZERO, ..PcConfig::tcp() }
    }

    fn column_at(machine: &Machine, now: Duration, input: &Input) -> String {
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
            Input::Sent(sent) => match machine.transmit(now, &Self::config()) {
                Some(_) if sent.rest != UnsentJobs::End => "Sent",
                Some(answer) if answer.last.is_some() => "Sent(end)",
                _ => "",
            },
            Input::Ahead { .. } if machine.name() != "Active" => "",
            Input::Reported if machine.report().is_none() => "",
            _ => robot_session::end::Input::name(input),
        };
        name.into()
    }
}

/// The robot.
#[derive(Debug)]
pub struct Robot;

impl Rows for Robot {
    type Machine = robot::Machine;

    fn states() -> Vec<robot::Machine> {
        use robot::Input as On;
        let config = Self::config();
        let after = |machine: &robot::Machine, inputs: &[On]| {
            let mut machine = machine.clone();
            for input in inputs {
                machine.on(NOW, *input, &config).expect("a state that can be reached");
            }
            machine
        };
        let message = |message| On::Message { message, room: true };
        let job = |number| message(FromPc::Job { order: OURS, number, good: true });
        let disconnected = robot::Machine::new(&config);
        let connecting = after(&disconnected, &[On::Timeout]);
        let opening = after(&connecting, &[On::Reported]);
        let idle = after(&opening, &[On::Connected]);
        let started = after(&idle, &[message(FromPc::Start { order: OURS, first: 1 })]);
        let active = after(&started, &[job(1), job(2), On::Executed { number: 1 }]);
        let missing = after(&active, &[On::Corrupt]);
        let clearing = after(&active, &[On::ClearQueue]);
        let cleared = after(&clearing, &[On::Settled]);
        let ending = after(&active, &[message(FromPc::End { order: OURS })]);
        let interrupted = after(&active, &[On::ResetOrder]);
        let broken_off = after(&interrupted, &[On::Settled]);
        let mut alarm = after(&active, &[On::Executed { number: 2 }]);
        if let robot::Order::Active { stage, .. } = &mut alarm.order {
            *stage = robot::Stage::Alarm;
        }
        let mut full = active.clone();
        if let robot::Order::Active { stage: robot::Stage::Intake { flow, .. }, .. } = &mut full.order {
            *flow = robot::Flow::Full;
        }
        let states = [
            disconnected,
            connecting,
            opening,
            idle,
            active,
            full,
            missing,
            clearing,
            cleared,
            ending,
            interrupted,
            broken_off,
            alarm,
        ];
        let sent = |state: &robot::Machine| after(state, &[On::Sent(robot::SentPacket::default())]);
        let mut rows = Vec::new();
        for state in states {
            rows.push(state.clone());
            let mut overdue = if state.is_connected() { sent(&state) } else { state.clone() };
            rows.push(overdue.clone());
            overdue.each_time(|at| *at = (*at).min(NOW - Duration::from_millis(1)));
            rows.push(overdue);
            let mut silent = state;
            if let robot::Link::Connected { close, .. } = &mut silent.link {
                *close = true;
                rows.push(silent);
            }
        }
        rows
    }

    fn inputs() -> Vec<robot::Input> {
        use robot::Input as On;
        let job =
            |number, room| On::Message { message: FromPc::Job { order: OURS, number, good: true }, room };
        let messages = [
            FromPc::Status { order: OURS + 1 },
            FromPc::Start { order: OURS, first: 1 },
            FromPc::Start { order: OURS + 1, first: 1 },
            FromPc::End { order: OURS },
            FromPc::Interrupt { order: OURS },
            FromPc::Filler,
            FromPc::WrongSide,
            FromPc::Unusable,
        ];
        let mut inputs = vec![On::Connected, On::Disconnected, On::Timeout];
        inputs.extend(messages.map(|message| On::Message { message, room: true }));
        inputs.extend([
            job(3, true),
            job(3, false),
            job(5, true),
            On::Corrupt,
            On::ReadEnd { whole: true },
            On::ReadEnd { whole: false },
            On::Executed { number: 2 },
            On::Settled,
            On::Drained,
            On::ClearQueue,
            On::ResetOrder,
            On::Sent(robot::SentPacket::default()),
            On::Reported,
        ]);
        inputs
    }

    fn config() -> RobotConfig {
        RobotConfig { max_number: 63, ..RobotConfig::tcp() }
    }

    fn column_at(machine: &robot::Machine, now: Duration, input: &robot::Input) -> String {
        use robot::Input as On;
        let active = machine.order.number();
        let is_ours = |order: u16| if active == 0 { order != OURS + 1 } else { order == active };
        let next = Numbering::new(Self::config().max_number).next(machine.queued);
        let name = match *input {
            On::Message { message, room } => match message {
                FromPc::Start { order, .. } if !is_ours(order) => "Message(Start of another)",
                FromPc::End { order } | FromPc::Interrupt { order } | FromPc::Job { order, .. }
                    if !is_ours(order) =>
                {
                    ""
                }
                FromPc::Job { good: false, .. } => "",
                FromPc::Job { number, .. } if number != next => "Message(Job of another number)",
                FromPc::Job { .. } if !room => "Message(Job, no room)",
                _ => robot_session::end::Input::name(input),
            },
            On::ReadEnd { whole: false } => "ReadEnd(partial)",
            // Nothing is sent before it is due, and nothing reported that did not happen.
            On::Sent(_) if machine.transmit(now, &Self::config()).is_none() => "",
            On::Reported if machine.report().is_none() => "",
            _ => robot_session::end::Input::name(input),
        };
        name.into()
    }
}
