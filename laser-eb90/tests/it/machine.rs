//! The state machines of both ends, without bytes.

use core::time::Duration;

use laser_eb90::controller::machine::{self as controller, ControllerMachine, Fault, Work};
use laser_eb90::host::machine::{Batch, HostLink, HostMachine, Input};
use laser_eb90::robot_session::Unexpected;
use laser_eb90::robot_session::end::Machine as _;
use laser_eb90::{Class, ControllerConfig, HostConfig, Refusal};

const WORD: u16 = 0x0101;

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
    machine.on(Duration::ZERO, Input::Sent { line: Duration::from_secs(1) }, &config).unwrap();
    assert_eq!(times(&mut machine), [1300, 1340, 1300, 1250].map(Duration::from_millis));
    let full = Input::Answer { word: 0xE006, refusal: Some(Refusal::QueueFull) };
    machine.on(Duration::from_secs(1), full, &config).unwrap();
    assert_eq!(times(&mut machine), [1100, 61_000].map(Duration::from_millis));
}

/// Interpreted instructions travel together, up to the batch; all others alone (§3(6)).
#[test]
fn an_instruction_that_the_next_frame_has_no_room_for_is_unexpected() {
    let config = HostConfig { batch: 2, ..HostConfig::default() };
    for (before, class, fits) in [
        (&[][..], Class::Query, true),
        (&[Class::Interpreted], Class::Interpreted, true),
        (&[Class::Interpreted; 2], Class::Interpreted, false),
        (&[Class::Interpreted], Class::Immediate, false),
        (&[Class::Query], Class::Query, false),
    ] {
        let mut machine = HostMachine::NEW;
        let mut submit = |class| {
            machine.on(Duration::ZERO, Input::Submit { ticket: 0, word: WORD, class }, &config).map(drop)
        };
        before.iter().for_each(|class| submit(*class).unwrap());
        let unexpected = Unexpected { state: "Disconnected", input: "Submit" };
        assert_eq!(submit(class), if fits { Ok(()) } else { Err(unexpected) }, "{before:?}, {class:?}");
    }
}

/// Returns the corrupt bytes that a controller remembers after these inputs.
fn fault(work: Work, inputs: &[controller::Input]) -> Option<Fault> {
    let mut machine = ControllerMachine { work, line: controller::LineState::Silent };
    for input in [controller::Input::Bytes].iter().chain(inputs) {
        machine.on(Duration::ZERO, *input, &ControllerConfig::default()).unwrap();
    }
    match machine.line {
        controller::LineState::Bytes(burst) => burst.fault,
        line => panic!("{line:?}"),
    }
}

#[test]
fn an_accepted_frame_ends_the_corruption_before_it() {
    use controller::Input;
    let corrupt = Input::Corrupt { refusal: Refusal::BadFrame, bytes: 3, begun: false };
    let idle = Work::Listening { rest: false };
    assert!(fault(idle, &[corrupt]).is_some());
    for good in
        [Input::Queued { word: WORD }, Input::Refused(Refusal::BadBatch), Input::Immediate { word: WORD }]
    {
        assert_eq!(fault(idle, &[corrupt, good]), None, "{good:?}");
    }
}

/// The rest of an answered frame has no answer of its own; a frame that begins after it does.
#[test]
fn corrupt_bytes_are_answered_from_the_first_that_asks_for_it() {
    use controller::Input;
    let corrupt = |refusal, bytes, begun| Input::Corrupt { refusal, bytes, begun };
    let rest = corrupt(Refusal::BadFrame, 2, false);
    let begun = corrupt(Refusal::BadChecksum, 8, true);
    let listening = Work::Listening { rest: true };
    let refusal = Refusal::BadFrame;
    assert_eq!(fault(listening, &[rest]), Some(Fault { refusal, bytes: 2, is_answered: false }));
    assert_eq!(fault(listening, &[rest, begun]), Some(Fault { refusal, bytes: 8, is_answered: true }));
    assert_eq!(fault(listening, &[rest, begun, rest]), Some(Fault { refusal, bytes: 8, is_answered: true }));
    let answering = Work::Answering { answer: controller::Answer::Echo(WORD), due: Duration::from_secs(1) };
    assert_eq!(fault(answering, &[begun]).map(|fault| fault.is_answered), Some(false));
    let untrusted = fault(answering, &[begun, Input::Untrusted]);
    assert_eq!(untrusted.map(|fault| fault.is_answered), Some(true));
}
