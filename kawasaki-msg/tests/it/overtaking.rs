//! Jobs that overtake one another, each with its own acknowledgement.

use core::time::Duration;

use kawasaki_msg::robot_session::Session as _;
use kawasaki_msg::{Acks, RobotConfig};

use crate::jobs::{Bench, PATIENT, jobs};

#[test]
fn jobs_that_overtake_are_acknowledged_one_by_one() {
    let mut bench = Bench::new(RobotConfig { acks: Acks::Individual, ..PATIENT }, 4, 999);
    bench.cycle(&jobs(1..=4));
    let job = bench.reader.take_where(|_, job| job.number == 3).unwrap();
    bench.robot.job_done(bench.now, job.number).unwrap();
    job.complete();
    assert_eq!(bench.robot.executed(), 0, "1 and 2 are not");
    assert!(bench.cycle(b"<Huuhaa$0##>").starts_with("<TyoKuittaus$4#50$3#><Tila$8#50$2$4$$#>"));
    // After a new connection the job is acknowledged again: the first acknowledgement may be lost.
    bench.robot.handle_disconnected(bench.now);
    bench.now += Duration::from_secs(2);
    bench.robot.handle_timeout(bench.now);
    bench.robot.handle_connected(bench.now);
    assert!(bench.cycle(b"<Huuhaa$0##>").starts_with("<TyoKuittaus$4#50$3#><Tila$8#50$2$4$$#>"));
    bench.execute();
    bench.execute();
    assert_eq!(bench.robot.executed(), 3);
}

/// After the wrap, the lowest number is not that of the oldest job.
#[test]
fn jobs_that_overtake_are_acknowledged_across_the_wrap() {
    let mut bench = Bench::new(RobotConfig { acks: Acks::Individual, ..PATIENT }, 4, 5);
    bench.cycle(&jobs([1, 2, 3]));
    (0..3).for_each(|_| _ = bench.execute());
    bench.cycle(&jobs([4, 5, 1, 2]));
    let take = |bench: &mut Bench, number| {
        let job = bench.reader.take_where(|_, job| job.number == number).unwrap();
        bench.robot.job_done(bench.now, number).unwrap();
        job.complete();
    };
    [2, 5].into_iter().for_each(|number| take(&mut bench, number));
    assert!(bench.cycle(b"<Huuhaa$0##>").starts_with("<TyoKuittaus$4#50$2#><TyoKuittaus$4#50$5#>"));
    [1, 4].into_iter().for_each(|number| take(&mut bench, number));
    assert!(bench.cycle(b"<Huuhaa$0##>").starts_with("<TyoKuittaus$4#50$1#><TyoKuittaus$4#50$4#><T"));
    assert_eq!((bench.robot.executed(), bench.robot.queued()), (7, 7));
}

#[test]
fn acknowledgements_that_do_not_fit_wait_for_the_next_cycle() {
    let mut bench = Bench::new(RobotConfig { acks: Acks::Individual, ..PATIENT }, 400, 999);
    let all = jobs(1..=400);
    for packet in all.chunks(4000) {
        bench.cycle(packet);
    }
    (0..400).for_each(|_| _ = bench.execute());
    let packets: Vec<String> = (0..37).map(|_| bench.cycle(b"<Huuhaa$0##>")).collect();
    let acks: Vec<usize> = packets.iter().map(|p| p.matches("TyoKuittaus").count()).collect();
    assert_eq!(acks.iter().sum::<usize>(), 400, "{acks:?}");
    let are_full = acks[..36].iter().all(|count| *count >= 10);
    assert!(are_full && packets.iter().all(|p| p.len() <= 256), "as many as a message of its size: {acks:?}");
}

#[test]
fn a_job_that_was_executed_ahead_is_not_queued_again_when_the_queue_was_cleared() {
    let mut bench = Bench::new(RobotConfig { acks: Acks::Individual, ..PATIENT }, 8, 999);
    bench.cycle(&jobs(1..=4));
    bench.execute();
    let job = bench.reader.take_where(|_, job| job.number == 4).unwrap();
    bench.robot.job_done(bench.now, job.number).unwrap();
    job.complete();
    bench.robot.clear_queue().unwrap();
    assert!(bench.reader.take().is_none());
    bench.cycle(b"<Huuhaa$0##>");
    bench.cycle(b"<Huuhaa$0##>");
    bench.cycle(&jobs(2..=4));
    assert_eq!(bench.queued_numbers(), [2, 3]);
    assert_eq!(bench.robot.statistics().queued, 7, "four, and three again");
}
