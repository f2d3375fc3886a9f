//! The counters and errors of each end, and formats of a caller.
//! The rules are the stories of `reference/sessions/val2-viewer.json`.
#![allow(clippy::cast_possible_truncation)]

use core::time::Duration;

use val2_viewer::robot_session::Session;
use val2_viewer::{
    ConfigError, DecodeError, ENQ, Format, Host, HostConfig, HostEvent, PosePacket, Workstation,
    WorkstationConfig, WorkstationEvent, XOFF, XON,
};

const MS: Duration = Duration::from_millis(1);
const POSE: [i16; 12] = [16384, 0, 0, 0, -16384, 0, 0, 0, -16384, 12800, -4816, 16];
const LINE: &[u8] = b"$POSE,7,16384,0,0,0,-16384,0,0,0,-16384,12800,-4816,16*30\r\n";
const SEVENTH: PosePacket = PosePacket { count: 7, pose: POSE };

fn events<S: Session>(session: &mut S) -> Vec<S::Event> {
    core::iter::from_fn(|| session.poll_event()).collect()
}

fn workstation() -> Workstation {
    let mut workstation = Workstation::new(WorkstationConfig::default()).unwrap();
    workstation.handle_connected(Duration::ZERO);
    workstation
}

/// Returns a host whose first interval is over.
fn host() -> Host {
    let mut host = Host::new(HostConfig::default()).unwrap();
    host.handle_connected(Duration::ZERO);
    host
}

fn asks(workstation: &mut Workstation, at: u32) -> bool {
    let mut out = [0; 1];
    workstation.draw(MS * at);
    let asked = workstation.poll_transmit(MS * at, &mut out).is_some();
    assert!(!asked || out == [ENQ]);
    assert_eq!(workstation.poll_transmit(MS * at, &mut out), None, "one byte a request");
    asked
}

fn answer(host: &mut Host, now: Duration) -> Option<PosePacket> {
    let mut out = [0; Host::MAX_TRANSMIT];
    let length = host.poll_transmit(now, &mut out)?;
    Some(PosePacket::decode(&out[..length]).unwrap().unwrap().0)
}

/// "… wird ein erneutes Versenden eines ENQ-Zeichen durch kurzes Unterbrechen (ca. zwei Sekunden) des Simulationsablaufes …
/// initiiert" (§9.4)
#[test]
fn a_pause_of_the_display_makes_it_ask_again() {
    let mut workstation = workstation();
    assert!(asks(&mut workstation, 0));
    for at in 1..20 {
        assert!(!asks(&mut workstation, 200 * at), "the display goes on");
    }
    assert!(!asks(&mut workstation, 3800 + 1999), "no pause of two seconds");
    assert_eq!(events(&mut workstation), [WorkstationEvent::Missed]);
    assert!(asks(&mut workstation, 5799 + 2000));
    assert_eq!(events(&mut workstation), []);
    // The answers to both come.
    workstation.handle_input(7850 * MS, &[LINE, LINE].concat());
    assert_eq!(
        events(&mut workstation),
        [WorkstationEvent::Pose(SEVENTH), WorkstationEvent::Unasked(SEVENTH)]
    );
    assert!(asks(&mut workstation, 8000));
    assert_eq!((workstation.statistics().requests, workstation.statistics().unasked), (3, 1));
}

#[test]
fn a_line_that_cannot_be_read_was_the_answer_and_noise_was_not() {
    let mut workstation = workstation();
    assert!(asks(&mut workstation, 0));
    let corrupt = |error| WorkstationEvent::Corrupt(error);
    workstation.handle_input(10 * MS, b"#?$POSE,1,2");
    assert_eq!(events(&mut workstation), [corrupt(DecodeError::Noise { length: 2 })]);
    assert!(!asks(&mut workstation, 200));
    workstation.handle_input(210 * MS, b"\r\n");
    assert_eq!(
        events(&mut workstation),
        [corrupt(DecodeError::Format { offset: 9 }), WorkstationEvent::Missed]
    );
    assert!(asks(&mut workstation, 400));
    // A line that a new one cuts off.
    workstation.handle_input(450 * MS, &[&LINE[..20], LINE].concat());
    assert_eq!(
        events(&mut workstation),
        [corrupt(DecodeError::Incomplete { length: 20 }), WorkstationEvent::Pose(SEVENTH)]
    );
    assert!(asks(&mut workstation, 600));
    assert_eq!((workstation.statistics().corrupt, workstation.statistics().missed), (3, 1));
}

