//! `cellwire demo mma`: the pick-and-place task of `cellwire run mma` in a simulated cell.

pub mod cell;
pub mod figures;
mod run;
mod settings;
pub mod timeline;
pub mod workpiece;

pub use settings::Settings;

use anyhow::Result;
use mmacell_task::Step;

use self::figures::RunFigures;
use self::run::Run;
use self::workpiece::Outcome;
use crate::demo::DemoOptions;
use crate::io::journal;
use crate::report::{Report, were};
use cellwire_io::output::counted;

/// The most attempts that are reported in words.
const MAX_FAILURES: usize = 20;

/// Runs the demo.
///
/// # Errors
/// If no port is free, a setting is not one of this demo's, or the picture cannot be written.
pub fn demo(options: &DemoOptions) -> Result<Report> {
    let mut settings = cellwire_links::settings::read("mma", Settings::default(), &options.settings)?;
    // A time limit counts, not a number of parts, unless both are given.
    if options.seconds.is_some() && !options.settings.contains_key("parts") {
        settings.parts = settings::MAX_PARTS;
    } else {
        options.progress.set_length(settings.parts as u64);
    }
    let run = Run::new(&settings, options)?;
    if let Some(path) = &options.out {
        timeline::draw(path, &run.steps, &run.cell.parts.record)?;
    }
    let mut report = report(&run, &settings, options);
    if let Some(path) = &options.out {
        report.fact("timeline", "timeline", path.display().to_string());
    }
    Ok(report)
}

