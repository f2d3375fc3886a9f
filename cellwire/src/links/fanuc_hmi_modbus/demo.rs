//! `cellwire demo fanuc-hmi-modbus`: the telemetry block of the simulated controller, read at the period of its background task.

use std::io::{ErrorKind, Read, Write};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::Duration;

use anyhow::{Result, bail};
use fanuc_hmi_modbus::client::{Client, Config, Event};
use fanuc_hmi_modbus::{Reply, TelemetryBlock, WordOrder, server};

use super::controller::{Controller, PERIOD, circle};
use super::simulate::serve_tcp;
use crate::demo::DemoOptions;
use crate::line::Clock;
use crate::report::{Budget, Report, Samples};
use crate::settings::Settings;
use crate::tcp;

/// Runs the controller and its client over loopback TCP.
///
/// # Errors
/// When no port is free, or a setting is given: the demo has none.
pub fn demo(options: &DemoOptions) -> Result<Report> {
    Settings::new("fanuc-hmi-modbus", &options.settings, &[])?;
    let clock = Clock::start();
    let listener = tcp::listen("127.0.0.1:0")?;
    let address = listener.local_addr()?;
    let controller = Arc::new(Mutex::new(Controller::new(Box::new(circle), WordOrder::LowFirst)));
    let trace = options.trace.start("fanuc");
    let shared = Arc::clone(&controller);
    // It ends with the process, as the listener does.
    thread::spawn(move || serve_tcp(&listener, &shared, clock, server::Config::tcp(), &trace, |_| {}));
    let proxy = options.faults.then(|| tcp::FaultyProxy::start(address, options.seed, 0.0)).transpose()?;
    let mut socket = tcp::connect(&proxy.as_ref().map_or(address, tcp::FaultyProxy::address).to_string())?;

    let mut client: Client = Client::new(Config::tcp());
    let mut turn_around = Samples::default();
    let (mut samples, mut repeated, mut skipped, mut failed) = (0u64, 0u64, 0u64, 0u64);
    let (mut last, mut next, mut asked) = (None::<TelemetryBlock>, clock.now(), None);
    let end = clock.now() + options.seconds.unwrap_or(Duration::from_secs(2));
    let mut buffer = [0; 4096];
    while clock.now() < end {
        let now = clock.now();
        if asked.is_none() && now >= next {
            client.request(1, &TelemetryBlock::request())?;
            next = (next + PERIOD).max(now.saturating_sub(PERIOD)); // a late run skips what it missed
        }
        while let Some(len) = client.poll_transmit(clock.now(), &mut buffer) {
            asked = Some(clock.now());
            socket.write_all(buffer.get(..len).unwrap_or_default())?;
        }
        let due = client.poll_timeout().unwrap_or(next).min(end);
        let wait = due.saturating_sub(clock.now()).max(Duration::from_micros(100));
        if asked.is_none() {
            thread::sleep(wait);
            continue;
        }
        socket.set_read_timeout(Some(wait))?;
        match socket.read(&mut buffer) {
            Ok(0) => bail!("the simulated controller closed the connection"),
            Ok(n) => drop(client.handle_input(clock.now(), buffer.get(..n).unwrap_or_default())),
            Err(e) if matches!(e.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {}
            Err(e) => return Err(e.into()),
        }
        client.handle_timeout(clock.now());
        while let Some(event) = client.poll_event() {
            let block = match event {
                Event::Reply { reply: Reply::HoldingRegisters(words), .. } => {
                    TelemetryBlock::from_words(&words, WordOrder::LowFirst)
                }
                _ => None,
            };
            if let Some(asked) = asked.take() {
                turn_around.add(clock.now().saturating_sub(asked));
            }
            let Some(block) = block else {
                failed += 1;
                continue;
            };
            samples += 1;
            options.progress.set_message(format!("run {} of the background task", block.life_counter));
            if let Some(last) = last.replace(block) {
                match block.life_counter.wrapping_sub(last.life_counter) {
                    0 => repeated += 1,
                    step => skipped += u64::from(step) - 1,
                }
            }
        }
    }
    let title = "37 registers every 8 ms in one request: the telemetry of a moving robot over Modbus TCP";
    let mut report = Report::new("fanuc-hmi-modbus", title);
    report.fact("samples", "telemetry blocks read", samples);
    report.fact("repeated", "runs of the task read twice", repeated);
    report.fact("skipped", "runs of the task not read", skipped);
    report.fact("failed", "requests without a block", failed);
    let budget = Budget { time: PERIOD, source: "Background Task: the period of the logging task" };
    report.timing("turn_around", "request to block", &turn_around, (!options.faults).then_some(budget));
    report.require(samples > 0, || "the controller never answered".into());
    report.require(failed == 0, || format!("{failed} requests had no telemetry block"));
    Ok(report)
}
