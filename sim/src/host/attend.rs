//! The host of a device that has one connection after the other.

use core::cell::RefCell;
use core::ops::ControlFlow;
use core::time::Duration;
use std::io;

use robot_session::{Driver, EndReason, Transport};

use super::{ConnectionEnd, HostedSession, Notice, Request};

/// The transport of a device, which also makes and ends its connections.
pub trait Endpoint: Transport {
    /// The failure of the endpoint.
    type Error;

    /// Looks for a change of the connection; called before each turn. A transport without a connection receives nothing.
    ///
    /// # Errors
    /// The endpoint cannot be used any more.
    fn look(&mut self, device: State) -> Result<Option<Change>, Self::Error>;

    /// Ends the connection. Returns false if the endpoint makes no other one: then the host returns.
    fn end(&mut self, ending: &ConnectionEnd) -> bool;
}

/// The state of a device between two turns.
#[derive(Debug, Clone, Copy)]
pub struct State {
    /// The device has a connection.
    pub is_connected: bool,
    /// The device can have a connection now.
    pub accepts: bool,
    /// The device does not read: the time of a transport that passes only while it is read is advanced by [`Endpoint::look`].
    pub is_held: bool,
    /// The device, which is a client, is to be connected.
    pub connects: bool,
}

/// A change of the connection of an endpoint.
#[derive(Debug)]
pub enum Change {
    /// The peer of this name is connected; an earlier connection is replaced.
    Connected(String),
    /// The connection has ended, or could not be made.
    Disconnected(ConnectionEnd),
}

/// Runs a session over an endpoint while `goes_on`, which is called at least each time that `look` has passed. Afterwards
/// the session still has its connection.
///
/// # Errors
/// The errors of the endpoint and of `observe`.
pub fn attend<S: HostedSession, T: Endpoint, E: From<T::Error>>(
    session: &mut S,
    mut endpoint: T,
    look: Duration,
    mut goes_on: impl FnMut() -> bool,
    mut observe: impl FnMut(&mut S, Notice<'_, S::Event>) -> Result<(), E>,
) -> Result<(), E> {
    let (mut driver, mut peer) = (Driver::new(&mut endpoint), None::<String>);
    let mut connects = false;
    while goes_on() {
        let now = driver.transport_mut().now();
        let state = State {
            is_connected: peer.is_some(),
            accepts: session.accepts(now),
            is_held: session.is_held(),
            connects: core::mem::take(&mut connects),
        };
        let change = driver.transport_mut().look(state)?;
        let now = driver.transport_mut().now();
        match change {
            Some(Change::Connected(name)) => {
                // Bytes of the previous connection are not sent on the next one.
                driver = Driver::new(&mut endpoint);
                if let Some(before) = peer.take() {
                    session.handle_disconnected(now);
                    observe(session, Notice::Disconnected(&before, &ConnectionEnd::Replaced))?;
                }
                session.handle_connected(now);
                observe(session, Notice::Connected(&name))?;
                peer = Some(name);
            }
            Some(Change::Disconnected(ending)) => {
                session.handle_disconnected(now);
                observe(session, Notice::Disconnected(&peer.take().unwrap_or_default(), &ending))?;
            }
            None => {}
        }
        let name = peer.as_deref().unwrap_or_default();
        let (observer, mut failed) = (RefCell::new(&mut observe), None);
        let keep = |session: &mut S| {
            let kept = (observer.borrow_mut())(session, Notice::Sending);
            kept.map_err(|error| {
                failed = Some(error);
                io::Error::other("the state cannot be stored")
            })
        };
        let turn = driver.turn_with(session, Some(look), keep, |session, event| {
            let request = S::request(&event);
            if let Err(error) = (observer.borrow_mut())(session, Notice::Event(name, event)) {
                return ControlFlow::Break(Err(error));
            }
            match request {
                Some(Request::Close(why)) => ControlFlow::Break(Ok(Some(ConnectionEnd::ByDevice(why)))),
                Some(Request::Connect) => ControlFlow::Break(Ok(None)),
                None => ControlFlow::Continue(()),
            }
        });
        if let Some(error) = failed {
            return Err(error);
        }
        observe(session, Notice::Settled)?;
        let ending = match turn {
            Ok(ControlFlow::Continue(())) => continue,
            Ok(ControlFlow::Break(EndReason::ByHandler(request))) => match request? {
                Some(ending) => ending,
                None => {
                    connects = true;
                    continue;
                }
            },
            Ok(ControlFlow::Break(EndReason::ByPeer)) => ConnectionEnd::ByPeer,
            Ok(ControlFlow::Break(EndReason::Stalled)) => ConnectionEnd::Stalled,
            Err(error) => error.into(),
        };
        session.handle_disconnected(driver.transport_mut().now());
        let is_left = driver.transport_mut().end(&ending);
        if let Some(name) = peer.take() {
            observe(session, Notice::Disconnected(&name, &ending))?;
        }
        if !is_left {
            return Ok(());
        }
    }
    Ok(())
}
