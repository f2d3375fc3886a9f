//! Both machines: every state with every input, and what a deadline is.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

use core::fmt::Debug;
use core::time::Duration;

use val2_viewer::host::machine::{self as host, HostMachine, Link, Pose};
use val2_viewer::robot_session::Unexpected;
use val2_viewer::workstation::machine::{self as workstation, Display, Picture, Request, WorkstationMachine};
use val2_viewer::{HostConfig, WorkstationConfig};

const MS: Duration = Duration::from_millis(1);
const NOW: Duration = Duration::from_secs(1);

fn row<A: Debug>(state: &str, input: &str, next: &str, outcome: Result<A, Unexpected>) -> String {
    match outcome {
        Ok(action) => format!("{state} × {input} -> {next}, {action:?}\n"),
        Err(error) => {
            assert_eq!(input, error.input);
            format!("{state} × {input} -> unexpected\n")
        }
    }
}

/// Every state of the host as its deadlines are passed or not, with a name.
fn host_states() -> Vec<(String, HostMachine)> {
    let (past, future) = (NOW - MS, NOW + MS);
    let links = [
        ("", Link::Disconnected),
        ("", Link::Ready { from: future }),
        (", due", Link::Ready { from: past }),
        ("", Link::Asked { from: future }),
        (", due", Link::Asked { from: past }),
    ];
    let poses = [
        ("", Pose::Unknown),
        ("", Pose::Known { until: future + 5 * MS }),
        (", too old", Pose::Known { until: past }),
    ];
    let mut states = Vec::new();
    for (link_note, link) in links {
        for (pose_note, pose) in poses {
            let machine = HostMachine { link, pose };
            states.push((format!("{}{link_note}{pose_note}", machine.name()), machine));
        }
    }
    states
}

const HOST_INPUTS: [host::Input; 6] = [
    host::Input::Connected,
    host::Input::Disconnected,
    host::Input::Timer,
    host::Input::Pose,
    host::Input::Enquiry,
    host::Input::Answer,
];

/// The same of the workstation.
fn workstation_states() -> Vec<(String, WorkstationMachine)> {
    let (past, future) = (NOW - MS, NOW + MS);
    let requests = [
        ("", Request::Allowed),
        ("", Request::Due),
        ("", Request::Waiting { again_from: future }),
        (", paused", Request::Waiting { again_from: past }),
    ];
    let pictures = [
        ("", Picture::Stale),
        ("", Picture::Live { until: future }),
        (", too old", Picture::Live { until: past }),
    ];
    let mut states = vec![("Disconnected".into(), WorkstationMachine::Disconnected)];
    for (request_note, request) in requests {
        for (picture_note, picture) in pictures {
            let machine = WorkstationMachine::Connected(Display { request, picture });
            states.push((format!("{}{request_note}{picture_note}", machine.name()), machine));
        }
    }
    states
}

const WORKSTATION_INPUTS: [workstation::Input; 8] = [
    workstation::Input::Connected,
    workstation::Input::Disconnected,
    workstation::Input::Timer,
    workstation::Input::Draw,
    workstation::Input::Ask,
    workstation::Input::Pose,
    workstation::Input::Corrupt { line: true },
    workstation::Input::Corrupt { line: false },
];

#[test]
fn every_state_and_input_is_defined() {
    let mut text = String::new();
    for (name, state) in host_states() {
        for input in HOST_INPUTS {
            let mut machine = state;
            let outcome = machine.on(NOW, input, &HostConfig::default());
            assert!(outcome.is_ok() || machine == state, "{name} {input:?}");
            text += &row(&name, input.name(), machine.name(), outcome);
        }
    }
    for (name, state) in workstation_states() {
        for input in WORKSTATION_INPUTS {
            let mut machine = state;
            let outcome = machine.on(NOW, input, &WorkstationConfig::default());
            assert!(outcome.is_ok() || machine == state, "{name} {input:?}");
            text += &row(&name, input.name(), machine.name(), outcome);
        }
    }
    if std::env::var_os("UPDATE").is_some() {
        std::fs::write("tests/state_matrix.txt", &text).unwrap();
    }
    let committed = std::fs::read_to_string("tests/state_matrix.txt").unwrap();
    assert_eq!(text, committed, "run with UPDATE=1 to write it anew");
}

#[test]
fn what_comes_due_is_what_the_deadline_says() {
    for (name, state) in host_states() {
        let mut machine = state;
        let timer = machine.on(NOW, host::Input::Timer, &HostConfig::default()).unwrap();
        let is_due = timer != host::Action::None || state.transmits(NOW);
        assert_eq!(state.deadline().is_some_and(|at| at <= NOW), is_due, "{name}");
    }
    for (name, state) in workstation_states() {
        let mut machine = state;
        let timer = machine.on(NOW, workstation::Input::Timer, &WorkstationConfig::default()).unwrap();
        let is_due = timer != workstation::Action::None;
        assert_eq!(state.deadline().is_some_and(|at| at <= NOW), is_due, "{name}");
        assert_eq!(state.transmits(), name.starts_with("Due"), "{name}");
    }
}

#[test]
fn every_time_is_visited_and_the_longest_is_never() {
    for (name, state) in host_states() {
        let mut machine = state;
        machine.each_time(|time| *time = Duration::MAX);
        let times = format!("{machine:?}");
        assert_eq!(machine.deadline(), None, "{name}");
        assert!(!times.contains("999ms") && !times.contains("1.0"), "{times}");
        let timer = machine.on(Duration::MAX, host::Input::Timer, &HostConfig::default());
        assert_eq!(timer, Ok(host::Action::None), "{name}");
        assert!(!machine.transmits(Duration::MAX));
    }
    for (name, state) in workstation_states() {
        let mut machine = state;
        machine.each_time(|time| *time = Duration::MAX);
        let times = format!("{machine:?}");
        assert_eq!(machine.deadline(), None, "{name}");
        assert!(!times.contains("999ms") && !times.contains("1.0"), "{times}");
        for input in [workstation::Input::Timer, workstation::Input::Draw] {
            let mut machine = machine;
            let action = machine.on(Duration::MAX, input, &WorkstationConfig::default());
            assert_eq!(action, Ok(workstation::Action::None), "{name}");
        }
    }
}

#[test]
fn a_machine_is_small() {
    assert!(size_of::<HostMachine>() <= 48, "{}", size_of::<HostMachine>());
    assert!(size_of::<WorkstationMachine>() <= 48, "{}", size_of::<WorkstationMachine>());
}
