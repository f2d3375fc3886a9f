//! A Modbus read of 38 registers over TCP, by each of our layers and by tokio-modbus: one server for all, and one processor.

use std::cell::RefCell;
use std::net::SocketAddr;
use std::ops::ControlFlow;
use std::sync::OnceLock;
use std::thread;

use fanuc_hmi_modbus::tokio::client;
use fanuc_hmi_modbus::{
    Client, ClientConfig, ClientEvent, Exception, Registers, Reply, Request, Server, ServerConfig, WordsMut,
};
use robot_session::tokio::{Driver, Tcp, serve};
use robot_session::{Session as _, now};
use tokio::net::{TcpListener, TcpStream};
use tokio::runtime::{Builder, Runtime};
use tokio_modbus::client::{Context, Reader, tcp};

use crate::race::race;

const N: u16 = 38;
/// The number of concurrent callers of one handle: if a server takes one request at a time, they take turns.
const CALLERS: u64 = 16;

pub(crate) fn races() {
    race(
        "one caller, a read of 38 registers over TCP",
        [
            ("tokio-modbus 0.17", over_tokio_modbus),
            ("fanuc-hmi-modbus, the session under its driver", over_driver),
            ("– the handle", over_handle),
        ],
    );
    race(
        "16 callers, the same",
        [
            ("tokio-modbus 0.17, one after the other", over_tokio_modbus),
            ("fanuc-hmi-modbus, the handle, 16 in flight", over_handle_at_once),
        ],
    );
}

#[derive(Clone)]
struct Bank;

impl Registers for Bank {
    fn read_holding_registers(&mut self, address: u16, out: &mut WordsMut<'_>) -> Result<(), Exception> {
        out.fill_with(|index| address + index as u16);
        Ok(())
    }
}

fn runtime() -> Runtime {
    Builder::new_current_thread().enable_all().build().expect("a runtime")
}

/// Returns the address of the server, which starts with the first client.
fn server() -> SocketAddr {
    static SERVER: OnceLock<SocketAddr> = OnceLock::new();
    *SERVER.get_or_init(|| {
        let listener = std::net::TcpListener::bind("127.0.0.1:0").expect("a port");
        let address = listener.local_addr().expect("an address");
        listener.set_nonblocking(true).expect("a mode");
        thread::spawn(move || {
            runtime().block_on(async {
                let listener = TcpListener::from_std(listener).expect("a listener");
                let session = |_| Server::<_, 16>::new(ServerConfig::tcp(), Bank).expect("a configuration");
                serve(listener, 8, session, |_, _, _| {}).await
            })
        });
        address
    })
}

fn over_tokio_modbus(rounds: u64) {
    thread_local!(static CLIENT: RefCell<Option<(Runtime, Context)>> = const { RefCell::new(None) });
    CLIENT.with_borrow_mut(|client| {
        let (runtime, client) = client.get_or_insert_with(|| {
            let runtime = runtime();
            let client = runtime.block_on(async {
                let stream = TcpStream::connect(server()).await.expect("a server");
                stream.set_nodelay(true).expect("a mode");
                tcp::attach_slave(stream, tokio_modbus::Slave(1))
            });
            (runtime, client)
        });
        runtime.block_on(async {
            for _ in 0..rounds {
                let words =
                    client.read_holding_registers(0, N).await.expect("a reply").expect("no exception");
                assert_eq!(words.len(), usize::from(N));
            }
        });
    });
}

fn over_driver(rounds: u64) {
    type Link = (Runtime, Driver<TcpStream>, Client<1>);
    thread_local!(static CLIENT: RefCell<Option<Link>> = const { RefCell::new(None) });
    CLIENT.with_borrow_mut(|link| {
        let (runtime, driver, session) = link.get_or_insert_with(|| {
            let runtime = runtime();
            let stream = runtime.block_on(TcpStream::connect(server())).expect("a server");
            stream.set_nodelay(true).expect("a mode");
            let mut session = Client::new(ClientConfig::tcp()).expect("a configuration");
            session.handle_connected(now());
            (runtime, Driver::new(stream), session)
        });
        runtime.block_on(async {
            for _ in 0..rounds {
                let read = Request::ReadHoldingRegisters { address: 0, quantity: N };
                session.request(1, &read).expect("a place");
                let mut words = Vec::new();
                while words.is_empty() {
                    let turn = driver.turn(session, |session, event| {
                        if let ClientEvent::Replied { ticket, .. } = event
                            && let Some(Reply::HoldingRegisters(found)) = session.reply(ticket)
                        {
                            words = found.iter().collect();
                        }
                        ControlFlow::<()>::Continue(())
                    });
                    assert!(turn.await.expect("a connection").is_continue());
                }
                assert_eq!(words.len(), usize::from(N));
            }
        });
    });
}

thread_local! {
    static ONE: (Runtime, fanuc_hmi_modbus::tokio::Client) = handle(1);
    static MANY: (Runtime, fanuc_hmi_modbus::tokio::Client) = handle(16);
}

fn handle(in_flight: usize) -> (Runtime, fanuc_hmi_modbus::tokio::Client) {
    let config = ClientConfig { in_flight, ..ClientConfig::tcp() };
    let (client, task) = client(config, Tcp::new(server().to_string())).expect("a configuration");
    let runtime = runtime();
    runtime.spawn(task.run());
    (runtime, client)
}

fn over_handle(rounds: u64) {
    ONE.with(|(runtime, client)| {
        let client = client.clone();
        // A task among others: the main future of a runtime is woken through its port, which costs two calls of the system.
        let caller = runtime.spawn(async move {
            for _ in 0..rounds {
                let words = client.read_holding_registers(0..N).await.expect("a reply");
                assert_eq!(words.len(), usize::from(N));
            }
        });
        runtime.block_on(caller).expect("a caller");
    });
}

fn over_handle_at_once(rounds: u64) {
    MANY.with(|(runtime, client)| {
        let callers = (0..CALLERS).map(|caller| {
            let client = client.clone();
            runtime.spawn(async move {
                for _ in (caller..rounds).step_by(CALLERS as usize) {
                    let words = client.read_holding_registers(0..N).await.expect("a reply");
                    assert_eq!(words.len(), usize::from(N));
                }
            })
        });
        let callers: Vec<_> = callers.collect();
        runtime.block_on(async {
            for caller in callers {
                caller.await.expect("a caller");
            }
        });
    });
}
