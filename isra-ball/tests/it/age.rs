//! The age of the values that a host has used: with packets that are missing, and with a ball that is late each time.

use core::time::Duration;
use std::collections::VecDeque;

use isra_ball::robot_session::{Encode as _, Session as _};
use isra_ball::{Host, HostConfig, HostEvent, Keys, Packet, Status, timing};

const MS: Duration = Duration::from_millis(1);

/// The fate of the packet that answers a poll.
#[derive(Clone, Copy, PartialEq)]
enum PacketFate {
    New,
    Old,
    Corrupt,
    Lost,
}

#[derive(Debug, Default, PartialEq)]
struct AgeStatistics {
    new: u32,
    stale: u32,
    unasked: u32,
    /// The greatest age of values that may be used.
    oldest: Duration,
    /// The longest time for which values are used that are older than the host's greatest age.
    too_old: Duration,
    /// The longest time without stale values.
    live: Duration,
}

/// Simulates ten seconds of a ball that measures when it is polled, and whose packets are this late.
fn ten_seconds(late: impl Fn(u32) -> Duration, fate: impl Fn(u32) -> PacketFate) -> AgeStatistics {
    ten_seconds_called(|at| at, late, fate)
}

/// Simulates the same with a host that is called after its deadline: `called` returns the time of the call.
fn ten_seconds_called(
    called: impl Fn(Duration) -> Duration,
    late: impl Fn(u32) -> Duration,
    fate: impl Fn(u32) -> PacketFate,
) -> AgeStatistics {
    let mut host = Host::new(HostConfig::default()).unwrap();
    let (mut seen, mut asked, mut now) = (AgeStatistics::default(), 0, Duration::ZERO);
    let mut line: VecDeque<(Duration, [u8; 12])> = VecDeque::new();
    // The times at which the values of each packet were measured, by their number.
    let mut measured = Vec::new();
    let (mut using, mut live_since, mut old_since) = (None, None, None);
    host.handle_connected(now);
    while now < 10_000 * MS {
        while line.front().is_some_and(|(at, _)| *at <= now) {
            let (_, bytes) = line.pop_front().unwrap();
            host.handle_input(now, &bytes);
        }
        host.handle_timeout(now);
        if host.poll_transmit(now, &mut [0]).is_some() {
            let number = u16::try_from(asked).unwrap().to_le_bytes().map(u8::cast_signed);
            let status = if fate(asked) == PacketFate::Old { Status::Old } else { Status::Fresh };
            let packet = Packet {
                sensor_type: 0,
                sensor: 0,
                status,
                force: [number[0], number[1], 0],
                moment: [0; 3],
                keys: Keys::NONE,
            };
            let mut bytes = [0; 12];
            packet.encode(&mut bytes).unwrap();
            bytes[11] ^= u8::from(fate(asked) == PacketFate::Corrupt);
            if fate(asked) != PacketFate::Lost {
                line.push_back((now + timing::exchange_time(9600) + late(asked), bytes));
            }
            measured.push(now);
            asked += 1;
        }
        while let Some(event) = host.poll_event() {
            match event {
                HostEvent::Packet(packet) => {
                    let [low, high, _] = packet.force.map(i8::cast_unsigned);
                    using = Some(measured[usize::from(u16::from_le_bytes([low, high]))]);
                    seen.new += 1;
                    live_since.get_or_insert(now);
                }
                HostEvent::Stale => {
                    seen.stale += 1;
                    (using, live_since, old_since) = (None, None, None);
                }
                HostEvent::Unasked(_) => seen.unasked += 1,
                _ => {}
            }
        }
        if let Some(measured) = using {
            seen.oldest = seen.oldest.max(now - measured);
            if now - measured > HostConfig::default().max_age {
                seen.too_old = seen.too_old.max(now - *old_since.get_or_insert(now));
            } else {
                old_since = None;
            }
            seen.live = seen.live.max(now - live_since.unwrap());
        }
        let next = line.front().map(|(at, _)| *at).into_iter().chain(host.poll_timeout()).min().unwrap();
        now = called(next.max(now + MS / 10));
    }
    seen
}

/// One packet in four is old, corrupt or lost, and each is as late as it may be: the values never become stale, and whoever
/// uses them may be 20 ms late.
#[test]
fn a_packet_that_is_missing_makes_nothing_stale() {
    for fate in [PacketFate::Old, PacketFate::Corrupt, PacketFate::Lost] {
        for late in 0..=13 {
            let fate = |n| if n % 4 == 3 { fate } else { PacketFate::New };
            let seen = ten_seconds(|_| late * MS, fate);
            assert_eq!((seen.stale, seen.unasked), (0, 0), "{late} ms");
            assert!(seen.new > 180, "{late} ms: {seen:?}");
            // 150 ms from the poll of the reply before.
            assert!(seen.oldest <= 130 * MS, "{late} ms: {seen:?}");
        }
    }
    let two_old = ten_seconds(|_| 13 * MS, |n| if n % 3 == 0 { PacketFate::New } else { PacketFate::Old });
    assert_eq!((two_old.stale, two_old.unasked), (0, 0), "{two_old:?}");
}

/// Packets have no number: one that is late by whole periods seems to answer another poll. That never continues for as long as
/// a hand has to rest, and is seen.
#[test]
fn values_of_a_ball_that_is_late_each_time_are_never_too_old_nor_used_for_long() {
    let max_age = HostConfig::default().max_age;
    let window = HostConfig::default().reply_window() - timing::exchange_time(9600);
    for late in (0..=1200).map(|late| late * MS) {
        let seen = ten_seconds(|_| late, |_| PacketFate::New);
        if late < window {
            assert!(seen.new > 300 && seen.unasked == 0, "{late:?}: {seen:?}");
        } else {
            assert!(seen.oldest <= max_age && seen.live < 70 * MS, "{late:?}: {seen:?}");
            assert!(seen.unasked > 10, "{late:?}: {seen:?}");
        }
    }
}

/// The same when it becomes late while its values are used: they are used no longer than the greatest age.
#[test]
fn a_ball_that_becomes_late_is_stale_in_time() {
    let max_age = HostConfig::default().max_age;
    for late in (15..=600).map(|late| late * MS) {
        let seen = ten_seconds(|n| if n < 100 { Duration::ZERO } else { late }, |_| PacketFate::New);
        assert!(seen.stale > 0 && seen.unasked > 10, "{late:?}: {seen:?}");
        assert!(seen.oldest <= max_age, "{late:?}: {seen:?}");
    }
}

/// A ball that is late each time, and a host that is called late twice a second: values that are too old are used no longer
/// than twice the greatest age.
#[test]
fn late_values_of_a_host_that_is_called_late_are_found_out() {
    let max_age = HostConfig::default().max_age;
    let called = |at: Duration| if at.as_millis() % 500 < 10 { at + 60 * MS } else { at };
    for late in (0..=1200).map(|late| late * MS) {
        let seen = ten_seconds_called(called, |_| late, |_| PacketFate::New);
        assert!(seen.too_old <= 2 * max_age, "{late:?}: {seen:?}");
    }
}
