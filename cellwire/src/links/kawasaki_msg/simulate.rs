//! `cellwire simulate kawasaki-pc` and `kawasaki-robot`: an end to test the other one against.

use std::path::PathBuf;
use std::sync::atomic::AtomicBool;
use std::sync::mpsc;

use anyhow::{Result, bail};
use kawasaki_msg::{Line, Pc, PcConfig, PcEvent, RobotConfig, RobotEvent};
use serde_json::json;

use super::options::{PcSettings, RobotSettings};
use super::pc::{self, Program};
use super::robot::{self, Setup, Stroke};
use super::sheet::{SHEET, drawn, jobs};
use crate::io::drawing::{self, Picture};
use crate::io::output::{log, ready};
use crate::io::tcp;
use crate::links::device::{Endpoint, SimulateOptions};
use crate::links::settings;

/// The PC until interrupted: a robot that connects gets the picture as an order.
///
/// # Errors
/// When the endpoint cannot be opened, or a setting is none of this device's.
pub fn pc(options: &SimulateOptions) -> Result<()> {
    let settings = settings::read("kawasaki-pc", PcSettings::default(), &options.settings)?;
    let picture = match settings.drawing() {
        Some(file) => Picture::from_file(&file, SHEET)?,
        None => Picture::built_in(SHEET)?,
    };
    let Endpoint::Listen(address) = &options.endpoint else {
        bail!("kawasaki-pc is a TCP server: use --listen")
    };
    let listener = tcp::listen(address)?;
    let lines = jobs(&picture);
    ready("kawasaki-pc", "listen", &listener.local_addr()?.to_string())?;
    let mut program = Orders { lines: &lines, next: settings.order, wanted: false, repeat: settings.repeat };
    let config = PcConfig { dialect: settings.plant.dialect()?, ..settings.config };
    pc::run(&listener, config, &options.trace.start("kawasaki-pc"), &mut program)?;
    Ok(())
}

/// The robot until interrupted.
///
/// # Errors
/// When a setting is none of this device's.
pub fn robot(options: &SimulateOptions) -> Result<()> {
    let RobotSettings { plant, config, bounds, queue, speed, out } =
        settings::read("kawasaki-robot", RobotSettings::default(), &options.settings)?;
    let config = RobotConfig { dialect: plant.dialect()?, ..config };
    let connect_timeout = options.connect_timeout;
    let setup = Setup { config, bounds, queue, speed: f64::from(speed), connect_timeout };
    let out = out.map(PathBuf::from);
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
                    let lines: Vec<drawing::Line> = drawn(strokes.try_iter().map(|stroke| stroke.job.work));
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
