//! The counts of jobs, and the truth about what was reported of each.

use cellwire_sim::Ledger;
use cellwire_sim::ledger::{Counts, JobFate, ReportedOutcome};

#[test]
fn each_job_has_its_fate_and_is_counted() {
    let mut ledger = Ledger::<&str>::default();
    for (note, reported, times) in [
        ("once", Some(ReportedOutcome::Done), 1),
        ("withdrawn", Some(ReportedOutcome::NotDone), 0),
        ("withdrawn", Some(ReportedOutcome::NotDone), 0),
        ("unknown", Some(ReportedOutcome::Unknown), 1),
        ("unknown", Some(ReportedOutcome::Unknown), 1),
        ("unknown", Some(ReportedOutcome::Unknown), 0),
        ("unknown", Some(ReportedOutcome::AnyTimes(1)), 2),
        ("lost", Some(ReportedOutcome::AnyTimes(1)), 0),
        ("lost", Some(ReportedOutcome::Done), 0),
        ("lost", None, 0),
        ("lost", None, 0),
        ("repeated", Some(ReportedOutcome::Done), 2),
        ("repeated", Some(ReportedOutcome::NotDone), 1),
    ] {
        let job = ledger.send(note);
        (0..times).for_each(|_| assert!(ledger.execute(job)));
        if let Some(reported) = reported {
            ledger.report(job, reported).unwrap();
        }
    }
    for job in ledger.jobs() {
        let fate = match job.fate() {
            JobFate::Once => "once",
            JobFate::NotDone => "withdrawn",
            JobFate::Unknown => "unknown",
            JobFate::Lost(_) => "lost",
            JobFate::Repeated(_) => "repeated",
        };
        assert_eq!(fate, job.note, "{job:?}");
    }
    let counts = Counts {
        sent: 13,
        executed_once: 3,
        repeated: 2,
        lost: 3,
        unknown: 5,
        unknown_executed: 3,
        withdrawn: 2,
        unreported: 1,
    };
    assert_eq!(ledger.count(), counts);
    assert!(!ledger.execute(13) && ledger.report(13, ReportedOutcome::Done).is_none());
    ledger.report(0, ReportedOutcome::Done).unwrap();
    assert_eq!(ledger.jobs()[0].fate(), JobFate::Repeated("its outcome was reported twice"));
}