#[test]
fn a_picture_without_new_poses_is_stale_once() {
    let mut workstation = workstation();
    assert!(asks(&mut workstation, 0));
    workstation.handle_input(50 * MS, LINE);
    events(&mut workstation);
    assert!(asks(&mut workstation, 200));
    let due = Some(1550 * MS);
    assert_eq!((workstation.poll_timeout(), workstation.live_until()), (due, due));
    workstation.handle_timeout(1550 * MS - MS / 10);
    assert_eq!(events(&mut workstation), []);
    workstation.handle_timeout(1550 * MS);
    assert_eq!(events(&mut workstation), [WorkstationEvent::Stale]);
    assert_eq!((workstation.poll_timeout(), workstation.live_until()), (Some(1700 * MS), None));
    // The answer comes in time for the request: the picture follows the arm again.
    workstation.handle_input(1699 * MS, LINE);
    assert_eq!(events(&mut workstation), [WorkstationEvent::Pose(SEVENTH)]);
    assert_eq!(workstation.live_until(), Some(3199 * MS));
    assert_eq!((workstation.statistics().stale, workstation.statistics().poses), (1, 2));
}

#[test]
fn the_host_answers_a_request_once_with_the_newest_pose() {
    let mut host = host();
    let begin = 150 * MS;
    host.handle_input(begin, &[ENQ]);
    assert_eq!((host.poll_timeout(), answer(&mut host, begin)), (None, None), "no pose");
    host.set_pose(begin, [1; 12]);
    host.set_pose(begin, POSE);
    assert_eq!(answer(&mut host, begin), Some(PosePacket { count: 0, pose: POSE }));
    assert_eq!(answer(&mut host, begin), None, "nothing unasked");
    host.handle_input(begin, &[ENQ, b'?']);
    assert_eq!(host.poll_timeout(), Some(300 * MS));
    assert_eq!(answer(&mut host, 299 * MS), None);
    assert_eq!(host.poll_transmit(300 * MS, &mut [0; 10]), None, "no room: the request stays");
    assert_eq!(answer(&mut host, 300 * MS), Some(PosePacket { count: 1, pose: POSE }));
    let sent = |count| HostEvent::Sent(PosePacket { count, pose: POSE });
    let asked = HostEvent::Asked;
    assert_eq!(events(&mut host), [asked, sent(0), asked, HostEvent::Unknown(b'?'), sent(1)]);
    assert_eq!((host.statistics().asked, host.statistics().sent, host.statistics().unknown), (2, 2, 1));
}

#[test]
fn another_format_may_be_sent() {
    let format = |packet: &PosePacket, out: &mut [u8]| {
        out.get_mut(..2)?.copy_from_slice(&packet.pose[9].to_be_bytes());
        Some(2)
    };
    let mut host = Host::new(HostConfig { format, ..HostConfig::default() }).unwrap();
    host.handle_connected(Duration::ZERO);
    host.set_pose(150 * MS, POSE);
    host.handle_input(150 * MS, &[ENQ]);
    let mut out = [0; Host::MAX_TRANSMIT];
    assert_eq!(host.poll_transmit(150 * MS, &mut out[..1]), None, "no room: the request stays");
    assert_eq!((host.poll_transmit(150 * MS, &mut out), &out[..2]), (Some(2), &[0x32, 0x00][..]));
    let mut silent = Host::new(HostConfig { format: |_, _| Some(0), ..HostConfig::default() }).unwrap();
    silent.handle_connected(Duration::ZERO);
    silent.set_pose(150 * MS, POSE);
    silent.handle_input(150 * MS, &[ENQ]);
    assert_eq!(silent.poll_transmit(150 * MS, &mut out), None, "nothing is no packet");
    assert_eq!(events(&mut silent), [HostEvent::Asked]);
    for format in [with::<XON> as Format, with::<XOFF>] {
        let mut unsendable = Host::new(HostConfig { format, ..HostConfig::default() }).unwrap();
        unsendable.handle_connected(Duration::ZERO);
        unsendable.set_pose(150 * MS, POSE);
        unsendable.handle_input(150 * MS, &[ENQ]);
        assert_eq!(unsendable.poll_transmit(150 * MS, &mut out), None, "it would stop the line");
        assert_eq!(events(&mut unsendable), [HostEvent::Asked, HostEvent::Unsendable]);
        assert_eq!((unsendable.poll_timeout(), unsendable.statistics().unsendable), (Some(350 * MS), 1));
    }
}

fn with<const BYTE: u8>(_: &PosePacket, out: &mut [u8]) -> Option<usize> {
    out.get_mut(..3)?.copy_from_slice(&[b'a', BYTE, b'b']);
    Some(3)
}

