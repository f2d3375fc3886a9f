//! `cellwire simulate mma-robot` and `mma-platform`: a device to test a central controller against.

use std::io::{self, ErrorKind};
use std::net::TcpStream;
use std::ops::ControlFlow;
use std::thread;
use std::time::Duration;

use anyhow::{Result, bail};
use cellwire_sim::mma::{Fate, Mma, MmaDevice, MmaEvent, Simulated};
use cellwire_sim::{Fault, MmaPlatform, MmaRobot, Settings as _, Simulator, Told};
use robot_session::spec::Configure;
use robot_session::{Driver, Ended, Received, Sent, Session as _, Transport, Wait};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::connections::Connections;
use crate::devices::control::{Command, Fields, Own, fields};
use crate::devices::device::{Endpoint, LOOK, SimulateOptions};
use cellwire_io::clock::Clock;
use cellwire_io::drive::Traced;
use cellwire_io::output::{log, notice};
use cellwire_io::stream::Stream;
use cellwire_io::tcp;
use cellwire_links::settings;

/// The robot until interrupted.
///
/// # Errors
/// When the endpoint cannot be opened, or a setting is none of this device's.
pub fn robot(options: &SimulateOptions) -> Result<()> {
    simulate("mma-robot", MmaRobot::default(), options)
}

/// The platform until interrupted.
///
/// # Errors
/// When the endpoint cannot be opened, or a setting is none of this device's.
pub fn platform(options: &SimulateOptions) -> Result<()> {
    simulate("mma-platform", MmaPlatform::default(), options)
}

fn simulate<P: Simulated + Serialize>(
    name: &'static str,
    settings: Mma<P>,
    options: &SimulateOptions,
) -> Result<()>
where
    Mma<P>: Configure,
{
    let settings = settings::read(name, settings, &options.settings)?;
    let Endpoint::Listen(address) = &options.endpoint else { bail!("{name} is a TCP server: use --listen") };
    let mut device = settings.simulator()?.keeping_nothing();
    let listener = tcp::listen(address)?;
    options.ready(name, "listen", &listener.local_addr()?.to_string())?;
    options.control(name, &mut device, own())?;
    // Without commands, everything that happens to the device comes from its client.
    let look = options.control.as_ref().map(|_| LOOK);
    let clock = Clock::start();
    let trace = options.trace.start(name);
    let mut connections = Connections::accept(listener, options.idle_timeout)?;
    while let Some(stream) = next(&mut connections, &mut device, clock, look)? {
        let peer = stream.peer_addr().map_or_else(|_| "gone".into(), |peer| peer.to_string());
        notice(&json!({"event": "connected", "peer": peer}))?;
        let mut watched =
            Watched { stream: Stream::new(stream), clock, idle: options.idle_timeout, heard: clock.now() };
        let why = serve(&mut device, Traced::new(&mut watched, &trace, clock), look)?;
        // What would end it from another thread has a second handle to it.
        watched.stream.close();
        notice(&json!({"event": "disconnected", "peer": peer, "why": why}))?;
        if let Some(path) = trace.finish(&why) {
            log(&json!({"event": "trace", "path": path}))?;
        }
    }
    Ok(())
}

