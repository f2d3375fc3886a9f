//! One program per end: it does the work of a board, and prints the bytes of RAM that it needs. Its code is exactly the code
//! that the end links.
#![allow(unused_imports, unused_macros, reason = "a program uses what it needs")]

use core::hint::black_box;
use core::time::Duration;

use no_std::{print_size, run};
use robot_session::Session;

/// A session that may not be made, how many bytes it may send, and a call of the user's.
macro_rules! run {
    ($session:expr, $room:expr, $call:expr) => {{
        let Ok(mut session) = $session else { return 1 };
        run(&mut session, &mut [0; $room], $call)
    }};
}

program!("none", { print_size(&()) });

program!("fanuc-hmi-modbus-client-rtu", {
    use fanuc_hmi_modbus::{Client, ClientConfig, TelemetryBlock};
    run!(Client::<1>::new(ClientConfig::rtu(19_200)), Client::<1>::MAX_TRANSMIT, |client, _| {
        client.request(1, &TelemetryBlock::request())
    })
});

program!("fanuc-hmi-modbus-client-tcp", {
    use fanuc_hmi_modbus::{Client, ClientConfig, TelemetryBlock};
    run!(Client::<1>::new(ClientConfig::tcp()), Client::<1>::MAX_TRANSMIT, |client, _| {
        client.request(1, &TelemetryBlock::request())
    })
});

#[cfg(any(program = "fanuc-hmi-modbus-server-rtu", program = "fanuc-hmi-modbus-server-tcp"))]
struct Board;

#[cfg(any(program = "fanuc-hmi-modbus-server-rtu", program = "fanuc-hmi-modbus-server-tcp"))]
impl fanuc_hmi_modbus::Registers for Board {
    fn read_holding_registers(
        &mut self,
        _: u16,
        out: &mut fanuc_hmi_modbus::WordsMut<'_>,
    ) -> Result<(), fanuc_hmi_modbus::Exception> {
        out.copy_from(&black_box([1; 37]));
        Ok(())
    }
}

program!("fanuc-hmi-modbus-server-rtu", {
    use fanuc_hmi_modbus::{Server, ServerConfig};
    run!(
        Server::<_, 1>::new(ServerConfig::rtu(1, 19_200), Board),
        Server::<Board, 1>::MAX_TRANSMIT,
        |_, _| {}
    )
});

program!("fanuc-hmi-modbus-server-tcp", {
    use fanuc_hmi_modbus::{Server, ServerConfig};
    run!(
        Server::<_, 1>::new(ServerConfig::tcp(), Board),
        Server::<Board, 1>::MAX_TRANSMIT,
        |_, _| {}
    )
});

program!("isra-ball-ball", {
    use isra_ball::{Ball, BallConfig, Keys};
    run!(Ball::new(BallConfig::default()), Ball::MAX_TRANSMIT, |ball, _| {
        ball.measure(black_box([1; 3]), black_box([1; 3]), Keys::NONE)
    })
});

program!("isra-ball-host", {
    use isra_ball::{Host, HostConfig};
    run!(Host::new(HostConfig::default()), Host::MAX_TRANSMIT, |host, _| host.live_until())
});

program!("kawasaki-msg-pc", {
    use kawasaki_msg::{JobKind, Line, Pc, PcConfig, Point};
    const LINES: [Line; 1] = [Line { kind: JobKind::Draw, start: Point::new(0, 0), end: Point::new(1, 0) }];
    run!(Pc::new(PcConfig::tcp()), 4096, |pc, _| pc.start(50, &LINES[..]))
});

// With a queue of 64 lines.
program!("kawasaki-msg-robot", {
    use kawasaki_msg::{Line, Robot, RobotConfig, motion::JobQueue};
    let Ok(mut queue) = JobQueue::<Line, 64>::new(9999) else { return 1 };
    let (jobs, mut motion) = queue.split();
    run!(Robot::new(RobotConfig::tcp(), jobs), 4096, |_, _| {
        if let Some(job) = motion.take() {
            job.complete();
        }
    })
});