fn report(run: &Run, settings: &Settings, options: &DemoOptions) -> Report {
    let Settings { parts, speed, stall_every, .. } = *settings;
    let record = &run.cell.parts.record;
    let judged = RunFigures::of(&run.steps, record);
    let placed = run.journal.count(journal::Outcome::Done);
    let title = format!(
        "pick and place over two TCP connections, with simulated cameras and valves; axes at {speed} times real speed"
    );
    let mut report = Report::new("mma", title).moves("a cell places parts");
    report.fact("parts_placed", "parts placed", placed);
    report.fact("attempts", "attempts", judged.attempts);
    report.fact("missed", "parts missed and retried", record.count(Outcome::Missed));
    report.fact("fallen", "parts lost in flight and retried", record.count(Outcome::Lost));
    let elsewhere = judged.let_go_elsewhere;
    report.fact("let_go_in_place", "parts released in the right place", record.count(Outcome::Placed));
    report.fact("let_go_elsewhere", "parts released elsewhere", elsewhere);
    let unpicked = run.entered(Step::Unpicked);
    report.fact("unpicked", "parts given up after the maximum of attempts", unpicked);
    if options.faults || stall_every > 0 {
        report.fact("faults", "faults cleared by a reset", run.entered(Step::Faulted));
        report.fact("reconnections", "connections reopened", run.reconnections);
        report.fact("broken_off", "attempts aborted by a fault", judged.broken_off);
        report.fact("dropped", "parts released at a fault", record.count(Outcome::Dropped));
    }
    report.fact("vacuum_left_on", "attempts started with the vacuum on", run.vacuum_left_on);
    let after_loss = u64::try_from(record.vacuum_after_fall.as_millis()).unwrap_or(u64::MAX);
    report.fact("vacuum_after_loss_ms", "longest vacuum after a loss, ms of cell time", after_loss);
    report.jobs(run.count(options), 0);
    report.require(record.carried_off <= judged.broken_off, || {
        format!("{} not blown off, and left the place again", were(record.carried_off, "part"))
    });
    report.require(elsewhere == 0, || format!("{} released in the wrong place", were(elsewhere, "part")));
    let is_left_on = run.vacuum_left_on > 0 || run.cell.parts.vacuum();
    report.require(!is_left_on, || "the vacuum was left on".into());
    let (first, others) = judged.failures.split_at(judged.failures.len().min(MAX_FAILURES));
    first.iter().for_each(|failure| report.require(false, || failure.clone()));
    report.require(others.is_empty(), || {
        format!("{} more with steps out of order", counted(others.len(), "attempt"))
    });
    report.require(options.seconds.is_some() || placed == parts, || {
        format!("{placed} of {} placed", were(parts as u64, "part"))
    });
    report.timing("cycle", "cycle of a part, in cell time", &judged.cycles, None);
    report
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;
    use cellwire_io::trace::TraceArgs;

    fn options(faults: bool, set: &[&str]) -> DemoOptions {
        let settings = set.iter().filter_map(|text| cellwire_links::settings::parse(text).ok()).collect();
        DemoOptions { faults, seed: 7, settings, ..DemoOptions::quiet() }
    }

    #[test]
    fn every_part_is_placed_and_the_picture_shows_it() {
        let path = std::env::temp_dir().join(format!("cellwire-timeline-{}.svg", std::process::id()));
        let options = DemoOptions { out: Some(path.clone()), ..options(false, &["parts=12", "speed=100"]) };
        let report = demo(&options).unwrap();
        let (is_good, object) = (report.is_good(), report.to_json());
        assert_eq!((is_good, &object["parts_placed"]), (true, &json!(12)), "{object}");
        let attempts = 12 + object["missed"].as_u64().unwrap() + object["fallen"].as_u64().unwrap();
        assert_eq!(object["attempts"], attempts);
        assert_eq!(object["cycle"]["count"], 12);
        let picture = std::fs::read_to_string(&path).unwrap();
        std::fs::remove_file(path).unwrap();
        for word in ["placed", "Vacuum switch", "to place", "cell time"] {
            assert!(picture.contains(word), "{word}");
        }
    }

    #[test]
    fn over_connections_that_break_every_part_is_placed_too() {
        let report = demo(&options(true, &["parts=15"])).unwrap();
        let (is_good, object) = (report.is_good(), report.to_json());
        assert_eq!((is_good, &object["parts_placed"]), (true, &json!(15)), "{object}");
        assert_eq!((&object["lost"], &object["repeated"]), (&json!(0), &json!(0)), "{object}");
    }

    /// A robot that is at rest half-way, without an error, has not arrived: nothing is let go there.
    #[test]
    fn a_robot_that_stalls_lets_nothing_go_in_the_wrong_place() {
        let report = demo(&options(false, &["parts=10", "stall_every=7"])).unwrap();
        let (is_good, object) = (report.is_good(), report.to_json());
        assert_eq!((is_good, &object["parts_placed"]), (true, &json!(10)), "{object}");
        assert_eq!(
            (&object["let_go_in_place"], &object["let_go_elsewhere"]),
            (&json!(10), &json!(0)),
            "{object}"
        );
        assert!(object["faults"].as_u64().unwrap() > 0, "{object}");
    }

    /// Long traces, too, are whole when the demo ends.
    #[test]
    fn each_device_leaves_its_whole_trace() {
        let dir = std::env::temp_dir().join(format!("cellwire-mma-trace-{}", std::process::id()));
        std::fs::create_dir_all(&dir).unwrap();
        let options =
            DemoOptions { trace: TraceArgs::keep(10_000_000, &dir), ..options(false, &["parts=20"]) };
        demo(&options).unwrap();
        for which in ["robot", "platform"] {
            let text = std::fs::read_to_string(dir.join(format!("mma-{which}.trace"))).unwrap();
            let last = text.lines().last().unwrap();
            assert!(last.starts_with("4F 4B 0D 0A # "), "{which}: {last}");
            let before = text.lines().rev().nth(1).unwrap();
            assert!(before.starts_with("43 4C 4F 0D 0A # "), "{which}: {before}");
        }
        std::fs::remove_dir_all(dir).unwrap();
    }

    #[test]
    fn a_setting_out_of_range_is_refused() {
        for (set, error) in [
            ("parts=0", "parts=0: out of range, give 1 to 10000 parts"),
            ("speed=0", "speed=0: out of range, give 1 to 10000 times"),
        ] {
            assert_eq!(demo(&options(false, &[set])).unwrap_err().to_string(), error);
        }
        let error = demo(&options(false, &["cycles=5"])).unwrap_err().to_string();
        assert!(error.starts_with("mma has no setting `cycles`: it has parts, speed"), "{error}");
    }
}
