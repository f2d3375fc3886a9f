//! Both machines: every state with every input, and what a deadline is.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

use core::fmt::Debug;
use core::time::Duration;

use isra_ball::ball::machine::{self as ball, BallMachine};
use isra_ball::host::machine::{Action, HostMachine, Input, Poll, Polling, Values};
use isra_ball::robot_session::Unexpected;
use isra_ball::{BallConfig, HostConfig};

const MS: Duration = Duration::from_millis(1);
const NOW: Duration = Duration::from_secs(1);

fn row<A: Debug>(state: &str, input: &str, next: &str, outcome: Result<A, Unexpected>) -> String {
    match outcome {
        Ok(action) => format!("{state} × {input} -> {next}, {action:?}\n"),
        Err(error) => {
            assert_eq!(next, error.state, "nothing changes");
            assert_eq!(input, error.input);
            format!("{state} × {input} -> unexpected\n")
        }
    }
}

/// Every state of the host as its deadlines are passed or not, with a name.
fn host_states() -> Vec<(String, HostMachine)> {
    let (past, future) = (NOW - MS, NOW + MS);
    let waiting = |from, until| Poll::Waiting { from, until, due: future, proof_until: future + 9 * MS };
    let polls = [
        ("", Poll::Idle { due: future }),
        (", due", Poll::Idle { due: past }),
        (", early", waiting(future, future + MS)),
        ("", waiting(past, future)),
        (", late", waiting(past, past)),
    ];
    let values = [
        ("", Values::Stale),
        ("", Values::Live { until: future + 5 * MS }),
        (", too old", Values::Live { until: past }),
    ];
    let mut states = vec![("Disconnected".into(), HostMachine::Disconnected)];
    for (poll_note, poll) in polls {
        for (values_note, values) in values {
            for (proof_note, proof_until) in [("", past), (", proof", future)] {
                let is_window =
                    matches!(poll, Poll::Waiting { from, until, .. } if from < NOW && NOW < until);
                if !is_window && proof_until > NOW {
                    continue;
                }
                let machine = HostMachine::Connected(Polling { poll, values, proof_until });
                states.push((format!("{}{poll_note}{values_note}{proof_note}", machine.name()), machine));
            }
        }
    }
    states
}

const HOST_INPUTS: [Input; 6] = [
    Input::Connected,
    Input::Disconnected,
    Input::Timer,
    Input::Poll,
    Input::Packet { fresh: true },
    Input::Packet { fresh: false },
];

#[test]
fn every_state_and_input_is_defined() {
    let mut text = String::new();
    for (name, state) in host_states() {
        for input in HOST_INPUTS {
            let mut machine = state;
            let outcome = machine.on(NOW, input, &HostConfig::default());
            assert!(outcome.is_ok() || machine == state, "{name} {input:?}");
            let next = if outcome.is_ok() { machine.name() } else { state.name() };
            text += &row(&name, input.name(), next, outcome);
        }
    }
    for link in [ball::Link::Disconnected, ball::Link::Ready, ball::Link::Replying] {
        for values in [ball::Values::Old, ball::Values::New] {
            let inputs = [
                ball::Input::Connected,
                ball::Input::Disconnected,
                ball::Input::Measured,
                ball::Input::Enquiry,
                ball::Input::Reply,
            ];
            for input in inputs {
                let state = BallMachine { link, values };
                let mut machine = state;
                let outcome = machine.on(NOW, input, &BallConfig::default());
                assert!(outcome.is_ok() || machine == state);
                text += &row(state.name(), input.name(), machine.name(), outcome);
            }
        }
    }
    if std::env::var_os("UPDATE").is_some() {
        std::fs::write("tests/state_matrix.txt", &text).unwrap();
    }
    assert_eq!(text, include_str!("state_matrix.txt"), "run with UPDATE=1 to write it anew");
}

#[test]
fn what_comes_due_is_what_the_deadline_says() {
    for (name, state) in host_states() {
        let deadline = state.deadline();
        let mut machine = state;
        let timer = machine.on(NOW, Input::Timer, &HostConfig::default()).unwrap();
        let is_due = timer != Action::None || state.transmits(NOW);
        assert_eq!(deadline.is_some_and(|at| at <= NOW), is_due, "{name}");
    }
    let ball = BallMachine::NEW;
    assert_eq!((ball.deadline(), ball.transmits()), (None, false));
}

#[test]
fn every_time_is_visited_and_the_longest_is_never() {
    for (name, state) in host_states() {
        let mut machine = state;
        machine.each_time(|time| *time = Duration::MAX);
        let (deadline, times) = (machine.deadline(), format!("{machine:?}"));
        assert_eq!(deadline, None, "{name}");
        assert!(!times.contains("999ms") && !times.contains("1.0"), "{times}");
        assert_eq!(
            machine.on(Duration::MAX, Input::Timer, &HostConfig::default()),
            Ok(Action::None),
            "{name}"
        );
        assert!(!machine.transmits(Duration::MAX));
    }
}

#[test]
fn a_machine_is_small() {
    assert!(size_of::<HostMachine>() <= 112, "{}", size_of::<HostMachine>());
    assert_eq!(size_of::<BallMachine>(), 2);
}
