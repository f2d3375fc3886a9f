//! A device's connection: its session, and a thread that reads.

use std::io::{Read, Write};
use std::net::{Shutdown, TcpStream};
use std::ops::ControlFlow;
use std::sync::mpsc::Sender;
use std::thread;
use std::time::Duration;

use anyhow::Result;
use mmacell_proto::robot_session::Session as _;
use mmacell_proto::{Central, CentralConfig, CentralEvent, Command, Pose};
use robot_session::{Output, now, settle};

use crate::io::tcp;

/// A peer that takes nothing for so long is gone.
const STUCK: Duration = Duration::from_secs(5);
/// A lost connection is tried again so often.
const RETRY: Duration = Duration::from_secs(1);

/// What has come on a connection.
#[derive(Debug)]
pub(super) struct Arrival {
    /// Which device.
    pub(super) from: usize,
    /// Which connection to it.
    pub(super) number: u64,
    /// `None` at its end.
    pub(super) bytes: Option<Vec<u8>>,
}

/// A device at its address.
pub(super) struct Connection<P: Pose> {
    from: usize,
    address: String,
    timeout: Duration,
    inbox: Sender<Arrival>,
    number: u64,
    stream: Option<TcpStream>,
    session: Central<P>,
    retry_at: Duration,
}

impl<P: Pose> Connection<P> {
    pub(super) fn open(
        from: usize,
        address: &str,
        timeout: Duration,
        config: CentralConfig,
        inbox: &Sender<Arrival>,
    ) -> Result<Self> {
        let session = Central::new(config)?;
        let (number, retry_at) = (0, Duration::ZERO);
        let (address, inbox) = (address.to_owned(), inbox.clone());
        let mut connection = Self { from, address, timeout, inbox, number, stream: None, session, retry_at };
        connection.connect()?;
        Ok(connection)
    }

    fn connect(&mut self) -> Result<()> {
        let stream = tcp::connect(&self.address, self.timeout)?;
        stream.set_nodelay(true)?;
        stream.set_write_timeout(Some(STUCK))?;
        let (mut reader, inbox) = (stream.try_clone()?, self.inbox.clone());
        self.number += 1;
        let (from, number) = (self.from, self.number);
        thread::spawn(move || {
            let mut buffer = [0; 1024];
            loop {
                let bytes = match reader.read(&mut buffer) {
                    Ok(0) | Err(_) => None,
                    Ok(length) => buffer.get(..length).map(<[u8]>::to_vec),
                };
                let is_over = bytes.is_none();
                if inbox.send(Arrival { from, number, bytes }).is_err() || is_over {
                    return;
                }
            }
        });
        self.stream = Some(stream);
        self.session.handle_connected(now());
        Ok(())
    }

    /// Opens a lost connection again, now and then; why it could not.
    pub(super) fn reconnect(&mut self) -> Option<String> {
        if self.stream.is_some() || now() < self.retry_at {
            return None;
        }
        let outcome = self.connect();
        self.retry_at = now().saturating_add(RETRY);
        outcome.err().map(|error| format!("{error:#}"))
    }

    pub(super) fn is_open(&self) -> bool {
        self.stream.is_some()
    }

    pub(super) fn request(&mut self, command: Command<P>) -> bool {
        self.session.request(command).is_ok()
    }

    pub(super) fn timeout(&self) -> Option<Duration> {
        self.session.poll_timeout()
    }

    pub(super) fn arrived(&mut self, arrival: Arrival) {
        match arrival.bytes {
            _ if arrival.number != self.number => {} // of a connection that was given up
            Some(bytes) => self.session.handle_input(now(), &bytes),
            None => self.lost(),
        }
    }

    fn lost(&mut self) {
        if let Some(stream) = self.stream.take() {
            let _ = stream.shutdown(Shutdown::Both);
            self.session.handle_disconnected(now());
        }
    }

    /// Does what is due; what has happened.
    pub(super) fn settle(&mut self) -> Vec<CentralEvent<P>> {
        let at = now();
        self.session.handle_timeout(at);
        let (mut events, mut outgoing, mut buffer) = (Vec::new(), Vec::new(), [0; 64]);
        let _ = settle(&mut self.session, at, &mut buffer, |_, output| {
            match output {
                Output::Event(event) => events.push(event),
                Output::Transmit(bytes) => outgoing.extend_from_slice(bytes),
            }
            ControlFlow::<()>::Continue(())
        });
        if events.iter().any(|event| matches!(event, CentralEvent::Closed { .. })) {
            self.stream = None;
        }
        let is_written = match &mut self.stream {
            Some(stream) => stream.write_all(&outgoing).is_ok(),
            None => true,
        };
        if !is_written {
            self.lost();
        }
        events
    }
}
