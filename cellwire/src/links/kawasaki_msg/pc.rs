//! The PC: listens, and answers the robot.

use std::net::{TcpListener, TcpStream};
use std::ops::ControlFlow;
use std::path::PathBuf;

use anyhow::{Context, Result};
use kawasaki_msg::{Line, Pc, PcConfig, PcEvent, timing};
use robot_session::{Driver, Session as _, Transport as _};

pub use super::peer::Packets;
use super::peer::{Peer, outcome};
use crate::io::listener::{Arrival, Listener};
use crate::io::output::remark;
use crate::io::trace::Trace;

/// The program of a PC: what it does between two looks at the connection.
pub trait Program<'a> {
    /// Acts on the session once everything that has happened was reported; false ends the run.
    ///
    /// # Errors
    /// Whatever ends the run as a failure.
    fn step(&mut self, pc: &mut Pc<'static, &'a [Line]>) -> Result<bool>;

    /// Something has happened.
    ///
    /// # Errors
    /// Whatever ends the run as a failure.
    fn notify(&mut self, notification: Notification<'_>) -> Result<()>;
}

/// What a PC reports while it runs.
#[derive(Debug)]
pub enum Notification<'a> {
    /// An event of the session.
    Event(PcEvent),
    /// A robot has connected.
    Connected(String),
    /// The connection has ended.
    Disconnected(&'a str),
    /// The session's bytes were written there.
    Traced(PathBuf),
}

/// Runs until the program ends it. One robot at a time: a new connection takes the place of the one before it.
///
/// # Errors
/// What the program returns, and a listener that fails.
pub fn run<'a>(
    listener: &TcpListener,
    config: PcConfig<'static>,
    trace: &Trace,
    program: &mut impl Program<'a>,
) -> Result<Packets> {
    let mut listener = Listener::new(listener.try_clone().context("cannot listen")?)?;
    let mut server =
        Server { session: Pc::new(config)?, driver: Driver::new(Peer::new(trace)), trace, program };
    loop {
        server.accept(&mut listener)?;
        match server.turn()? {
            Err(why) => server.disconnected(&why)?,
            Ok(()) if server.program.step(&mut server.session)? => {}
            Ok(()) => break,
        }
    }
    server.disconnected("the PC has ended")?;
    Ok(server.driver.transport().packets)
}

struct Server<'r, 'a, P> {
    session: Pc<'static, &'a [Line]>,
    driver: Driver<Peer<'r>>,
    trace: &'r Trace,
    program: &'r mut P,
}

impl<'a, P: Program<'a>> Server<'_, 'a, P> {
    fn accept(&mut self, listener: &mut Listener) -> Result<()> {
        let (stream, peer) = match listener.accept() {
            Ok(Arrival::Client(stream, peer)) => (TcpStream::from(stream), peer),
            Ok(Arrival::Refused(peer)) => {
                remark(&format!("refused the robot {peer}: no descriptor is free, see ulimit -n"));
                return Ok(());
            }
            // Who waits may be accepted at the next turn.
            Ok(Arrival::Nobody) | Err(_) => return Ok(()),
        };
        stream.set_nonblocking(false)?;
        self.disconnected("another robot has connected")?;
        self.driver.transport().connect(stream);
        self.session.handle_connected(self.driver.transport().now());
        self.program.notify(Notification::Connected(peer.to_string()))
    }

    /// The inner error is why the connection is to be closed.
    fn turn(&mut self) -> Result<Result<(), String>> {
        let Self { session, driver, program, .. } = self;
        let turn = driver.turn(session, Some(timing::CPU_CYCLE), |_, event| {
            match program.notify(Notification::Event(event)) {
                Err(error) => ControlFlow::Break(Some(error)),
                Ok(()) if event == PcEvent::Disconnect => ControlFlow::Break(None),
                Ok(()) => ControlFlow::Continue(()),
            }
        });
        match outcome(turn, "the robot closed the connection") {
            ControlFlow::Continue(lost) => Ok(lost),
            ControlFlow::Break(None) => Ok(Err("the robot is silent".into())),
            ControlFlow::Break(Some(error)) => Err(error),
        }
    }

    fn disconnected(&mut self, why: &str) -> Result<()> {
        if !self.driver.transport().disconnect() {
            return Ok(());
        }
        self.session.handle_disconnected(self.driver.transport().now());
        self.program.notify(Notification::Disconnected(why))?;
        match self.trace.finish(why) {
            Some(path) => self.program.notify(Notification::Traced(path)),
            None => Ok(()),
        }
    }
}
