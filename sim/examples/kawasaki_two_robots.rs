//! Two robots share a list of jobs, half each. Killed and started again with the same folder, it goes on where each robot is:
//! `cargo run -p cellwire-sim --all-features --example kawasaki_two_robots -- FOLDER 0.0.0.0:9105 0.0.0.0:9106`

use std::path::PathBuf;

use kawasaki_msg::robot_session::tokio::Listen;
use kawasaki_msg::tokio::{Journal, LastOrder, pc};
use kawasaki_msg::{JobKind, Line, PcConfig, Point};

type Result<T> = core::result::Result<T, Box<dyn core::error::Error>>;

/// Returns how many jobs are executed, by this run and earlier ones.
async fn draw(journal: PathBuf, robots: Listen, jobs: Vec<Line>) -> Result<u32> {
    let (journal, last) = Journal::open(journal)?;
    let (robot, task) = pc(PcConfig::tcp(), journal, robots)?;
    tokio::spawn(task.run());
    let order = match last {
        LastOrder::None => robot.start(50, jobs).await?,
        LastOrder::Active(kept) => robot.resume(kept, jobs).await?,
        LastOrder::Stopped(kept) => robot.go_on(51, kept, jobs).await?,
        LastOrder::Complete(kept) => return Ok(kept.done()), // before the other robot had drawn its half
        LastOrder::Unknown(kept) => {
            return Err(format!("check the drawing after job {}", kept.done()).into());
        }
    };
    let outcome = order.await;
    robot.handle().shutdown().await; // the journal has that too, then
    Ok(outcome?.executed)
}

fn halves(count: i32) -> [Vec<Line>; 2] {
    let line = |n| Line { kind: JobKind::Draw, start: Point::new(n, 0), end: Point::new(n + 1, 0) };
    [(0..count / 2).map(line).collect(), (count / 2..count).map(line).collect()]
}

#[tokio::main(flavor = "current_thread")]
async fn main() -> Result<()> {
    let mut arguments = std::env::args().skip(1);
    let folder = PathBuf::from(arguments.next().ok_or("usage: FOLDER LISTEN LISTEN")?);
    let [left, right] = halves(200);
    let mut listen = async || Listen::bind(arguments.next().unwrap_or_default()).await;
    let (one, other) = (listen().await?, listen().await?);
    let (one, other) =
        tokio::join!(draw(folder.join("left"), one, left), draw(folder.join("right"), other, right));
    println!("{} and {} executed", one?, other?);
    Ok(())
}

#[cfg(test)]
mod tests {
    use core::time::Duration;

    use cellwire_sim::{Fault, KawasakiRobot, Script, Settings as _};

    use super::*;

    #[test]
    fn each_job_is_drawn_once_by_robots_that_lose_their_connections_and_a_pc_that_is_killed() {
        let runtime = || tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
        let (folder, [left, right], pc) = (tempfile::tempdir().unwrap(), halves(400), runtime());
        let bind = |address: &str| pc.block_on(Listen::bind(address)).unwrap();
        let both = [bind("127.0.0.1:0"), bind("127.0.0.1:0")];
        let addresses = both.each_ref().map(|listen| listen.address().unwrap());
        let settings = KawasakiRobot { job_time: Duration::from_millis(2), ..KawasakiRobot::default() };
        let robots = addresses.map(|address| settings.connect(address).unwrap());
        let freeze = Fault::Freeze(Duration::from_millis(300));
        robots[0].faults().follow(Script::new().answer(3, Fault::Cut).answer(9, Fault::Corrupt));
        robots[1].faults().follow(Script::new().request(5, Fault::Cut).answer(12, freeze));
        let run = async |[one, other]: [Listen; 2]| {
            let (one_file, other_file) = (folder.path().join("left"), folder.path().join("right"));
            tokio::join!(draw(one_file, one, left.clone()), draw(other_file, other, right.clone()))
        };
        let early = pc.block_on(async { tokio::time::timeout(Duration::from_millis(250), run(both)).await });
        assert!(early.is_err());
        drop(pc); // killed
        // The run after the last one has nothing to do.
        for _ in 0..2 {
            let (one, other) = runtime().block_on(async {
                let one = Listen::bind(addresses[0]).await.unwrap();
                run([one, Listen::bind(addresses[1]).await.unwrap()]).await
            });
            assert_eq!((one.unwrap(), other.unwrap()), (200, 200));
        }
        for (robot, half) in robots.iter().zip([&left, &right]) {
            let drawn = robot.executed().into_iter().map(|done| done.work.work);
            assert_eq!(drawn.collect::<Vec<Line>>(), *half);
        }
    }
}
