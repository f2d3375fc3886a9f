//! The operator's screen of the teleoperation.
//!
//! Three threads besides the host's: one reads the keys, and gives the stop itself to the robot's thread; one writes what
//! was drawn; this one draws, and handles the other keys. The threads do not wait for each other.

mod commands;
mod keys;
mod model;
mod screen;
mod settings;

pub use settings::Settings;

use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::Duration;

use anyhow::{Result, ensure};
use ratatui::crossterm::event::KeyEvent;

use self::commands::Command;
use self::model::{Model, Ports};
use crate::alter::{self, Notification, Order, Teleop, TeleopConfig, Traces};
use crate::io::terminal::{self, Screen};
use cellwire_io::clock::Clock;
use cellwire_io::interrupt::{self, Policy};
use cellwire_io::output::remark;

/// A picture is drawn this often.
const PICTURE: Duration = Duration::from_millis(50);

/// Runs the teleoperation until the operator quits, or a signal ends it: false then. The arm comes to rest first.
///
/// # Errors
/// If there is no terminal, a port cannot be opened, or a thread of the host has failed.
pub fn run(config: TeleopConfig, traces: Traces) -> Result<bool> {
    let clock = Clock::start();
    let gripper = config.alter.subroutine;
    let ports =
        Ports { robot: config.robot.clone(), input: config.input.clone(), viewer: config.viewer.clone() };
    let mut model = Model::new(ports, traces.clone(), &config.alter, config.profile);
    if let Some(advice) = alter::window::advice(&config.alter) {
        remark(&format!("warning: {advice}"));
    }
    interrupt::account("the arm gets no values any more, and the robot ends ALTER".into());
    let teleop = Teleop::start(config, clock, &traces)?;
    teleop.order(Order::GripperKeys(gripper));
    let orders = teleop.orders();
    interrupt::on_interrupt(Policy::Call(Box::new(move |signals| {
        if signals > 1 {
            end_at_once();
        }
        orders.order(Order::End);
    })))?;
    let mut screen = Screen::enter()?;
    let keys = keys::read(teleop.orders(), teleop.jog(), end_at_once);
    let shown = show(&mut screen, &mut model, &teleop, clock, &keys);
    let has_ended = model.has_ended();
    drop(screen);
    terminal::leave();
    match model.unfinished() {
        Some(what) => remark(&format!("warning: {what}")),
        None if interrupt::requested() => remark("interrupted: the arm is at rest, and ALTER has ended"),
        None => {}
    }
    let traces = end(teleop);
    traces.iter().for_each(|line| remark(line));
    shown?;
    ensure!(has_ended, "a thread of the host failed: the robot ends ALTER on its own");
    Ok(!interrupt::requested())
}

fn end_at_once() {
    terminal::leave();
    interrupt::end_at_once("ended at once");
}

fn show(
    screen: &mut Screen,
    model: &mut Model,
    teleop: &Teleop,
    clock: Clock,
    keys: &Receiver<KeyEvent>,
) -> Result<()> {
    loop {
        // Before the reports: a host that has ended has reported it.
        let has_ended = teleop.has_ended();
        for (at, notification) in teleop.notifications() {
            model.take(at, notification);
        }
        if has_ended || model.has_ended() {
            return Ok(());
        }
        model.pass_time(clock.now());
        if screen.is_gone() {
            teleop.order(Order::End);
        } else if screen.draw(|frame| screen::draw(frame, model))? {
            model.drawn += 1;
        }
        let mut key = match keys.recv_timeout(PICTURE) {
            Ok(key) => Some(key),
            Err(RecvTimeoutError::Timeout) => None,
            Err(RecvTimeoutError::Disconnected) => {
                std::thread::sleep(PICTURE);
                None
            }
        };
        while let Some(pressed) = key {
            match model.key(pressed, clock.now()) {
                Some(Command::Order(order)) => teleop.order(order),
                Some(Command::Probe) => teleop.probe(),
                None => {}
            }
            key = keys.try_recv().ok();
        }
    }
}

/// Ends the host's threads, and waits for their traces; where they are.
fn end(mut teleop: Teleop) -> Vec<String> {
    teleop.end();
    let traces = teleop.notifications().filter_map(|(_, notification)| match notification {
        Notification::Trace(path) => Some(format!("trace: {}", path.display())),
        Notification::PortLost("trace", why) => Some(format!("warning: {why}")),
        _ => None,
    });
    traces.collect()
}
