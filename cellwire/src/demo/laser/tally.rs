//! The outcome of each instruction, seen from both ends.

use std::collections::HashMap;

use cellwire_sim::Ledger;
use cellwire_sim::ledger::{Counts, ReportedOutcome};

use crate::run::laser::Instruction;

/// The outcomes of all instructions.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Tally {
    /// The instructions that were sent.
    pub jobs: Counts,
    /// The instructions that were executed once, with other values than were sent. The checksum cannot detect every corrupt byte.
    pub altered: u64,
    /// All executions of instructions that were not sent so.
    pub unseen: u64,
}

/// The path, by its instructions.
#[derive(Debug)]
pub struct PathIndex(HashMap<(u16, Vec<u32>), usize>);

impl PathIndex {
    /// Creates an index of these instructions.
    pub fn new(path: &[Instruction]) -> Self {
        Self(path.iter().enumerate().map(|(place, instruction)| (key(instruction), place)).collect())
    }

    /// Returns the index of an instruction; `None` if there is no equal one.
    pub fn of(&self, instruction: &Instruction) -> Option<usize> {
        self.0.get(&key(instruction)).copied()
    }
}

fn key(Instruction { word, values, .. }: &Instruction) -> (u16, Vec<u32>) {
    (*word, values.iter().map(|value| value.to_bits()).collect())
}

/// Compares the reported outcomes of the path with the executed instructions, both in their order.
pub fn count(places: &PathIndex, known: &[Option<ReportedOutcome>], executed: &[Instruction]) -> Tally {
    let mut ledger = Ledger::default();
    let mut jobs: HashMap<usize, usize> = HashMap::new();
    for (place, outcome) in known.iter().enumerate() {
        if let Some(outcome) = outcome {
            let job = ledger.send(());
            ledger.report(job, *outcome);
            jobs.insert(place, job);
        }
    }
    // An instruction that was not sent is the next one that was, with other values: the order is the same.
    let (mut next, mut unseen, mut altered) = (0, 0, Vec::new());
    for instruction in executed {
        let found = places.of(instruction);
        let place = found.unwrap_or(next);
        // The host has sent no instruction of which it reports nothing.
        let job = *jobs.entry(place).or_insert_with(|| {
            let job = ledger.send(());
            ledger.report(job, ReportedOutcome::NotDone);
            job
        });
        ledger.execute(job);
        if found.is_none() {
            unseen += 1;
            altered.push(job);
        }
        next = place + 1;
    }
    let is_altered = |job: &&usize| {
        let job = ledger.jobs().get(**job);
        job.is_some_and(|job| job.times == 1 && job.reported != Some(ReportedOutcome::NotDone))
    };
    let altered = altered.iter().filter(is_altered).count() as u64;
    let jobs = ledger.count();
    Tally { jobs: Counts { executed_once: jobs.executed_once - altered, ..jobs }, altered, unseen }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cut(length: f32) -> Instruction {
        Instruction { line: 0, word: 0x0101, values: vec![1.0, 2.0, 3.0, 4.0, 5.0, length] }
    }

    fn counted(known: &[Option<ReportedOutcome>], executed: &[f32]) -> Tally {
        let path: Vec<_> = (1..8u8).map(|length| cut(length.into())).collect();
        let executed: Vec<_> = executed.iter().map(|length| cut(*length)).collect();
        count(&PathIndex::new(&path), known, &executed)
    }

    const QUEUED: Option<ReportedOutcome> = Some(ReportedOutcome::Done);
    const UNKNOWN: Option<ReportedOutcome> = Some(ReportedOutcome::Unknown);

    #[test]
    fn each_fate_is_counted() {
        let known = [QUEUED, QUEUED, UNKNOWN, UNKNOWN, QUEUED, QUEUED, None];
        // The second was corrupt, the third executed, the fourth not, the fifth lost, the sixth executed twice.
        let jobs = Counts {
            sent: 6,
            executed_once: 2,
            unknown: 2,
            unknown_executed: 1,
            lost: 1,
            repeated: 1,
            ..Counts::default()
        };
        let tally = counted(&known, &[1.0, 2.5, 3.0, 6.0, 6.0]);
        assert_eq!(tally, Tally { jobs, altered: 1, unseen: 1 });
    }

    #[test]
    fn an_instruction_that_is_executed_although_it_was_refused_or_never_sent_is_not_overlooked() {
        let refused = Some(ReportedOutcome::NotDone);
        let tally = counted(&[QUEUED, refused, None, None, None, None, None], &[1.0, 2.0, 3.0]);
        let jobs = Counts { sent: 3, executed_once: 1, unreported: 2, ..Counts::default() };
        assert_eq!(tally.jobs, jobs);
    }
}