// With a queue of seven cuts.
program!("laser-eb90-controller", {
    use laser_eb90::{Controller, ControllerConfig, Instruction, Item};
    struct Cut([f32; 2]);
    impl TryFrom<Instruction<'_>> for Cut {
        type Error = ();
        fn try_from(mut instruction: Instruction<'_>) -> Result<Self, ()> {
            match instruction.parameters.next() {
                Some(Ok(Item::F32(values))) => values.array().map(Self).ok_or(()),
                _ => Err(()),
            }
        }
    }
    let Ok(mut queue) = robot_work_queue::WorkQueue::<Cut, 7>::new(9999) else { return 1 };
    let (writer, mut reader) = queue.split();
    run!(Controller::new(ControllerConfig::default(), writer), Controller::<Cut>::MAX_TRANSMIT, |_, _| {
        if let Some(job) = reader.take() {
            black_box(job.0);
            job.complete();
        }
    })
});

program!("laser-eb90-host", {
    use laser_eb90::{Host, HostConfig};
    run!(Host::new(HostConfig::default()), Host::MAX_TRANSMIT, |host, _| {
        host.submit(0x0101, |parameters| parameters.f32(&black_box([1.0, 2.0])).map(drop))
    })
});

program!("mmacell-proto-central", {
    use mmacell_proto::{Central, CentralConfig, Command, RobotPose};
    run!(
        Central::<RobotPose>::new(CentralConfig::DEFAULT),
        Central::<RobotPose>::MAX_TRANSMIT,
        |central, _| central.request(Command::Status)
    )
});

program!("mmacell-proto-device", {
    use mmacell_proto::{Device, DeviceConfig, RobotPose};
    run!(Device::<RobotPose>::new(DeviceConfig::DEFAULT), Device::<RobotPose>::MAX_TRANSMIT, |device, _| {
        device.set_pose(RobotPose::from_units(black_box([1; 4])))
    })
});

// Without the sessions that carry its orders.
program!("mmacell-task-task", {
    use mmacell_task::{Device, Event, Task, TaskConfig};
    let now = black_box(Duration::ZERO);
    let mut task = Task::new(TaskConfig::DEFAULT);
    task.handle_event(now, black_box(Event::Ready(Device::Robot)));
    task.handle_timeout(now);
    black_box(task.poll_output(now));
    black_box((task.poll_timeout(), task.step(), task.fault()));
    print_size(&task)
});

// The buffer of a stream's decoder.
program!("robot-session-buffer", {
    let mut buffer = robot_session::end::StreamBuffer::<256>::new();
    let used = black_box(&mut buffer);
    black_box(used.push(black_box(&[])));
    black_box(used.bytes());
    black_box(used.take(1));
    used.clear();
    print_size(&buffer)
});

// A queue of events.
program!("robot-session-queue", {
    let mut queue = robot_session::end::EventQueue::<u64, 16>::new();
    let used = black_box(&mut queue);
    let _ = black_box(used.push_outcome(1));
    used.push_notice(2);
    black_box(used.has_room(1));
    black_box(used.pop());
    print_size(&queue)
});

program!("val2-alter-controller", {
    use val2_alter::{Controller, ControllerConfig};
    run!(Controller::new(ControllerConfig::default()), Controller::MAX_TRANSMIT, |controller, now| controller
        .start(now))
});

program!("val2-alter-host", {
    use val2_alter::{Host, HostConfig};
    run!(Host::new(HostConfig::default()), Host::MAX_TRANSMIT, |host, now| {
        host.set_target(now, black_box([1; 6]))
    })
});

program!("val2-viewer-host", {
    use val2_viewer::{Host, HostConfig};
    run!(Host::new(HostConfig::default()), Host::MAX_TRANSMIT, |host, now| {
        host.set_pose(now, black_box([1; 12]))
    })
});

program!("val2-viewer-workstation", {
    use val2_viewer::{Workstation, WorkstationConfig};
    run!(Workstation::new(WorkstationConfig::default()), Workstation::MAX_TRANSMIT, |workstation, now| {
        workstation.draw(now)
    })
});
