//! A session that is connected again whenever its connection ends, and reports to the hub.

use std::ops::ControlFlow;
use std::time::Duration;

use anyhow::{Context, Result, ensure};
use robot_session::{Driver, Ended, Session, now};

use super::Client;
use crate::end::End;
use crate::metric::Definition;
use crate::report::{Command, Outcome};
use crate::site::Cell;
use cellwire_io::latency::Deadline;
use cellwire_io::port::AnyPort;
use cellwire_io::tcp::Dialing;
use cellwire_links::settings::Fields;
use serde_json::json;

/// The wait before the first attempt to connect again; each one after it waits twice as long, up to the longest.
const FIRST_WAIT: Duration = Duration::from_millis(250);
const LONGEST_WAIT: Duration = Duration::from_secs(10);
/// How often commands and the end of the bridge are looked at.
const GLANCE: Duration = Duration::from_millis(50);

/// When a device that does not answer counts as dead.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Silence {
    /// After this long; zero: never, it counts as alive while it is connected.
    pub time: Duration,
    /// It answers what it is asked, and has not seen who asks if it does not: then the connection is reopened. Another one speaks by
    /// itself, and may begin at any time.
    pub is_asked: bool,
}

impl Silence {
    /// Of a device that sends unsolicited messages.
    pub(super) fn of_speaker(time: Duration) -> Self {
        Self { time, is_asked: false }
    }

    /// For a device polled with this period: at least three requests without an answer.
    pub(super) fn of_asked(time: Duration, every: Duration) -> Self {
        let time = if time.is_zero() { time } else { time.max(every.saturating_mul(3)) };
        Self { time, is_asked: true }
    }

    /// Its setting.
    pub(super) fn configure(fields: &mut impl Fields, time: &mut Duration) {
        let range = Duration::ZERO..=Duration::from_secs(3600);
        let about = "the silence, of at least three requests, after which the device is dead; 0s: never while connected";
        fields.time("silence", range, about, time);
    }
}

/// What the bridge does with a session.
pub(super) trait Adapter {
    /// The session.
    type Session: Session;

    /// Whether an event is the device's doing, so that it is alive.
    fn is_answer(event: &<Self::Session as Session>::Event) -> bool;

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

/// The client of a cell whose device waits for a connection: at `HOST:PORT`, or on a serial line if the link has one.
///
/// # Errors
/// When the cell has no such address.
pub(super) fn of<A>(
    cell: &Cell,
    metrics: &'static [Definition],
    line: Option<Line>,
    silence: Silence,
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
        .context("this link's device does not connect to the bridge: give address instead of listen")?;
    ensure!(
        line.is_some() || !AnyPort::is_serial(&place),
        "{place} looks like a serial port, but this link uses TCP: give HOST:PORT"
    );
    let line = line.unwrap_or(Line { baud: 0, deadline: None });
    let device = Device { place, line, dialing: super::dialing(cell), silence };
    Ok(Client::new(metrics, move |end| run(adapter, session, &device, end)))
}

/// The serial line of a link.
#[derive(Debug, Clone, Copy)]
pub(super) struct Line {
    /// The baud rate.
    pub(super) baud: u32,
    /// The deadline that a USB adapter may miss.
    pub(super) deadline: Option<Deadline>,
}

/// Where the device is, and when it counts as dead.
struct Device {
    place: String,
    line: Line,
    dialing: Dialing,
    silence: Silence,
}

/// Runs until the bridge ends.
fn run<A: Adapter>(mut adapter: A, mut session: A::Session, device: &Device, mut end: End) {
    let mut wait = FIRST_WAIT;
    let mut deadline = device.line.deadline;
    while !end.is_stopped() {
        let why = match AnyPort::open(&device.place, device.line.baud, device.dialing) {
            Ok(port) => {
                // Once: another attempt opens the same port.
                if let Some(advice) = deadline.take().and_then(|deadline| deadline.advice(&device.place)) {
                    end.event(&json!({"event": "slow_adapter", "why": advice}));
                }
                session.handle_connected(now());
                let (has_answered, why) =
                    connection(&mut adapter, &mut session, Driver::new(port), device, &mut end);
                // A device that accepts connections and does not answer is tried less and less often.
                wait = if has_answered { FIRST_WAIT } else { wait };
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

/// Until the connection ends: whether the device has answered on it, and why it ended. The device is alive from its first answer on.
fn connection<A: Adapter>(
    adapter: &mut A,
    session: &mut A::Session,
    mut driver: Driver<AnyPort>,
    Device { place, silence, .. }: &Device,
    end: &mut End,
) -> (bool, String) {
    let (mut heard, mut is_alive, mut has_answered) = (now(), silence.time.is_zero(), false);
    if is_alive {
        end.connected(place);
    }
    while !end.is_over() {
        if !silence.time.is_zero() && now().saturating_sub(heard) > silence.time {
            let why = format!("the device has not answered for {}", humantime::format_duration(silence.time));
            if silence.is_asked {
                return (has_answered, why);
            }
            is_alive = false;
            end.disconnected(&why);
        }
        if let Some(command) = end.command() {
            // Such a device may be about to send.
            let begun = if is_alive || !silence.is_asked {
                adapter.command(session, command)
            } else {
                Err("the device does not answer".into())
            };
            if let Err(why) = begun {
                end.finish(Outcome::Refused, why);
            }
        }
        let wait = adapter.step(session, end).unwrap_or(GLANCE).min(GLANCE);
        let turn = driver.turn(session, Some(wait), |session, event| {
            if A::is_answer(&event) {
                (heard, has_answered) = (now(), true);
                if !core::mem::replace(&mut is_alive, true) {
                    end.connected(place);
                }
            }
            match adapter.event(session, event, end) {
                Ok(()) => ControlFlow::Continue(()),
                Err(why) => ControlFlow::Break(why),
            }
        });
        let why = match turn {
            Ok(ControlFlow::Continue(())) => continue,
            Ok(ControlFlow::Break(Ended::ByHandler(why))) => why,
            Ok(ControlFlow::Break(Ended::ByPeer)) => "the device closed the connection".into(),
            Ok(ControlFlow::Break(Ended::Stalled)) => "the device does not read".into(),
            Err(error) => error.to_string(),
        };
        return (has_answered, why);
    }
    (has_answered, "the bridge ends".into())
}
