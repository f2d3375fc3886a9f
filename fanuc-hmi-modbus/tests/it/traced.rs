//! The records of a connection and of its calls.

#![allow(
    clippy::disallowed_methods,
    clippy::disallowed_types,
    reason = "the test has a pipe and a subscriber"
)]

use core::cell::Cell;
use std::io::{self, Write};
use std::sync::{Arc, Mutex};

use fanuc_hmi_modbus::ClientConfig;
use fanuc_hmi_modbus::robot_session::tokio::{Connector, Link};
use fanuc_hmi_modbus::tokio::client;
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _, DuplexStream, duplex};
use tracing_subscriber::filter::dynamic_filter_fn;
use tracing_subscriber::fmt::{self, MakeWriter};
use tracing_subscriber::layer::SubscriberExt as _;
use tracing_subscriber::util::SubscriberInitExt as _;
use tracing_subscriber::{Layer as _, registry};

thread_local! {
    static IS_RECORDED: Cell<bool> = const { Cell::new(false) };
}

/// The first connection, whose name is known; then none.
struct Once(Option<DuplexStream>);

impl Connector for Once {
    type Transport = DuplexStream;

    async fn connect(&mut self) -> io::Result<DuplexStream> {
        self.0.take().ok_or_else(|| io::Error::other("the cable is out"))
    }

    fn peer(&self) -> Option<String> {
        Some("cell 7".into())
    }
}

#[derive(Clone, Default)]
struct Lines(Arc<Mutex<Vec<u8>>>);

impl Write for Lines {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        Write::write(&mut *self.0.lock().unwrap(), bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl MakeWriter<'_> for Lines {
    type Writer = Self;

    fn make_writer(&self) -> Self {
        self.clone()
    }
}

/// A call with its reply, a corrupt reply, a lost connection, and an attempt that fails.
#[tokio::test(start_paused = true)]
async fn a_connection_and_its_calls_are_recorded() {
    let lines = Lines::default();
    // One for the process: one of a thread misses records while other threads come and go. The other tests are not recorded.
    let layer = fmt::layer().with_writer(lines.clone()).without_time().with_ansi(false);
    registry().with(layer.with_filter(dynamic_filter_fn(|_, _| IS_RECORDED.get()))).init();
    IS_RECORDED.set(true);
    let (near, mut server) = duplex(64);
    let (robot, task) = client(ClientConfig::tcp(), Once(Some(near))).unwrap();
    let running = tokio::spawn(task.run());
    let mut request = [0; 12];
    let (read, ()) = tokio::join!(robot.read_holding_registers(5..6), async {
        server.read_exact(&mut request).await.unwrap();
        server.write_all(&[request[0], request[1], 0, 0, 0, 5, 1, 3, 2, 0, 42]).await.unwrap();
    });
    assert_eq!(read.unwrap(), [42]);
    server.write_all(b"noise, not Modbus").await.unwrap();
    let mut link = robot.handle().link();
    link.wait_for(|link| matches!(link, Link::Failed(why) if why.to_string().contains("cable")))
        .await
        .unwrap();
    drop(robot);
    running.await.unwrap();
    let text = String::from_utf8(lines.0.lock().unwrap().clone()).unwrap();
    println!("{text}");
    let mut rest = text.as_str();
    for expected in [
        "DEBUG call{link=\"fanuc-hmi-modbus\" end=\"client\"}: robot_session: call=",
        "INFO connection{link=\"fanuc-hmi-modbus\" end=\"client\" peer=\"cell 7\"}: robot_session: connected",
        "written bytes=[00, 01, 00, 00, 00, 06, 01, 03, 00, 05, 00, 01]",
        "received bytes=[00, 01, 00, 00, 00, 05, 01, 03, 02, 00, 2A]",
        "event=Replied",
        "outcome=Ok(",
        "event=OutOfStep(",
        "robot_session: disconnected",
        "WARN connection",
        "the connection is lost reason=",
        "no connection reason=the cable is out",
    ] {
        let at = rest.find(expected).unwrap_or_else(|| panic!("{expected} is not in\n{rest}"));
        rest = &rest[at + expected.len()..];
    }
}
