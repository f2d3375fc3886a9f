use benches::{Count, Link};
use laser_eb90::robot_session::Encode as _;
use laser_eb90::tokio::Command;
use laser_eb90::{Frame, HostConfig, Payload, Profile};

use super::peer::{DELAY, ROUNDS, reply, with_peer};

const MOVE: u16 = 0x0160;

pub(super) const LINK: Link = Link {
    name: "laser-eb90",
    counts: &[Count::op("TCP: an immediate instruction through the handle", handle).rounds(ROUNDS)],
    peers: &[|stream| reply(stream, DELAY, &echo())],
    ..Link::EMPTY
};

fn echo() -> Vec<u8> {
    let (mut buffer, mut bytes) = ([0; 16], [0; Frame::MAX_LEN]);
    let mut payload = Payload::new(&mut buffer, &Profile::default());
    payload.word(MOVE).expect("room");
    let length = payload.frame().expect("a word").encode(&mut bytes).expect("long enough");
    bytes[..length].to_vec()
}

fn handle(rounds: u64) {
    with_peer(LINK.name, 0, |tcp| async move {
        let (laser, task) = laser_eb90::tokio::host(HostConfig::default(), tcp).expect("the defaults work");
        tokio::spawn(task.run());
        for _ in 0..rounds {
            laser.now(Command::bare(MOVE)).await.expect("an echo");
        }
    });
}
