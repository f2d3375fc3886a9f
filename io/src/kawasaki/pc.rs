//! The PC: a program acts on its session between two checks of the connection.

use std::cell::RefCell;
use std::io;
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::time::Duration;

use anyhow::Result;
use kawasaki_msg::{JobSource, LargePc, PcEvent, SessionError};
use robot_session::{Driver, Session, Transport as _};

use super::meeting::Meeting;
pub use super::peer::Packets;
use super::peer::{Peer, outcome};
use crate::trace::Trace;

/// The interval at which the program runs: the longest time that a connecting robot waits.
const GLANCE: Duration = Duration::from_millis(20);

/// The program of a PC.
pub trait Program {
    /// The session of the program.
    type Session: Session<Event = PcEvent>;

    /// Acts on the session once everything that has happened was reported; false ends the run.
    ///
    /// # Errors
    /// The failure that ends the run.
    fn step(&mut self, session: &mut Self::Session) -> Result<bool>;

    /// Keeps the state that has to survive the program, before the session's output is sent.
    ///
    /// # Errors
    /// When the state could not be kept: nothing is sent, and the connection ends.
    fn keep(&mut self, _session: &mut Self::Session) -> io::Result<()> {
        Ok(())
    }

    /// Reports an event.
    ///
    /// # Errors
    /// The failure that ends the run.
    fn notify(&mut self, session: &mut Self::Session, notification: Notification<'_>) -> Result<()>;
}

/// The reports of a running PC.
#[derive(Debug)]
pub enum Notification<'a> {
    /// An event of the session.
    Event(PcEvent),
    /// A robot has connected.
    Connected(String),
    /// The connection has ended, or cannot be opened.
    Disconnected(&'a str),
    /// The session's bytes were written to this file.
    Traced(PathBuf),
}

/// Runs until the program ends it. One robot at a time: over TCP a new connection takes the place of the previous one, over UDP
/// another robot is answered when the previous one is silent.
///
/// # Errors
/// The errors of the program, and an endpoint that fails.
pub fn run<P: Program>(
    meeting: &mut Meeting,
    session: P::Session,
    trace: &Trace,
    program: &mut P,
) -> Result<Packets> {
    let driver = Driver::new(Peer::new(trace));
    let mut server =
        Server { session, driver, trace, program, retry_at: Duration::ZERO, reported: String::new() };
    loop {
        server.meet(meeting)?;
        let turn = server.turn()?;
        if server.driver.transport_mut().take_received() {
            meeting.answered();
        }
        match turn {
            Err(why) => server.disconnected(meeting, &why)?,
            Ok(()) if server.program.step(&mut server.session)? => {}
            Ok(()) => break,
        }
    }
    server.disconnected(meeting, "the PC has ended")?;
    Ok(server.driver.transport_mut().packets)
}

/// The order ends after the job that is being executed; if the plant has no message for that, after the jobs that the robot has queued.
pub fn break_off<S: JobSource>(session: &mut LargePc<S>) {
    if let Err(SessionError::Lacks { .. }) = session.interrupt() {
        // The order is ending already, or has not begun: then the call is retried.
        let _ = session.end();
    }
}

struct Server<'r, P: Program> {
    session: P::Session,
    driver: Driver<Peer<'r>>,
    trace: &'r Trace,
    program: &'r mut P,
    /// When a connection is looked for again.
    retry_at: Duration,
    /// The reason why no connection could be opened, as reported last.
    reported: String,
}

impl<P: Program> Server<'_, P> {
    fn meet(&mut self, meeting: &mut Meeting) -> Result<()> {
        let now = self.driver.transport_mut().now();
        let is_open = self.driver.transport_mut().is_connected();
        if now < self.retry_at || is_open && !meeting.takes_another() {
            return Ok(());
        }
        let (carrier, peer) = match meeting.meet()? {
            Ok(Some(found)) => found,
            Ok(None) => return Ok(()),
            Err(why) => {
                self.retry_at = now.saturating_add(meeting.pause());
                if self.reported != why {
                    self.program.notify(&mut self.session, Notification::Disconnected(&why))?;
                    self.reported = why;
                }
                return Ok(());
            }
        };
        self.disconnected(meeting, "another robot has connected")?;
        self.reported.clear();
        self.driver.transport_mut().connect(carrier)?;
        self.session.handle_connected(self.driver.transport_mut().now());
        self.program.notify(&mut self.session, Notification::Connected(peer))
    }

    /// The inner error is why the connection is to be closed.
    fn turn(&mut self) -> Result<Result<(), String>> {
        let Self { session, driver, program, .. } = self;
        let program = RefCell::new(program);
        let keep = |session: &mut P::Session| program.borrow_mut().keep(session);
        let turn = driver.turn_keeping(session, Some(GLANCE), keep, |session, event| {
            let ends = (event == PcEvent::Disconnect).then_some("the robot is silent");
            match program.borrow_mut().notify(session, Notification::Event(event)) {
                Err(error) => ControlFlow::Break(Err(error)),
                Ok(()) => ends.map_or(ControlFlow::Continue(()), |why| ControlFlow::Break(Ok(why))),
            }
        });
        match outcome(turn, "the robot closed the connection") {
            ControlFlow::Continue(lost) => Ok(lost),
            ControlFlow::Break(Ok(why)) => Ok(Err(why.into())),
            ControlFlow::Break(Err(error)) => Err(error),
        }
    }

    fn disconnected(&mut self, meeting: &mut Meeting, why: &str) -> Result<()> {
        if !self.driver.transport_mut().disconnect() {
            return Ok(());
        }
        let now = self.driver.transport_mut().now();
        self.retry_at = now.saturating_add(meeting.pause());
        self.session.handle_disconnected(now);
        self.program.notify(&mut self.session, Notification::Disconnected(why))?;
        match self.trace.finish(why) {
            Some(path) => self.program.notify(&mut self.session, Notification::Traced(path)),
            None => Ok(()),
        }
    }
}
