//! The central controller's end in a task of its own, over TCP.

#![allow(clippy::disallowed_methods, clippy::disallowed_types, reason = "the drivers take the time")]

use core::future::{pending, ready};
use core::net::SocketAddr;
use core::ops::ControlFlow;
use core::time::Duration;
use std::io;

use crate::common::{HOME, MS, pose};
use mmacell_proto::robot_session::tokio::{Dial, Driver, GIVE_UP_AFTER, Reconnect, Tcp};
use mmacell_proto::robot_session::{Session as _, now};
use mmacell_proto::tokio::{Device as Robot, Error, central};
use mmacell_proto::{
    CentralConfig, Command, Device, DeviceConfig, DeviceEvent, ErrorCode, MissReason, Order, Progress,
    RobotPose,
};
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::{TcpListener, TcpStream};
use tokio::time::{sleep, timeout};

const LONG: Duration = Duration::from_secs(20);

/// Serves a robot that takes 150 ms for a motion; a motion towards 13 mm stops half way, and one to 999 mm is refused.
async fn device(stream: TcpStream) {
    let mut device = Device::<RobotPose>::new(DeviceConfig::DEFAULT).unwrap();
    let mut driver = Driver::new(stream);
    let mut motion: Option<(Duration, RobotPose)> = None;
    device.set_pose(HOME);
    device.handle_connected(now());
    loop {
        if let Some((end, target)) = motion
            && end <= now()
        {
            motion = None;
            device.set_pose(if target == pose(13.0) { pose(6.0) } else { target });
            device.arrived();
        }
        let turn = driver.turn(&mut device, |device, event| {
            if let DeviceEvent::Asked { order } = event {
                match order {
                    Order::Move { target, .. } if target == pose(999.0) => {
                        device.refuse(order, ErrorCode::Servo1).unwrap();
                        return ControlFlow::Continue(());
                    }
                    Order::Move { target, .. } => motion = Some((now() + 150 * MS, target)),
                    Order::Stop => motion = None,
                    _ => {}
                }
                device.accept(order).unwrap();
            }
            ControlFlow::<()>::Continue(())
        });
        match timeout(5 * MS, turn).await {
            Ok(Ok(ControlFlow::Continue(()))) | Err(_) => {}
            Ok(_) => return,
        }
    }
}

async fn cell() -> (Robot<RobotPose>, TcpListener) {
    let listener = TcpListener::bind(SocketAddr::from(([127, 0, 0, 1], 0))).await.unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let (robot, task) = central(CentralConfig::DEFAULT, Tcp::new(address)).unwrap();
    tokio::spawn(task.reconnect(Reconnect { first: 5 * MS, longest: 50 * MS }).run());
    (robot, listener)
}

#[tokio::test]
async fn a_motion_is_waited_for_until_it_has_arrived() {
    let (robot, listener) = cell().await;
    tokio::spawn(async move { device(listener.accept().await.unwrap().0).await });
    robot.command(Command::Servo { on: true }).await.unwrap();
    let status = timeout(LONG, robot.move_to(pose(100.0))).await.unwrap().unwrap();
    assert_eq!((status.pose, status.moving, status.servo), (pose(100.0), false, true));
    let missed = timeout(LONG, robot.move_to(pose(13.0))).await.unwrap();
    assert!(matches!(missed, Err(Error::Missed(MissReason::Elsewhere))), "{missed:?}");
    let refused = timeout(LONG, robot.move_to(pose(999.0))).await.unwrap();
    assert!(matches!(refused, Err(Error::Refused(ErrorCode::Servo1))), "{refused:?}");
    // Others ask meanwhile, and one of them stops it.
    let moving = tokio::spawn({
        let robot = robot.clone();
        async move { robot.move_to(HOME).await }
    });
    sleep(60 * MS).await;
    let (_, progress) = robot.status().await.unwrap();
    assert!(matches!(progress, Progress::Moving | Progress::Starting), "{progress:?}");
    robot.command(Command::Stop).await.unwrap();
    let stopped = timeout(LONG, moving).await.unwrap().unwrap();
    assert!(matches!(stopped, Err(Error::Stopped)), "{stopped:?}");
}

