//! The outcome of each instruction, seen from both ends.

use std::collections::HashMap;

use cellwire_sim::Ledger;
use cellwire_sim::ledger::{Counts, Reported};

use super::path::Cut;

/// Compares the sent instructions with the executed ones, both in their order: `known` has the outcome of each instruction that was sent.
/// Returns the counts, and the number of instructions that were executed with other values than were sent: corruption that the checksum cannot
/// see. Those are not executed once.
pub fn count(path: &[Cut], known: &[Option<Reported>], executed: &[Option<Cut>]) -> (Counts, u64) {
    let key = |cut: &Cut| (cut.word, cut.values.map(f32::to_bits));
    let index: HashMap<_, _> = path.iter().enumerate().map(|(index, cut)| (key(cut), index)).collect();
    let mut ledger = Ledger::default();
    let jobs: Vec<Option<usize>> = known
        .iter()
        .map(|known| {
            let job = known.is_some().then(|| ledger.send(()));
            job.zip(*known).map(|(job, known)| ledger.report(job, known));
            job
        })
        .collect();
    // An instruction that was not sent is the next one that was, with other values: the order is the same.
    let (mut next, mut unseen) = (0, 0);
    for cut in executed {
        let found = cut.as_ref().and_then(|cut| index.get(&key(cut)).copied());
        unseen += u64::from(found.is_none());
        let place = found.unwrap_or(next);
        if let Some(Some(job)) = jobs.get(place) {
            ledger.execute(*job);
        }
        next = place + 1;
    }
    let counts = ledger.count();
    (Counts { executed_once: counts.executed_once.saturating_sub(unseen), ..counts }, unseen)
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
        let (queued, unknown) = (Some(Reported::Done), Some(Reported::Unknown));
        let known = [queued, queued, unknown, unknown, queued, queued, None];
        // The second was corrupt, the third executed, the fourth not, the fifth lost, the sixth executed twice.
        let executed = [1.0, 2.5, 3.0, 6.0, 6.0].map(|length| Some(cut(length)));
        let counts = Counts {
            sent: 6,
            executed_once: 2,
            unknown: 2,
            unknown_executed: 1,
            lost: 1,
            repeated: 1,
            ..Counts::default()
        };
        assert_eq!(count(&path, &known, &executed), (counts, 1));
    }
}
