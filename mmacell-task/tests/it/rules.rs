//! The task of §6 after failures, and properties that hold in every case.

use core::time::Duration;

use crate::common::*;
use mmacell_proto::{
    BLOW, CentralEvent, CloseReason, Command, ErrorCode, MissReason, Progress, Status, Unfinished, VACUUM,
};
use mmacell_task::{Device, Event, Failure, Fault, Output, Step, Task, TaskConfig};
use proptest::prelude::*;

#[test]
fn a_camera_that_sees_nothing_waits_for_its_caller() {
    for step in [Step::FindPart, Step::FindSlot] {
        let mut task = task_at(step);
        task.handle_event(ZERO, Event::NotFound);
        assert_eq!(task.step(), step, "before the first request");
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
    let reachable = reachable
        .filter(|s| !matches!(s, Step::DevicesReady | Step::NothingFound | Step::Unpicked | Step::Resetting));
    for (step, failure) in reachable.flat_map(|step| failures.map(|failure| (step, failure))) {
        let device = Device::Platform;
        let mut task = task_at(step);
        if task.step() != step {
            continue; // passed through at once
        }
        task.handle_event(ZERO, Event::Failed { device, failure });
        assert_eq!(task.fault(), Some(Fault::Device { device, failure }));
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
    let from = |event| Event::from_central(Device::Robot, &event);
    let status = |error| Status { moving: false, pose: robot(0), servo: true, percent: 1, error };
    let done = CentralEvent::Done { command: Command::Stop };
    assert_eq!(from(done), Some(Event::Done(Device::Robot)));
    let refused = CentralEvent::Refused { command: Command::Stop, error: ErrorCode::Other(77) };
    let failed = |failure| Some(Event::Failed { device: Device::Robot, failure });
    assert_eq!(from(refused), failed(Failure::Refused(ErrorCode::Other(77))));
    let motion = Progress::Missed(MissReason::ServoOff);
    let event = CentralEvent::Status { status: status(ErrorCode::None), motion };
    assert_eq!(from(event), Some(Event::Status { device: Device::Robot, motion }));
    let event = CentralEvent::Status { status: status(ErrorCode::Servo2), motion: Progress::Arrived };
    assert_eq!(from(event), failed(Failure::Error(ErrorCode::Servo2)));
    assert_eq!(from(CentralEvent::Aborted { command: Command::Stop }), failed(Failure::Aborted));
    let closed = |reason| from(CentralEvent::Closed { reason, unfinished: Unfinished::Nothing });
    assert_eq!(closed(CloseReason::Timeout), failed(Failure::Lost));
    assert_eq!(closed(CloseReason::Agreed), Some(Event::Done(Device::Robot)));
    assert_eq!(from(CentralEvent::Connected), None);
}

/// D-15: at rest is not arrived. Each step that waits for a motion fails when it ends elsewhere, or without servo motors.
#[test]
fn a_motion_that_has_not_arrived_fails_the_step() {
    let device = Device::Robot;
    for step in [Step::AwaitHome, Step::AwaitCamera1, Step::AwaitCamera2, Step::AwaitPick, Step::AwaitPlace] {
        for (motion, miss) in [
            (Progress::Missed(MissReason::Elsewhere), MissReason::Elsewhere),
            (Progress::Missed(MissReason::ServoOff), MissReason::ServoOff),
            // At rest, and the session does not know where it should be.
            (Progress::Still, MissReason::Elsewhere),
        ] {
            let mut task = task_at(step);
            poll(&mut task, ZERO);
            task.handle_event(ZERO, progress(device, motion));
            assert_eq!(task.step(), Step::Faulted, "{step:?} {motion:?}");
            let failure = Failure::Missed(miss);
            assert_eq!(task.fault(), Some(Fault::Device { device, failure }));
            let released = poll(&mut task, ZERO).contains(&grip(BLOW, true));
            assert!(!released, "nothing is put down");
        }
        for motion in [Progress::Starting, Progress::Moving, Progress::Stopping] {
            let mut task = task_at(step);
            poll(&mut task, ZERO);
            task.handle_event(ZERO, progress(device, motion));
            assert_eq!(task.step(), step, "{motion:?}");
        }
    }
}

/// D-16: high before the vacuum is on is a fault, not a part.
#[test]
fn a_switch_that_is_stuck_high_counts_no_parts() {
    let mut task = task_at(Step::FindSlot);
    poll(&mut task, ZERO);
    task.handle_event(ZERO, Event::Switch { high: true });
    assert_eq!(task.step(), Step::FindSlot);
    task.handle_event(ZERO, SLOT);
    assert_eq!(task.step(), Step::Faulted);
    assert_eq!(task.fault(), Some(Fault::SwitchHigh { step: Step::GoPick }));
    assert!(!poll(&mut task, ZERO).contains(&to(30)), "the robot is not sent to the part");
    let mut task = task_at(Step::GoPick);
    poll(&mut task, ZERO);
    task.handle_event(ZERO, Event::Switch { high: true });
    assert_eq!(task.step(), Step::Faulted, "before the vacuum is on");
    // High all the time since the part was picked: it is still on the gripper, or never was.
    let mut task = task_at(Step::AwaitPick);
    task.handle_event(ZERO, Event::Switch { high: true });
    let mut now = ZERO;
    for _ in 0..100 {
        while let Some(output) = task.poll_output(now) {
            if let Some(event) = answer(output, &task) {
                task.handle_event(now, event);
            }
        }
        if task.step() == Step::CheckReleased {
            break;
        }
        now = task.poll_timeout().unwrap_or(now).max(now);
        task.handle_timeout(now);
    }
    assert_eq!(task.step(), Step::CheckReleased);
    task.handle_timeout(now + CONFIG.order_timeout);
    assert_eq!(task.fault(), Some(Fault::SwitchHigh { step: Step::CheckReleased }));
}

/// The switch is acted on when it changes: what happened in between counts too.
#[test]
fn the_task_acts_on_edges() {
    let mut task = task_at(Step::VacuumOn);
    poll(&mut task, ZERO);
    task.handle_event(ZERO, Event::Switch { high: true });
    task.handle_event(ZERO, Event::Switch { high: false });
    task.handle_event(ZERO, Event::Done(Device::Gripper));
    assert_eq!(task.step(), Step::StopAtPart, "it touched the part");
    let mut task = task_at(Step::GoPlace);
    poll(&mut task, ZERO);
    task.handle_event(ZERO, Event::Switch { high: false });
    task.handle_event(ZERO, Event::Switch { high: true });
    task.handle_event(ZERO, Event::Done(Device::Robot));
    assert_eq!(task.step(), Step::GiveUp, "nobody knows how the part hangs now");
}

#[test]
fn the_vacuum_has_its_time_to_build_up() {
    let mut task = task_at(Step::GripDwell);
    assert_eq!(task.poll_timeout(), Some(CONFIG.grip_dwell));
    let mut late = task.clone();
    task.handle_event(MS, Event::Switch { high: true });
    assert_eq!(task.step(), Step::GoPlace);
    late.handle_timeout(CONFIG.grip_dwell - MS);
    assert_eq!(late.step(), Step::GripDwell);
    late.handle_timeout(CONFIG.grip_dwell);
    assert_eq!(late.step(), Step::GiveUp);
    let mut task = Task::new(TaskConfig { place_dwell: 30 * MS, ..CONFIG });
    ready(&mut task, ZERO);
    run_to(&mut task, Step::AwaitPick);
    task.handle_event(ZERO, Event::Switch { high: true });
    run_to(&mut task, Step::PlaceDwell);
    assert_eq!(task.poll_timeout(), Some(30 * MS));
    task.handle_timeout(29 * MS);
    assert_eq!(task.step(), Step::PlaceDwell);
    let mut lost = task.clone();
    lost.handle_event(29 * MS, Event::Switch { high: false });
    assert_eq!(lost.step(), Step::GiveUp);
    task.handle_timeout(30 * MS);
    assert_eq!(task.step(), Step::Release);
}

#[test]
fn a_part_is_picked_so_often_and_not_more() {
    let mut task = Task::new(TaskConfig { attempts: 2, ..CONFIG });
    ready(&mut task, ZERO);
    for round in 0..2 {
        let steps = entered(&run_to(&mut task, Step::Unpicked));
        assert_eq!(steps.iter().filter(|step| **step == Step::GiveUp).count(), 2, "round {round}");
        task.handle_event(ZERO, Event::Next);
        assert_eq!(task.step(), Step::GoCamera1);
    }
}

/// Every step that waits for somebody else ends by itself.
#[test]
fn every_step_has_a_timeout() {
    for step in Step::ALL {
        let waits_for_the_caller = matches!(
            step,
            Step::Placed | Step::Unpicked | Step::NothingFound | Step::Faulted | Step::Finished
        );
        // It waits for devices to be switched on without a timeout, unless a setting limits it.
        let passes = matches!(step, Step::DevicesReady | Step::CheckGrip | Step::Resetting | Step::Closing);
        if waits_for_the_caller || passes || step == Step::AwaitDevices {
            continue;
        }
        let mut task = task_at(step);
        if task.step() != step {
            continue; // passed through at once
        }
        poll(&mut task, ZERO);
        for now in [CONFIG.order_timeout, CONFIG.motion_timeout] {
            task.handle_timeout(now * 2);
        }
        assert_ne!(task.step(), step);
        let dwells = matches!(step, Step::GripDwell | Step::PlaceDwell | Step::Blow);
        if !dwells && step != Step::CheckReleased {
            assert_eq!(task.fault(), Some(Fault::Timeout { step }));
        }
    }
    let mut task = Task::new(TaskConfig { ready_timeout: 5 * MS, ..CONFIG });
    assert_eq!(task.poll_timeout(), Some(5 * MS));
    task.handle_timeout(5 * MS);
    assert_eq!(task.fault(), Some(Fault::Timeout { step: Step::AwaitDevices }));
    let mut task = task_at(Step::Placed);
    task.handle_event(ZERO, Event::Finish);
    poll(&mut task, ZERO);
    task.handle_timeout(CONFIG.order_timeout);
    assert_eq!(task.step(), Step::Finished, "also when nobody answers");
}

/// A valve that never answers does not keep the valves from being closed.
#[test]
fn after_a_timeout_the_valves_are_closed_all_the_same() {
    let mut task = task_at(Step::VacuumOn);
    assert_eq!(poll(&mut task, ZERO), [grip(VACUUM, true)]);
    task.handle_timeout(CONFIG.order_timeout);
    assert!(poll(&mut task, CONFIG.order_timeout).contains(&grip(VACUUM, false)));
}

#[test]
fn the_caller_aborts_from_any_step() {
    for step in Step::ALL {
        if matches!(
            step,
            Step::AwaitDevices | Step::NothingFound | Step::Unpicked | Step::Faulted | Step::Resetting
        ) || matches!(
            step,
            Step::DevicesReady | Step::CheckGrip | Step::GiveUp | Step::Closing | Step::Finished
        ) {
            continue;
        }
        let mut task = task_at(step);
        if task.step() != step {
            continue; // passed through at once
        }
        task.handle_event(ZERO, Event::Abort);
        assert_eq!((task.step(), task.fault()), (Step::Faulted, Some(Fault::Aborted)), "{step:?}");
        assert!(poll(&mut task, ZERO).contains(&STOP));
    }
    let mut task = Task::new(CONFIG);
    task.handle_event(ZERO, Event::Abort);
    assert_eq!((task.step(), task.fault()), (Step::AwaitDevices, None), "there is nothing to stop");
}

/// An end that is requested at once does not take the place of the stop: the connections close when nothing moves any more.
#[test]
fn what_was_aborted_is_at_rest_before_the_connections_close() {
    let mut task = task_at(Step::AwaitPlace);
    task.handle_event(ZERO, Event::Abort);
    task.handle_event(ZERO, Event::Finish);
    let stops = [STOP, Output::Platform(Command::Stop)];
    let given = poll(&mut task, ZERO);
    assert!(stops.iter().all(|stop| given.contains(stop)), "{given:?}");
    for device in [Device::Robot, Device::Platform, Device::Gripper] {
        task.handle_event(ZERO, Event::Done(device));
        poll(&mut task, ZERO);
        task.handle_event(ZERO, Event::Done(Device::Gripper));
    }
    task.handle_event(ZERO, progress(Device::Platform, Progress::Still));
    task.handle_event(ZERO, progress(Device::Robot, Progress::Stopping));
    assert_eq!((task.step(), poll(&mut task, ZERO)), (Step::Faulted, vec![]), "the robot still moves");
    assert_eq!(poll(&mut task, CONFIG.poll), [ASK_ROBOT]);
    task.handle_event(CONFIG.poll, progress(Device::Robot, Progress::Still));
    assert_eq!(task.step(), Step::Closing);
}

/// A device that is not there is not waited for, and one that has lost its motion is at rest.
#[test]
fn an_end_after_a_fault_waits_for_those_that_can_move() {
    let mut task = task_at(Step::AwaitPick);
    let lost = Event::Failed { device: Device::Platform, failure: Failure::Lost };
    task.handle_event(ZERO, lost);
    task.handle_event(ZERO, Event::Finish);
    for _ in 0..3 {
        poll(&mut task, ZERO);
        task.handle_event(ZERO, Event::Done(Device::Robot));
        task.handle_event(ZERO, Event::Done(Device::Gripper));
    }
    assert_eq!(task.step(), Step::Faulted);
    poll(&mut task, ZERO);
    task.handle_event(ZERO, progress(Device::Robot, Progress::Missed(MissReason::Elsewhere)));
    assert_eq!(task.step(), Step::Closing);
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
        1 => (device(), prop::sample::select(vec![Progress::Still, Progress::Arrived, Progress::Moving, Progress::Missed(MissReason::Elsewhere)]))
            .prop_map(|(device, motion)| Some(progress(device, motion))),
        1 => (device(), failures).prop_map(|(device, failure)| Some(Event::Failed { device, failure })),
        1 => prop::sample::select(vec![PART, SLOT, Event::NotFound, Event::Next, Event::Finish, Event::Recover, Event::Abort])
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
    /// For any events in any sequence: every step follows from the previous one by the table, no device has two
    /// orders at a time, no motion is ordered before the last one is known to have ended, and the vacuum is off
    /// before a new attempt.
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
                    prop_assert!(outstanding.iter().all(|(busy, _)| *busy != device), "{:?} after {:?}", output, outstanding);
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

/// No limits at all, at any time up to the end of the clock: nothing overflows, and nothing is overdue.
#[test]
fn the_longest_times_are_legal() {
    const MAX: Duration = Duration::MAX;
    let config = TaskConfig {
        poll: MAX,
        grip_dwell: MAX,
        place_dwell: MAX,
        blow: MAX,
        ready_timeout: MAX,
        order_timeout: MAX,
        motion_timeout: MAX,
        ..CONFIG
    };
    for now in [ZERO, MAX - MS, MAX] {
        let mut task = Task::new(config);
        ready(&mut task, now);
        let mut entered = 0;
        for _ in 0..40 {
            while let Some(output) = task.poll_output(now) {
                entered += u32::from(matches!(output, Output::Entered(_)));
                if let Some(event) = answer(output, &task) {
                    task.handle_event(now, event);
                }
            }
            task.handle_timeout(MAX);
            assert_eq!(task.fault(), None, "{:?} at {now:?}", task.step());
        }
        assert!(entered > 5, "{entered} steps at {now:?}");
    }
}

#[test]
fn a_fault_is_a_sentence() {
    let device = |device, failure| Fault::Device { device, failure }.to_string();
    assert_eq!(
        device(Device::Robot, Failure::Refused(ErrorCode::Generic)),
        "the robot has refused an order (generic error (1)): it may still be moving"
    );
    assert_eq!(
        device(Device::Platform, Failure::Missed(MissReason::ServoOff)),
        "the platform has not arrived: its servo motors are off"
    );
    assert_eq!(device(Device::Vision, Failure::Lost), "the vision system is not connected any more");
    let timeout = Fault::Timeout { step: Step::AwaitCamera1 };
    assert_eq!(timeout.to_string(), "the step `await camera 1` took too long");
}
