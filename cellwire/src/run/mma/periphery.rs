//! Cameras, valves and the vacuum switch: simulated, or at the end of a line.

use std::collections::VecDeque;
use std::io::{BufRead, BufReader};
use std::sync::mpsc::{self, Receiver, TryRecvError};
use std::thread;
use std::time::Duration;

use anyhow::{Context, Result};
use mmacell_proto::{PlatformPose, RobotPose, VACUUM};
use robot_session::now;

use super::connection::WAITING;
use super::settings::Part;
use super::wire::{STUCK, Wire};
use cellwire_io::bell::Bell;
use cellwire_io::tcp::Dialing;
use cellwire_io::tls::Tls;

/// A camera's answer, a valve that is set, the switch.
#[derive(Debug, Clone, PartialEq)]
pub enum PeripheryEvent {
    /// Camera 1 sees a part: the pose of the platform, and that in which the robot takes the part.
    Part(PlatformPose, RobotPose),
    /// Camera 2 sees the place: the pose in which the robot puts the part.
    Slot(RobotPose),
    /// A camera sees neither a part nor a place.
    Nothing,
    /// A valve is set as it was requested.
    ValveSet,
    /// The vacuum switch is high, or low.
    Switch(bool),
    /// The periphery cannot execute the request; the reason.
    Failed(String),
    /// The connection of the periphery is gone.
    Lost,
}

/// Cameras, valves and the vacuum switch.
pub trait Periphery {
    /// Orders a picture of camera 1 or 2, for the part of this number.
    fn acquire(&mut self, camera: i32, part: usize);

    /// Orders the vacuum valve or the blow valve to be opened or closed.
    fn set_valve(&mut self, valve: i32, open: bool);

    /// Returns the next event.
    fn poll(&mut self) -> Option<PeripheryEvent>;

    /// Returns the time of the next event for which no bell rings.
    fn due(&self) -> Option<Duration>;
}

/// Cameras that see the parts of the task, and a vacuum that builds up when its valve is open.
#[derive(Debug)]
pub struct SimulatedPeriphery {
    parts: Vec<Part>,
    vacuum: Duration,
    high_at: Option<Duration>,
    happened: VecDeque<PeripheryEvent>,
}

impl SimulatedPeriphery {
    /// Creates a periphery that sees these parts.
    pub fn new(parts: Vec<Part>, vacuum: Duration) -> Self {
        Self { parts, vacuum, high_at: None, happened: VecDeque::new() }
    }
}

impl Periphery for SimulatedPeriphery {
    fn acquire(&mut self, camera: i32, part: usize) {
        self.happened.push_back(match (self.parts.get(part), camera) {
            (Some(part), 1) => PeripheryEvent::Part(part.platform, part.pick),
            (Some(part), _) => PeripheryEvent::Slot(part.place),
            (None, _) => PeripheryEvent::Nothing,
        });
    }

    fn set_valve(&mut self, valve: i32, open: bool) {
        self.happened.push_back(PeripheryEvent::ValveSet);
        if valve == VACUUM {
            self.high_at = open.then(|| now().saturating_add(self.vacuum));
            if !open {
                self.happened.push_back(PeripheryEvent::Switch(false));
            }
        }
    }

    fn poll(&mut self) -> Option<PeripheryEvent> {
        if self.high_at.is_some_and(|at| at <= now()) {
            self.high_at = None;
            self.happened.push_back(PeripheryEvent::Switch(true));
        }
        self.happened.pop_front()
    }

    fn due(&self) -> Option<Duration> {
        self.high_at
    }
}

/// A periphery at a TCP address, in lines of text (see the help of `cellwire run mma`).
#[derive(Debug)]
pub struct Line {
    wire: Wire,
    lines: Receiver<String>,
    is_lost: bool,
}

