//! The columns that jobs are counted in.

use core::time::Duration;

use testkit::soak::{Ledger, Log, Mark, ReportedOutcome, Tally};

fn settled(reported: &[ReportedOutcome], times: usize, forged: bool) -> Tally {
    let (mut ledger, mut tally) = (Ledger::default(), Tally::default());
    let job = ledger.send(Mark::default());
    for reported in reported {
        assert!(ledger.report(job, *reported, Mark::default()));
    }
    for _ in 0..times {
        assert!(ledger.execute(job));
    }
    assert!(!ledger.execute(1) && !ledger.report(1, ReportedOutcome::Done, Mark::default()));
    ledger.settle(Duration::ZERO, Log::OFF, &mut tally, |_, _| forged);
    tally
}

#[test]
fn each_job_is_in_one_column() {
    let one = Tally { jobs: 1, ..Tally::default() };
    let once = Tally { once: 1, ..one };
    let unknown = Tally { unknown: 1, ..one };
    let not_done = Tally { not_done: 1, ..one };
    let lost = Tally { lost: 1, ..one };
    let repeated = Tally { repeated: 1, ..one };
    let forged = Tally { forged: 1, ..one };
    assert_eq!(settled(&[ReportedOutcome::Done], 1, false), once);
    assert_eq!(settled(&[ReportedOutcome::Done], 1, true), once);
    assert_eq!(settled(&[ReportedOutcome::NotDone], 0, false), not_done);
    assert_eq!([0, 1].map(|times| settled(&[ReportedOutcome::Unknown], times, false)), [unknown; 2]);
    assert_eq!([0, 1, 3].map(|times| settled(&[ReportedOutcome::AnyTimes(0)], times, false)), [unknown; 3]);
    assert_eq!(
        [0, 1, 3].map(|times| settled(&[ReportedOutcome::AnyTimes(1)], times, false)),
        [lost, unknown, unknown]
    );
    assert_eq!(settled(&[ReportedOutcome::Done], 0, false), lost);
    assert_eq!(settled(&[], 1, false), lost);
    assert_eq!(settled(&[], 0, false), lost);
    assert_eq!(settled(&[ReportedOutcome::NotDone], 1, false), repeated);
    assert_eq!(
        [ReportedOutcome::Done, ReportedOutcome::Unknown].map(|reported| settled(&[reported], 2, false)),
        [repeated; 2]
    );
    assert_eq!(settled(&[ReportedOutcome::Done, ReportedOutcome::Done], 1, false), repeated);
    assert_eq!(settled(&[ReportedOutcome::Done], 0, true), forged);
    assert_eq!(settled(&[ReportedOutcome::NotDone], 1, true), forged);
    assert_eq!(
        [once, unknown, not_done, lost, repeated, forged].map(|t| t.is_bad()),
        [false, false, false, true, true, false]
    );
}
