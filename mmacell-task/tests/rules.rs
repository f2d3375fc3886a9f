//! The task of §6 when something goes wrong, and what it never does whatever happens.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

mod common;

use common::tasks::*;
use mmacell_proto::state::Motion;
use mmacell_proto::task::{Device, Event, Failure, Output, Step, Task};
use mmacell_proto::{BLOW, Command, ErrorCode, Status, VACUUM, controller};
use proptest::prelude::*;

#[test]
fn a_camera_that_sees_nothing_waits_to_be_told() {
    for step in [Step::FindPart, Step::FindSlot] {
        let mut task = task_at(step);
        task.handle_event(ZERO, Event::NotFound);
        assert_eq!(task.step(), step, "nobody has asked yet");
        poll(&mut task, ZERO);
        task.handle_event(ZERO, Event::NotFound);
        assert_eq!(poll(&mut task, ZERO), [Output::Entered(Step::NothingFound)]);
        task.handle_event(ZERO, Event::Next);
        assert_eq!(task.step(), Step::GoCamera1);
    }
}

#[test]
fn what_was_not_asked_for_means_nothing() {
    let mut task = task_at(Step::ServosOn);
    for event in [Event::Done(Device::Robot), Event::Done(Device::Platform), PART, SLOT] {
        task.handle_event(ZERO, event);
        assert_eq!(task.step(), Step::ServosOn);
    }
    assert_eq!(poll(&mut task, ZERO), servo());
    let mut task = task_at(Step::FindPart);
    poll(&mut task, ZERO);
    task.handle_event(ZERO, SLOT);
    assert_eq!(task.step(), Step::FindPart, "that is camera 2's");
}

/// Wherever something fails, everything stops, the valves close, and only a reset leads on.
#[test]
fn a_failure_stops_the_cell_from_every_step_and_a_reset_leads_back() {
    let failures = [Failure::Refused(ErrorCode::Generic), Failure::Error(ErrorCode::Servo2), Failure::Lost];
    let immune = [Step::AwaitDevices, Step::Faulted, Step::Closing, Step::Finished];
    let reachable = Step::ALL.into_iter().filter(|step| !immune.contains(step));
    let reachable =
        reachable.filter(|s| !matches!(s, Step::DevicesReady | Step::NothingFound | Step::Resetting));
    for (step, failure) in reachable.flat_map(|step| failures.map(|failure| (step, failure))) {
        let device = Device::Platform;
        let mut task = task_at(step);
        if task.step() != step {
            continue; // passed through at once
        }
        task.handle_event(ZERO, Event::Failed { device, failure });
        assert_eq!(task.failure(), Some((device, failure)));
        let mut orders = poll(&mut task, ZERO);
        assert_eq!(orders.remove(0), Output::Entered(Step::Faulted), "{step:?}");
        // Each order may have to wait for the answer to the last one.
        for device in [Device::Robot, Device::Platform, Device::Gripper] {
            task.handle_event(ZERO, Event::Done(device));
            orders.extend(poll(&mut task, ZERO));
        }
        let mut expected = vec![STOP, grip(VACUUM, false), grip(BLOW, false)];
        if failure != Failure::Lost {
            expected.insert(1, Output::Platform(Command::Stop));
        }
        assert_eq!(orders, expected, "{step:?}");
        for device in [Device::Robot, Device::Platform, Device::Gripper] {
            task.handle_event(ZERO, Event::Done(device));
        }
        task.handle_event(ZERO, Event::Recover);
        if failure == Failure::Lost {
            assert_eq!(task.step(), Step::Faulted, "the platform is not there");
            task.handle_event(ZERO, Event::Ready(Device::Platform));
        }
        let outputs = run_to(&mut task, Step::ServosOn);
        let reset = [Output::Robot(Command::Reset), Output::Platform(Command::Reset)];
        let closed = [grip(VACUUM, false), grip(BLOW, false)];
        for expected in reset.iter().chain(&closed) {
            assert!(outputs.contains(expected), "{step:?}: {outputs:?}");
        }
    }
}

