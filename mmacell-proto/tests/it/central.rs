//! The central controller's counters and limits. Its rules are the stories of `reference/sessions/mmacell-proto.json`.

use core::time::Duration;

use crate::common::{HOME, MS, ZERO, central_with, connect, go, receive, send};
use mmacell_proto::robot_session::Session as _;
use mmacell_proto::{Central, CentralConfig, CentralEvent as Event, Command, ConfigError, RobotPose};

const S: Duration = Duration::from_secs(1);

#[test]
fn a_timeout_for_ever_saturates() {
    let mut c: Central<RobotPose> =
        central_with(CentralConfig { timeout: Duration::MAX, ..CentralConfig::DEFAULT });
    send(&mut c, S, Command::Stop);
    assert_eq!(c.poll_timeout(), None);
    c.handle_timeout(Duration::MAX - MS);
    assert_eq!(c.poll_event(), None);
    c.handle_input(Duration::MAX, b"OK\r\n");
    assert_eq!(c.poll_event(), Some(Event::Done { command: Command::Stop }));
    // At the end of time, and with a motion that is never believed to have begun.
    let config = CentralConfig { settle: Duration::MAX, tolerance: u32::MAX, ..CentralConfig::DEFAULT };
    let mut c: Central<RobotPose> = central_with(config);
    send(&mut c, Duration::MAX, go(HOME));
    assert_eq!(c.poll_timeout(), None);
    c.handle_input(Duration::MAX, b"OK\r\n");
    assert_eq!(c.poll_event(), Some(Event::Done { command: go(HOME) }));
    c.handle_connected(Duration::MAX);
    c.handle_disconnected(Duration::MAX);
    c.abort(Duration::MAX);
    let config = CentralConfig { timeout: ZERO, ..CentralConfig::DEFAULT };
    assert_eq!(Central::<RobotPose>::new(config).unwrap_err(), ConfigError::Timeout);
}

#[test]
fn a_connection_is_there_until_it_ends() {
    let mut c = Central::<RobotPose>::new(CentralConfig::DEFAULT).unwrap();
    let state = |c: &Central<RobotPose>| (c.is_connected(), c.is_ended());
    assert_eq!(state(&c), (false, false));
    connect(&mut c);
    assert_eq!(state(&c), (true, false));
    send(&mut c, ZERO, Command::Stop);
    assert_eq!(state(&c), (true, false));
    receive(&mut c, ZERO, b"OK\r\n");
    send(&mut c, ZERO, Command::Stop);
    c.abort(ZERO);
    assert_eq!(state(&c), (false, true), "it is to be closed");
    c.handle_disconnected(ZERO);
    assert_eq!(state(&c), (false, false));
    let count = c.statistics();
    assert_eq!((count.connections, count.commands, count.lines, count.unknown), (1, 2, 1, 1));
}

/// A command whose reply is given up must not be executed later: a driver discards its bytes.
#[test]
fn bytes_that_nobody_has_taken_are_discarded_when_the_reply_is_given_up() {
    let config = CentralConfig { timeout: S * 7, ..CentralConfig::DEFAULT };
    assert_eq!(central_with::<RobotPose>(config).discards_after(), Some(S * 7));
}
