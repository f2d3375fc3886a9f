//! What each machine does in each state with each input, as committed in `state_matrix.txt`.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

use core::fmt::{Debug, Write as _};
use core::time::Duration;

use laser_eb90::controller::machine::{Answer, ControllerInput, ControllerMachine, Fault, Receiving, Work};
use laser_eb90::host::machine::{Batch, HostInput, HostLink, HostMachine};
use laser_eb90::{Class, ControllerConfig, HostConfig, Refusal};

/// Late enough for every deadline of the states here.
const NOW: Duration = Duration::from_secs(100);
const WORD: u16 = 0x0101;

fn host() -> String {
    use HostInput as On;
    let config = HostConfig::default();
    let on = |machine: &mut HostMachine, now, input| {
        machine.on(now, input, &config).unwrap();
    };
    let submit = On::Submit { ticket: 0, word: WORD, class: Class::Interpreted };
    let disconnected = HostMachine::NEW;
    let mut idle = disconnected;
    on(&mut idle, Duration::ZERO, On::Connected);
    let mut filled = idle;
    on(&mut filled, Duration::ZERO, submit);
    let mut awaiting = filled;
    on(&mut awaiting, Duration::from_secs(10), On::Transmit { line: Duration::ZERO });
    let error = |refusal| On::Answer { word: 0xE001, refusal: Some(refusal) };
    let [mut resending, mut rest, mut held] = [awaiting; 3];
    on(&mut resending, Duration::from_secs(10), error(Refusal::BadChecksum));
    on(&mut rest, Duration::from_secs(10), error(Refusal::BadFrame));
    on(&mut held, Duration::from_secs(10), error(Refusal::UnknownCommand));
    let mut lost = held;
    on(&mut lost, Duration::from_secs(10), On::Disconnected);
    let echo = |word| On::Answer { word, refusal: None };
    let inputs = [
        ("Connected", On::Connected),
        ("Disconnected", On::Disconnected),
        ("Submit", submit),
        ("TakeBack", On::TakeBack),
        ("Transmit", On::Transmit { line: Duration::ZERO }),
        ("Transmitted", On::Transmitted),
        ("Answer, the word", echo(WORD)),
        ("Answer, another word", echo(0x0102)),
        ("ErrorCode BadChecksum", error(Refusal::BadChecksum)),
        ("ErrorCode BadFrame", error(Refusal::BadFrame)),
        ("ErrorCode QueueFull", error(Refusal::QueueFull)),
        ("ErrorCode BadParameters", error(Refusal::BadParameters)),
        ("Corrupt", On::Corrupt),
        ("Timeout", On::Timeout),
        ("Resume", On::Resume),
    ];
    let states = [
        ("Disconnected", disconnected),
        ("DisconnectedHeld", lost),
        ("Idle", idle),
        ("Idle, filled", filled),
        ("Awaiting", awaiting),
        ("Resending", resending),
        ("AwaitingRest", rest),
        ("Held", held),
    ];
    let filled = |machine: &HostMachine| if machine.next.is_some() { ", filled" } else { "" };
    for (name, machine) in states {
        assert!(name.starts_with(machine.name()) && name.ends_with(filled(&machine)), "{name}");
    }
    matrix("host", &states, &inputs, |machine, input| {
        // An error code at once; everything else when it is due.
        let now = if matches!(input, On::Answer { .. }) { Duration::from_secs(10) } else { NOW };
        let action = machine.on(now, input, &config);
        (format!("{}{}", machine.name(), filled(machine)), action)
    })
}

