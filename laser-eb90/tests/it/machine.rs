//! The state machine of the host, without bytes.

use core::time::Duration;

use laser_eb90::host::machine::{Batch, HostLink, HostMachine, Input};
use laser_eb90::robot_session::Unexpected;
use laser_eb90::robot_session::end::Machine as _;
use laser_eb90::{Class, HostConfig, Refusal};

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
