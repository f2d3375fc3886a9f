//! The outcome of each instruction, seen from both ends.

use std::collections::{HashMap, HashSet};

use cellwire_sim::Ledger;
use cellwire_sim::ledger::{Counts, ReportedOutcome};

use super::path::Cut;

/// The host's knowledge of each instruction of the path, by its index.
#[derive(Debug, Clone, Copy)]
pub struct HostKnowledge<'a> {
    /// The reported outcome; `None`: not sent.
    pub outcomes: &'a [Option<ReportedOutcome>],
    /// The instructions that the robot confirmed, and may have forgotten when it restarted: they are unknown.
    pub doubted: &'a [usize],
}

/// The robot's record.
#[derive(Debug, Clone, Copy)]
pub struct Record<'a> {
    /// The executed instructions, in their order; `None`: it is not an instruction of a path.
    pub executed: &'a [Option<Cut>],
    /// The instructions that the robot held when it was killed; `None`: it is not an instruction of a path.
    pub forgotten: &'a [Option<Cut>],
}

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
pub struct PathIndex(HashMap<(u16, [u32; 6]), usize>);

impl PathIndex {
    /// Creates an index of these instructions.
    pub fn new(path: &[Cut]) -> Self {
        Self(path.iter().enumerate().map(|(place, cut)| (key(cut), place)).collect())
    }

    /// Returns the index of an instruction; `None` if there is no equal one.
    pub fn of(&self, cut: &Option<Cut>) -> Option<usize> {
        cut.as_ref().and_then(|cut| self.0.get(&key(cut)).copied())
    }
}

fn key(cut: &Cut) -> (u16, [u32; 6]) {
    (cut.word, cut.values.map(f32::to_bits))
}

/// Compares the sent instructions with the executed ones, both in their order.
pub fn count(places: &PathIndex, known: HostKnowledge<'_>, record: Record<'_>) -> Tally {
    let mut ledger = Ledger::default();
    let mut jobs: HashMap<usize, usize> = HashMap::new();
    for (place, outcome) in known.outcomes.iter().enumerate() {
        if let Some(outcome) = outcome {
            let job = ledger.send(());
            ledger.report(job, *outcome);
            jobs.insert(place, job);
        }
    }
    // An instruction that was not sent is the next one that was, with other values: the order is the same.
    let (mut next, mut unseen, mut altered) = (0, 0, Vec::new());
    for cut in record.executed {
        let found = places.of(cut);
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
    // The restart is a reason for a confirmed instruction not to be executed only if the robot still held it.
    let forgotten: HashSet<usize> = record.forgotten.iter().filter_map(|cut| places.of(cut)).collect();
    for place in known.doubted.iter().filter(|place| !forgotten.contains(place)) {
        let job = jobs.get(place).and_then(|job| ledger.jobs_mut().get_mut(*job));
        if let Some(job) = job.filter(|job| job.times == 0) {
            job.reported = Some(ReportedOutcome::Done);
        }
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

    fn cut(length: f32) -> Cut {
        Cut { word: 0x0101, values: [1.0, 2.0, 3.0, 4.0, 5.0, length] }
    }

    fn counted(
        outcomes: &[Option<ReportedOutcome>],
        doubted: &[usize],
        executed: &[f32],
        forgotten: &[f32],
    ) -> Tally {
        let path: Vec<_> = (1..8u8).map(|length| cut(length.into())).collect();
        let [executed, forgotten] =
            [executed, forgotten].map(|all| all.iter().map(|length| Some(cut(*length))).collect::<Vec<_>>());
        let record = Record { executed: &executed, forgotten: &forgotten };
        count(&PathIndex::new(&path), HostKnowledge { outcomes, doubted }, record)
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
        let tally = counted(&known, &[], &[1.0, 2.5, 3.0, 6.0, 6.0], &[]);
        assert_eq!(tally, Tally { jobs, altered: 1, unseen: 1 });
    }

    #[test]
    fn a_confirmed_instruction_is_unknown_only_if_the_robot_still_held_it() {
        // The robot restarted: the host doubts the last three. One of them was executed, one still held, and one is lost.
        let known = [QUEUED, UNKNOWN, UNKNOWN, UNKNOWN, None, None, None];
        let tally = counted(&known, &[1, 2, 3], &[1.0, 2.0], &[4.0]);
        let jobs = Counts {
            sent: 4,
            executed_once: 2,
            unknown: 2,
            unknown_executed: 1,
            lost: 1,
            ..Counts::default()
        };
        assert_eq!(tally, Tally { jobs, altered: 0, unseen: 0 });
    }

    #[test]
    fn an_instruction_that_is_executed_although_it_was_refused_or_never_sent_is_not_overlooked() {
        let refused = Some(ReportedOutcome::NotDone);
        let tally = counted(&[QUEUED, refused, None, None, None, None, None], &[], &[1.0, 2.0, 3.0], &[]);
        let jobs = Counts { sent: 3, executed_once: 1, unreported: 2, ..Counts::default() };
        assert_eq!(tally.jobs, jobs);
    }
}
