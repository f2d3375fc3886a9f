//! The computer that polls the ball in a task of its own, over TCP.

#![allow(clippy::disallowed_methods, clippy::disallowed_types, reason = "the drivers take the time")]

use core::net::SocketAddr;
use core::ops::ControlFlow;
use core::time::Duration;

use isra_ball::robot_session::tokio::{Driver, Reconnect, Tcp};
use isra_ball::robot_session::{Session as _, now};
use isra_ball::tokio::host;
use isra_ball::{Ball, BallConfig, HostConfig, HostEvent, Keys};
use tokio::net::{TcpListener, TcpStream};
use tokio::time::{sleep, timeout};

const LONG: Duration = Duration::from_secs(20);
/// Returns the configuration of a line without delay: TCP.
fn fast() -> HostConfig {
    HostConfig { baud: u32::MAX, ..HostConfig::default() }
}

const MS: Duration = Duration::from_millis(1);

/// Serves a ball that always measures the same.
async fn measuring(stream: TcpStream, x: i8) {
    let mut driver = Driver::new(stream);
    let mut session = Ball::new(BallConfig::default()).unwrap();
    session.handle_connected(now());
    loop {
        session.measure([x, 0, 0], [0; 3], Keys::NONE);
        let turn = driver.turn(&mut session, |_, _| ControlFlow::<()>::Continue(()));
        if let Ok(turn) = timeout(5 * MS, turn).await
            && !matches!(turn, Ok(ControlFlow::Continue(())))
        {
            return;
        }
    }
}

#[tokio::test]
async fn values_are_the_latest_until_the_ball_is_gone_and_come_back_with_it() {
    let listener = TcpListener::bind(SocketAddr::from(([127, 0, 0, 1], 0))).await.unwrap();
    let (mut ball, task) = host(fast(), Tcp::new(listener.local_addr().unwrap().to_string())).unwrap();
    let reconnect = Reconnect { first: 5 * MS, longest: 50 * MS };
    let task = tokio::spawn(task.reconnect(reconnect).run());
    let mut events = ball.handle.events();
    for x in [7, 9] {
        let serving = tokio::spawn(measuring(listener.accept().await.unwrap().0, x));
        let values = timeout(LONG, ball.values.next()).await.unwrap().unwrap();
        assert_eq!(values.unwrap().force, [x, 0, 0]);
        assert_eq!(ball.values.get().unwrap().force, [x, 0, 0]);
        serving.abort();
        while timeout(LONG, ball.values.next()).await.unwrap().unwrap().is_some() {}
        assert_eq!(ball.values.get(), None);
    }
    let mut stale = 0;
    while let Ok(event) = events.try_recv() {
        stale += u32::from(event == HostEvent::Stale);
    }
    assert_eq!(stale, 2);
    drop(events);
    ball.handle.shutdown().await;
    task.await.unwrap();
    assert!(ball.values.next().await.is_err());
}

/// Values become too old even if nothing reports it.
#[tokio::test]
async fn values_of_a_task_that_stands_still_are_too_old() {
    let listener = TcpListener::bind(SocketAddr::from(([127, 0, 0, 1], 0))).await.unwrap();
    let (mut ball, task) = host(fast(), Tcp::new(listener.local_addr().unwrap().to_string())).unwrap();
    let thread = task.thread().unwrap();
    let (stream, _) = listener.accept().await.unwrap();
    tokio::spawn(measuring(stream, 1));
    assert!(timeout(LONG, ball.values.next()).await.unwrap().unwrap().is_some());
    let latest = ball.values.clone();
    ball.handle.shutdown().await;
    drop(thread.join().unwrap());
    sleep(2 * fast().max_age).await;
    assert_eq!(latest.get(), None);
}
