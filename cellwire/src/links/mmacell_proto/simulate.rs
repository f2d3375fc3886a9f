//! `cellwire simulate mma-robot` and `mma-platform`: a device to test a controller against.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};

use anyhow::{Result, bail, ensure};
use mmacell_proto::{PlatformPose, RobotPose};
use serde_json::json;

use super::axes::Simulated;
use super::central::CONFIG;
use super::codec::{DIALECT, dialect};
use super::station::Station;
use crate::settings::Settings;
use crate::simulate::{Endpoint, SimulateOptions, log, ready};
use crate::tcp;
use crate::trace::{Trace, Way};

/// The robot until interrupted.
///
/// # Errors
/// When the endpoint cannot be opened, or a setting is none of this device's.
pub fn robot(options: &SimulateOptions) -> Result<()> {
    simulate::<RobotPose>("mma-robot", CONFIG.robot_home, options)
}

/// The platform until interrupted.
///
/// # Errors
/// When the endpoint cannot be opened, or a setting is none of this device's.
pub fn platform(options: &SimulateOptions) -> Result<()> {
    simulate::<PlatformPose>("mma-platform", CONFIG.platform_home, options)
}

/// Settings: `speed`, how many times faster than life it moves; `fail_every`, `mute_every` and `drop_every`, after how many
/// motions one fails with an error of servo motor 1, and after how many reads one is not answered or ends the connection;
/// those of the dialect.
fn simulate<P: Simulated>(name: &'static str, home: P, options: &SimulateOptions) -> Result<()> {
    let known = [&["speed", "fail_every", "mute_every", "drop_every"][..], &DIALECT].concat();
    let settings = Settings::new(name, &options.settings, &known)?;
    let speed = settings.number("speed", 1u32)?;
    ensure!((1..=10_000).contains(&speed), "speed={speed} is outside 1 to 10000");
    let mut faults = Inject {
        fail: settings.number("fail_every", 0)?,
        mute: settings.number("mute_every", 0)?,
        drop: settings.number("drop_every", 0)?,
        reads: 0,
    };
    let Endpoint::Listen(address) = &options.endpoint else { bail!("{name} is a TCP server: use --listen") };
    let mut station = Station::new(home, dialect(&options.settings)?);
    if faults.fail > 0 {
        station.fail_motion(faults.fail);
    }
    let listener = tcp::listen(address)?;
    ready(name, "listen", &listener.local_addr()?.to_string())?;
    let clock = Instant::now();
    let trace = options.trace.start(name);
    for stream in listener.incoming() {
        let stream = stream?;
        let peer = stream.peer_addr().map_or_else(|_| "gone".into(), |peer| peer.to_string());
        log(&json!({"event": "connected", "peer": peer}))?;
        station.connect();
        let why = match serve(stream, &mut station, &mut faults, &trace, || {
            (clock.elapsed(), clock.elapsed() * speed)
        }) {
            Ok(why) => why.to_owned(),
            Err(error) => format!("{error:#}"),
        };
        log(&json!({"event": "disconnected", "peer": peer, "why": why}))?;
        if let Some(path) = trace.session_ended(&why)? {
            log(&json!({"event": "trace", "path": path}))?;
        }
    }
    Ok(())
}

/// Every how many motions or reads something goes wrong; 0: never.
#[derive(Debug)]
struct Inject {
    fail: u64,
    mute: u64,
    drop: u64,
    reads: u64,
}

/// One connection until it ends, and why it ended. `now` gives the time of the trace, and that of the axes.
fn serve<P: Simulated>(
    mut stream: TcpStream,
    station: &mut Station<P>,
    faults: &mut Inject,
    trace: &Trace,
    now: impl Fn() -> (Duration, Duration),
) -> Result<&'static str> {
    stream.set_nodelay(true)?;
    let mut buffer = [0; 4096];
    loop {
        let bytes = match stream.read(&mut buffer)? {
            0 => return Ok("the controller closed the connection"),
            n => buffer.get(..n).unwrap_or_default(),
        };
        let (at, of_axes) = now();
        trace.add(at, Way::Received, bytes);
        let motions = station.motions();
        let heard = station.hear(of_axes, bytes);
        if faults.fail > 0 && motions / faults.fail < station.motions() / faults.fail {
            station.fail_motion(faults.fail + 1);
        }
        heard.events.iter().try_for_each(log)?;
        faults.reads += 1;
        let every = |n: u64| n > 0 && faults.reads.is_multiple_of(n);
        if every(faults.drop) {
            return Ok("the set fault: the connection is dropped before the reply");
        }
        if every(faults.mute) {
            log(&json!({"event": "muted"}))?;
            continue;
        }
        trace.add(now().0, Way::Sent, &heard.replies);
        stream.write_all(&heard.replies)?;
        if heard.closed {
            return Ok("the controller said CLO");
        }
    }
}
