//! Both ends under tokio's driver, and the client in a task, over transports with a small buffer.

#![allow(clippy::cast_possible_truncation)]
#![allow(clippy::disallowed_methods, clippy::disallowed_types, reason = "the drivers take the time")]

use core::ops::ControlFlow;
use core::time::Duration;
use std::io;

use crate::common::Bank;
use fanuc_hmi_modbus::robot_session::tokio::{Dial, Driver};
use fanuc_hmi_modbus::robot_session::{EndReason, Session as _, now};
use fanuc_hmi_modbus::tokio::{Client as Robot, Error, client};
use fanuc_hmi_modbus::{
    Client, ClientConfig, ClientEvent, Failure, Request, Server, ServerConfig, ServerEvent, Words,
};
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _, DuplexStream};
use tokio::time::{sleep, timeout};

const LONG: Duration = Duration::from_secs(20);

/// Requests and replies are longer than the pipe, and both ends write at the same time.
#[tokio::test]
async fn four_requests_in_flight_go_through_a_pipe_of_seven_bytes() {
    let (near, far) = tokio::io::duplex(7);
    let mut server = Server::<_>::new(ServerConfig::tcp(), Bank::new()).unwrap();
    let serve = async {
        let go_on = |_: &mut Server<Bank>, _: ServerEvent| ControlFlow::<()>::Continue(());
        Driver::new(far).drive(&mut server, go_on).await.unwrap()
    };
    let ask = async move {
        let config = ClientConfig { in_flight: 4, ..ClientConfig::tcp() };
        let mut client = Client::<4>::new(config).unwrap();
        let (mut driver, mut replied) = (Driver::new(near), 0);
        client.handle_connected(now());
        while replied < 400 {
            let write = Request::WriteRegisters { address: 0, values: Words::from(&[7; 100]) };
            let read = Request::ReadHoldingRegisters { address: 0, quantity: 100 };
            while client.request(1, &write).is_ok() && client.request(1, &read).is_ok() {}
            let turn = driver.turn(&mut client, |_, event| match event {
                ClientEvent::Replied { .. } => {
                    replied += 1;
                    ControlFlow::<()>::Continue(())
                }
                event => panic!("{event:?}"),
            });
            assert!(turn.await.unwrap().is_continue());
        }
    };
    let both = async { tokio::join!(serve, ask) };
    let (ended, ()) = tokio::time::timeout(LONG, both).await.expect("neither end hangs");
    assert_eq!(ended, EndReason::ByPeer);
}

/// A server that does not read costs a request its reply, and no more time than `timeout`.
#[tokio::test]
async fn a_server_that_does_not_read_times_out() {
    let (near, _far) = tokio::io::duplex(4);
    let config = ClientConfig { timeout: Duration::from_millis(50), ..ClientConfig::tcp() };
    let mut client = Client::<1>::new(config).unwrap();
    let mut driver = Driver::new(near);
    client.handle_connected(now());
    client.request(1, &Request::ReadHoldingRegisters { address: 0, quantity: 1 }).unwrap();
    let turn = driver.turn(&mut client, |_, event| ControlFlow::Break(event));
    let ended = tokio::time::timeout(LONG, turn).await.expect("it does not hang").unwrap();
    let ControlFlow::Break(EndReason::ByHandler(ClientEvent::Failed { failure, .. })) = ended else {
        panic!("{ended:?}")
    };
    assert_eq!(failure, Failure::TimedOut);
}

/// Runs a client on this end of a pipe.
fn on(near: DuplexStream, config: ClientConfig) -> Robot {
    let mut near = Some(near);
    let dial = Dial(move || core::future::ready(near.take().ok_or(io::ErrorKind::NotConnected.into())));
    let (robot, task) = client(config, dial).unwrap();
    tokio::spawn(task.run());
    robot
}

/// The deadline of the first request passes while nothing is in flight.
#[tokio::test(start_paused = true)]
async fn a_request_after_a_rest_has_its_deadline() {
    let (near, mut far) = tokio::io::duplex(64);
    let robot = on(near, ClientConfig::tcp());
    let answer = async {
        let mut request = [0; 12];
        far.read_exact(&mut request).await.unwrap();
        let [t0, t1, ..] = request;
        far.write_all(&[t0, t1, 0, 0, 0, 4, request[6], 1, 1, 0]).await.unwrap();
    };
    tokio::join!(robot.read_coils(0..1), answer).0.unwrap();
    for _ in 0..3 {
        sleep(2 * ClientConfig::tcp().timeout).await;
        let error = timeout(LONG, robot.read_coils(0..1)).await.expect("an outcome").unwrap_err();
        assert!(matches!(error, Error::Failed(Failure::TimedOut)), "{error}");
    }
}

/// A reply with a wrong byte count, and in the same segment the beginning of the reply to the other request.
#[tokio::test(start_paused = true)]
async fn a_malformed_reply_before_a_part_of_another_one_costs_its_own_request_alone() {
    let (near, mut far) = tokio::io::duplex(64);
    let robot = on(near, ClientConfig { in_flight: 2, ..ClientConfig::tcp() });
    let answers = async {
        far.read_exact(&mut [0; 24]).await.unwrap();
        far.write_all(b"\0\x01\0\0\0\x05\x01\x03\x04\0\x07\0\x02\0\0\0\x07\x01\x03").await.unwrap();
        sleep(Duration::from_millis(10)).await;
        far.write_all(b"\x04\0\x07\0\x08").await.unwrap();
    };
    let read = || robot.read_holding_registers(0..2);
    let (first, second, ()) = tokio::join!(read(), read(), answers);
    assert!(matches!(first, Err(Error::Failed(Failure::Malformed(_)))), "{first:?}");
    assert_eq!(second.unwrap(), [7, 8]);
}
