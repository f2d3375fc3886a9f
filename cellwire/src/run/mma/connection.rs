//! A device's connection: its session, and a thread that reads.

use std::io::Read as _;
use std::sync::mpsc::SyncSender;
use std::thread;
use std::time::Duration;

use anyhow::Result;
use mmacell_proto::robot_session::Session as _;
use mmacell_proto::{Central, CentralConfig, CentralEvent, CloseReason, Command, Pose};
use mmacell_task::Device;
use robot_session::{Step, Steps, now};

use super::wire::Wire;
use cellwire_io::backoff::Backoff;
use cellwire_io::bell::Bell;
use cellwire_io::tcp::Dialing;
use cellwire_io::tls::Tls;

/// The maximum number of items that wait, and that are handled in one turn.
pub(super) const WAITING: usize = 64;

/// Bytes that have arrived on a connection, or its end.
#[derive(Debug)]
pub(super) struct Arrival {
    /// The device.
    pub(super) from: Device,
    /// The number of the connection to the device.
    pub(super) number: u64,
    /// The bytes, or the reason for the end of the connection.
    pub(super) bytes: Result<Vec<u8>, String>,
}

/// Takes arrivals, and rings for each. A device that sends faster than it is read waits in its socket.
#[derive(Clone)]
pub(super) struct Inbox {
    pub(super) arrivals: SyncSender<Arrival>,
    pub(super) bell: Bell,
}

impl Inbox {
    /// Returns false when the peer is gone.
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
    tls: Option<Tls>,
    inbox: Inbox,
    number: u64,
    wire: Option<Wire>,
    session: Central<P>,
    retry_at: Duration,
    backoff: Backoff,
    /// The reason why the connection was lost, until the device has answered again: one that ends may still accept a connection.
    lost: Option<String>,
    /// The end of the last connection in words.
    ended: String,
}

impl<P: Pose> Connection<P> {
    pub(super) fn open(
        from: Device,
        address: &str,
        dialing: Dialing,
        tls: Option<Tls>,
        config: CentralConfig,
        inbox: &Inbox,
    ) -> Result<Self> {
        let session = Central::new(config)?;
        let (number, wire, retry_at, lost, ended) = (0, None, Duration::ZERO, None, String::new());
        let backoff = Backoff::default();
        let (address, inbox) = (address.to_owned(), inbox.clone());
        let mut connection = Self {
            from,
            address,
            dialing,
            tls,
            inbox,
            number,
            wire,
            session,
            retry_at,
            backoff,
            lost,
            ended,
        };
        connection.connect()?;
        Ok(connection)
    }

    fn connect(&mut self) -> Result<()> {
        let wire = Wire::connect(&self.address, self.dialing, self.tls.as_ref())?;
        if let Some(after) = self.session.discards_after() {
            wire.discard_after(after)?;
        }
        let (mut reader, inbox) = (wire.clone(), self.inbox.clone());
        self.number += 1;
        let (from, number) = (self.from, self.number);
        thread::spawn(move || {
            let mut buffer = [0; 1024];
            loop {
                let bytes = match reader.read(&mut buffer) {
                    Ok(0) => Err("it closed the connection".into()),
                    Ok(length) => Ok(buffer.get(..length).unwrap_or_default().to_vec()),
                    Err(error) => Err(error.to_string()),
                };
                let is_over = bytes.is_err();
                if !inbox.put(Arrival { from, number, bytes }) || is_over {
                    return;
                }
            }
        });
        self.wire = Some(wire);
        self.session.handle_connected(now());
        Ok(())
    }

    /// Opens a lost connection again, now and then; when there is something to do next.
    pub(super) fn reconnect(&mut self) -> Option<Duration> {
        if self.wire.is_some() {
            return None;
        }
        if now() < self.retry_at {
            return Some(self.retry_at);
        }
        let outcome = self.connect();
        self.retry_at = now().saturating_add(self.backoff.pause());
        match outcome {
            // The session begins with a turn at once.
            Ok(()) => Some(now()),
            Err(error) => {
                self.lost = Some(format!("{error:#}"));
                Some(self.retry_at)
            }
        }
    }

    /// Returns the reason why the connection was lost, if it is not regained.
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
            Ok(bytes) => {
                self.lost = None;
                self.backoff.answered();
                self.session.handle_input(now(), &bytes);
            }
            Err(why) => self.close(why),
        }
    }

    fn close(&mut self, why: String) {
        if self.end_wire() {
            self.ended = why;
            self.session.handle_disconnected(now());
        }
    }

    /// Ends the connection, which the reading thread shares; returns whether there was one.
    fn end_wire(&mut self) -> bool {
        self.wire.take().map(|wire| wire.close()).is_some()
    }

    /// Does the work that is due; returns the events.
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
            if *reason != CloseReason::Disconnected {
                self.end_wire();
            }
            if *reason != CloseReason::Agreed {
                let why = match reason {
                    CloseReason::Disconnected => self.ended.clone(),
                    reason => reason.to_string(),
                };
                self.lost = Some(format!("the connection to the {} was lost: {why}", name(self.from)));
            }
        }
        if let Some(Err(error)) = self.wire.as_ref().map(|wire| wire.send(&outgoing)) {
            self.close(error.to_string());
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
