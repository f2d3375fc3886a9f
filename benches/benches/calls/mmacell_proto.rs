use benches::frames::MMA_STATUS;
use benches::{Count, Link};
use mmacell_proto::{CentralConfig, RobotPose};

use super::peer::{DELAY, ROUNDS, reply, with_peer};

pub(super) const LINK: Link = Link {
    name: "mmacell-proto",
    counts: &[Count::op("TCP: a status through the handle", handle).rounds(ROUNDS)],
    peers: &[|stream| reply(stream, DELAY, MMA_STATUS)],
    ..Link::EMPTY
};

fn handle(rounds: u64) {
    with_peer(LINK.name, 0, |tcp| async move {
        let (robot, task) = mmacell_proto::tokio::central::<RobotPose, _>(CentralConfig::DEFAULT, tcp)
            .expect("the defaults work");
        tokio::spawn(task.run());
        robot.handle().connected().await.expect("the task runs");
        for _ in 0..rounds {
            robot.status().await.expect("a status");
        }
    });
}
