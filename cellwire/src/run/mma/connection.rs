//! A device's connection: its session, and a thread that reads.

use std::io::{Read, Write};
use std::net::{Shutdown, TcpStream};
use std::sync::mpsc::SyncSender;
use std::thread;
use std::time::Duration;

use anyhow::Result;
use mmacell_proto::robot_session::Session as _;
use mmacell_proto::{Central, CentralConfig, CentralEvent, Closing, Command, Pose};
use mmacell_task::Device;
use robot_session::{Step, Steps, discard_unacknowledged, now};

use cellwire_io::backoff::Backoff;
use cellwire_io::bell::Bell;
use cellwire_io::tcp::{self, Dialing};

/// A peer that takes nothing for this long is gone.
pub(super) const STUCK: Duration = Duration::from_secs(5);

/// The most that waits to be taken, and is done in one turn.
pub(super) const WAITING: usize = 64;

/// What has come on a connection.
#[derive(Debug)]
pub(super) struct Arrival {
    /// Which device.
    pub(super) from: Device,
    /// Which connection to it.
    pub(super) number: u64,
    /// `None` at its end.
    pub(super) bytes: Option<Vec<u8>>,
}

/// Takes what has come, and rings for it. A device that sends faster than it is read waits in its socket.
#[derive(Clone)]
pub(super) struct Inbox {
    pub(super) arrivals: SyncSender<Arrival>,
    pub(super) bell: Bell,
}

impl Inbox {
    /// False when the peer is gone.
    fn put(&self, arrival: Arrival) -> bool {
        let is_taken = self.arrivals.send(arrival).is_ok();
        self.bell.ring();
        is_taken
    }
}

/// A device at its address.
pub(super) struct Connection<P: Pose> {
    from: Device,
    address: String,
    dialing: Dialing,
    inbox: Inbox,
    number: u64,
    stream: Option<TcpStream>,
    session: Central<P>,
    retry_at: Duration,
    backoff: Backoff,
    /// Why it was lost, until the device has answered again: one that ends may still accept a connection.
    lost: Option<String>,
}

impl<P: Pose> Connection<P> {
    pub(super) fn open(
        from: Device,
        address: &str,
        dialing: Dialing,
        config: CentralConfig,
        inbox: &Inbox,
    ) -> Result<Self> {
        let session = Central::new(config)?;
        let (number, stream, retry_at, lost) = (0, None, Duration::ZERO, None);
        let backoff = Backoff::default();
        let (address, inbox) = (address.to_owned(), inbox.clone());
        let mut connection =
            Self { from, address, dialing, inbox, number, stream, session, retry_at, backoff, lost };
        connection.connect()?;
        Ok(connection)
    }

    fn connect(&mut self) -> Result<()> {
        let stream = tcp::connect(&self.address, self.dialing)?;
        stream.set_nodelay(true)?;
        stream.set_write_timeout(Some(STUCK))?;
        if let Some(after) = self.session.discards_after() {
            discard_unacknowledged(&stream, after)?;
        }
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
                if !inbox.put(Arrival { from, number, bytes }) || is_over {
                    return;
                }
            }
        });
        self.stream = Some(stream);
        self.session.handle_connected(now());
        Ok(())
    }

    /// Opens a lost connection again, now and then; when there is something to do next.
    pub(super) fn reconnect(&mut self) -> Option<Duration> {
        if self.stream.is_some() {
            return None;
        }
        if now() < self.retry_at {
            return Some(self.retry_at);
        }
        let outcome = self.connect();
        self.retry_at = now().saturating_add(self.backoff.pause());
        match outcome {
            // What the session begins with.
            Ok(()) => Some(now()),
            Err(error) => {
                self.lost = Some(format!("{error:#}"));
                Some(self.retry_at)
            }
        }
    }

    /// Why it was lost, if it is not regained.
    pub(super) fn why_lost(&self) -> Option<&str> {
        self.lost.as_deref()
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
            Some(bytes) => {
                self.lost = None;
                self.backoff.answered();
                self.session.handle_input(now(), &bytes);
            }
            None => self.close(),
        }
    }

    fn close(&mut self) {
        if self.end_stream() {
            self.session.handle_disconnected(now());
        }
    }

    /// Whether there was one. The thread that reads has it as well.
    fn end_stream(&mut self) -> bool {
        self.stream.take().map(|stream| stream.shutdown(Shutdown::Both)).is_some()
    }

    /// Does what is due; what has happened.
    pub(super) fn settle(&mut self) -> Vec<CentralEvent<P>> {
        let at = now();
        self.session.handle_timeout(at);
        let (mut events, mut outgoing, mut buffer) = (Vec::new(), Vec::new(), [0; 64]);
        let mut steps = Steps::NEW;
        loop {
            match steps.next(&mut self.session, at, &mut buffer) {
                Step::Event(event) => events.push(event),
                Step::Write(bytes) => outgoing.extend_from_slice(bytes),
                Step::Wait { .. } => break,
            }
        }
        for event in &events {
            let CentralEvent::Closed { reason, .. } = event else { continue };
            // Of a connection that is gone this comes late: the next may be open.
            if *reason != Closing::Disconnected {
                self.end_stream();
            }
            if *reason != Closing::Agreed {
                self.lost = Some(format!("the connection to the {} was lost: {reason}", name(self.from)));
            }
        }
        let is_written = match &mut self.stream {
            Some(stream) => stream.write_all(&outgoing).is_ok(),
            None => true,
        };
        if !is_written {
            self.close();
        }
        events
    }
}

fn name(device: Device) -> &'static str {
    match device {
        Device::Robot => "robot",
        Device::Platform => "platform",
        _ => "periphery",
    }
}
