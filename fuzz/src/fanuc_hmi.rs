//! FANUC's data over Modbus: the telemetry, and the assignments.

use core::time::Duration;

use arbitrary::Arbitrary;
use cellwire_motion::dpm::{Axis, Config, Modifier};
use cellwire_motion::{Observation, Quaternion, Tracker};
use fanuc_hmi_modbus::assignment::{self, Slots};
use fanuc_hmi_modbus::{TelemetryBlock, WordOrder};

use crate::Bytes;

/// A block of telemetry, and the demand of the DPM user after it.
#[derive(Debug, Arbitrary)]
pub(crate) struct Sample {
    registers: [u16; 37],
    /// The time until the next block, in milliseconds.
    pause: u8,
    /// The speeds for DPM, in mm/s and degrees/s.
    speeds: [f32; 6],
}

/// Checks a listing of assignments: the printed form of a slot decodes to the same.
pub(crate) fn assignment(Bytes(data): Bytes) {
    let text = String::from_utf8_lossy(&data);
    let slots = match Slots::parse(&text) {
        Ok(slots) => slots,
        Err(error) => return assert!((1..=text.lines().count()).contains(&error.line)),
    };
    let used: Vec<_> = slots.used().collect();
    for (slot, found) in &used {
        assert!((1..=80).contains(slot));
        if found.check().is_err() {
            continue;
        }
        let mut printed = String::new();
        found.print(*slot, &mut printed).unwrap();
        let again = Slots::parse(&printed).unwrap();
        let (_, read) = again.used().next().unwrap();
        assert_eq!((read.address, read.size, read.var_name), (found.address, found.size, found.var_name));
        assert_eq!(read.multiply, found.multiply);
    }
    let all: Vec<_> = used.iter().map(|(_, found)| **found).collect();
    if assignment::check(&all).is_ok() {
        let taken: usize = all.iter().map(|found| found.pdu_range().len()).sum();
        assert!(taken <= 16_384, "no two overlap");
    }
}

/// Blocks of telemetry, and speeds for DPM: whatever the registers hold, orientations are unit quaternions that follow one
/// another, and no offset passes a limit.
pub(crate) fn motion(blocks: Vec<Sample>) {
    let axis = Some(Axis::new(0.001));
    let mut modifier = Modifier::new(Config::new([axis; 6])).unwrap();
    let (mut tracker, mut before, mut now) = (Tracker::new(), None::<Quaternion>, Duration::ZERO);
    let (mut samples, mut path) = (0, [0i64; 6]);
    for Sample { registers, pause, speeds } in blocks {
        let block = TelemetryBlock::from_registers(&registers, WordOrder::LowFirst);
        match tracker.push(&block) {
            Observation::Sample(sample) => {
                samples += 1;
                let [w, x, y, z] = sample.orientation.to_array();
                assert!((w * w + x * x + y * y + z * z - 1.0).abs() < 1e-9);
                if let Some(before) = before.replace(sample.orientation) {
                    assert_eq!(sample.orientation.near(before), sample.orientation, "no jump of the sign");
                }
            }
            Observation::Repeated => {}
            _ => before = None,
        }
        now += Duration::from_millis(pause.into());
        let refused = modifier.demand(now, speeds.map(f64::from)).is_err();
        assert_eq!(refused, !speeds.iter().all(|speed| speed.is_finite()));
        let offsets = modifier.next_period(now);
        for (path, count) in path.iter_mut().zip(offsets.counts) {
            *path += i64::from(count);
            assert!(count.abs() <= 200 && path.abs() <= 10_000 && !(offsets.lost && count != 0));
        }
    }
    assert_eq!(tracker.counts().samples, samples);
}