fn controller() -> String {
    use ControllerInput as On;
    let config = ControllerConfig::default();
    let bytes = |partial| Receiving::Bytes { silent_at: Duration::from_secs(1), partial };
    let machine = |work, line| ControllerMachine { work, line };
    let listening = Work::Listening { fault: None };
    let executing = |connected| Work::Executing { word: WORD, connected };
    let answering = Work::Answering { answer: Answer::Echo(WORD), due: Duration::from_secs(1) };
    let fault = |bytes| Work::Listening { fault: Some(Fault { refusal: Refusal::BadFrame, bytes }) };
    let states = [
        ("Disconnected", ControllerMachine::NEW),
        ("DisconnectedExecuting", machine(executing(false), Receiving::Disconnected)),
        ("Listening, silent", machine(listening, Receiving::Silent)),
        ("Listening, bytes", machine(listening, bytes(false))),
        ("Listening, fault of 7 bytes", machine(fault(7), bytes(false))),
        ("Listening, fault of 8 bytes", machine(fault(8), bytes(true))),
        ("Executing, silent", machine(executing(true), Receiving::Silent)),
        ("Executing, bytes", machine(executing(true), bytes(true))),
        ("Executing for nobody", machine(executing(false), bytes(false))),
        ("Answering, silent", machine(answering, Receiving::Silent)),
        ("Answering, bytes", machine(answering, bytes(false))),
        ("Answering, a partial frame", machine(answering, bytes(true))),
    ];
    let inputs = [
        ("Connected", On::Connected),
        ("Disconnected", On::Disconnected),
        ("Bytes", On::Bytes),
        ("Corrupt", On::Corrupt { refusal: Refusal::BadChecksum, bytes: 1 }),
        ("Queued", On::Queued { word: WORD }),
        ("Refused", On::Refused(Refusal::QueueFull)),
        ("Immediate", On::Immediate { word: WORD }),
        ("Read, nothing left", On::Read { partial: false }),
        ("Read, a partial frame", On::Read { partial: true }),
        ("Silence", On::Silence),
        ("Executed", On::Executed(Ok(()))),
        ("Executed, failed", On::Executed(Err(Refusal::BadParameters))),
        ("Transmit", On::Transmit),
    ];
    matrix("controller", &states, &inputs, |machine, input| {
        let action = machine.on(NOW, input, &config);
        let line = match machine.line {
            Receiving::Disconnected => "",
            Receiving::Silent => ", silent",
            Receiving::Bytes { partial: false, .. } => ", bytes",
            Receiving::Bytes { partial: true, .. } => ", a partial frame",
        };
        (format!("{}{line}", machine.name()), action)
    })
}

/// An input that a state does not allow changes nothing.
fn matrix<M: Copy + PartialEq + Debug, I: Copy, A: Debug, E>(
    end: &str,
    states: &[(&str, M)],
    inputs: &[(&str, I)],
    on: impl Fn(&mut M, I) -> (String, Result<A, E>),
) -> String {
    let mut text = String::new();
    for (state, machine) in states {
        writeln!(text, "{end}: {state}").unwrap();
        for (input, value) in inputs {
            let mut after = *machine;
            match on(&mut after, *value) {
                (next, Ok(action)) => writeln!(text, "    {input}: {next}; {action:?}").unwrap(),
                (_, Err(_)) => {
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

#[test]
fn every_time_is_visited() {
    let config = HostConfig::default();
    let batch = Batch { first: 0, count: 1, word: WORD, class: Class::Interpreted };
    let mut machine = HostMachine { link: HostLink::Idle { quiet_until: Duration::ZERO }, next: Some(batch) };
    let times = |machine: &mut HostMachine| {
        let mut times = Vec::new();
        machine.each_time(|time| times.push(*time));
        times
    };
    assert_eq!(times(&mut machine), [Duration::ZERO]);
    machine.on(Duration::ZERO, HostInput::Transmit { line: Duration::from_secs(1) }, &config).unwrap();
    assert_eq!(times(&mut machine), [1300, 1340, 1300, 1250].map(Duration::from_millis));
    let full = HostInput::Answer { word: 0xE006, refusal: Some(Refusal::QueueFull) };
    machine.on(Duration::from_secs(1), full, &config).unwrap();
    assert_eq!(times(&mut machine), [1100, 61_000].map(Duration::from_millis));
}