#[tokio::test]
async fn a_device_that_goes_in_a_motion_is_found_again_and_nothing_is_said_to_have_arrived() {
    let (robot, listener) = cell().await;
    let first = tokio::spawn(async move {
        let running = tokio::spawn(device(listener.accept().await.unwrap().0));
        sleep(100 * MS).await;
        running.abort();
        listener
    });
    robot.command(Command::Servo { on: true }).await.unwrap();
    let lost = timeout(LONG, robot.move_to(pose(100.0))).await.unwrap();
    assert!(matches!(lost, Err(Error::Unknown(_))), "{lost:?}");
    let text = lost.unwrap_err().to_string();
    assert_eq!(text, "outcome of the command unknown: the connection ended: disconnected");
    let listener = first.await.unwrap();
    tokio::spawn(async move { device(listener.accept().await.unwrap().0).await });
    timeout(LONG, robot.handle().connected()).await.unwrap().unwrap();
    let (status, progress) = timeout(LONG, robot.status()).await.unwrap().unwrap();
    assert_eq!((status.pose, progress), (HOME, Progress::Still));
    robot.command(Command::Close).await.unwrap();
    robot.handle().shutdown().await;
    assert!(matches!(robot.status().await, Err(Error::Closed(_))));
}

/// Serves a device that receives these commands and sends these replies.
async fn script(listener: &TcpListener, commands: &[(&str, &str)]) -> TcpStream {
    let mut stream = listener.accept().await.unwrap().0;
    for (command, reply) in commands {
        let mut line = vec![0; command.len()];
        stream.read_exact(&mut line).await.unwrap();
        assert_eq!(line.escape_ascii().to_string(), command.as_bytes().escape_ascii().to_string());
        stream.write_all(reply.as_bytes()).await.unwrap();
    }
    stream
}

#[tokio::test]
async fn a_command_waits_for_the_reply_to_the_one_before_and_an_agreed_end_for_the_next_connection() {
    let (robot, listener) = cell().await;
    let commands = [("SRVON\r\n", "OK\r\n"), ("OVR+00050\r\n", "OK\r\n"), ("CLO\r\n", "OK\r\n")];
    let asked = async {
        tokio::join!(
            robot.command(Command::Servo { on: true }),
            robot.command(Command::Override { percent: 50 }),
            robot.command(Command::Close),
            script(&listener, &commands),
        )
    };
    let (servo, percent, close, _open) = timeout(LONG, asked).await.unwrap();
    assert!(servo.is_ok() && percent.is_ok() && close.is_ok(), "{servo:?} {percent:?} {close:?}");
    // The device has not closed it.
    timeout(LONG, listener.accept()).await.unwrap().unwrap();
}

#[tokio::test]
async fn a_device_that_refuses_its_status_in_a_motion_is_asked_again() {
    let (robot, listener) = cell().await;
    let there = "OKF+100.000+000.000+000.000+00.0000T+00100+00000\r\n";
    let commands = [
        ("MOVA+100.000+000.000+000.000+00.0000\r\n", "OK\r\n"),
        ("STA\r\n", "ER+00001\r\n"),
        ("STA\r\n", there),
    ];
    let moving = async { tokio::join!(robot.move_to(pose(100.0)), script(&listener, &commands)) };
    let (arrived, _open) = timeout(LONG, moving).await.unwrap();
    assert_eq!(arrived.unwrap().pose, pose(100.0));
}

#[tokio::test]
async fn without_a_connection_nothing_is_sent() {
    let listener = TcpListener::bind(SocketAddr::from(([127, 0, 0, 1], 0))).await.unwrap();
    let to = Tcp::new(listener.local_addr().unwrap().to_string());
    drop(listener);
    let (robot, task) = central::<RobotPose, _>(CentralConfig::DEFAULT, to).unwrap();
    tokio::spawn(task.run());
    let refused = timeout(LONG, robot.command(Command::Stop)).await.unwrap();
    assert!(matches!(refused, Err(Error::NotConnected(_))), "{refused:?}");
}

