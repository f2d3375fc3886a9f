//! Logs the telemetry block and registers of your own as CSV, with the clock time, ten times a second until Ctrl-C:
//! `cargo run -p fanuc-hmi-modbus --features tokio --example logger_tokio -- 192.168.0.10:502 log.csv`
//!
//! R[101] to R[105] are 16-bit integers from address 1000; the crate's page has the assignments. Without a robot it waits,
//! and says why.
#![allow(clippy::disallowed_methods, clippy::disallowed_types, reason = "the program has the clock")]

use core::time::Duration;
use std::fs::File;
use std::io::{ErrorKind, LineWriter, Write as _};
use std::time::SystemTime;

use fanuc_hmi_modbus::robot_session::tokio::{Link, Tcp};
use fanuc_hmi_modbus::tokio::{Client, Error, client};
use fanuc_hmi_modbus::{ClientConfig, TelemetryBlock, WordOrder};
use tokio::time::{MissedTickBehavior, interval};

#[tokio::main(flavor = "current_thread")]
async fn main() -> Result<(), Box<dyn core::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let (Some(address), Some(path)) = (arguments.next(), arguments.next()) else {
        return Err("usage: HOST:PORT FILE.csv".into());
    };
    let mut csv = LineWriter::new(File::create_new(path)?); // whole lines, however the program ends
    writeln!(csv, "utc,life_counter,x_mm,y_mm,z_mm,r101,r102,r103,r104,r105")?;
    let (robot, task) = client(ClientConfig::tcp(), Tcp::new(address))?;
    let task = tokio::spawn(task.run());
    tokio::spawn(report(robot.clone()));

    let mut ticks = interval(Duration::from_millis(100));
    ticks.set_missed_tick_behavior(MissedTickBehavior::Skip); // after an outage one line is due at once, and no other
    let stop = tokio::signal::ctrl_c();
    tokio::pin!(stop);
    loop {
        let next = async {
            ticks.tick().await;
            line(&robot).await
        };
        // A line that is stopped in the middle is a read: it may be dropped.
        let line = tokio::select! {
            stopped = &mut stop => break stopped?,
            line = next => line,
        };
        match line {
            Ok(line) => writeln!(csv, "{line}")?,
            Err(Error::NotConnected(why)) if why.kind() == ErrorKind::InvalidInput => return Err(why.into()), // of the address
            Err(Error::NotConnected(_) | Error::Failed(_)) => {} // `report` prints the connection
            Err(Error::Closed(closed)) => return Err(closed.into()),
            Err(error) => eprintln!("{error}"),
        }
    }
    robot.handle().shutdown().await;
    task.await?;
    Ok(())
}

/// Reads a line of the log. The time is that of the reply with the block.
async fn line(robot: &Client) -> Result<String, Error> {
    let block = robot.read_telemetry(TelemetryBlock::ADDRESS, WordOrder::LowFirst).await?;
    let time = humantime::format_rfc3339_millis(SystemTime::now());
    let numbers = robot.read_holding_registers(1000..1005).await?;
    let [x, y, z] = block.position;
    let mut line = format!("{time},{},{x},{y},{z}", block.life_counter);
    numbers.iter().for_each(|number| line.push_str(&format!(",{}", number.cast_signed())));
    Ok(line)
}

/// Prints every change of the connection.
async fn report(robot: Client) {
    let mut link = robot.handle().link();
    loop {
        match &*link.borrow_and_update() {
            Link::Connecting => eprintln!("connecting"),
            Link::Connected => eprintln!("connected"),
            Link::Failed(why) => eprintln!("{why}; trying again"),
            Link::Ended => return,
        }
        if link.changed().await.is_err() {
            return;
        }
    }
}
