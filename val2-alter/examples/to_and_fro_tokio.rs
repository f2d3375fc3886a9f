//! Moves the tool slowly to and fro, within 50 mm, until Ctrl-C brings it to rest:
//! `cargo run -p val2-alter --features tokio-serial --example to_and_fro_tokio -- /dev/ttyS0`
#![allow(clippy::disallowed_methods, clippy::disallowed_types, reason = "the program sets the pace")]

use core::time::Duration;

use val2_alter::robot_session::tokio::{Serial, tokio_serial};
use val2_alter::tokio::{Arm, host};
use val2_alter::{HostConfig, HostEvent, Reach};

/// 50 mm, in units of 1/32 mm.
const END: i32 = 1600;

#[tokio::main(flavor = "current_thread")]
async fn main() -> Result<(), Box<dyn core::error::Error>> {
    let path = std::env::args().nth(1).ok_or("usage: PORT")?;
    // A busy computer may read contiguous bytes with pauses: no silence ends a frame.
    let config = HostConfig { gap: None, ..HostConfig::default() };
    let reach = Reach { low: [0; 6], high: [END, 0, 0, 0, 0, 0] };
    let (arm, task) = host(config, Some(reach), Serial(tokio_serial::new(path, config.baud)))?;
    drop(task.thread()?); // a reply is due within 15 ms, whatever else this program does
    tokio::select! {
        () = to_and_fro(&arm) => {}
        interrupted = tokio::signal::ctrl_c() => interrupted?,
    }
    Ok(arm.stop().await?)
}

async fn to_and_fro(arm: &Arm) {
    let mut events = arm.handle().events();
    let mut speed = 16; // units a cycle: 18 mm/s
    loop {
        match arm.commanded()[0] {
            END => speed = -16,
            0 => speed = 16,
            _ => {}
        }
        arm.set_target([speed, 0, 0, 0, 0, 0]);
        while let Ok(event) = events.try_recv() {
            if !matches!(event, HostEvent::Motion(_)) {
                println!("{event:?}");
            }
        }
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
}
