//! `cellwire simulate kawasaki-pc` and `kawasaki-robot`: an end to test the other one against.

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::sync::mpsc;

use anyhow::{Result, bail, ensure};
use kawasaki_msg::{Acks, Line, Pc, PcConfig, PcEvent, RobotConfig, RobotEvent};
use serde_json::json;

use super::pc::{self, Program};
use super::robot::{self, Setup, Stroke};
use super::sheet::{SHEET, drawn, jobs};
use crate::io::drawing::{self, Picture};
use crate::io::output::{log, ready};
use crate::io::tcp;
use crate::links::device::{Endpoint, SimulateOptions};
use crate::links::settings::Settings;

/// The PC until interrupted: a robot that connects gets the picture as an order. Settings: `drawing`, an SVG file [default: a built-in
/// picture]; `order`, the number of the first order; `repeat`, begin the next order when one is over.
///
/// # Errors
/// When the endpoint cannot be opened, or a setting is none of this device's.
pub fn pc(options: &SimulateOptions) -> Result<()> {
    let settings = Settings::new("kawasaki-pc", &options.settings, &["drawing", "order", "repeat"])?;
    let order: u16 = settings.number("order", 50)?;
    ensure!(order > 0, "order=0: orders are numbered from 1");
    let repeat = settings.flag("repeat", false)?;
    let picture = match settings.text("drawing")? {
        Some(file) => Picture::from_file(Path::new(file), SHEET)?,
        None => Picture::built_in(SHEET)?,
    };
    let Endpoint::Listen(address) = &options.endpoint else {
        bail!("kawasaki-pc is a TCP server: use --listen")
    };
    let listener = tcp::listen(address)?;
    let lines = jobs(&picture);
    ready("kawasaki-pc", "listen", &listener.local_addr()?.to_string())?;
    let mut program = Orders { lines: &lines, next: order, wanted: false, repeat };
    pc::run(&listener, PcConfig::TCP, &options.trace.start("kawasaki-pc"), &mut program)?;
    Ok(())
}

/// The robot until interrupted. Settings: `speed` of the pen in mm/s, `queue`, how many jobs it holds, `acks`, every how many jobs it
/// acknowledges, `out`, an SVG file that is written whenever an order is over.
///
/// # Errors
/// When a setting is none of this device's.
pub fn robot(options: &SimulateOptions) -> Result<()> {
    let settings = Settings::new("kawasaki-robot", &options.settings, &["acks", "out", "queue", "speed"])?;
    let speed: u32 = settings.number("speed", 250)?;
    ensure!(speed > 0, "speed={speed}: give at least 1 mm/s");
    let every = settings.number("acks", 1u16)?.try_into();
    let Ok(every) = every else { bail!("acks=0: give 1 to acknowledge every job") };
    let config = RobotConfig { acks: Acks::Cumulative { every }, ..RobotConfig::TCP };
    let queue = settings.number("queue", 256)?;
    ensure!((1..=9998).contains(&queue), "queue={queue}: give 1 to 9998 jobs, less than there are numbers");
    let setup = Setup { config, queue, speed: f64::from(speed), connect_timeout: options.connect_timeout };
    let out = settings.text("out")?.map(PathBuf::from);
    let Endpoint::Connect(address) = &options.endpoint else {
        bail!("kawasaki-robot is a TCP client, it opens the connection: use --connect")
    };
    ready("kawasaki-robot", "connect", address)?;
    let (sender, strokes) = mpsc::channel::<Stroke>();
    let trace = options.trace.start("kawasaki-robot");
    robot::run(
        &setup,
        address,
        &trace,
        &AtomicBool::new(false),
        sender,
        |notification| match notification {
            robot::Notification::Event(event) => {
                if let RobotEvent::OrderOver { .. } = event {
                    let lines: Vec<drawing::Line> = drawn(strokes.try_iter().map(|stroke| stroke.job.line));
                    log(
                        &json!({"event": "drawn", "strokes": lines.iter().filter(|line| line.draws).count()}),
                    )?;
                    if let Some(file) = &out {
                        drawing::write_svg(file, SHEET, &lines)?;
                    }
                }
                log(&serde_json::to_value(event)?)
            }
            robot::Notification::Connected(peer) => log(&json!({"event": "connected", "peer": peer})),
            robot::Notification::Disconnected(why) => log(&json!({"event": "disconnected", "why": why})),
            robot::Notification::Traced(path) => log(&json!({"event": "trace", "path": path})),
        },
    )?;
    Ok(())
}

/// The simulated PC's program: an order for each robot that connects without one.
struct Orders<'a> {
    lines: &'a [Line],
    next: u16,
    wanted: bool,
    repeat: bool,
}

impl<'a> Program<'a> for Orders<'a> {
    fn step(&mut self, pc: &mut Pc<&'a [Line]>) -> Result<bool> {
        if std::mem::take(&mut self.wanted) && pc.order().is_none() {
            pc.start(self.next, self.lines)?;
            self.next = self.next.checked_add(1).unwrap_or(1);
        }
        Ok(true)
    }

    fn notify(&mut self, notification: pc::Notification<'_>) -> Result<()> {
        let line = match notification {
            pc::Notification::Event(event) => {
                self.wanted |= match event {
                    PcEvent::OrderOver { .. } => self.repeat,
                    PcEvent::OutcomeUnknown { .. } | PcEvent::OrderRefused { given_up: true, .. } => true,
                    _ => false,
                };
                serde_json::to_value(event)?
            }
            pc::Notification::Connected(peer) => {
                self.wanted = true;
                json!({"event": "connected", "peer": peer})
            }
            pc::Notification::Disconnected(why) => json!({"event": "disconnected", "why": why}),
            pc::Notification::Traced(path) => json!({"event": "trace", "path": path}),
        };
        log(&line)
    }
}
