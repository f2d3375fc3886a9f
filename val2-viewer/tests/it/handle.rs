//! Both ends in a task of their own, over TCP.

#![allow(clippy::disallowed_methods, clippy::disallowed_types, reason = "the drivers take the time")]

use core::net::SocketAddr;
use core::ops::ControlFlow;
use core::sync::atomic::{AtomicBool, Ordering};
use core::time::Duration;
use std::io;
use std::sync::Arc;

use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _, DuplexStream};
use tokio::net::{TcpListener, TcpStream};
use tokio::time::{advance, sleep, timeout};
use val2_viewer::robot_session::tokio::{Dial, Driver, Link, Reconnect, Tcp};
use val2_viewer::robot_session::{Session as _, now};
use val2_viewer::tokio::{Error, Screen, host, workstation};
use val2_viewer::{ENQ, Host, HostConfig, HostEvent, WorkstationConfig};

const LONG: Duration = Duration::from_secs(20);
const MS: Duration = Duration::from_millis(1);

/// Serves a host whose arm always has the same pose.
async fn posing(stream: TcpStream, x: i16) {
    let mut driver = Driver::new(stream);
    let mut session = Host::new(HostConfig::default()).unwrap();
    session.handle_connected(now());
    loop {
        session.set_pose(now(), [x; 12]);
        let turn = driver.turn(&mut session, |_, _: HostEvent| ControlFlow::<()>::Continue(()));
        if let Ok(turn) = timeout(50 * MS, turn).await
            && !matches!(turn, Ok(ControlFlow::Continue(())))
        {
            return;
        }
    }
}

#[tokio::test]
async fn the_pose_is_the_latest_until_the_host_is_gone_and_comes_back_with_it() {
    let listener = TcpListener::bind(SocketAddr::from(([127, 0, 0, 1], 0))).await.unwrap();
    let to = Tcp::new(listener.local_addr().unwrap().to_string());
    let (mut arm, task) = workstation(WorkstationConfig::default(), to).unwrap();
    tokio::spawn(task.reconnect(Reconnect { first: 5 * MS, longest: 50 * MS }).run());
    for x in [7, 9] {
        let serving = tokio::spawn(posing(listener.accept().await.unwrap().0, x));
        let pose = timeout(LONG, arm.pose.next()).await.unwrap().unwrap();
        assert_eq!(pose.unwrap().pose, [x; 12]);
        assert!(arm.pause(true));
        sleep(500 * MS).await;
        let before = arm.handle.events();
        sleep(500 * MS).await;
        assert_eq!(before.len(), 0, "nothing is asked for while the display is paused");
        assert!(arm.pause(false));
        serving.abort();
        while timeout(LONG, arm.pose.next()).await.unwrap().unwrap().is_some() {}
        assert_eq!(arm.pose.get(), None);
    }
}

#[tokio::test]
async fn a_pause_without_a_connection_holds_when_there_is_one() {
    let listener = TcpListener::bind(SocketAddr::from(([127, 0, 0, 1], 0))).await.unwrap();
    let address = listener.local_addr().unwrap();
    let is_open = Arc::new(AtomicBool::new(false));
    let opens = Arc::clone(&is_open);
    let dial = Dial(move || {
        let is_open = opens.load(Ordering::Relaxed);
        async move {
            if is_open {
                TcpStream::connect(address).await
            } else {
                Err(io::ErrorKind::ConnectionRefused.into())
            }
        }
    });
    let (arm, task) = workstation(WorkstationConfig::default(), dial).unwrap();
    assert!(arm.pause(true));
    tokio::spawn(task.reconnect(Reconnect { first: 5 * MS, longest: 50 * MS }).run());
    let mut link = arm.handle.link();
    timeout(LONG, link.wait_for(|link| matches!(link, Link::Failed(_)))).await.unwrap().unwrap();
    is_open.store(true, Ordering::Relaxed);
    let stream = timeout(LONG, listener.accept()).await.unwrap().unwrap().0;
    let mut asked = [0; 2];
    sleep(500 * MS).await;
    let nothing = stream.try_read(&mut asked).map_err(|error| error.kind());
    assert_eq!(nothing, Err(io::ErrorKind::WouldBlock), "two display cycles without a request");
    assert!(arm.pause(false));
    let reading = async {
        loop {
            stream.readable().await.unwrap();
            if let Ok(length) = stream.try_read(&mut asked) {
                return length;
            }
        }
    };
    assert_eq!((timeout(LONG, reading).await.unwrap(), asked[0]), (1, ENQ));
}

