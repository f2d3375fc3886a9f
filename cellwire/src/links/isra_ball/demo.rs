//! `cellwire demo isra-ball`.

use std::io::{ErrorKind, Read, Write};
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use anyhow::{Context, Result};
use isra_ball::{Config, Host, HostEvent, Status, timing};

use super::ball;
use crate::demo::DemoOptions;
use crate::line::{Clock, Line, LineFaults};
use crate::report::{Budget, Report, Samples};
use crate::serial;

/// The rate of each kind of damage with `--faults`, for each byte.
const FAULT_RATE: f64 = 0.002;

/// A host polls the simulated ball over a pseudo-terminal whose bytes take their time.
///
/// # Errors
/// When there is no pseudo-terminal.
pub fn demo(options: &DemoOptions) -> Result<Report> {
    let seconds = options.seconds.unwrap_or(Duration::from_secs(3));
    let config = Config::default();
    let (device, path) = serial::pair()?;
    let clock = Clock::start();
    let mut line = Line::over_port(device, clock, config.baud, options.trace.start("ball"))?;
    if options.faults {
        line = line.with_faults(LineFaults::with_rate(FAULT_RATE, options.seed));
    }
    let stop = AtomicBool::new(false);
    let (ball, polled) = thread::scope(|scope| {
        let ball = scope.spawn(|| ball::run(&mut line, clock, &stop, |_| Ok(())));
        let polled = poll(&path, config, clock, seconds, options);
        stop.store(true, Ordering::Relaxed);
        (ball.join(), polled)
    });
    let ball = ball.map_err(|_| anyhow::anyhow!("the simulated ball panicked"))??;
    let polled = polled?;

    let mut report =
        Report::new("isra-ball", "a host polls the simulated ball at 9600 baud, once in the robot's cycle");
    report.fact("polls", "polls", polled.polls);
    report.fact("fresh", "packets with new values", polled.fresh);
    report.fact("old", "packets with old values", polled.old);
    report.fact("missed", "polls without a packet", polled.missed);
    report.fact("errors", "damaged packets", polled.errors);
    report.fact("line_faults", "bytes damaged by the line", line.faults());
    let budget = Budget { time: config.period, source: "§3.4: the robot's cycle" };
    report.timing("exchange", "poll to packet", &polled.exchange, Some(budget));
    let answered = polled.fresh + polled.old;
    report.require(answered > 0, || "the ball never answered".into());
    report.require(options.faults || ball.fresh + ball.old <= answered + 1, || {
        format!("the ball sent {} packets, {answered} arrived", ball.fresh + ball.old)
    });
    report.require(polled.exchange.at(0.0) >= timing::exchange_time(config.baud), || {
        "a packet came faster than the line carries it".into()
    });
    Ok(report)
}

#[derive(Default)]
struct Polled {
    polls: u64,
    fresh: u64,
    old: u64,
    missed: u64,
    errors: u64,
    exchange: Samples,
}

fn poll(
    path: &str,
    config: Config,
    clock: Clock,
    seconds: Duration,
    options: &DemoOptions,
) -> Result<Polled> {
    let mut port = serial::open(path, config.baud)?;
    let mut host = Host::new(config)?;
    let mut polled = Polled::default();
    let mut buffer = [0; 64];
    let (end, mut asked) = (clock.now() + seconds, Duration::ZERO);
    options.progress.set_length(u64::try_from(seconds.as_millis() / config.period.as_millis())?);
    while clock.now() < end {
        while let Some(n) = host.poll_transmit(clock.now(), &mut buffer) {
            asked = clock.now();
            port.write_all(buffer.get(..n).unwrap_or_default())?;
            polled.polls += 1;
            options.progress.inc(1);
        }
        while let Some(event) = host.poll_event() {
            match event {
                HostEvent::Packet(packet) => {
                    polled.exchange.add(clock.now() - asked);
                    let count =
                        if packet.status == Status::Fresh { &mut polled.fresh } else { &mut polled.old };
                    *count += 1;
                }
                HostEvent::Missed => polled.missed += 1,
                HostEvent::Error(_) => polled.errors += 1,
                _ => {}
            }
        }
        let due = host.poll_timeout().unwrap_or_default();
        port.set_timeout(due.saturating_sub(clock.now()).max(Duration::from_micros(100)))?;
        match port.read(&mut buffer) {
            Ok(n) => host.handle_input(clock.now(), buffer.get(..n).unwrap_or_default()),
            Err(e) if matches!(e.kind(), ErrorKind::TimedOut | ErrorKind::Interrupted) => {}
            Err(e) => return Err(e).context("the ball's port"),
        }
    }
    Ok(polled)
}
