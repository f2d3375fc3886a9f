//! What each machine does in each state with each input, as committed in `state_matrix.txt`.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

use core::fmt::{Debug, Write as _};
use core::time::Duration;

use val2_alter::machine::{
    ControllerActions, ControllerInput, ControllerMachine, Draft, HostActions, HostInput, HostMachine,
};
use val2_alter::{
    ControllerConfig, ErrorCode, Exception, HostConfig, MotionPhase, Policy, StartCode, timing::CYCLE,
};

const MS: Duration = Duration::from_millis(1);
/// Late enough for every deadline of the states here.
const LATE: Duration = Duration::from_secs(100);
const DRAFT: Draft = Draft { bare: 8, words: [2; 6], moving: 0, at_rest: true, has_room: true };
const GRIP: HostInput = HostInput::Exception { exception: Exception::CloseGripper, has_room: true };

const fn motion(phase: MotionPhase, error: ErrorCode) -> HostInput {
    HostInput::Motion { phase, error, len: 36 }
}

fn host() -> String {
    use HostInput as On;
    let config = HostConfig { subroutine: true, ..HostConfig::default() };
    let after = |machine: &HostMachine, inputs: &[HostInput]| {
        let mut machine = machine.clone();
        for input in inputs {
            machine.on(Duration::ZERO, *input, &config).unwrap();
        }
        machine
    };
    let runs = motion(MotionPhase::Running, ErrorCode::None);
    let rejects = motion(MotionPhase::Running, ErrorCode::Checksum);
    let interrupted = motion(MotionPhase::Interrupted, ErrorCode::None);
    let start = On::Start { is_expected: true, len: 8 };
    let disconnected = HostMachine::new(Policy::Accept, true);
    let idle = after(&disconnected, &[On::Connected]);
    let asking = after(&idle, &[On::CorruptFrame]);
    let starting = after(&idle, &[start]);
    let accepted = after(&starting, &[On::Transmit(DRAFT)]);
    let asked = after(&accepted, &[runs]);
    let running = after(&asked, &[On::Target, On::Transmit(DRAFT)]);
    let unsent = after(&running, &[GRIP]);
    let sent = after(&unsent, &[runs, On::Transmit(DRAFT)]);
    let unread = after(&sent, &[rejects, On::Transmit(DRAFT)]);
    let paused = after(&sent, &[interrupted]);
    let stopping = after(&running, &[On::Stop]);
    let zeros = after(&stopping, &[runs, On::Transmit(DRAFT)]);
    let silent = after(&zeros, &[runs]);
    let asked_before = after(&asking, &[On::Transmit(DRAFT)]);
    let states = [
        ("disconnected", disconnected),
        ("idle", idle),
        ("repeating, an answer is due", asking),
        ("repeating", asked_before),
        ("starting", starting),
        ("accepted", accepted),
        ("running, a reply is due", asked),
        ("running", running),
        ("running, an exception to be sent", unsent),
        ("running, an exception sent", sent),
        ("running, an exception not read", unread),
        ("interrupted, a reply is due", paused),
        ("stopping", stopping),
        ("stopping, zeros sent", zeros),
        ("silent", silent),
    ];
    let inputs = [
        ("connected", On::Connected),
        ("disconnected", On::Disconnected),
        ("bytes", On::Bytes { partial: false }),
        ("bytes, a frame begins", On::Bytes { partial: true }),
        ("start message", start),
        ("start message, another mode", On::Start { is_expected: false, len: 8 }),
        ("standard message", runs),
        ("standard message, bad checksum", rejects),
        ("standard message, timeout", motion(MotionPhase::Running, ErrorCode::Timeout)),
        ("standard message, interrupted", interrupted),
        ("end message", On::End),
        ("corrupt frame", On::CorruptFrame),
        ("noise", On::Noise),
        ("timeout", On::Timeout),
        ("timeout, late", On::Timeout),
        ("transmit", On::Transmit(DRAFT)),
        ("transmit, late", On::Transmit(DRAFT)),
        ("target", On::Target),
        ("no target", On::NoTarget),
        ("exception", GRIP),
        ("exception, no room", On::Exception { exception: Exception::CloseGripper, has_room: false }),
        ("stop", On::Stop),
        ("policy", On::Policy(Policy::Refuse)),
        ("subroutine", On::Subroutine(false)),
    ];
    matrix("host", &states, &inputs, HostMachine::name, |machine, name, input| {
        let now = if name.ends_with("late") { LATE } else { Duration::ZERO };
        machine.on(now, input, &config).map(|actions| host_actions(&actions))
    })
}

