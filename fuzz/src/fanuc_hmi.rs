//! What is behind FANUC's Modbus: the telemetry, and the assignments.

use core::time::Duration;

use cellwire_motion::dpm::{Axis, Config, Modifier};
use cellwire_motion::{Observation, Quaternion, Tracker};
use fanuc_hmi_modbus::assignment::{self, Slots};
use fanuc_hmi_modbus::{Signal, Table, TelemetryBlock, WordOrder};

/// A listing of assignments, and the place of every signal: what a slot prints is read back the same.
pub(crate) fn assignment(data: &[u8]) {
    let text = String::from_utf8_lossy(data);
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
        let (a, b) = (read.multiply.value(), found.multiply.value());
        assert!((a - b).abs() <= 1e-6 * b.abs(), "six decimals are printed: {a} for {b}");
    }
    let all: Vec<_> = used.iter().map(|(_, found)| **found).collect();
    if assignment::check(&all).is_ok() {
        let taken: usize = all.iter().map(|found| found.pdu_range().len()).sum();
        assert!(taken <= 16_384, "no two overlap");
    }
    for address in data.chunks_exact(2).map(|pair| u16::from_be_bytes([pair[0], pair[1]])) {
        for table in [Table::Coils, Table::DiscreteInputs, Table::InputRegisters, Table::HoldingRegisters] {
            if let Some(signal) = Signal::at(table, address) {
                assert_eq!(signal.place(), Some((table, address)));
            }
        }
    }
}

/// Blocks of telemetry, 37 registers each, and speeds for DPM: whatever the registers hold, orientations are unit
/// quaternions that follow one another, and no offset passes a limit.
pub(crate) fn motion(data: &[u8]) {
    let axis = Some(Axis::new(0.001));
    let mut modifier = Modifier::new(Config::new([axis; 6])).unwrap();
    let (mut tracker, mut before, mut now) = (Tracker::new(), None::<Quaternion>, Duration::ZERO);
    let (mut samples, mut path) = (0, [0i64; 6]);
    for bytes in data.chunks_exact(74) {
        let mut registers = [0u16; 37];
        for (register, word) in registers.iter_mut().zip(bytes.chunks_exact(2)) {
            *register = u16::from_be_bytes([word[0], word[1]]);
        }
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
        now += Duration::from_millis((block.life_counter % 32).into());
        let [x, y, z] = block.velocity.map(f64::from);
        let [w, p, r] = block.position.map(f64::from);
        let refused = modifier.demand(now, [x, y, z, w, p, r]).is_err();
        assert_eq!(refused, ![x, y, z, w, p, r].iter().all(|speed| speed.is_finite()));
        let offsets = modifier.next_period(now);
        for (path, count) in path.iter_mut().zip(offsets.counts) {
            *path += i64::from(count);
            assert!(count.abs() <= 200 && path.abs() <= 10_000 && !(offsets.lost && count != 0));
        }
    }
    assert_eq!(tracker.counts().samples, samples);
}
