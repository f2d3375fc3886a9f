//! The robot in a task of its own, against a PC in a task of its own, over TCP.

#![allow(clippy::disallowed_methods, clippy::disallowed_types, reason = "the drivers take the time")]

use core::net::SocketAddr;
use core::sync::atomic::{AtomicU32, Ordering};
use core::time::Duration;
use std::sync::Arc;

use kawasaki_msg::robot_session::tokio::{Link, Listen, Reconnect, Tcp};
use kawasaki_msg::tokio::{Motion, OrderResult, Pc, Robot, RobotError, pc, robot};
use kawasaki_msg::{JobKind, Line, PcConfig, Point, RobotConfig, RobotEvent, SessionError};
use tokio::io::copy_bidirectional;
use tokio::net::{TcpListener, TcpStream};
use tokio::task::JoinHandle;
use tokio::time::{sleep, timeout};

const LONG: Duration = Duration::from_secs(60);
const MS: Duration = Duration::from_millis(1);

fn jobs(count: i32) -> Vec<Line> {
    (0..count)
        .map(|n| Line { kind: JobKind::Draw, start: Point::new(n, 0), end: Point::new(n + 1, 0) })
        .collect()
}

async fn a_pc() -> (Pc<Line, ()>, SocketAddr) {
    let listen = Listen::bind("127.0.0.1:0").await.unwrap();
    let address = listen.address().unwrap();
    let (pc, task) = pc(PcConfig::tcp(), (), listen).unwrap();
    tokio::spawn(task.run());
    (pc, address)
}

fn a_robot(address: SocketAddr) -> (Robot<Line>, Motion<Line>) {
    let connector = Tcp::new(address.to_string());
    let (robot, motion, task) = robot(RobotConfig::tcp(), Default::default(), 64, connector).unwrap();
    let soon = Reconnect { first: MS, longest: 20 * MS };
    tokio::spawn(task.reconnect(soon).run());
    (robot, motion)
}

/// Starts a motion task that takes this time for each job; returns the executed jobs when its robot is gone.
fn working(mut motion: Motion<Line>, time: Duration) -> JoinHandle<Vec<Line>> {
    tokio::spawn(async move {
        let mut executed = Vec::new();
        while motion.wait().await {
            while let Some(job) = motion.take() {
                if !time.is_zero() {
                    sleep(time).await;
                }
                executed.push(job.complete().work);
            }
        }
        executed
    })
}

#[tokio::test]
async fn an_order_is_executed_and_the_task_ends() {
    let (pc, address) = a_pc().await;
    let (robot, motion) = a_robot(address);
    let executed = working(motion, Duration::ZERO);
    let over = timeout(LONG, pc.run(50, jobs(300))).await.unwrap().unwrap();
    assert_eq!(over, OrderResult { executed: 300, complete: true, unfit: None });
    robot.handle().shutdown().await;
    assert_eq!(timeout(LONG, executed).await.unwrap().unwrap(), jobs(300));
    assert!(matches!(robot.clear_queue().await, Err(RobotError::Closed(_))));
}

/// The connection is cut again and again, wherever it is.
#[tokio::test]
async fn every_job_is_executed_once_however_often_the_connection_is_cut() {
    let (pc, address) = a_pc().await;
    let between = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let (at, cuts) = (between.local_addr().unwrap(), Arc::new(AtomicU32::new(0)));
    let count = Arc::clone(&cuts);
    tokio::spawn(async move {
        loop {
            let (mut robot, _) = between.accept().await.unwrap();
            let Ok(mut pc) = TcpStream::connect(address).await else { continue };
            let cut = count.fetch_add(1, Ordering::Relaxed) + 3;
            let _ = timeout(cut * 9 * MS, copy_bidirectional(&mut robot, &mut pc)).await;
        }
    });
    let (robot, motion) = a_robot(at);
    let executed = working(motion, Duration::ZERO);
    let over = timeout(LONG, pc.run(50, jobs(1500))).await.unwrap().unwrap();
    assert_eq!(over, OrderResult { executed: 1500, complete: true, unfit: None });
    assert!(cuts.load(Ordering::Relaxed) > 5, "{cuts:?}");
    robot.handle().shutdown().await;
    assert_eq!(timeout(LONG, executed).await.unwrap().unwrap(), jobs(1500));
}

/// The operator resets a robot whose PC is gone: it need not come back for that.
#[tokio::test]
async fn a_robot_is_reset_without_a_pc() {
    let (pc, address) = a_pc().await;
    let (robot, motion) = a_robot(address);
    let mut events = robot.handle().events();
    let idle = robot.reset_order().await;
    assert_eq!(idle, Err(RobotError::Call(SessionError::NoOrder)));
    let executed = working(motion, 100 * MS);
    let mut order = pc.start(50, jobs(1000)).await.unwrap();
    while timeout(LONG, order.progress()).await.unwrap().unwrap().executed < 3 {}
    pc.handle().shutdown().await;
    drop(pc);
    let mut link = robot.handle().link();
    link.wait_for(|link| matches!(link, Link::Failed(_))).await.unwrap();
    // Long after the robot's own deadlines: the queue alone wakes it.
    sleep(1500 * MS).await;
    robot.reset_order().await.unwrap();
    let over = timeout(LONG, async {
        loop {
            if let RobotEvent::OrderOver { order, executed } = events.recv().await.unwrap() {
                break (order, executed);
            }
        }
    });
    let (order, count) = over.await.expect("the queue has settled, and nobody else says so");
    robot.handle().shutdown().await;
    assert_eq!((order, executed.await.unwrap()), (50, jobs(count.try_into().unwrap())));
}

#[tokio::test]
async fn a_queue_is_refused_that_cannot_be() {
    let connector = Tcp::new("127.0.0.1:1");
    let refused = robot::<Line, _>(RobotConfig::tcp(), Default::default(), 0, connector).unwrap_err();
    assert_eq!(refused.to_string(), "a queue of 0 jobs does not match job numbers up to 9999");
}
