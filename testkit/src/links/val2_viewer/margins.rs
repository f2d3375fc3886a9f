//! The tolerance of the viewer's ends for wrong assumptions about each other: their sessions on a virtual clock, with
//! the default settings.

use core::time::Duration;

use robot_session::Session as _;
use val2_viewer::{
    ENQ, Host, HostConfig, HostEvent, PosePacket, Workstation, WorkstationConfig, WorkstationEvent, XOFF, XON,
};

use crate::model::Margin;

const MS: Duration = Duration::from_millis(1);
const HOST: &str = "val2-viewer host";
const WORKSTATION: &str = "val2-viewer workstation";

/// Returns the assumptions of the ends about time.
pub fn margins() -> Vec<Margin> {
    let (host, workstation) = (HostConfig::default(), WorkstationConfig::default());
    vec![
        Margin::around(
            [HOST, "interval", "requests that have piled up are read for so long"],
            host.interval,
            is_one_pile,
        ),
        Margin::around([HOST, "max_age", "ALTER gives no pose for so long"], host.max_age, is_aged),
        Margin::around(
            [HOST, "max_hold", "the workstation holds the line for so long"],
            host.max_hold,
            is_held,
        ),
        Margin::around(
            [WORKSTATION, "max_hold", "the host holds the line for so long"],
            workstation.max_hold,
            is_quiet,
        ),
        Margin::around(
            [WORKSTATION, "stale_after", "an answer takes so long"],
            workstation.stale_after,
            is_answered,
        ),
        Margin::around(
            [WORKSTATION, "pause", "two display cycles are so far apart"],
            workstation.pause,
            pauses,
        ),
    ]
}

/// Returns the times at which a host with a new pose in each cycle until `until` sends.
fn sent(inputs: &[(Duration, u8)], until: Duration, end: Duration) -> Vec<Duration> {
    let mut host = Host::new(HostConfig::default()).expect("the default can work");
    let (mut sent, mut now, mut pose, mut read) = (Vec::new(), Duration::ZERO, 0u32, 0);
    let mut out = [0; PosePacket::MAX_LEN];
    host.handle_connected(now);
    while now < end {
        if now <= until && now >= 28 * MS * pose {
            pose += 1;
            host.set_pose(now, [pose as i16; 12]);
        }
        while let Some((at, byte)) = inputs.get(read).filter(|(at, _)| *at <= now) {
            read += 1;
            host.handle_input(*at, &[*byte]);
        }
        host.handle_timeout(now);
        while host.poll_transmit(now, &mut out).is_some() {
            sent.push(now);
        }
        while let Some(event) = host.poll_event() {
            assert!(!matches!(event, HostEvent::Unexpected(_)), "{event:?}");
        }
        now += MS / 20;
    }
    sent
}

fn is_one_pile(long: Duration) -> Option<&'static str> {
    let requests = (0..=long.as_millis() as u32).map(|at| (MS * at, ENQ));
    let pile: Vec<_> = requests.chain([(long, ENQ)]).collect();
    let sent = sent(&pile, Duration::MAX, long + Duration::from_secs(1));
    (sent.len() > 1).then_some("a pile of requests has one packet")
}

fn is_aged(silent: Duration) -> Option<&'static str> {
    // The pose of 980 ms is the last one.
    let asked = 980 * MS + silent;
    let sent = sent(&[(asked, ENQ)], 980 * MS, asked + MS);
    sent.is_empty().then_some("a request is answered at once")
}

fn is_held(held: Duration) -> Option<&'static str> {
    let inputs = [(500 * MS, XOFF), (510 * MS, ENQ), (500 * MS + held, XON)];
    let sent = sent(&inputs, Duration::MAX, 500 * MS + held + 200 * MS);
    sent.iter().any(|at| *at < 500 * MS + held).then_some("nothing is sent while the other holds it")
}

/// Returns a workstation that has sent its request at once.
fn asking() -> Workstation {
    let mut workstation = Workstation::new(WorkstationConfig::default()).expect("the default can work");
    workstation.handle_connected(Duration::ZERO);
    workstation.draw(Duration::ZERO);
    assert!(workstation.poll_transmit(Duration::ZERO, &mut [0; 8]).is_some());
    workstation
}

fn is_quiet(held: Duration) -> Option<&'static str> {
    let mut workstation = Workstation::new(WorkstationConfig::default()).expect("the default can work");
    workstation.handle_connected(Duration::ZERO);
    workstation.handle_input(Duration::ZERO, &[XOFF]);
    let mut now = Duration::ZERO;
    while now < held {
        workstation.draw(now);
        workstation.handle_timeout(now);
        if workstation.poll_transmit(now, &mut [0; 8]).is_some() {
            return Some("nothing is sent while the other holds it");
        }
        now += MS / 20;
    }
    None
}

fn is_answered(after: Duration) -> Option<&'static str> {
    let (mut workstation, mut line) = (asking(), [0; PosePacket::MAX_LEN]);
    let packet = PosePacket { count: 0, pose: [1; 12] };
    let length = robot_session::Encode::encode(&packet, &mut line).expect("a buffer of a packet");
    workstation.handle_input(after, &line[..length]);
    let missed = core::iter::from_fn(|| workstation.poll_event()).any(|it| it == WorkstationEvent::Missed);
    missed.then_some("a request that is answered is not missed")
}

fn pauses(apart: Duration) -> Option<&'static str> {
    let mut workstation = asking();
    workstation.handle_timeout(apart);
    workstation.draw(apart);
    workstation.poll_transmit(apart, &mut [0; 8]).map(|_| "it does not ask again while an answer may come")
}