fn controller() -> String {
    use ControllerInput as On;
    let config = ControllerConfig { subroutine: true, ..ControllerConfig::default() };
    let after = |machine: &ControllerMachine, inputs: &[(Duration, ControllerInput)]| {
        let mut machine = machine.clone();
        for (now, input) in inputs {
            machine.on(*now, *input, &config).unwrap();
        }
        machine
    };
    let zero = Duration::ZERO;
    let reply = |exception| On::Reply { exception, has_room: true };
    let send = On::Transmit { len: 36 };
    let disconnected = ControllerMachine::NEW;
    let off = after(&disconnected, &[(zero, On::Connected)]);
    let starting = after(&off, &[(zero, On::Start { has_room: true })]);
    let asking = after(&starting, &[(zero, On::Transmit { len: 8 })]);
    let running = after(&asking, &[(5 * MS, On::StartReply(StartCode::Accept))]);
    let sent = after(&running, &[(CYCLE, send)]);
    let grip = (CYCLE + 12 * MS, reply(Exception::CloseGripper));
    let interrupted = after(&sent, &[grip]);
    let reported = after(&interrupted, &[(2 * CYCLE, send)]);
    let returned = after(&reported, &[(2 * CYCLE, On::Return)]);
    let ending = after(&running, &[(5 * MS, On::Finish)]);
    // Each with a time at which the window of its message is open, or its next message is due.
    let states = [
        ("disconnected", (disconnected, zero)),
        ("off", (off, zero)),
        ("starting", (starting, zero)),
        ("starting, sent", (asking, 5 * MS)),
        ("running", (running, CYCLE)),
        ("running, being sent", (sent.clone(), CYCLE)),
        ("running, sent", (sent, CYCLE + 12 * MS)),
        ("interrupted", (interrupted, 2 * CYCLE)),
        ("interrupted, sent", (reported, 2 * CYCLE + 12 * MS)),
        ("interrupted, returned, sent", (returned, 2 * CYCLE + 12 * MS)),
        ("ending", (ending, CYCLE)),
    ];
    let inputs = [
        ("connected", On::Connected),
        ("disconnected", On::Disconnected),
        ("bytes", On::Bytes { partial: false }),
        ("bytes, a frame begins", On::Bytes { partial: true }),
        ("accept", On::StartReply(StartCode::Accept)),
        ("repeat", On::StartReply(StartCode::Repeat)),
        ("refuse", On::StartReply(StartCode::Refuse)),
        ("reply", reply(Exception::None)),
        ("reply with an exception", reply(Exception::CloseGripper)),
        (
            "reply with an exception, no room",
            On::Reply { exception: Exception::CloseGripper, has_room: false },
        ),
        ("corrupt bytes", On::Corrupt(ErrorCode::Checksum)),
        ("timeout", On::Timeout),
        ("timeout, late", On::Timeout),
        ("window closed", On::WindowClosed),
        ("window closed, late", On::WindowClosed),
        ("transmit", send),
        ("start", On::Start { has_room: true }),
        ("start, no room", On::Start { has_room: false }),
        ("finish", On::Finish),
        ("interrupt", On::Interrupt),
        ("return", On::Return),
    ];
    matrix(
        "controller",
        &states,
        &inputs,
        |(machine, _)| machine.name(),
        |(machine, at), name, input| {
            let now = if name.ends_with("late") { LATE } else { *at };
            machine.on(now, input, &config).map(|actions| controller_actions(&actions))
        },
    )
}

fn host_actions(actions: &HostActions) -> String {
    list(&[
        (actions.end_frame, "end the frame".into()),
        (actions.missed, "missed".into()),
        (actions.rejected.is_some(), format!("rejected {:?}", actions.rejected)),
        (actions.stale, "target stale".into()),
        (actions.outcome.is_some(), format!("exception {:?}", actions.outcome.map(|(_, outcome)| outcome))),
        (actions.stopped, "stopped".into()),
        (actions.ended, "ended".into()),
        (actions.lost.is_some(), format!("lost {:?}", actions.lost)),
        (actions.send.is_some(), format!("send {:?}", actions.send)),
        (actions.refused.is_some(), format!("refused {:?}", actions.refused)),
    ])
}

fn controller_actions(actions: &ControllerActions) -> String {
    list(&[
        (actions.end_frame, "end the frame".into()),
        (actions.close_window, "close the window".into()),
        (actions.send.is_some(), format!("send {:?}", actions.send)),
        (actions.restart, "all words are zero".into()),
        (actions.taken.is_some(), format!("taken {:?}", actions.taken)),
        (actions.rest, "rest".into()),
        (actions.bad_reply.is_some(), format!("bad reply {:?}", actions.bad_reply)),
        (actions.exception.is_some(), format!("exception {:?}", actions.exception)),
        (actions.start.is_some(), format!("{:?}", actions.start)),
        (actions.ended.is_some(), format!("ended {:?}", actions.ended)),
        (actions.stray, "stray".into()),
        (actions.refused.is_some(), format!("refused {:?}", actions.refused)),
    ])
}

fn list(actions: &[(bool, String)]) -> String {
    let set: Vec<_> = actions.iter().filter(|(set, _)| *set).map(|(_, name)| name.as_str()).collect();
    set.join(", ").replace("Some(", "(")
}

/// An input that a state does not allow changes nothing.
fn matrix<M: Clone + PartialEq + Debug, I: Copy, E>(
    end: &str,
    states: &[(&str, M)],
    inputs: &[(&str, I)],
    name: impl Fn(&M) -> &'static str,
    on: impl Fn(&mut M, &str, I) -> Result<String, E>,
) -> String {
    let mut text = String::new();
    for (state, machine) in states {
        assert!(state.starts_with(name(machine)), "{state} is {}", name(machine));
        writeln!(text, "{end}: {state}").unwrap();
        for (input, value) in inputs {
            let mut after = machine.clone();
            match on(&mut after, input, *value) {
                Ok(actions) if actions.is_empty() => writeln!(text, "    {input}: {}", name(&after)).unwrap(),
                Ok(actions) => writeln!(text, "    {input}: {}; {actions}", name(&after)).unwrap(),
                Err(_) => {
                    assert_eq!(after, *machine, "{state}, {input}");
                    writeln!(text, "    {input}: unexpected").unwrap();
                }
            }
        }
    }
    text
}

#[test]
fn every_state_and_input_is_defined() {
    let text = host() + &controller();
    if std::env::var_os("UPDATE_MATRIX").is_some() {
        std::fs::write(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/state_matrix.txt"), &text).unwrap();
    }
    assert_eq!(text, include_str!("state_matrix.txt"));
}
