//! A session that is connected again whenever its connection ends, and reports to the hub.

use std::ops::ControlFlow;
use std::time::Duration;

use anyhow::{Context, Result, ensure};
use robot_session::{Driver, Ended, Session, now};

use super::Client;
use crate::end::End;
use crate::hall::Cell;
use crate::metric::Definition;
use crate::report::{Command, Outcome};
use cellwire::io::port::AnyPort;

/// A connection may take so long to open.
const CONNECT: Duration = Duration::from_secs(5);
/// The wait before the first attempt to connect again; each one after it waits twice as long, up to the longest.
const FIRST_WAIT: Duration = Duration::from_millis(250);
const LONGEST_WAIT: Duration = Duration::from_secs(10);
/// Commands and the end of the bridge are looked at so often.
const GLANCE: Duration = Duration::from_millis(50);

/// What the bridge does with a session.
pub(super) trait Adapter {
    /// The session.
    type Session: Session;

    /// Does what is due; how long it has nothing to do, unless something happens.
    fn step(&mut self, _: &mut Self::Session, _: &mut End) -> Option<Duration> {
        None
    }

    /// Something has happened. Only a connection that is best given up is an error.
    ///
    /// # Errors
    /// Why.
    fn event(
        &mut self,
        session: &mut Self::Session,
        event: <Self::Session as Session>::Event,
        end: &mut End,
    ) -> Result<(), String>;

    /// Begins a command; its outcome is reported by [`End::finish`].
    ///
    /// # Errors
    /// Why it is refused: nothing of it was given to the session.
    fn command(&mut self, session: &mut Self::Session, command: Command) -> Result<(), String>;

    /// The connection has ended, and its last events were taken: what has no outcome now has none.
    fn lost(&mut self) {}
}

/// The client of a cell whose device waits for a connection: at `HOST:PORT`, or on a serial line where the link has a `baud` rate.
///
/// # Errors
/// When the cell has no such address.
pub(super) fn of<A>(
    cell: &Cell,
    metrics: &'static [Definition],
    baud: Option<u32>,
    session: A::Session,
    adapter: A,
) -> Result<Client>
where
    A: Adapter + Send + 'static,
    A::Session: Send + 'static,
{
    let place = cell
        .address
        .clone()
        .context("this link's device does not connect by itself: give address instead of listen")?;
    ensure!(
        baud.is_some() || !AnyPort::is_serial(&place),
        "{place} would be a serial port, and this link has none: give HOST:PORT"
    );
    Ok(Client::new(metrics, move |end| run(adapter, session, &place, baud.unwrap_or_default(), end)))
}

/// Runs until the bridge ends.
fn run<A: Adapter>(mut adapter: A, mut session: A::Session, place: &str, baud: u32, mut end: End) {
    let mut wait = FIRST_WAIT;
    while !end.is_stopped() {
        let why = match AnyPort::open(place, baud, CONNECT) {
            Ok(port) => {
                session.handle_connected(now());
                end.connected(place);
                wait = FIRST_WAIT;
                let why = connection(&mut adapter, &mut session, Driver::new(port), &mut end);
                session.handle_disconnected(now());
                while let Some(event) = session.poll_event() {
                    let _ = adapter.event(&mut session, event, &mut end);
                }
                adapter.lost();
                end.finish(Outcome::Unknown, format!("the connection has ended: {why}"));
                why
            }
            Err(error) => format!("{error:#}"),
        };
        end.disconnected(&why);
        if !end.wait(wait) {
            return;
        }
        wait = (wait * 2).min(LONGEST_WAIT);
    }
}

/// Until the connection ends; why.
fn connection<A: Adapter>(
    adapter: &mut A,
    session: &mut A::Session,
    mut driver: Driver<AnyPort>,
    end: &mut End,
) -> String {
    while !end.is_stopped() {
        if let Some(command) = end.command()
            && let Err(why) = adapter.command(session, command)
        {
            end.finish(Outcome::Refused, why);
        }
        let wait = adapter.step(session, end).unwrap_or(GLANCE).min(GLANCE);
        let turn =
            driver.turn(session, Some(wait), |session, event| match adapter.event(session, event, end) {
                Ok(()) => ControlFlow::Continue(()),
                Err(why) => ControlFlow::Break(why),
            });
        match turn {
            Ok(ControlFlow::Continue(())) => {}
            Ok(ControlFlow::Break(Ended::ByHandler(why))) => return why,
            Ok(ControlFlow::Break(Ended::ByPeer)) => return "the device has closed it".into(),
            Err(error) => return error.to_string(),
        }
    }
    "the bridge ends".into()
}
