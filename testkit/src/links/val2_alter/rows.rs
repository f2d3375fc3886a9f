//! The rows of both machines' tables.

use core::time::Duration;

use robot_session::end::{Machine, is_due};
use val2_alter::controller::machine::{
    self as controller, ControllerMachine, ControllerPhase, Progress, Turn,
};
use val2_alter::host::machine::{self as host, HostMachine, HostPhase, PendingException, Stage, Target};
use val2_alter::timing::CYCLE;
use val2_alter::{ControllerConfig, ErrorCode, Exception, HostConfig, MotionPhase, Policy, StartCode};

use crate::model::{NOW, Rows};

const MS: Duration = Duration::from_millis(1);
const PAST: Duration = NOW.saturating_sub(MS);
const REPLY_LEN: u8 = 36;

fn after<M: Machine<Input: Copy> + Clone>(machine: &M, inputs: &[M::Input], config: &M::Config) -> M {
    let mut machine = machine.clone();
    for input in inputs {
        machine.on(NOW, *input, config).expect("a state that can be reached");
    }
    machine
}

/// The host.
#[derive(Debug)]
pub enum Host {}

impl Rows for Host {
    type Machine = HostMachine;

    fn states() -> Vec<HostMachine> {
        use host::Input as On;
        let config = Self::config();
        let after = |machine: &HostMachine, inputs: &[On]| after(machine, inputs, &config);
        let motion = |phase, error| On::Motion { phase, error, len: 36 };
        let runs = motion(MotionPhase::Running, ErrorCode::None);
        let rejects = motion(MotionPhase::Running, ErrorCode::Checksum);
        let exception = On::Exception { exception: Exception::CloseGripper, has_room: true };
        let sent = On::Sent { moving: 0, at_rest: true };
        let disconnected = HostMachine::new(Policy::Accept, true);
        let idle = after(&disconnected, &[On::Connected]);
        let asking = after(&idle, &[On::CorruptFrame]);
        let repeating = after(&asking, &[sent]);
        let starting = after(&idle, &[On::Start { is_expected: true }]);
        let accepted = after(&starting, &[sent]);
        let asked = after(&accepted, &[runs]);
        let running = after(&asked, &[On::Target, sent]);
        let with_target = after(&running, &[runs]);
        let to_send = after(&running, &[exception]);
        let asked_to_send = after(&to_send, &[runs]);
        let exception_sent = after(&asked_to_send, &[sent]);
        let unread = after(&exception_sent, &[rejects, sent]);
        let interrupted = after(&exception_sent, &[motion(MotionPhase::Interrupted, ErrorCode::None)]);
        let stopping = after(&running, &[On::Stop]);
        let asked_to_stop = after(&stopping, &[runs]);
        let zeros = after(&asked_to_stop, &[sent]);
        let silent = after(&zeros, &[runs]);
        let states = [
            disconnected,
            idle,
            asking,
            repeating,
            starting,
            accepted,
            asked,
            with_target,
            running,
            to_send,
            asked_to_send,
            exception_sent,
            unread,
            interrupted,
            stopping,
            asked_to_stop,
            zeros,
            silent,
        ];
        // The last message came a cycle ago.
        let later = |mut state: HostMachine| {
            if let HostPhase::Active(active) = &mut state.phase {
                active.lost_at -= CYCLE;
            }
            state
        };
        let each = |state: HostMachine| [vec![state.clone()], overdue(&state)].concat();
        states.into_iter().map(later).flat_map(each).collect()
    }

    fn inputs() -> Vec<host::Input> {
        use host::Input as On;
        let exception = |has_room| On::Exception { exception: Exception::CloseGripper, has_room };
        let motion = |phase, error| On::Motion { phase, error, len: 36 };
        vec![
            On::Connected,
            On::Disconnected,
            On::Timeout,
            On::Bytes { partial: false },
            On::Bytes { partial: true },
            On::Start { is_expected: true },
            On::Start { is_expected: false },
            motion(MotionPhase::Running, ErrorCode::None),
            motion(MotionPhase::Running, ErrorCode::Checksum),
            motion(MotionPhase::Interrupted, ErrorCode::None),
            On::End,
            On::CorruptFrame,
            On::Noise,
            On::Sent { moving: 0, at_rest: true },
            On::Late,
            On::Ignored,
            On::Target,
            On::NoTarget,
            exception(true),
            exception(false),
            On::Stop,
            On::Policy(Policy::Refuse),
            On::Subroutine(false),
        ]
    }

