//! The outcome of each instruction, seen from both ends.

use std::collections::HashMap;

use super::path::Cut;
use crate::report::Jobs;

/// What the host knows of an instruction.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Known {
    /// The controller reported that it is queued.
    Queued,
    /// Unknown.
    Unknown,
}

/// The result.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Tally {
    /// Instructions that left the host and were not refused.
    pub sent: u64,
    /// Executed exactly once, whatever the host knows.
    pub executed_once: u64,
    /// Reported unknown.
    pub unknown: u64,
    /// Of these: executed.
    pub unknown_executed: u64,
    /// Executed with other values than were sent: corruption that the checksum cannot see.
    pub unseen: u64,
    /// Reported as queued, neither executed nor replaced by a corrupt one.
    pub lost: u64,
    /// Executed more than once.
    pub repeated: u64,
}

impl Tally {
    /// Compares what was sent with what was executed, both in their order.
    pub fn new(path: &[Cut], known: &[Option<Known>], executed: &[Option<Cut>]) -> Self {
        let key = |cut: &Cut| (cut.word, cut.values.map(f32::to_bits));
        let index: HashMap<_, _> = path.iter().enumerate().map(|(index, cut)| (key(cut), index)).collect();
        let mut times = vec![0u32; path.len()];
        let mut tally = Self::default();
        // One that nobody sent stands for the next of those that were: the order is kept.
        let mut next = 0;
        for cut in executed {
            match cut.as_ref().and_then(|cut| index.get(&key(cut))) {
                Some(&found) => {
                    if let Some(times) = times.get_mut(found) {
                        *times += 1;
                    }
                    next = found + 1;
                }
                None => {
                    tally.unseen += 1;
                    if let Some(times) = times.get_mut(next) {
                        *times += 1;
                    }
                    next += 1;
                }
            }
        }
        for (times, known) in times.into_iter().zip(known) {
            let Some(known) = known else { continue };
            tally.sent += 1;
            tally.executed_once += u64::from(times == 1);
            tally.repeated += u64::from(times > 1);
            match known {
                Known::Queued => tally.lost += u64::from(times == 0),
                Known::Unknown => {
                    tally.unknown += 1;
                    tally.unknown_executed += u64::from(times > 0);
                }
            }
        }
        tally.executed_once = tally.executed_once.saturating_sub(tally.unseen);
        tally
    }

    /// For the report.
    pub fn jobs(&self) -> Jobs {
        Jobs {
            sent: self.sent,
            executed_once: self.executed_once,
            lost: self.lost,
            repeated: self.repeated,
            unknown: self.unknown,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cut(length: f32) -> Cut {
        Cut { word: 0x0101, values: [1.0, 2.0, 3.0, 4.0, 5.0, length] }
    }

    #[test]
    fn each_fate_is_counted() {
        let path: Vec<_> = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0].map(cut).into();
        let (queued, unknown) = (Some(Known::Queued), Some(Known::Unknown));
        let known = [queued, queued, unknown, unknown, queued, queued, None];
        // The second was corrupt, the third executed, the fourth not, the fifth lost, the sixth executed twice.
        let executed = [1.0, 2.5, 3.0, 6.0, 6.0].map(|length| Some(cut(length)));
        assert_eq!(
            Tally::new(&path, &known, &executed),
            Tally {
                sent: 6,
                executed_once: 2,
                unknown: 2,
                unknown_executed: 1,
                unseen: 1,
                lost: 1,
                repeated: 1
            }
        );
    }
}
