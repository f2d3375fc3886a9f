//! The simulated ball on a line.

use std::sync::atomic::AtomicBool;

use anyhow::Result;
use cellwire_sim::{Settings as _, TeachBall, Told};
use isra_ball::{BallConfig, BallEvent, BallStatistics};
use robot_session::Session as _;
use serde_json::{Value, json};

use crate::io::line::Line;
use crate::io::output::log;
use crate::links::device::{SimulateOptions, on_line, serve};
use cellwire_links::settings;

/// `cellwire simulate ball`.
///
/// # Errors
/// When the endpoint cannot be opened, or a setting is none of this device's.
pub fn simulate(options: &SimulateOptions) -> Result<()> {
    let settings = settings::read("ball", TeachBall::default(), &options.settings)?;
    serve("ball", "ball", options, settings.baud, |line, _| {
        run(line, settings.config, &AtomicBool::new(false), |event| log(&event))?;
        Ok(())
    })
}

/// Answers polls until it is to stop, or until the connection is gone.
///
/// # Errors
/// When an event cannot be logged.
pub fn run(
    line: &mut Line,
    config: BallConfig,
    stop: &AtomicBool,
    mut report: impl FnMut(Value) -> Result<()>,
) -> Result<BallStatistics> {
    let mut ball = TeachBall { config, ..TeachBall::default() }.simulator()?;
    on_line(line, &mut ball, stop, |event| match event {
        Ok(Told::Device(BallEvent::Unknown(byte))) => report(json!({"event": "unknown", "byte": byte})),
        Ok(_) => Ok(()),
        Err(connected) => report(json!({"event": if connected { "connected" } else { "disconnected" }})),
    })?;
    Ok(ball.statistics())
}
