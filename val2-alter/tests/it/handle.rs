//! The host in a task of its own, over TCP.

#![allow(clippy::disallowed_methods, clippy::disallowed_types, reason = "the drivers take the time")]

use core::net::SocketAddr;
use core::ops::ControlFlow;
use core::time::Duration;
use std::sync::{Arc, Mutex};
use std::thread;

use tokio::net::{TcpListener, TcpStream};
use tokio::time::{sleep, timeout};
use val2_alter::robot_session::tokio::{Driver, Reconnect, Tcp};
use val2_alter::robot_session::{Session as _, now};
use val2_alter::tokio::{Arm, Error, host};
use val2_alter::{
    Controller, ControllerConfig, ControllerEvent, ControllerState, Exception, HostConfig, Reach,
    SessionError,
};

const LONG: Duration = Duration::from_secs(30);
/// A line that takes no time: TCP.
const FAST: u32 = u32::MAX;
const MS: Duration = Duration::from_millis(1);

/// Where the arm is by the values that its controller has taken, and the furthest that it was.
type Path = Arc<Mutex<([i32; 6], [i32; 6])>>;

/// A controller that executes ALTER again whenever it has ended.
async fn controller(stream: TcpStream, path: Path) {
    let mut session =
        Controller::new(ControllerConfig { baud: FAST, ..ControllerConfig::default() }).unwrap();
    let mut driver = Driver::new(stream);
    session.handle_connected(now());
    loop {
        if session.state() == ControllerState::Off {
            session.start(now()).unwrap();
        }
        let turn = driver.turn(&mut session, |_, event| {
            if let ControllerEvent::Reply { values, .. } = event {
                let (at, most) = &mut *path.lock().unwrap();
                for axis in 0..6 {
                    at[axis] += i32::from(values[axis]);
                    most[axis] = most[axis].max(at[axis].abs());
                }
            }
            ControlFlow::<()>::Continue(())
        });
        if !matches!(timeout(100 * MS, turn).await, Ok(Ok(ControlFlow::Continue(()))) | Err(_)) {
            return;
        }
    }
}

/// Both ends in threads of their own, as a reply is due within 15 ms.
async fn cell(reach: Option<Reach>) -> (Arm, Path) {
    let listener = TcpListener::bind(SocketAddr::from(([127, 0, 0, 1], 0))).await.unwrap();
    let to = Tcp::new(listener.local_addr().unwrap().to_string());
    let (arm, task) = host(HostConfig { baud: FAST, ..HostConfig::default() }, reach, to).unwrap();
    drop(task.reconnect(Reconnect { first: 5 * MS, longest: 50 * MS }).thread().unwrap());
    let path = Path::default();
    let stream = listener.accept().await.unwrap().0.into_std().unwrap();
    let moved = Arc::clone(&path);
    thread::spawn(move || {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
        runtime.block_on(async { controller(TcpStream::from_std(stream).unwrap(), moved).await });
    });
    (arm, path)
}

#[tokio::test]
async fn a_target_from_anywhere_stays_within_reach_and_a_stop_is_waited_for() {
    let reach = Reach { low: [-150, 0, 0, 0, 0, 0], high: [200, 0, 0, 0, 0, 0] };
    let (arm, path) = cell(Some(reach)).await;
    for (speed, end) in [(60, 200), (-60, -150)] {
        let moving = {
            let arm = arm.clone();
            thread::spawn(move || {
                for _ in 0..600 {
                    arm.set_target([speed, 60, 0, 0, 0, 0]);
                    if arm.commanded()[0] == end {
                        return;
                    }
                    thread::sleep(20 * MS);
                }
            })
        };
        tokio::task::spawn_blocking(move || moving.join().unwrap()).await.unwrap();
        assert_eq!(arm.commanded(), [end, 0, 0, 0, 0, 0], "{path:?}");
    }
    let most = path.lock().unwrap().1;
    assert!((1..=350).contains(&most[0]) && most[1] == 0, "{most:?}");
    arm.set_target([30, 0, 0, 0, 0, 0]);
    sleep(100 * MS).await;
    timeout(LONG, arm.stop()).await.unwrap().unwrap();
    let stopped = arm.commanded();
    arm.set_target([30, 0, 0, 0, 0, 0]);
    sleep(200 * MS).await;
    assert_eq!(arm.commanded(), stopped);
    arm.accept().await.unwrap();
    let refused = arm.exception(Exception::from(5)).await;
    assert!(matches!(refused, Err(Error::Call(SessionError::NoSubroutine))), "{refused:?}");
    arm.handle().shutdown().await;
    assert!(matches!(arm.stop().await, Err(Error::Closed(_))));
}

/// A target is as old as its caller lets it become, also where nobody has said that it ends.
#[tokio::test]
async fn a_target_that_nobody_renews_ends() {
    let (arm, _path) = cell(None).await;
    while arm.commanded()[0] == 0 {
        arm.set_target([9, 0, 0, 0, 0, 0]);
        sleep(10 * MS).await;
    }
    sleep(HostConfig::default().target_timeout + 150 * MS).await;
    let at = arm.commanded();
    sleep(300 * MS).await;
    assert_eq!(arm.commanded(), at);
}