    fn config() -> HostConfig {
        HostConfig { subroutine: true, ..HostConfig::default() }
    }

    fn row(machine: &HostMachine, _now: Duration) -> String {
        match &machine.phase {
            HostPhase::Repeating { answer: Some(_), .. } => "repeating, an answer is due",
            HostPhase::Active(active) => match (active.stage, active.request, active.exception) {
                (Stage::Running, _, PendingException::Unsent(_)) => "running, an exception to be sent",
                (Stage::Running, _, PendingException::Sent(_)) => "running, an exception sent",
                (Stage::Running, _, PendingException::Unread { .. }) => "running, an exception not read",
                (Stage::Running, Some(_), PendingException::None) => "running, a reply is due",
                (Stage::Running, None, PendingException::None) => "running",
                (Stage::Interrupted, ..) => "interrupted, a reply is due",
                (Stage::Stopping { zeros_sent: true }, ..) => "stopping, zeros sent",
                (Stage::Stopping { .. }, ..) => "stopping",
                (Stage::Accepted, ..) => "accepted",
            },
            _ => machine.name(),
        }
        .into()
    }

    fn column_at(machine: &HostMachine, now: Duration, input: &host::Input) -> String {
        use host::Input as On;
        let more = match *input {
            On::Timeout if machine.gap_at.is_some_and(|at| is_due(at, now)) => " of a frame",
            On::Timeout if machine.reply_by().is_some_and(|at| is_due(at, now)) => " of an answer",
            On::Timeout => match &machine.phase {
                HostPhase::Active(active) if matches!(active.target, Target::Fresh { until } if is_due(until, now)) => {
                    " of the target"
                }
                HostPhase::Repeating { .. } => " of the repetitions",
                _ => " of the controller",
            },
            On::Bytes { partial: true } => "(partial)",
            On::Motion { phase: MotionPhase::Running, error, .. } if error != ErrorCode::None => "(error)",
            On::Exception { has_room: false, .. } if Self::row(machine, now).starts_with("running") => {
                "(no room)"
            }
            // The room decides nothing.
            On::Exception { has_room: false, .. } => return String::new(),
            _ => "",
        };
        format!("{}{more}", robot_session::end::Input::name(input))
    }
}

/// Returns the same state with each of its times in turn in the past.
fn overdue(state: &HostMachine) -> Vec<HostMachine> {
    let mut states = Vec::new();
    if !matches!(state.phase, HostPhase::Disconnected) {
        states.push(HostMachine { gap_at: Some(PAST), ..state.clone() });
    }
    let mut push = |change: fn(&mut HostPhase) -> bool| {
        let mut state = state.clone();
        if change(&mut state.phase) {
            states.push(state);
        }
    };
    push(|phase| match phase {
        HostPhase::Repeating { answer: Some(due), .. } | HostPhase::Starting { answer: due, .. } => {
            due.begin_by = PAST;
            true
        }
        HostPhase::Active(active) => active.request.as_mut().map(|it| it.due.begin_by = PAST).is_some(),
        _ => false,
    });
    push(|phase| match phase {
        HostPhase::Active(active) if matches!(active.target, Target::Fresh { .. }) => {
            active.target = Target::Fresh { until: PAST };
            true
        }
        _ => false,
    });
    push(|phase| match phase {
        HostPhase::Repeating { answer: None, forget_at: at, .. } | HostPhase::Silent { lost_at: at } => {
            *at = PAST;
            true
        }
        HostPhase::Active(active) => {
            // The rest has come before.
            (active.lost_at, active.request) = (PAST, None);
            if matches!(active.target, Target::Fresh { .. }) {
                active.target = Target::Stale;
            }
            true
        }
        _ => false,
    });
    states
}

/// The controller.
#[derive(Debug)]
pub enum Controller {}

impl Rows for Controller {
    type Machine = ControllerMachine;

