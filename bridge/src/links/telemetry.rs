//! The telemetry block of a FANUC controller: its word order and its plausibility, as `cellwire fanuc log` checks them.

use std::time::Duration;

use cellwire_motion::plausibility::Plausibility;
use fanuc_hmi_modbus::typed::OrderProbe;
use fanuc_hmi_modbus::{TelemetryBlock, WordOrder};

/// The result of reading a block.
#[derive(Debug, PartialEq)]
pub(super) enum ReadResult {
    /// The values that the controller reports.
    Values(TelemetryBlock),
    /// The block is implausible: the fault's name, the value that shows it, and the number of such blocks in a row. Once a minute
    /// for each fault.
    Cannot(&'static str, &'static str, u32),
    /// The block is implausible for the same reason as the previous one.
    Still,
}

/// Reads blocks one after the other.
#[derive(Debug)]
pub(super) struct Telemetry {
    /// The word order that the site file gives.
    given: Option<WordOrder>,
    /// The word order that the life counter shows.
    probe: OrderProbe,
    /// The word order that the blocks have been read in while neither of the others is known.
    assumed: WordOrder,
    plausibility: Plausibility,
    fault: Option<Fault>,
}

/// A fault that was reported.
#[derive(Debug, Clone, Copy)]
struct Fault {
    name: &'static str,
    value: &'static str,
    /// The number of blocks in a row.
    blocks: u32,
    /// The time at which the fault was reported last.
    at: Duration,
}

/// A fault that continues is reported again after this time.
const REPEAT_INTERVAL: Duration = Duration::from_secs(60);

impl Telemetry {
    /// Makes the telemetry of a controller whose blocks are read every `poll`.
    pub(super) fn new(given: Option<WordOrder>, period: Duration, poll: Duration) -> Self {
        Self {
            given,
            probe: OrderProbe::default(),
            assumed: WordOrder::default(),
            plausibility: Plausibility::new(None, period, poll),
            fault: None,
        }
    }

    /// Notes a new connection.
    pub(super) fn reconnected(&mut self) {
        (self.probe, self.fault) = (OrderProbe::default(), None);
        self.plausibility.reconnected();
    }

    /// Decodes a block that was read at `now`.
    pub(super) fn read(&mut self, registers: &[u16; 37], now: Duration) -> ReadResult {
        let [first, second, ..] = *registers;
        let found = self.probe.watch([first, second]);
        let in_order = |order| TelemetryBlock::from_registers(registers, order);
        if self.given.is_none() && found.is_none() {
            // A real in the wrong order is a denormal or has no sense, and a quaternion no unit length.
            let can_be = |order| self.plausibility.clone().check(&in_order(order), now).is_none();
            let other = match self.assumed {
                WordOrder::LowFirst => WordOrder::HighFirst,
                WordOrder::HighFirst => WordOrder::LowFirst,
            };
            if !can_be(self.assumed) && can_be(other) {
                self.assumed = other;
            }
        }
        self.assumed = self.given.or(found).unwrap_or(self.assumed);
        let block = in_order(self.assumed);
        let fault = match self.plausibility.check(&block, now) {
            Some((fault, value)) => Some((fault.name(), value)),
            None if found.is_some_and(|found| found != self.assumed) => Some(("word_order", "life_counter")),
            None => None,
        };
        let Some((name, value)) = fault else {
            self.fault = None;
            return ReadResult::Values(block);
        };
        match &mut self.fault {
            Some(fault) if (fault.name, fault.value) == (name, value) => {
                fault.blocks = fault.blocks.saturating_add(1);
                if now.saturating_sub(fault.at) < REPEAT_INTERVAL {
                    return ReadResult::Still;
                }
                fault.at = now;
                ReadResult::Cannot(name, value, fault.blocks)
            }
            fault => {
                *fault = Some(Fault { name, value, blocks: 1, at: now });
                ReadResult::Cannot(name, value, 1)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const POLL: Duration = Duration::from_millis(100);

    /// Returns a block with this life counter.
    fn registers(order: WordOrder, life: u32) -> [u16; 37] {
        let block = TelemetryBlock {
            life_counter: life,
            position: [465.0, 0.0, 365.0],
            quaternion: [0.0, 0.6, 0.0, 0.8],
            ..TelemetryBlock::default()
        };
        block.to_registers(order)
    }

    fn telemetry(given: Option<WordOrder>) -> Telemetry {
        Telemetry::new(given, Duration::from_millis(8), POLL)
    }

    #[test]
    fn the_word_order_is_found_from_the_first_block_on() {
        for order in [WordOrder::LowFirst, WordOrder::HighFirst] {
            let mut telemetry = telemetry(None);
            for life in 1..9 {
                let ReadResult::Values(block) = telemetry.read(&registers(order, life * 12), POLL * life)
                else {
                    panic!("{order:?} {life}")
                };
                assert_eq!((block.life_counter, block.position[0]), (life * 12, 465.0));
            }
        }
    }

    #[test]
    fn a_word_order_that_cannot_be_is_said_once() {
        let mut telemetry = telemetry(Some(WordOrder::HighFirst));
        let read = telemetry.read(&registers(WordOrder::LowFirst, 12), POLL);
        assert_eq!(read, ReadResult::Cannot("denormal", "POS_X", 1));
        assert_eq!(telemetry.read(&registers(WordOrder::LowFirst, 24), POLL * 2), ReadResult::Still);
        assert!(matches!(
            telemetry.read(&registers(WordOrder::HighFirst, 36), POLL * 3),
            ReadResult::Values(_)
        ));
    }

    #[test]
    fn what_is_no_telemetry_is_said_with_its_fault() {
        let mut telemetry = telemetry(None);
        assert_eq!(telemetry.read(&[u16::MAX; 37], POLL), ReadResult::Cannot("nan", "POS_X", 1));
        assert_eq!(telemetry.read(&[0; 37], POLL * 2), ReadResult::Cannot("quaternion", "Q_1", 1));
        for at in 3..13 {
            assert!(matches!(
                telemetry.read(&registers(WordOrder::LowFirst, 12 * at), POLL * at),
                ReadResult::Values(_)
            ));
        }
    }

    #[test]
    fn a_fault_that_goes_on_is_said_once_a_minute_with_its_blocks() {
        let mut telemetry = telemetry(None);
        let said = (0..1300).filter_map(|at| match telemetry.read(&[0; 37], POLL * at) {
            ReadResult::Cannot(fault, value, blocks) => Some((at, fault, value, blocks)),
            _ => None,
        });
        let (fault, value) = ("quaternion", "Q_1");
        let expected = [(0, fault, value, 1), (600, fault, value, 601), (1200, fault, value, 1201)];
        assert_eq!(said.collect::<Vec<_>>(), expected);
    }
}
