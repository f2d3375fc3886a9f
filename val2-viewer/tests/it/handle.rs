//! The workstation in a task of its own, over TCP.

#![allow(clippy::disallowed_methods, clippy::disallowed_types, reason = "the drivers take the time")]

use core::net::SocketAddr;
use core::ops::ControlFlow;
use core::time::Duration;

use tokio::net::TcpListener;
use tokio::time::{sleep, timeout};
use val2_viewer::robot_session::tokio::{Driver, Reconnect, Tcp};
use val2_viewer::robot_session::{Session as _, now};
use val2_viewer::tokio::workstation;
use val2_viewer::{Host, HostConfig, HostEvent, WorkstationConfig};

const LONG: Duration = Duration::from_secs(20);
const MS: Duration = Duration::from_millis(1);

#[tokio::test]
async fn the_pose_is_the_latest_until_the_host_is_gone_and_comes_back_with_it() {
    let listener = TcpListener::bind(SocketAddr::from(([127, 0, 0, 1], 0))).await.unwrap();
    let to = Tcp::new(listener.local_addr().unwrap().to_string());
    let (mut arm, task) = workstation(WorkstationConfig::default(), to).unwrap();
    tokio::spawn(task.reconnect(Reconnect { first: 5 * MS, longest: 50 * MS }).run());
    for x in [7, 9] {
        let mut driver = Driver::new(listener.accept().await.unwrap().0);
        let serving = tokio::spawn(async move {
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
        });
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
