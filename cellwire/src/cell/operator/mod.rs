//! The operator's screen of the teleoperation.

mod model;
mod screen;

use std::time::Duration;

use anyhow::Result;
use ratatui::crossterm::event::{self, Event, KeyEventKind};

use self::model::{Command, Model, Ports};
use crate::cell::teleop::{Order, Teleop, TeleopConfig, Traces};
use crate::io::line::Clock;

/// A picture is drawn this often.
const PICTURE: Duration = Duration::from_millis(50);

/// Runs the teleoperation until the operator quits.
///
/// # Errors
/// When there is no terminal, or a port cannot be opened.
pub fn run(config: TeleopConfig, traces: Traces) -> Result<()> {
    let clock = Clock::start();
    let gripper = config.alter.subroutine;
    let ports =
        Ports { robot: config.robot.clone(), ball: config.ball.clone(), viewer: config.viewer.clone() };
    let teleop = Teleop::start(config, clock, &traces)?;
    teleop.order(Order::GripperKeys(gripper));
    let mut model = Model::new(ports, traces, gripper);
    let mut terminal = ratatui::try_init()?;
    let outcome = show(&mut terminal, &mut model, &teleop, clock);
    ratatui::restore();
    outcome
}

fn show(
    terminal: &mut ratatui::DefaultTerminal,
    model: &mut Model,
    teleop: &Teleop,
    clock: Clock,
) -> Result<()> {
    loop {
        for (at, notification) in teleop.notifications() {
            model.take(at, notification);
        }
        model.pass_time(clock.now());
        terminal.draw(|frame| screen::draw(frame, model))?;
        model.drawn += 1;
        if model.may_quit() {
            return Ok(());
        }
        if !event::poll(PICTURE)? {
            continue;
        }
        let Event::Key(key) = event::read()? else { continue };
        if key.kind != KeyEventKind::Press {
            continue;
        }
        match model.key(key, clock.now()) {
            Some(Command::Order(order)) => teleop.order(order),
            Some(Command::Probe) => teleop.probe(),
            None => {}
        }
    }
}
