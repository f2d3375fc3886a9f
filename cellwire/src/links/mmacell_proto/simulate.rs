//! `cellwire simulate mma-robot` and `mma-platform`: a device to test a central controller against.

use std::io::{Read, Write};
use std::net::{Shutdown, TcpStream};
use std::time::{Duration, Instant};

use anyhow::{Result, bail};
use mmacell_proto::{PlatformPose, RobotPose};
use serde_json::json;

use super::axes::{PLATFORM_HOME, ROBOT_HOME, Simulated};
use super::connections::Connections;
use super::options::DeviceSettings;
use super::station::Station;
use crate::io::output::{log, ready};
use crate::io::tcp::{self, is_silence};
use crate::io::trace::{Trace, Way};
use crate::links::device::{Endpoint, SimulateOptions};
use cellwire_links::settings;

/// The robot until interrupted.
///
/// # Errors
/// When the endpoint cannot be opened, or a setting is none of this device's.
pub fn robot(options: &SimulateOptions) -> Result<()> {
    simulate::<RobotPose>("mma-robot", ROBOT_HOME, options)
}

/// The platform until interrupted.
///
/// # Errors
/// When the endpoint cannot be opened, or a setting is none of this device's.
pub fn platform(options: &SimulateOptions) -> Result<()> {
    simulate::<PlatformPose>("mma-platform", PLATFORM_HOME, options)
}

/// The settings are those of [`DeviceSettings`].
fn simulate<P: Simulated>(name: &'static str, home: P, options: &SimulateOptions) -> Result<()> {
    let DeviceSettings { config, speed, faults: motions, mute_every, drop_every } =
        settings::read(name, DeviceSettings::default(), &options.settings)?;
    let mut faults = Inject { mute: mute_every, drop: drop_every, reads: 0 };
    let Endpoint::Listen(address) = &options.endpoint else { bail!("{name} is a TCP server: use --listen") };
    let mut station = Station::new(home, config, motions)?;
    let listener = tcp::listen(address)?;
    ready(name, "listen", &listener.local_addr()?.to_string())?;
    let clock = Instant::now();
    let trace = options.trace.start(name);
    for stream in Connections::accept(listener, options.idle_timeout)? {
        let peer = stream.peer_addr().map_or_else(|_| "gone".into(), |peer| peer.to_string());
        log(&json!({"event": "connected", "peer": peer}))?;
        station.connect(clock.elapsed() * speed);
        let why = match serve(stream, &mut station, &mut faults, &trace, || {
            (clock.elapsed(), clock.elapsed() * speed)
        }) {
            Ok(why) => why.to_owned(),
            Err(error) => match (error.downcast_ref().is_some_and(is_silence), options.idle_timeout) {
                (true, Some(timeout)) => {
                    format!("silent for {} s, see --idle-timeout", timeout.as_secs_f64())
                }
                _ => format!("{error:#}"),
            },
        };
        log(&json!({"event": "disconnected", "peer": peer, "why": why}))?;
        if let Some(path) = trace.finish(&why) {
            log(&json!({"event": "trace", "path": path}))?;
        }
    }
    Ok(())
}

/// Every how many reads something goes wrong; 0: never.
#[derive(Debug)]
struct Inject {
    mute: u64,
    drop: u64,
    reads: u64,
}

/// One connection until it ends, and why it ended. `now` gives the time of the trace, and that of the axes.
fn serve<P: Simulated>(
    stream: TcpStream,
    station: &mut Station<P>,
    faults: &mut Inject,
    trace: &Trace,
    now: impl Fn() -> (Duration, Duration),
) -> Result<&'static str> {
    let outcome = converse(&stream, station, faults, trace, now);
    // What would end it from another thread has a second handle to it.
    let _ = stream.shutdown(Shutdown::Both);
    outcome
}

fn converse<P: Simulated>(
    mut stream: &TcpStream,
    station: &mut Station<P>,
    faults: &mut Inject,
    trace: &Trace,
    now: impl Fn() -> (Duration, Duration),
) -> Result<&'static str> {
    let mut buffer = [0; 4096];
    loop {
        let bytes = match stream.read(&mut buffer)? {
            0 => return Ok("the central controller closed the connection, or another one took its place"),
            n => buffer.get(..n).unwrap_or_default(),
        };
        let (at, of_axes) = now();
        trace.add(at, Way::Received, bytes);
        let answer = station.receive(of_axes, bytes);
        answer.events.iter().try_for_each(log)?;
        faults.reads += 1;
        let every = |n: u64| n > 0 && faults.reads.is_multiple_of(n);
        if every(faults.drop) {
            return Ok("the set fault: the connection is dropped before the reply");
        }
        if every(faults.mute) {
            log(&json!({"event": "muted"}))?;
            continue;
        }
        trace.add(now().0, Way::Sent, &answer.replies);
        stream.write_all(&answer.replies)?;
        if answer.closed {
            return Ok("the connection ended by CLO, or by more commands than can be kept");
        }
    }
}