#[test]
fn what_cannot_work_is_refused() {
    let host = HostConfig { max_hold: Duration::ZERO, ..HostConfig::default() };
    assert_eq!(Host::new(host).map(drop), Err(ConfigError::MaxHold));
    let held = WorkstationConfig { max_hold: Duration::ZERO, ..WorkstationConfig::default() };
    assert_eq!(Workstation::new(held).map(drop), Err(ConfigError::MaxHold));
    assert_eq!(ConfigError::MaxHold.to_string(), "the longest hold of the line is zero");
    let host = |interval, max_age| {
        Host::new(HostConfig { interval, max_age, ..HostConfig::default() })
            .map(drop)
            .map_err(|e| e.to_string())
    };
    assert_eq!(host(Duration::ZERO, MS), Err("the interval between two packets is zero".into()));
    assert_eq!(host(MS, Duration::ZERO), Err("the maximum age of a pose is zero".into()));
    assert_eq!((host(MS, MS), host(Duration::MAX, Duration::MAX)), (Ok(()), Ok(())));
    let workstation = |pause, stale_after| {
        let config = WorkstationConfig { pause, stale_after, ..WorkstationConfig::default() };
        Workstation::new(config).map(drop)
    };
    let minimum = 200 * MS;
    let pause = ConfigError::Pause { minimum, found: minimum };
    assert_eq!(workstation(minimum, 201 * MS), Err(pause));
    assert_eq!(pause.to_string(), "a pause of 200ms must be longer than the display cycle of 200ms");
    let stale = ConfigError::StaleAfter { minimum, found: minimum };
    assert_eq!(workstation(201 * MS, minimum), Err(stale));
    assert_eq!(stale.to_string(), "the stale time 200ms must be longer than the display cycle of 200ms");
    assert_eq!(workstation(201 * MS, 201 * MS), Ok(()));
    assert_eq!(workstation(Duration::MAX, Duration::MAX), Ok(()));
}

#[test]
fn a_request_that_is_never_answered_is_missed_once() {
    let mut workstation = workstation();
    assert!(asks(&mut workstation, 0));
    assert_eq!(workstation.poll_timeout(), Some(1500 * MS));
    workstation.handle_timeout(1500 * MS - MS / 10);
    assert_eq!(events(&mut workstation), []);
    workstation.handle_timeout(1500 * MS);
    assert_eq!(
        (events(&mut workstation), workstation.poll_timeout()),
        (vec![WorkstationEvent::Missed], None)
    );
    assert!(!asks(&mut workstation, 1600), "time alone does not make it ask again");
    assert!(asks(&mut workstation, 3600), "a pause of the display does");
    assert_eq!(events(&mut workstation), [], "it was reported");
    // The answer comes late: nobody waits for it, and the host is there.
    workstation.handle_timeout(5100 * MS);
    workstation.handle_input(5200 * MS, LINE);
    assert_eq!(events(&mut workstation), [WorkstationEvent::Missed, WorkstationEvent::Unasked(SEVENTH)]);
    assert!(asks(&mut workstation, 5300));
    assert_eq!((workstation.statistics().missed, workstation.statistics().requests), (2, 3));
}

/// A `3` with one corrupt bit is an XOFF.
#[test]
fn an_xoff_out_of_noise_does_not_silence_the_line() {
    let mut workstation = workstation();
    workstation.handle_input(MS, &[XOFF]);
    assert_eq!(workstation.poll_timeout(), Some(5001 * MS));
    workstation.handle_input(101 * MS, &[XOFF]);
    assert_eq!(workstation.poll_timeout(), Some(5101 * MS), "again: for longer");
    assert!(!asks(&mut workstation, 5100));
    assert!(asks(&mut workstation, 5101));
    assert_eq!(events(&mut workstation), [WorkstationEvent::HoldEnded]);
    let mut host = host();
    host.handle_input(200 * MS, &[ENQ, XOFF]);
    host.handle_input(201 * MS, &[XOFF]);
    host.set_pose(5100 * MS, POSE);
    assert_eq!((answer(&mut host, 5200 * MS), host.poll_timeout()), (None, Some(5201 * MS)));
    assert_eq!(answer(&mut host, 5201 * MS), Some(PosePacket { count: 0, pose: POSE }));
    let sent = HostEvent::Sent(PosePacket { count: 0, pose: POSE });
    assert_eq!(events(&mut host), [HostEvent::Asked, HostEvent::HoldEnded, sent]);
    assert_eq!((host.statistics().holds_ended, workstation.statistics().holds_ended), (1, 1));
}