impl Line {
    /// Connects to the periphery. The bell is rung for each of its lines, and when it is gone.
    ///
    /// # Errors
    /// If there is no peer.
    pub fn open(address: &str, dialing: Dialing, tls: Option<&Tls>, bell: Bell) -> Result<Self> {
        let wire = Wire::connect(address, dialing, tls).context("the periphery")?;
        wire.discard_after(STUCK)?;
        let (sender, lines) = mpsc::sync_channel(WAITING);
        let reader = BufReader::new(wire.clone());
        thread::spawn(move || {
            // No answer is longer.
            let mut reader = std::io::Read::take(reader, 0);
            loop {
                let mut line = String::new();
                reader.set_limit(4096);
                match reader.read_line(&mut line) {
                    Ok(1..) if sender.send(line).is_ok() => bell.ring(),
                    _ => break,
                }
            }
            drop(sender);
            bell.ring();
        });
        Ok(Self { wire, lines, is_lost: false })
    }

    fn write(&mut self, line: &str) {
        // Ignore a write error: a peer that does not read does not answer either, and that is reported.
        let _ = self.wire.send(line.as_bytes());
    }
}

/// Ends the connection.
impl Drop for Line {
    fn drop(&mut self) {
        self.wire.close();
    }
}

impl Periphery for Line {
    fn acquire(&mut self, camera: i32, _: usize) {
        self.write(&format!("acquire {camera}\n"));
    }

    fn set_valve(&mut self, valve: i32, open: bool) {
        let (valve, state) =
            (if valve == VACUUM { "vacuum" } else { "blow" }, if open { "on" } else { "off" });
        self.write(&format!("{valve} {state}\n"));
    }

    fn poll(&mut self) -> Option<PeripheryEvent> {
        match self.lines.try_recv() {
            Ok(line) => Some(read(&line)),
            Err(TryRecvError::Disconnected) if !core::mem::replace(&mut self.is_lost, true) => {
                Some(PeripheryEvent::Lost)
            }
            Err(_) => None,
        }
    }

    fn due(&self) -> Option<Duration> {
        None
    }
}

/// Parses a line of the periphery: `part [rad,rad] [mm,mm,mm,rad]`, `slot [mm,mm,mm,rad]`, `none`, `ok`, `switch high`,
/// `switch low`, or `error TEXT`.
fn read(line: &str) -> PeripheryEvent {
    let line = line.trim();
    let (word, rest) = line.split_once(' ').unwrap_or((line, ""));
    let strange = || PeripheryEvent::Failed(format!("it says `{}`", line.escape_debug()));
    match (word, rest) {
        ("ok", "") => PeripheryEvent::ValveSet,
        ("none", "") => PeripheryEvent::Nothing,
        ("switch", "high") => PeripheryEvent::Switch(true),
        ("switch", "low") => PeripheryEvent::Switch(false),
        ("error", why) => PeripheryEvent::Failed(format!("it says error {}", why.escape_debug())),
        ("slot", pose) => serde_json::from_str(pose).map_or_else(|_| strange(), PeripheryEvent::Slot),
        ("part", poses) => {
            let poses = poses.trim().strip_suffix(']').and_then(|it| it.split_once(']'));
            let part = poses.and_then(|(platform, pick)| {
                let platform = serde_json::from_str(&format!("{platform}]")).ok()?;
                let pick = serde_json::from_str(&format!("{pick}]")).ok()?;
                Some(PeripheryEvent::Part(platform, pick))
            });
            part.unwrap_or_else(strange)
        }
        _ => strange(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_lines_of_a_periphery() {
        let place = RobotPose::from_units([1000, -2500, 30_000, 0]);
        assert_eq!(read("slot [1.0,-2.5,30.0,0.0]\r\n"), PeripheryEvent::Slot(place));
        let platform = PlatformPose::from_rad(0.1, -0.2);
        assert_eq!(read("part [0.1,-0.2] [1.0,-2.5,30.0,0.0]"), PeripheryEvent::Part(platform, place));
        assert_eq!(read("switch high"), PeripheryEvent::Switch(true));
        assert_eq!(read("none"), PeripheryEvent::Nothing);
        assert_eq!(read("error lens\u{7}"), PeripheryEvent::Failed("it says error lens\\u{7}".into()));
        for line in ["part [1] [2]", "part", "slot 1,2", "switch", "hello"] {
            assert_eq!(read(line), PeripheryEvent::Failed(format!("it says `{line}`")));
        }
    }
}
