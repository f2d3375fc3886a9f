//! Moves a PUMA's tool to given positions, in mm from the position at which ALTER began, at most 50 mm away: lines of
//! `X Y Z`.
//! `cargo run -p cellwire-sim --all-features --example alter_host -- 192.168.0.9:4001`

use core::time::Duration;
use std::io::stdin;

use tokio::sync::watch;
use tokio::time::sleep;
use val2_alter::robot_session::tokio::Tcp;
use val2_alter::tokio::{Arm, host};
use val2_alter::{HostConfig, Reach, Scale};

/// 50 mm, in units of 1/32 mm.
const END: i32 = 1600;

/// The fastest that is asked for, in units a cycle; the configuration has the limits.
const FASTEST: i32 = 40;

fn follower(address: &str) -> Result<Arm, Box<dyn core::error::Error>> {
    let reach = Reach { low: [-END, -END, -END, 0, 0, 0], high: [END, END, END, 0, 0, 0] };
    let config = HostConfig { gap: None, ..HostConfig::default() };
    let (arm, task) = host(config, Some(reach), Tcp::new(address))?;
    drop(task.thread()?); // a reply is due within 15 ms, whatever else this program does
    Ok(arm)
}

/// Follows the wanted pose: each cycle covers a third of the remaining way.
#[expect(
    clippy::cast_possible_truncation,
    reason = "a place beyond an i32 is out of reach, and a speed is limited"
)]
async fn follow(arm: &Arm, wanted: watch::Receiver<[f64; 3]>) {
    loop {
        let (wanted, there, mut speeds) = (*wanted.borrow(), arm.commanded(), [0; 6]);
        for ((speed, mm), at) in speeds.iter_mut().zip(wanted).zip(there) {
            let left = (mm * Scale::PUMA_562.per_mm) as i32 - at;
            let part = if left.abs() < 3 { left } else { left / 3 };
            *speed = part.clamp(-FASTEST, FASTEST) as i16;
        }
        arm.set_target(speeds);
        sleep(Duration::from_millis(7)).await;
    }
}

#[tokio::main(flavor = "current_thread")]
async fn main() -> Result<(), Box<dyn core::error::Error>> {
    let arm = follower(&std::env::args().nth(1).ok_or("usage: ADDRESS")?)?;
    let (want, wanted) = watch::channel([0.0; 3]);
    std::thread::spawn(move || {
        for line in stdin().lines().map_while(Result::ok) {
            let words: Vec<f64> = line.split_whitespace().map_while(|word| word.parse().ok()).collect();
            match words.try_into() {
                Ok(place) => drop(want.send_replace(place)),
                Err(_) => println!("give three numbers"),
            }
        }
    });
    tokio::select! {
        () = follow(&arm, wanted) => {}
        _ = tokio::signal::ctrl_c() => arm.stop().await?,
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use cellwire_sim::puma::PumaEvent;
    use cellwire_sim::{Fault, Puma, Script, Settings as _, SimulatorReport};

    use super::*;

    #[tokio::test]
    async fn the_arm_arrives_over_lost_messages_and_stays_in_its_box() {
        let sim =
            Puma { restart: Duration::from_millis(100), ..Puma::default() }.listen("127.0.0.1:0").unwrap();
        sim.faults()
            .follow(Script::new().request(20, Fault::Drop).answer(60, Fault::Drop).answer(90, Fault::Cut));
        let arm = follower(&sim.address().to_string()).unwrap();
        let (_want, wanted) = watch::channel([20.0, -900.0, 0.0]);
        let arrive = async {
            while arm.commanded()[..3] != [640, -END, 0] || sim.faults().happened().len() < 3 {
                sleep(Duration::from_millis(5)).await;
            }
            arm.stop().await.unwrap();
        };
        tokio::select! {
            () = follow(&arm, wanted) => {}
            () = arrive => {}
        }
        let told = sim.told();
        let count = |is: fn(&PumaEvent) -> bool| {
            told.iter()
                .filter(|(_, told)| matches!(told, SimulatorReport::Device(event) if is(event)))
                .count()
        };
        assert!(count(|event| matches!(event, PumaEvent::Started(_))) >= 3);
        let done = sim.executed();
        assert!(done.iter().all(|moved| moved.work.pose.p[1].abs() < 50.01), "it has left the box");
        // The tool points down: its Y is against the world's. A reply that was lost, or late on a busy machine, has moved
        // nothing: at most 1.25 mm each.
        let lost = count(|event| matches!(event, PumaEvent::BadReply(_))).max(3);
        let short = f64::from(u32::try_from(lost).unwrap()) * 1.25 + 0.25;
        let [x, y, _] = done.last().unwrap().work.pose.p;
        assert!((x - 420.0).abs() < short && (y - 50.0).abs() < short, "{x} {y}, {lost} replies lost");
    }
}
