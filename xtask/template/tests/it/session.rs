//! Both ends, and every rule of the source.

use core::time::Duration;

use toy_link::robot_session::Session;
use toy_link::{
    ConfigError, Device, DeviceConfig, DeviceEvent, Host, HostConfig, HostEvent, Message, SessionError,
};

const NOW: Duration = Duration::from_secs(5);

fn host() -> Host {
    let mut host = Host::new(HostConfig::default()).unwrap();
    host.handle_connected(NOW);
    host
}

fn device() -> Device {
    let mut device = Device::new(DeviceConfig::default());
    device.handle_connected(NOW);
    device
}

fn sent(session: &mut impl Session) -> Option<Vec<u8>> {
    let mut out = [0; Message::MAX_LEN];
    let length = session.poll_transmit(NOW, &mut out)?;
    Some(out[..length].to_vec())
}

#[test]
fn a_request_has_one_outcome() {
    let mut host = host();
    assert_eq!(host.get(NOW, 7), Ok(()));
    assert_eq!(host.get(NOW, 8), Err(SessionError::Busy));
    assert_eq!(sent(&mut host).unwrap(), b"G7\n");
    assert_eq!(sent(&mut host), None);
    host.handle_input(NOW, b"V8=1\nV7=-120\nV7=5\n");
    assert_eq!(host.poll_event(), Some(HostEvent::Unasked { register: 8, value: 1 }));
    assert_eq!(host.poll_event(), Some(HostEvent::Value { register: 7, value: -120 }));
    assert_eq!(host.poll_event(), Some(HostEvent::Unasked { register: 7, value: 5 }));
    assert_eq!(host.poll_event(), None);
}

#[test]
fn a_request_without_a_reply_times_out_and_ends_with_its_connection() {
    let mut host = host();
    host.get(NOW, 7).unwrap();
    sent(&mut host).unwrap();
    let due = host.poll_timeout().unwrap();
    assert_eq!(due, NOW + Duration::from_secs(1));
    host.handle_timeout(due - Duration::from_nanos(1));
    assert_eq!(host.poll_event(), None);
    host.handle_timeout(due);
    assert_eq!(host.poll_event(), Some(HostEvent::TimedOut { register: 7 }));
    host.get(due, 8).unwrap();
    host.handle_disconnected(due);
    assert_eq!(host.poll_event(), Some(HostEvent::TimedOut { register: 8 }));
    assert_eq!(host.get(due, 9), Err(SessionError::NotConnected));
    assert_eq!(
        Host::new(HostConfig { timeout: Duration::ZERO, ..HostConfig::default() }).err(),
        Some(ConfigError::Timeout)
    );
}

#[test]
fn requests_are_answered_in_order_and_wait_for_the_one_before() {
    let mut device = device();
    device.handle_input(NOW, b"G1\nG2\n");
    assert!(!device.wants_input());
    for (register, reply) in [(1, b"V1=10\n"), (2, b"V2=20\n")] {
        assert_eq!(device.poll_event(), Some(DeviceEvent::Asked { register }));
        device.answer(i32::from(register) * 10).unwrap();
        assert_eq!(sent(&mut device).unwrap(), reply);
    }
    assert_eq!(device.answer(3), Err(SessionError::NotAsked));
    assert!(device.wants_input());
}

#[test]
fn a_request_is_not_answered_on_the_next_connection() {
    let mut device = device();
    device.handle_input(NOW, b"G1\n");
    device.answer(10).unwrap();
    device.handle_disconnected(NOW);
    device.handle_connected(NOW);
    assert_eq!(sent(&mut device), None);
}