#[cfg(test)]
mod tests {
    use std::io::{BufRead, BufReader, ErrorKind};
    use std::thread;

    use mmacell_proto::DeviceConfig;

    use super::*;
    use crate::links::mmacell_proto::station::MotionFaults;

    /// What a robot with these faults answers to these lines, until it ends the connection.
    fn talk(mut faults: Inject, lines: &[&str]) -> (Vec<String>, &'static str) {
        let listener = tcp::listen("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap().to_string();
        let robot = thread::spawn(move || {
            let config = DeviceConfig::DEFAULT;
            let mut station = Station::new(RobotPose::ORIGIN, config, MotionFaults::default()).unwrap();
            station.connect(Duration::ZERO);
            let clock = Instant::now();
            let now = || (clock.elapsed(), clock.elapsed());
            serve(listener.accept().unwrap().0, &mut station, &mut faults, &Trace::new("x", 0, None), now)
                .unwrap()
        });
        let mut stream = tcp::connect(&address, tcp::CONNECT_TIMEOUT).unwrap();
        stream.set_read_timeout(Some(Duration::from_millis(200))).unwrap();
        let mut reader = BufReader::new(stream.try_clone().unwrap());
        let mut replies = Vec::new();
        for line in lines {
            let mut reply = String::new();
            match stream.write_all(line.as_bytes()).and_then(|()| reader.read_line(&mut reply)) {
                Ok(1..) => replies.push(reply.trim_end().to_owned()),
                Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {
                    replies.push("silence".into());
                }
                Ok(0) | Err(_) => break, // what is written to a connection that has ended resets it
            }
        }
        drop((stream, reader));
        (replies, robot.join().unwrap())
    }

    const NONE: Inject = Inject { mute: 0, drop: 0, reads: 0 };

    #[test]
    fn a_robot_answers_until_the_connection_ends() {
        let (replies, why) = talk(NONE, &["SRVON\r\n", "STA\r\n", "PNP\r\n", "CLO\r\n", "STA\r\n"]);
        let status = "OKF+000.000+000.000+000.000+00.0000T+00100+00000";
        assert_eq!(replies, ["OK", status, "ER+00001", "OK"]);
        assert_eq!(why, "the connection ended by CLO, or by more commands than can be kept");
    }

    #[test]
    fn a_set_fault_mutes_or_drops() {
        let (replies, _) = talk(Inject { mute: 2, ..NONE }, &["STP\r\n", "STP\r\n", "STP\r\n"]);
        assert_eq!(replies, ["OK", "silence", "OK"]);
        let (replies, why) = talk(Inject { drop: 2, ..NONE }, &["STP\r\n", "STP\r\n", "STP\r\n"]);
        assert_eq!(replies, ["OK"]);
        assert_eq!(why, "the set fault: the connection is dropped before the reply");
    }

    /// The first connection is half open: its central controller has vanished without a word.
    #[test]
    fn a_second_connection_is_served_at_once_while_the_first_is_half_open() {
        let listener = tcp::listen("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap().to_string();
        thread::spawn(move || {
            let mut station =
                Station::new(RobotPose::ORIGIN, DeviceConfig::DEFAULT, MotionFaults::default()).unwrap();
            for stream in Connections::accept(listener, None).unwrap() {
                station.connect(Duration::ZERO);
                let now = || (Duration::ZERO, Duration::ZERO);
                let _ = serve(stream, &mut station, &mut { NONE }, &Trace::new("x", 0, None), now);
            }
        });
        let mut first = tcp::connect(&address, tcp::CONNECT_TIMEOUT).unwrap();
        first.write_all(b"ST").unwrap();
        for _ in 0..3 {
            let mut second = tcp::connect(&address, tcp::CONNECT_TIMEOUT).unwrap();
            second.set_read_timeout(Some(Duration::from_secs(5))).unwrap();
            second.write_all(b"STP\r\n").unwrap();
            let mut reply = String::new();
            BufReader::new(second.try_clone().unwrap()).read_line(&mut reply).unwrap();
            assert_eq!(reply, "OK\r\n");
            std::mem::forget(second); // half open, too
        }
    }
}
