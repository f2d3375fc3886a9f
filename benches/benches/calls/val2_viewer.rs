use benches::frames::VIEWER_POSE;
use benches::{Count, Link};
use val2_viewer::{WorkstationConfig, WorkstationEvent};

use super::peer::{DELAY, reply, with_peer};

pub(super) const LINK: Link = Link {
    name: "val2-viewer",
    counts: &[Count::op("TCP: ENQ and its pose through the workstation's handle", handle).rounds(20)],
    peers: &[|stream| reply(stream, DELAY, VIEWER_POSE)],
    ..Link::EMPTY
};

fn handle(rounds: u64) {
    with_peer(LINK.name, 0, |tcp| async move {
        let (arm, task) =
            val2_viewer::tokio::workstation(WorkstationConfig::default(), tcp).expect("the defaults work");
        tokio::spawn(task.run());
        let (mut events, mut poses) = (arm.handle.events(), 0);
        while poses < rounds {
            let event = events.recv().await.expect("the task runs");
            poses += u64::from(matches!(event, WorkstationEvent::Pose(_)));
        }
    });
}