#[tokio::test]
async fn a_task_that_has_ended_or_is_not_run_any_more_has_no_pose() {
    let listener = TcpListener::bind(SocketAddr::from(([127, 0, 0, 1], 0))).await.unwrap();
    let to = listener.local_addr().unwrap().to_string();
    let config = WorkstationConfig::default();
    let (mut arm, task) = workstation(config, Tcp::new(to.clone())).unwrap();
    let mut running = Box::pin(task.run());
    let serving = async {
        let host = tokio::spawn(posing(listener.accept().await.unwrap().0, 7));
        assert!(timeout(LONG, arm.pose.next()).await.unwrap().unwrap().is_some());
        host.abort_handle()
    };
    let host = tokio::select! {
        host = serving => host,
        _ = &mut running => panic!("it runs on"),
    };
    assert!(arm.pose.get().is_some());
    sleep(config.stale_after).await;
    assert_eq!(arm.pose.get(), None, "the task is not polled any more");
    drop(running);
    host.abort();

    let (mut arm, task) = workstation(config, Tcp::new(to)).unwrap();
    let task = tokio::spawn(task.run());
    tokio::spawn(posing(listener.accept().await.unwrap().0, 7));
    while timeout(LONG, arm.pose.next()).await.unwrap().unwrap().is_none() {}
    task.abort();
    assert!(task.await.is_err());
    assert_eq!(arm.pose.get(), None);
    assert!(matches!(&*arm.handle.link().borrow(), Link::Ended));
    timeout(LONG, async { while arm.pose.next().await.is_ok() {} }).await.unwrap();
}

#[tokio::test]
async fn a_pose_is_shown_when_the_workstation_asks_for_it_and_too_old_otherwise() {
    let listener = TcpListener::bind(SocketAddr::from(([127, 0, 0, 1], 0))).await.unwrap();
    let to = Tcp::new(listener.local_addr().unwrap().to_string());
    let config = HostConfig { max_age: 300 * MS, ..HostConfig::default() };
    let (screen, task) = host(config, to).unwrap();
    tokio::spawn(task.run());
    let (mut workstation, _) = listener.accept().await.unwrap();
    screen.handle().connected().await.unwrap();
    let why = timeout(LONG, screen.show([7; 12])).await.unwrap().unwrap_err();
    assert!(matches!(why, Error::Stale), "{why:?}");
    let (first, second, ()) = tokio::join!(screen.show([8; 12]), screen.show([9; 12]), async {
        sleep(10 * MS).await;
        workstation.write_all(&[ENQ]).await.unwrap();
    });
    assert!(matches!(first, Err(Error::Replaced)), "{first:?}");
    assert_eq!(second.unwrap().pose, [9; 12]);
    drop((listener, workstation));
    let why = timeout(LONG, screen.show([7; 12])).await.unwrap().unwrap_err();
    assert!(matches!(why, Error::NotConnected(_) | Error::Stale), "{why:?}");
    screen.handle().shutdown().await;
    assert!(matches!(screen.show([7; 12]).await, Err(Error::Closed(_))));
}

/// A screen whose line takes one byte at a time, and that end of the line.
async fn on_a_narrow_line(config: HostConfig) -> (Screen, DuplexStream) {
    let (mut near, far) = tokio::io::duplex(1);
    near.write_all(&[0]).await.unwrap();
    let mut near = Some(near);
    let dial = Dial(move || core::future::ready(near.take().ok_or(io::ErrorKind::NotConnected.into())));
    let (screen, task) = host(config, dial).unwrap();
    tokio::spawn(task.run());
    screen.handle().connected().await.unwrap();
    (screen, far)
}

/// The task has no time to end a pose before the next one is set.
#[tokio::test(start_paused = true)]
async fn a_pose_that_is_too_old_does_not_end_the_next_one() {
    let config = HostConfig::default();
    let (screen, mut workstation) = on_a_narrow_line(config).await;
    let (old, new) = tokio::join!(screen.show([8; 12]), async {
        sleep(MS).await;
        let (_, new, ()) = tokio::join!(advance(config.max_age), screen.show([9; 12]), async {
            workstation.read_u8().await.unwrap();
            workstation.write_all(&[ENQ]).await.unwrap();
        });
        new
    });
    assert!(matches!(old, Err(Error::Replaced)), "{old:?}");
    assert_eq!(new.unwrap().pose, [9; 12]);
}

/// The line was full when the packet of the previous pose was sent.
#[tokio::test(start_paused = true)]
async fn the_packet_of_a_pose_is_not_that_of_the_next_one() {
    let config = HostConfig::default();
    let (screen, mut workstation) = on_a_narrow_line(config).await;
    let (previous, next) = tokio::join!(screen.show([8; 12]), async {
        workstation.write_all(&[ENQ]).await.unwrap();
        sleep(config.interval + MS).await;
        let (next, ()) = tokio::join!(screen.show([9; 12]), async {
            assert_eq!(workstation.read_u8().await.unwrap(), 0);
            while workstation.read_u8().await.unwrap() != b'\n' {}
            workstation.write_all(&[ENQ]).await.unwrap();
        });
        next
    });
    assert!(matches!(previous, Err(Error::Replaced)), "{previous:?}");
    assert_eq!(next.unwrap().pose, [9; 12]);
}