    fn states() -> Vec<ControllerMachine> {
        use controller::Input as On;
        let config = Self::config();
        let after = |machine: &ControllerMachine, inputs: &[On]| after(machine, inputs, &config);
        // Half a cycle later: a message has left, or the next one is due.
        let later = |machine: &ControllerMachine| {
            let mut machine = machine.clone();
            machine.each_time(|at| *at -= CYCLE / 2);
            machine
        };
        let send = On::Sent { len: REPLY_LEN };
        let exception = On::Reply { exception: Exception::CloseGripper, has_room: true };
        let disconnected = ControllerMachine::NEW;
        let off = after(&disconnected, &[On::Connected]);
        let starting = after(&off, &[On::Start { has_room: true }]);
        let asking = later(&after(&starting, &[On::Sent { len: 8 }]));
        let running = after(&asking, &[On::StartReply(StartCode::Accept)]);
        let being_sent = after(&later(&running), &[send]);
        let sent = later(&being_sent);
        let interrupted = after(&sent, &[exception]);
        let reported = later(&after(&later(&interrupted), &[send]));
        let returned = after(&reported, &[On::Return]);
        let ending = after(&running, &[On::Finish]);
        let states = [
            disconnected,
            off,
            starting,
            asking,
            running,
            being_sent,
            sent,
            interrupted,
            reported,
            returned,
            ending,
        ];
        let each = |state: ControllerMachine| {
            let mut states = vec![state.clone()];
            if let ControllerPhase::On(mut alter) = state.phase {
                states.push(ControllerMachine { gap_at: Some(PAST), ..state });
                if let Turn::Host { opens, closes, .. } = &mut alter.turn
                    && *opens < NOW
                {
                    *closes = PAST;
                    alter.slot = NOW;
                    states.push(ControllerMachine { phase: ControllerPhase::On(alter), gap_at: None });
                }
            }
            states
        };
        states.into_iter().flat_map(each).collect()
    }

    fn inputs() -> Vec<controller::Input> {
        use controller::Input as On;
        let reply = |exception, has_room| On::Reply { exception, has_room };
        vec![
            On::Connected,
            On::Disconnected,
            On::Timeout,
            On::Bytes { partial: false },
            On::Bytes { partial: true },
            On::StartReply(StartCode::Accept),
            On::StartReply(StartCode::Repeat),
            On::StartReply(StartCode::Refuse),
            reply(Exception::None, true),
            reply(Exception::CloseGripper, true),
            reply(Exception::CloseGripper, false),
            On::Corrupt(ErrorCode::Checksum),
            On::Sent { len: REPLY_LEN },
            On::Start { has_room: true },
            On::Start { has_room: false },
            On::Finish,
            On::Interrupt,
            On::Return,
        ]
    }

    fn config() -> ControllerConfig {
        ControllerConfig { subroutine: true, ..ControllerConfig::default() }
    }

    fn row(machine: &ControllerMachine, now: Duration) -> String {
        let ControllerPhase::On(alter) = machine.phase else { return machine.name().into() };
        let sent = match alter.turn {
            Turn::Controller => "",
            Turn::Host { opens, .. } if now < opens => ", being sent",
            Turn::Host { .. } => ", sent",
        };
        let is_returned = matches!(alter.progress, Progress::Interrupted { returned: true, .. });
        format!("{}{}{sent}", machine.name(), if is_returned { ", returned" } else { "" })
    }

    fn column_at(machine: &ControllerMachine, now: Duration, input: &controller::Input) -> String {
        use controller::Input as On;
        let more = match *input {
            On::Timeout => match machine.phase {
                ControllerPhase::On(alter) if matches!(alter.turn, Turn::Host { closes, .. } if is_due(closes, now)) => {
                    " of the window"
                }
                _ => " of a frame",
            },
            On::Bytes { partial: true } => "(partial)",
            On::Reply { has_room: false, .. } => match Self::row(machine, now).as_str() {
                "running, sent" | "interrupted, sent" | "interrupted, returned, sent" => {
                    return "Reply(exception, no room)".into();
                }
                // The room decides nothing.
                _ => return String::new(),
            },
            On::Start { has_room: false } if machine.phase == ControllerPhase::Off => "(no room)",
            On::Start { has_room: false } => return String::new(),
            _ => "",
        };
        format!("{}{more}", robot_session::end::Input::name(input))
    }
}
