//! Both ends under tokio's driver, over transports with a small buffer.

#![allow(clippy::cast_possible_truncation)]
#![allow(clippy::disallowed_methods, clippy::disallowed_types, reason = "the drivers take the time")]

use core::ops::ControlFlow;
use core::time::Duration;

use crate::common::Bank;
use fanuc_hmi_modbus::robot_session::tokio::Driver;
use fanuc_hmi_modbus::robot_session::{EndReason, Session as _, now};
use fanuc_hmi_modbus::{
    Client, ClientConfig, ClientEvent, Failure, Request, Server, ServerConfig, ServerEvent, Words,
};

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
