use std::time::Duration;

use benches::frames::BALL_PACKET;
use benches::{Count, Link};
use isra_ball::{HostConfig, HostEvent};

use super::peer::{reply, with_peer};

pub(super) const LINK: Link = Link {
    name: "isra-ball",
    counts: &[Count::op("TCP: a poll and its packet through the handle", handle).rounds(50)],
    peers: &[|stream| reply(stream, Duration::from_millis(15), &BALL_PACKET)],
    ..Link::EMPTY
};

fn handle(rounds: u64) {
    with_peer(LINK.name, 0, |tcp| async move {
        let (ball, task) = isra_ball::tokio::host(HostConfig::default(), tcp).expect("the defaults work");
        tokio::spawn(task.run());
        let (mut events, mut polls) = (ball.handle.events(), 0);
        while polls < rounds {
            let event = events.recv().await.expect("the task runs");
            polls += u64::from(matches!(event, HostEvent::Packet(_) | HostEvent::Old(_)));
        }
    });
}
