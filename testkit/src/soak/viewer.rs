//! The workstation that draws the robot, and the host that feeds it, on a serial line. A job is a pose that was sent.

use core::time::Duration;

use val2_alter::Transform;
use val2_alter::viewer::{PoseFeed, PosePacket, Viewer, ViewerError};

use super::{Check, Ledger, Log, Reported, Row, Tally, Wire};
use crate::link::{Delivery, End, Faults};
use crate::rng::Rng;

pub(super) const SERIAL: Row =
    Row { link: "val2-alter", transport: "viewer", job: "poses", one_in: Some(256), session };

const MS: Duration = Duration::from_millis(1);

/// The pose of a job: no two are alike.
fn pose(job: usize) -> Transform {
    let n = job as i16;
    Transform(core::array::from_fn(|i| n.wrapping_mul(2 * i as i16 + 1) ^ 0x1234))
}

fn session(seed: u64, log: Log) -> Tally {
    let mut rng = Rng::new(!seed);
    let bad = [0.2, 1.0, 3.0][rng.below(3)];
    let faults = Faults {
        flip: 0.001 * bad,
        lose_byte: 0.0005 * bad,
        insert: 0.0005 * bad,
        lose: 0.03,
        pause: 20 * MS,
        ..Faults::SERIAL
    };
    let mut wire = Wire::new(seed, faults.at_baud(19_200), ["viewer", "host"], true, log);
    let (mut viewer, mut feed) = (Viewer::default(), PoseFeed::default());
    let (mut ledger, mut now, mut out) = (Ledger::default(), Duration::ZERO, [0; PosePacket::MAX_LEN]);
    let (mut aliens, mut invented) = (Vec::new(), 0);
    // Up to which count the viewer knows what became of the packets.
    let mut known = 0;
    let (jobs, mut draw_at, mut asked) = (5 + rng.below(40), Duration::ZERO, 0);
    let end = Duration::from_secs(600);
    while now < end && (ledger.len() < jobs || known < ledger.len() && asked < 3) {
        while let Some(Delivery::Bytes(bytes)) = wire.receive(End::A, now) {
            viewer.handle_input(&bytes);
        }
        while let Some(event) = viewer.poll_event() {
            log.line(now, format_args!("  viewer: {event:?}"));
            let Ok(packet) = event else { continue };
            let count = usize::from(packet.count);
            if count >= ledger.len() || packet.pose != pose(count) {
                aliens.push(packet);
            } else if count < known {
                log.line(now, format_args!("!!! it comes behind a later one"));
                ledger.execute(count);
                invented += 1;
            } else {
                // The counts show which ones were lost.
                (known..count).for_each(|lost| _ = ledger.report(lost, Reported::NotDone, wire.mark()));
                ledger.execute(count);
                ledger.report(count, Reported::Done, wire.mark());
                known = count + 1;
            }
        }
        if now >= draw_at {
            // The operator pauses the display when no picture has come for long.
            viewer.draw(now);
            draw_at = now + if rng.chance(0.1) { 2100 * MS } else { 200 * MS };
            asked += usize::from(ledger.len() >= jobs);
        }
        while let Some(len) = viewer.poll_transmit(&mut out) {
            wire.send(End::A, now, &out[..len]);
        }
        while let Some(Delivery::Bytes(bytes)) = wire.receive(End::B, now) {
            feed.handle_input(&bytes);
        }
        feed.set_pose(pose(ledger.len()));
        if rng.chance(0.01) {
            log.line(now, format_args!("ALTER begins anew"));
            feed.restart(now);
        }
        if let Some(len) = feed.poll_transmit(now, &mut out) {
            ledger.send(wire.mark());
            wire.send(End::B, now, &out[..len]);
        }
        now = wire.next(now, [feed.poll_timeout(), Some(draw_at)]);
    }
    // Behind the last one that came no count shows anything: their requests were not answered.
    (known..ledger.len()).for_each(|job| _ = ledger.report(job, Reported::Unknown, wire.mark()));
    let mut tally = Tally { invented, ..Tally::default() };
    let unseen = wire.settle(now, &mut tally, PosePacket::MAX_LEN, |from, bytes| match from {
        // A request of one byte has no check: one out of noise is answered with a pose.
        End::A => Check::Nothing,
        End::B => match PosePacket::decode(bytes) {
            Ok(Some((_, len))) => Check::Good(len),
            Err(ViewerError::Checksum { .. }) => Check::Refused,
            Ok(None) | Err(_) => Check::Nothing,
        },
    });
    for alien in aliens {
        let made =
            |bytes: &[u8]| matches!(PosePacket::decode(bytes), Ok(Some((packet, _))) if packet == alien);
        if !unseen.iter().any(|unseen| made(&unseen.bytes)) {
            log.line(now, format_args!("!!! nobody sent {alien:?}"));
            tally.invented += 1;
        }
    }
    ledger.settle(now, log, &mut tally, |_| false);
    tally
}