#[tokio::test(start_paused = true)]
async fn without_a_motion_nothing_is_due() {
    let (near, _far) = tokio::io::duplex(64);
    let mut near = Some(near);
    let dial = Dial(move || ready(near.take().ok_or_else(|| io::ErrorKind::ConnectionRefused.into())));
    let (robot, task) = central::<RobotPose, _>(CentralConfig::DEFAULT, dial).unwrap();
    tokio::spawn(task.run());
    robot.handle().connected().await.unwrap();
    let runtime = tokio::runtime::Handle::current().metrics();
    let before = runtime.worker_park_count(0);
    sleep(Duration::from_secs(10)).await;
    let parked = runtime.worker_park_count(0) - before;
    assert!(parked < 10, "the task was woken {parked} times");
}

/// A peer, by its treatment of a connection.
#[derive(Debug, Clone, Copy)]
enum Peer {
    Closes,
    Silent,
    /// No attempt to connect ends.
    Absent,
}

#[tokio::test(start_paused = true)]
async fn every_command_ends_whatever_the_device_does() {
    const HOUR: Duration = Duration::from_secs(3600);
    for peer in [Peer::Closes, Peer::Silent, Peer::Absent] {
        let mut open = Vec::new();
        let dial = Dial(move || {
            let (near, far) = tokio::io::duplex(4096);
            match peer {
                Peer::Closes => drop(far),
                Peer::Silent | Peer::Absent => open.push(far),
            }
            async move {
                if matches!(peer, Peer::Absent) {
                    pending::<()>().await;
                }
                Ok(near)
            }
        });
        let (robot, task) = central::<RobotPose, _>(CentralConfig::DEFAULT, dial).unwrap();
        tokio::spawn(task.run());
        let begun = tokio::time::Instant::now();
        let calls =
            async { tokio::join!(robot.status(), robot.command(Command::Stop), robot.move_to(pose(1.0))) };
        let (status, stop, motion) = timeout(HOUR, calls).await.expect("outcomes");
        for error in [status.map(drop).unwrap_err(), stop.unwrap_err(), motion.map(drop).unwrap_err()] {
            let is_absent = matches!(error, Error::NotConnected(_));
            assert!(is_absent || matches!(error, Error::Unknown(_) | Error::NotSent(_)), "{peer:?}: {error}");
            assert_eq!(is_absent, matches!(peer, Peer::Absent), "{peer:?}: {error}");
        }
        assert!(begun.elapsed() < GIVE_UP_AFTER + LONG, "{peer:?}: {:?}", begun.elapsed());
        let begun = tokio::time::Instant::now();
        timeout(HOUR, robot.handle().shutdown_after(HOUR)).await.unwrap();
        assert!(begun.elapsed() < MS);
    }
}

#[tokio::test(start_paused = true)]
async fn a_motion_of_which_nothing_is_reported_ends() {
    let (near, mut far) = tokio::io::duplex(4096);
    let mut near = Some(near);
    let dial = Dial(move || ready(near.take().ok_or_else(|| io::ErrorKind::ConnectionRefused.into())));
    let (robot, task) = central::<RobotPose, _>(CentralConfig::DEFAULT, dial).unwrap();
    tokio::spawn(task.run());
    // It reports that it moves for a minute, and then no status any more.
    let moving_until = tokio::time::Instant::now() + Duration::from_secs(60);
    tokio::spawn(async move {
        let mut command = [0; 64];
        while let Ok(length @ 1..) = far.read(&mut command).await {
            let reply = if command[..length].starts_with(b"MOV") {
                "OK\r\n"
            } else if tokio::time::Instant::now() < moving_until {
                "OKT+100.000+000.000+000.000+00.0000T+00100+00000\r\n"
            } else {
                "ER+00001\r\n"
            };
            far.write_all(reply.as_bytes()).await.unwrap();
        }
    });
    let motion = timeout(10 * LONG, robot.move_to(pose(1.0))).await.expect("an outcome");
    assert!(matches!(motion, Err(Error::Unreported(ErrorCode::Generic))), "{motion:?}");
    let silent = moving_until.elapsed();
    assert!((GIVE_UP_AFTER - 100 * MS..GIVE_UP_AFTER + 200 * MS).contains(&silent), "{silent:?}");
}
