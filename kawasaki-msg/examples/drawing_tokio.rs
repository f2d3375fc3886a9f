//! A PC lets a robot draw a line of 100 pieces. Killed and started again with the same journal, it goes on:
//! `cargo run -p kawasaki-msg --features tokio --example drawing_tokio -- 127.0.0.1:9105 [JOURNAL]`

use kawasaki_msg::robot_session::tokio::Listen;
use kawasaki_msg::tokio::{Journal, LastOrder, pc};
use kawasaki_msg::{JobKind, Line, PcConfig, Point};

#[tokio::main(flavor = "current_thread")]
async fn main() -> Result<(), Box<dyn core::error::Error>> {
    let address = std::env::args().nth(1).ok_or("usage: HOST:PORT [JOURNAL]")?;
    let journal = std::env::args().nth(2).unwrap_or_else(|| "drawing.journal".to_owned());
    let jobs: Vec<Line> = (0..100)
        .map(|n| Line { kind: JobKind::Draw, start: Point::new(n, 0), end: Point::new(n + 1, 0) })
        .collect();
    let (journal, last) = Journal::open(journal)?;
    let (robot, task) = pc(PcConfig::tcp(), journal, Listen::bind(address).await?)?;
    tokio::spawn(task.run());
    let mut order = match last {
        LastOrder::None => robot.start(50, jobs).await?,
        LastOrder::Active(kept) => robot.resume(kept, jobs).await?,
        // The order was interrupted: a new one has the rest.
        LastOrder::Stopped(kept) => robot.go_on(51, kept, jobs).await?,
        LastOrder::Complete(kept) => {
            println!("{} executed by an earlier run: another journal begins again", kept.done());
            return Ok(());
        }
        LastOrder::Unknown(kept) => {
            return Err(format!("check the workpiece after job {}", kept.done()).into());
        }
    };
    while let Some(progress) = order.progress().await {
        println!("{progress:?}");
    }
    let outcome = order.await;
    // The journal has that too, then.
    robot.handle().shutdown().await;
    println!("{} executed", outcome?.executed);
    Ok(())
}
