//! A read of 37 holding registers over TCP: each way to call our client, tokio-modbus' client, and our server.

use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::ops::ControlFlow;
use std::thread::sleep;
use std::time::Duration;

use benches::{Count, Link, Peer};
use fanuc_hmi_modbus::tokio::client;
use fanuc_hmi_modbus::{
    Client, ClientConfig, ClientEvent, Exception, Registers, Reply, Request, Server, ServerConfig,
    TelemetryBlock, WordsMut,
};
use robot_session::tokio::Driver;
use robot_session::{Session as _, now};
use tokio::time::timeout;
use tokio_modbus::client::Reader as _;

use super::peer::{DELAY, ROUNDS, connected, with_peer};

const N: u16 = TelemetryBlock::QUANTITY;
const READ: Request<'_> = Request::ReadHoldingRegisters { address: 0, quantity: N };
const REQUEST: [u8; 12] = [0, 1, 0, 0, 0, 6, 1, 3, 0, 0, 0, N as u8];

pub(super) const LINK: Link = Link {
    name: "fanuc-hmi-modbus",
    counts: &[
        Count::op("TCP: a read of 37 registers through the handle", handle).rounds(ROUNDS).goal(7000.0),
        Count::op("TCP: the same by tokio's driver, without a task", driver).rounds(ROUNDS).goal(5500.0),
        Count::op("TCP: the same by the blocking driver", blocking).rounds(ROUNDS),
        Count::op("– tokio-modbus 0.17 with a timeout", tokio_modbus).rounds(ROUNDS),
        Count::op("TCP: a read of 37 registers served", server).rounds(ROUNDS),
    ],
    peers: &[answer, ask],
    ..Link::EMPTY
};

/// Answers each request.
fn answer(mut stream: TcpStream) {
    let mut request = REQUEST;
    let mut reply = [7; 9 + 2 * N as usize];
    while stream.read_exact(&mut request).is_ok() {
        reply[..9].copy_from_slice(&[
            request[0],
            request[1],
            0,
            0,
            0,
            3 + 2 * N as u8,
            request[6],
            3,
            2 * N as u8,
        ]);
        sleep(DELAY);
        stream.write_all(&reply).expect("a client");
    }
}

/// Sends a request after each reply.
fn ask(mut stream: TcpStream) {
    let mut reply = [0; 9 + 2 * N as usize];
    while stream.write_all(&REQUEST).and_then(|()| stream.read_exact(&mut reply)).is_ok() {
        sleep(DELAY);
    }
}

fn handle(rounds: u64) {
    with_peer(LINK.name, 0, |tcp| async move {
        let (client, task) = client(ClientConfig::tcp(), tcp).expect("a configuration");
        tokio::spawn(task.run());
        for _ in 0..rounds {
            assert_eq!(client.read_holding_registers(0..N).await.expect("a reply").len(), usize::from(N));
        }
    });
}

/// Reads the words of the reply that an event is about.
fn words(session: &mut Client, event: &ClientEvent, words: &mut Vec<u16>) {
    if let ClientEvent::Replied { ticket, .. } = event
        && let Some(Reply::HoldingRegisters(found)) = session.reply(*ticket)
    {
        *words = found.iter().collect();
    }
}

fn session() -> Client {
    let mut session = Client::new(ClientConfig::tcp()).expect("a configuration");
    session.handle_connected(now());
    session
}

fn driver(rounds: u64) {
    with_peer(LINK.name, 0, |tcp| async move {
        let (mut driver, mut session) = (Driver::new(connected(tcp).await), session());
        for _ in 0..rounds {
            session.request(1, &READ).expect("a place");
            let mut found = Vec::new();
            while found.is_empty() {
                let turn = driver.turn(&mut session, |session, event| {
                    words(session, &event, &mut found);
                    ControlFlow::<()>::Continue(())
                });
                assert!(turn.await.expect("a connection").is_continue());
            }
            assert_eq!(found.len(), usize::from(N));
        }
    });
}

fn blocking(rounds: u64) {
    let peer = Peer::of(LINK.name, 0);
    let stream = TcpStream::connect(peer.address).expect("a peer");
    let (mut driver, mut session) = (robot_session::Driver::new(stream), session());
    for _ in 0..rounds {
        session.request(1, &READ).expect("a place");
        let mut found = Vec::new();
        while found.is_empty() {
            let turn = driver.turn(&mut session, None, |session, event| {
                words(session, &event, &mut found);
                ControlFlow::<()>::Continue(())
            });
            assert!(turn.expect("a connection").is_continue());
        }
        assert_eq!(found.len(), usize::from(N));
    }
}

fn tokio_modbus(rounds: u64) {
    with_peer(LINK.name, 0, |tcp| async move {
        let mut client =
            tokio_modbus::client::tcp::attach_slave(connected(tcp).await, tokio_modbus::Slave(1));
        for _ in 0..rounds {
            let read = timeout(Duration::from_secs(1), client.read_holding_registers(0, N));
            let words = read.await.expect("in time").expect("a reply").expect("no exception");
            assert_eq!(words.len(), usize::from(N));
        }
    });
}

#[derive(Clone)]
struct Bank;

impl Registers for Bank {
    fn read_holding_registers(&mut self, address: u16, out: &mut WordsMut<'_>) -> Result<(), Exception> {
        out.fill_with(|index| address + index as u16);
        Ok(())
    }
}

fn server(rounds: u64) {
    with_peer(LINK.name, 1, |tcp| async move {
        let mut driver = Driver::new(connected(tcp).await);
        let mut server = Server::<_, 16>::new(ServerConfig::tcp(), Bank).expect("a configuration");
        let mut served = 0;
        let each = |_: &mut _, _| {
            served += 1;
            if served == rounds { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        };
        driver.drive(&mut server, each).await.expect("a connection");
    });
}