/// The commands of `--control`: the end of a motion, and the pose.
fn own<P: Simulated + Serialize>() -> Own<MmaDevice<P>> {
    Own {
        commands: const {
            &[
                Command {
                    name: "end_motion",
                    about: "the `fate` of the motion that is under way: arrives, fails (half-way, with an error) or stalls (half-way, without one)",
                    examples: &[r#"{"do":"end_motion","fate":"stalls"}"#],
                },
                Command::get("the pose in mm and rad, whether the device moves, and the number of motions"),
            ]
        },
        execute: |device, args| {
            if args.name == "end_motion" {
                let End { fate } = args.read()?;
                if !device.moves() {
                    return Err("no motion is under way; send a motion first".into());
                }
                device.end_motion(match fate {
                    Ending::Arrives => Fate::Arrives,
                    Ending::Fails => Fate::Fails,
                    Ending::Stalls => Fate::Stalls,
                });
                return Ok(Fields::new());
            }
            args.none()?;
            Ok(fields([
                ("pose", json!(device.pose())),
                ("moves", device.moves().into()),
                ("motions", device.motions().into()),
            ]))
        },
        show: Box::new(|motion| json!({"to": motion.to, "at": motion.at})),
    }
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct End {
    fate: Ending,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Ending {
    Arrives,
    Fails,
    Stalls,
}

/// The next connection, while the device has power. Calls the device meanwhile, each time that `look` has passed.
fn next<P: Simulated + Serialize>(
    connections: &mut Connections,
    device: &mut Simulator<MmaDevice<P>>,
    clock: Clock,
    look: Option<Duration>,
) -> Result<Option<TcpStream>> {
    let Some(look) = look else { return Ok(connections.next()) };
    loop {
        device.handle_timeout(clock.now());
        while let Some(told) = device.poll_event() {
            print(&told)?;
        }
        if !device.accepts(clock.now()) {
            thread::sleep(look);
        } else if let Some(stream) = connections.next_within(look) {
            return Ok(Some(stream));
        }
    }
}

/// One connection until it ends, and why it ended.
fn serve<P: Simulated + Serialize>(
    device: &mut Simulator<MmaDevice<P>>,
    transport: impl Transport,
    look: Option<Duration>,
) -> Result<String> {
    let mut driver = Driver::new(transport);
    device.handle_connected(driver.transport_mut().now());
    let why = loop {
        let turn = driver.turn(device, look, |_, told| match told {
            Told::Close(why) => ControlFlow::Break(Ok(why)),
            told => match print(&told) {
                Ok(()) => ControlFlow::Continue(()),
                Err(error) => ControlFlow::Break(Err(error)),
            },
        });
        match turn {
            Ok(ControlFlow::Continue(())) => {}
            Ok(ControlFlow::Break(Ended::ByHandler(why))) => break why?.to_owned(),
            Ok(ControlFlow::Break(Ended::ByPeer)) => {
                break "the central controller closed the connection, or another one replaced it".into();
            }
            Ok(ControlFlow::Break(Ended::Stalled)) => break "the central controller does not read".into(),
            Err(error) => break error.to_string(),
        }
    };
    device.handle_disconnected(driver.transport_mut().now());
    Ok(why)
}

fn print<P: Simulated + Serialize>(told: &Told<MmaEvent<P>>) -> Result<()> {
    let print = match told {
        Told::Device(MmaEvent::Refused(_) | MmaEvent::Rejected(_)) => notice,
        _ => log,
    };
    show(told).map_or(Ok(()), |line| print(&line))
}

fn show<P: Simulated + Serialize>(told: &Told<MmaEvent<P>>) -> Option<Value> {
    Some(match told {
        Told::Fault(Fault::Drop) => json!({"event": "muted"}),
        Told::Device(MmaEvent::Move(to)) => json!({"event": "move", "to": to}),
        Told::Device(MmaEvent::Home) => json!({"event": "home"}),
        Told::Device(MmaEvent::Servo(on)) => json!({"event": "servo", "on": on}),
        Told::Device(MmaEvent::Override(percent)) => json!({"event": "override", "percent": percent}),
        Told::Device(MmaEvent::Refused(error)) => json!({"event": "refused", "error": error}),
        Told::Device(MmaEvent::Rejected(reason)) => {
            json!({"event": "rejected", "reason": reason.to_string()})
        }
        Told::Device(MmaEvent::Closed(reason)) => {
            json!({"event": "closed", "reason": format!("{reason:?}").to_lowercase()})
        }
        _ => return None,
    })
}

/// A connection that fails when nothing was heard on it for too long.
struct Watched {
    stream: Stream,
    clock: Clock,
    idle: Option<Duration>,
    /// When something was heard last.
    heard: Duration,
}

impl Transport for Watched {
    fn receive(&mut self, buffer: &mut [u8], wait: Wait<'_>) -> io::Result<Received> {
        let Some(idle) = self.idle else { return self.stream.receive(buffer, wait) };
        let left = self.heard.saturating_add(idle).saturating_sub(self.clock.now());
        let received = self.stream.receive(buffer, wait.at_most(left))?;
        let now = self.clock.now();
        match received {
            Received::Nothing if now.saturating_sub(self.heard) >= idle => {
                let why = format!("silent for {} s, see --idle-timeout", idle.as_secs_f64());
                return Err(io::Error::new(ErrorKind::TimedOut, why));
            }
            Received::Bytes(_) => self.heard = now,
            _ => {}
        }
        Ok(received)
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<Sent> {
        self.stream.send(bytes)
    }
}

#[cfg(test)]
mod tests {
    use std::io::{BufRead as _, BufReader, Write as _};

    use super::*;
    use cellwire_io::trace::Trace;

    /// The first connection is half open: its central controller has vanished without a word.
    #[test]
    fn a_second_connection_is_served_at_once_while_the_first_is_half_open() {
        let listener = tcp::listen("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap().to_string();
        thread::spawn(move || {
            let mut device = MmaRobot::default().simulator().unwrap();
            let trace = Trace::new("x", 0, None);
            for stream in Connections::accept(listener, None).unwrap() {
                let _ = serve(&mut device, Traced::new(Stream::new(stream), &trace, Clock::start()), None);
            }
        });
        let mut first = tcp::connect(&address, tcp::Dialing::default()).unwrap();
        first.write_all(b"ST").unwrap();
        for _ in 0..3 {
            let mut second = tcp::connect(&address, tcp::Dialing::default()).unwrap();
            second.set_read_timeout(Some(Duration::from_secs(5))).unwrap();
            second.write_all(b"STP\r\n").unwrap();
            let mut reply = String::new();
            BufReader::new(second.try_clone().unwrap()).read_line(&mut reply).unwrap();
            assert_eq!(reply, "OK\r\n");
            std::mem::forget(second); // half open, too
        }
    }
}
