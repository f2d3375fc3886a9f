//! Cuts a square over a serial line: `cargo run --features serialport --example cut_square /dev/ttyUSB0`. A simulator to try
//! it on: `cellwire simulate laser --pty /tmp/laser`.

use core::ops::ControlFlow;

use laser_eb90::robot_session::{EndReason, Serial, drive, serialport};
use laser_eb90::{Host, HostConfig, HostEvent, SessionError, timing};

/// A straight cut to X, Y: interpreted, so it is queued.
const LINE: u16 = 0x0101;
const CORNERS: [[f32; 2]; 5] = [[0.0, 0.0], [100.0, 0.0], [100.0, 100.0], [0.0, 100.0], [0.0, 0.0]];

fn main() -> Result<(), Box<dyn core::error::Error>> {
    let path = std::env::args().nth(1).ok_or("give the serial port")?;
    let mut host = Host::new(HostConfig::default())?;
    let port = serialport::new(path, timing::BAUD).open()?;
    submit(&mut host, 0)?;
    let ended = drive(&mut host, Serial(port), |host, event| match event {
        HostEvent::Done { first, count, .. } => {
            let next = first + u64::from(count);
            println!("{next} of {} corners are queued", CORNERS.len());
            match submit(host, usize::try_from(next).unwrap_or(CORNERS.len())) {
                Ok(0) if host.is_idle() => ControlFlow::Break(Ok(())),
                Ok(_) => ControlFlow::Continue(()),
                Err(error) => ControlFlow::Break(Err(error.to_string())),
            }
        }
        HostEvent::Corrupt(_) | HostEvent::Unasked { .. } => ControlFlow::Continue(()),
        other => ControlFlow::Break(Err(format!("look at the robot first: {other:?}"))),
    })?;
    match ended {
        EndReason::ByHandler(result) => Ok(result?),
        EndReason::ByPeer => Err("the port is gone".into()),
        EndReason::Stalled => Err("the port takes nothing".into()),
    }
}

/// Submits what fits into the next frame; returns how many corners.
fn submit(host: &mut Host, from: usize) -> Result<usize, SessionError> {
    for (count, corner) in CORNERS.iter().skip(from).enumerate() {
        match host.submit(LINE, |parameters| parameters.f32(corner).map(drop)) {
            Ok(_) => {}
            Err(SessionError::Full) => return Ok(count),
            Err(error) => return Err(error),
        }
    }
    Ok(CORNERS.len().saturating_sub(from))
}
