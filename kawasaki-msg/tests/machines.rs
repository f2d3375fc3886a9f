//! The robot's machine: every state with every input, printed and compared with what is committed.
#![allow(clippy::unwrap_used, clippy::panic, clippy::indexing_slicing)]

use core::fmt::Debug;
use core::iter::from_fn;
use core::time::Duration;

use kawasaki_msg::{FromPc, Phase, RobotConfig, robot};

const NOW: Duration = Duration::from_secs(100);
const LATER: Duration = Duration::from_secs(1000);

/// A line for each state and input: the next state, the action and what is reported of the state, or `unexpected`.
fn matrix<M: Clone + PartialEq + Debug, I: Copy + Debug, A: Debug, R: Debug>(
    states: &[M],
    inputs: &[(I, &str)],
    name: impl Fn(&M) -> &'static str,
    report: impl Fn(&mut M) -> Option<R>,
    on: impl Fn(&mut M, I) -> Result<A, kawasaki_msg::robot_session::Unexpected>,
) -> String {
    let mut text = String::new();
    for state in states {
        for (input, input_name) in inputs {
            let mut next = state.clone();
            while report(&mut next).is_some() {}
            let before = next.clone();
            let line = match on(&mut next, *input) {
                Ok(action) => {
                    let reports: String = from_fn(|| report(&mut next)).map(|r| format!(", {r:?}")).collect();
                    format!("{} / {action:?}{reports}", name(&next))
                }
                Err(unexpected) => {
                    assert_eq!(next, before, "nothing has changed");
                    assert_eq!((unexpected.state, unexpected.input), (name(state), *input_name));
                    "unexpected".into()
                }
            };
            text += &format!("{} + {input:?} -> {line}\n", name(state));
        }
    }
    text
}

fn compare(found: &str, committed: &str, file: &str) {
    if std::env::var_os("UPDATE").is_some() {
        std::fs::write(format!("{}/tests/{file}", env!("CARGO_MANIFEST_DIR")), found).unwrap();
        return;
    }
    assert_eq!(found, committed, "write it with: UPDATE=1 cargo test -p kawasaki-msg --test machines");
}

#[test]
fn what_a_robot_does_is_what_is_committed() {
    use robot::{Input, Machine};
    let config = RobotConfig { max_number: 63, patience: Duration::MAX, ..RobotConfig::TCP };
    let message = |message| Input::Message { message, room: true };
    let job = |number| message(FromPc::Job { order: 50, number, good: true });
    let inputs = [
        Input::Connected,
        Input::Disconnected,
        Input::Timeout,
        message(FromPc::Status { order: 51 }),
        message(FromPc::Start { order: 50, first: 1 }),
        message(FromPc::Start { order: 51, first: 1 }),
        message(FromPc::End { order: 50 }),
        message(FromPc::Interrupt { order: 50 }),
        job(3),
        job(5),
        Input::Message { message: FromPc::Job { order: 50, number: 3, good: true }, room: false },
        message(FromPc::Filler),
        message(FromPc::WrongSide),
        message(FromPc::Unusable),
        Input::Corrupt,
        Input::Queued { count: 1 },
        Input::ReadEnd,
        Input::Executed { number: 2 },
        Input::Settled,
        Input::Drained,
        Input::ClearQueue,
        Input::ResetOrder,
    ];
    let run = |inputs: &[Input]| {
        let mut machine = Machine::<1>::new(&config);
        for input in inputs {
            machine.on(NOW, *input, &config).unwrap();
        }
        machine
    };
    let start = [Input::Timeout, Input::Connected, message(FromPc::Start { order: 50, first: 1 })];
    let active = [&start[..], &[job(1), job(2), Input::Executed { number: 1 }]].concat();
    let and = |more: &[Input]| run(&[&active[..], more].concat());
    let mut alarm = and(&[Input::Executed { number: 2 }]);
    for _ in 0..8 {
        for input in [Input::Disconnected, Input::Timeout, Input::Connected, Input::Settled] {
            alarm.on(LATER, input, &config).unwrap();
        }
        alarm.on(LATER + LATER, Input::Settled, &config).unwrap();
    }
    let states = [
        run(&[]),
        run(&[Input::Timeout]),
        run(&[Input::Timeout, Input::Connected]),
        and(&[]),
        and(&[Input::Corrupt]),
        and(&[Input::ClearQueue]),
        and(&[message(FromPc::End { order: 50 })]),
        and(&[Input::ResetOrder]),
        alarm,
    ];
    let inputs = inputs.map(|input| (input, input.name()));
    let found = matrix(&states, &inputs, Machine::name, Machine::report, |machine, input| {
        machine.on(LATER, input, &config)
    });
    compare(&found, include_str!("robot_matrix.txt"), "robot_matrix.txt");
    for name in ["JobsMissing", "Clearing", "Ending", "Interrupted", "Alarm", "Connecting"] {
        assert!(found.contains(&format!("\n{name} + ")), "{name}");
    }
}

#[test]
fn every_code_of_a_phase_survives() {
    for code in 0..=u8::MAX {
        assert_eq!(u8::from(Phase::from(code)), code);
    }
}
