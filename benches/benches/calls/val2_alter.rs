use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::thread::sleep;
use std::time::Duration;

use benches::frames::{ALTER_REQUEST as REQUEST, ALTER_START as START};
use benches::{Count, Link};
use val2_alter::{HostConfig, HostEvent, timing};

use super::peer::with_peer;

pub(super) const LINK: Link = Link {
    name: "val2-alter",
    counts: &[Count::op("TCP: a request and its reply through the host's handle", handle).rounds(50)],
    peers: &[controller],
    ..Link::EMPTY
};

/// Serves as a controller that starts ALTER, and sends a request a cycle after each reply.
fn controller(mut stream: TcpStream) {
    // A host under callgrind that is too late does not reply.
    stream.set_read_timeout(Some(Duration::from_secs(1))).expect("a socket");
    let mut bytes: &[u8] = &START;
    while stream.write_all(bytes).is_ok() {
        _ = stream.read(&mut [0; 64]);
        sleep(timing::CYCLE);
        bytes = &REQUEST;
    }
}

fn handle(rounds: u64) {
    with_peer(LINK.name, 0, |tcp| async move {
        let config = HostConfig { gap: None, ..HostConfig::default() };
        let (arm, task) = val2_alter::tokio::host(config, None, tcp).expect("the defaults work");
        tokio::spawn(task.run());
        let (mut events, mut requests) = (arm.handle().events(), 0);
        while requests < rounds {
            let event = events.recv().await.expect("the task runs");
            requests += u64::from(matches!(event, HostEvent::Motion(_)));
            arm.set_target([80, -80, 0, 182, -182, 5]);
        }
    });
}
