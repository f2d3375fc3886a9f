//! The PC: listens, and answers the robot.

use std::io::{ErrorKind, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::PathBuf;
use std::thread;
use std::time::{Duration, Instant};

use anyhow::{Context, Result};
use kawasaki_msg::robot_session::Session as _;
use kawasaki_msg::{Line, Pc, PcConfig, PcEvent, START, timing};

use crate::tcp;
use crate::trace::{Trace, Way};

/// What is due within this time is slept for.
pub(super) const SOON: Duration = Duration::from_millis(10);

/// The program of a PC: what it does between two looks at the connection.
pub trait Program<'a> {
    /// Acts on the session once everything that has happened is told; false ends the run.
    ///
    /// # Errors
    /// Whatever ends the run as a failure.
    fn step(&mut self, pc: &mut Pc<&'a [Line]>) -> Result<bool>;

    /// Something has happened.
    ///
    /// # Errors
    /// Whatever ends the run as a failure.
    fn told(&mut self, told: Told<'_>) -> Result<()>;
}

/// What a PC says while it runs.
#[derive(Debug)]
pub enum Told<'a> {
    /// An event of the session.
    Event(PcEvent),
    /// A robot has connected.
    Connected(String),
    /// The connection has ended.
    Disconnected(&'a str),
    /// The session's bytes were written there.
    Traced(PathBuf),
}

/// What the PC has sent.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Packets {
    /// Packets.
    pub count: u64,
    /// Messages in all of them.
    pub messages: u64,
    /// Messages in the one that held most.
    pub most_messages: usize,
    /// Bytes of the longest.
    pub longest: usize,
}

impl Packets {
    fn add(&mut self, packet: &[u8]) {
        // A value cannot hold the mark that begins a message.
        let messages = packet.iter().filter(|byte| **byte == START).count();
        self.count += 1;
        self.messages += messages as u64;
        self.most_messages = self.most_messages.max(messages);
        self.longest = self.longest.max(packet.len());
    }
}

/// Runs until the program ends it. One robot at a time: a new connection takes the place of the one before it.
///
/// # Errors
/// What the program returns, and a listener that fails.
pub fn run<'a>(
    listener: &TcpListener,
    config: PcConfig,
    trace: &Trace,
    program: &mut impl Program<'a>,
) -> Result<Packets> {
    listener.set_nonblocking(true)?;
    let mut server = Server {
        session: Pc::new(config)?,
        epoch: Instant::now(),
        connection: None,
        trace,
        packets: Packets::default(),
        program,
    };
    loop {
        server.accept(listener)?;
        server.session.handle_timeout(server.epoch.elapsed());
        let told = server.events()?;
        if !server.program.step(&mut server.session)? {
            break;
        }
        if let Err(why) = told.and_then(|()| server.answer()) {
            server.disconnected(&why)?;
        }
        if server.connection.is_none() {
            thread::sleep(timing::CPU_CYCLE);
        }
    }
    server.disconnected("the PC has ended")?;
    Ok(server.packets)
}

struct Server<'r, 'a, P> {
    session: Pc<&'a [Line]>,
    epoch: Instant,
    connection: Option<TcpStream>,
    trace: &'r Trace,
    packets: Packets,
    program: &'r mut P,
}

impl<'a, P: Program<'a>> Server<'_, 'a, P> {
    fn accept(&mut self, listener: &TcpListener) -> Result<()> {
        let (stream, peer) = match listener.accept() {
            Ok(accepted) => accepted,
            // A robot that has gone again before it was accepted is no failure of the listener.
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::ConnectionAborted) => {
                return Ok(());
            }
            Err(error) => return Err(error).context("cannot accept a connection"),
        };
        stream.set_nonblocking(false)?;
        stream.set_nodelay(true)?;
        stream.set_read_timeout(Some(timing::CPU_CYCLE))?;
        self.disconnected("another robot has connected")?;
        self.session.handle_connected(self.epoch.elapsed());
        self.connection = Some(stream);
        self.program.told(Told::Connected(peer.to_string()))
    }

    /// The inner error is why the connection is to be closed.
    fn events(&mut self) -> Result<Result<(), String>> {
        while let Some(event) = self.session.poll_event() {
            self.program.told(Told::Event(event))?;
            if event == PcEvent::Disconnect {
                return Ok(Err("the robot is silent".into()));
            }
        }
        Ok(Ok(()))
    }

    fn answer(&mut self) -> Result<(), String> {
        let Some(stream) = &mut self.connection else { return Ok(()) };
        let mut buffer = [0; 4096];
        while let Some(length) = self.session.poll_transmit(self.epoch.elapsed(), &mut buffer) {
            let packet = buffer.get(..length).unwrap_or_default();
            self.packets.add(packet);
            self.trace.add(self.epoch.elapsed(), Way::Sent, packet);
            stream.write_all(packet).map_err(|error| error.to_string())?;
        }
        // A socket's time limit is rounded up to several milliseconds, a sleep is not.
        let now = self.epoch.elapsed();
        if let Some(due) = self.session.poll_timeout().filter(|due| *due < now + SOON) {
            thread::sleep(due.saturating_sub(now));
            return Ok(());
        }
        match stream.read(&mut buffer) {
            Ok(0) => Err("the robot closed the connection".into()),
            Ok(length) => {
                let (now, bytes) = (self.epoch.elapsed(), buffer.get(..length).unwrap_or_default());
                self.trace.add(now, Way::Received, bytes);
                self.session.handle_input(now, bytes);
                Ok(())
            }
            Err(error) if tcp::is_silence(&error) => Ok(()),
            Err(error) => Err(error.to_string()),
        }
    }

    fn disconnected(&mut self, why: &str) -> Result<()> {
        if self.connection.take().is_none() {
            return Ok(());
        }
        self.session.handle_disconnected(self.epoch.elapsed());
        self.program.told(Told::Disconnected(why))?;
        match self.trace.session_ended(why)? {
            Some(path) => self.program.told(Told::Traced(path)),
            None => Ok(()),
        }
    }
}