#[test]
fn the_events_of_a_connection_are_translated() {
    let from = |event| Event::from_controller(Device::Robot, &event);
    let status = |error, moving| Status { moving, pose: robot(0), servo: true, percent: 1, error };
    let done = controller::Event::Done { command: Command::Stop };
    assert_eq!(from(done), Some(Event::Done(Device::Robot)));
    let refused = controller::Event::Refused { command: Command::Stop, error: ErrorCode::Servo1 };
    let failed = |failure| Some(Event::Failed { device: Device::Robot, failure });
    assert_eq!(from(refused), failed(Failure::Refused(ErrorCode::Servo1)));
    for (motion, moving) in
        [(Motion::Still, false), (Motion::Starting, true), (Motion::Moving, true), (Motion::Stopping, true)]
    {
        let event = controller::Event::Status { status: status(ErrorCode::None, false), motion };
        assert_eq!(from(event), Some(Event::Status { device: Device::Robot, moving }));
    }
    let event = controller::Event::Status { status: status(ErrorCode::Servo2, false), motion: Motion::Still };
    assert_eq!(from(event), failed(Failure::Error(ErrorCode::Servo2)));
    let closed = |reason| from(controller::Event::Closed { reason, unknown: None });
    assert_eq!(closed(controller::Closing::Timeout), failed(Failure::Lost));
    assert_eq!(closed(controller::Closing::Agreed), None);
}

fn device() -> impl Strategy<Value = Device> {
    use Device::{Conditioning, Gripper, Platform, Robot, Vision};
    prop::sample::select(vec![Robot, Platform, Conditioning, Vision, Gripper])
}

fn event() -> impl Strategy<Value = Option<Event>> {
    let failures = prop::sample::select(vec![Failure::Refused(ErrorCode::Generic), Failure::Lost]);
    prop_oneof![
        8 => Just(None), // the answer that is due
        2 => any::<bool>().prop_map(|high| Some(Event::Switch { high })),
        2 => device().prop_map(|device| Some(Event::Ready(device))),
        1 => device().prop_map(|device| Some(Event::Done(device))),
        1 => (device(), any::<bool>()).prop_map(|(device, moving)| Some(Event::Status { device, moving })),
        1 => (device(), failures).prop_map(|(device, failure)| Some(Event::Failed { device, failure })),
        1 => prop::sample::select(vec![PART, SLOT, Event::NotFound, Event::Next, Event::Finish, Event::Recover])
            .prop_map(Some),
    ]
}

fn of(output: Output) -> Option<Device> {
    Some(match output {
        Output::Robot(_) => Device::Robot,
        Output::Platform(_) => Device::Platform,
        Output::Conditioning(_) => Device::Conditioning,
        Output::Acquire { .. } => Device::Vision,
        Output::Grip { .. } => Device::Gripper,
        _ => return None,
    })
}

proptest! {
    /// Whatever happens in whatever order: every step follows from the one before by the table, no device has two orders at a
    /// time, no motion is ordered before the last one is known to have ended, and the vacuum is off before a new attempt.
    #[test]
    fn whatever_happens_the_rules_hold(events in prop::collection::vec(event(), 1..300)) {
        let mut task = Task::new(CONFIG);
        let mut step = None;
        let mut vacuum = false;
        let mut outstanding: Vec<(Device, Output)> = Vec::new();
        let mut now = ZERO;
        for event in events {
            for output in poll(&mut task, now) {
                if let Output::Entered(entered) = output {
                    let legal = step.is_none_or(|step: Step| step.transitions().iter().any(|(_, to)| *to == entered));
                    prop_assert!(legal, "{:?} -> {:?}", step, entered);
                    step = Some(entered);
                    let new_attempt = matches!(entered, Step::GoCamera1 | Step::Placed | Step::ServosOn);
                    prop_assert!(!(new_attempt && vacuum), "{:?} with the vacuum on", entered);
                } else if let Some(device) = of(output) {
                    prop_assert!(outstanding.iter().all(|(busy, _)| *busy != device), "{:?} behind {:?}", output, outstanding);
                    outstanding.push((device, output));
                    if let Output::Grip { gripper: VACUUM, open } = output {
                        vacuum = open;
                    }
                }
            }
            prop_assert_eq!(step, Some(task.step()));
            now += MS;
            match event {
                Some(event) => {
                    match event {
                        Event::Done(device) | Event::Status { device, .. } | Event::Failed { device, .. } => {
                            outstanding.retain(|(busy, _)| *busy != device);
                        }
                        Event::PartFound { .. } | Event::SlotFound { .. } | Event::NotFound => {
                            outstanding.retain(|(busy, _)| *busy != Device::Vision);
                        }
                        _ => {}
                    }
                    task.handle_event(now, event);
                }
                None if outstanding.is_empty() => {
                    now = task.poll_timeout().unwrap_or(now).max(now);
                    task.handle_timeout(now);
                }
                None => {
                    let (_, output) = outstanding.remove(0);
                    let event = answer(output, &task).unwrap();
                    task.handle_event(now, event);
                }
            }
        }
    }
}
