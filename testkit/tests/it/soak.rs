//! A few seeds of the soak in every run of the tests, and a test that it detects the faults that it is for.

use testkit::soak::{HANDLES, Log, ROWS, Row, SABOTAGED, Tally};

fn run(row: &Row, seeds: core::ops::Range<u64>) -> Tally {
    sum(seeds.map(|seed| row.run(seed, Log::OFF)))
}

fn sum(sessions: impl IntoIterator<Item = Tally>) -> Tally {
    sessions.into_iter().fold(Tally::default(), |mut sum, session| {
        sum += session;
        sum
    })
}

/// Runs the seeds of each row once, for three properties; four rows at once.
#[test]
fn every_row_holds_is_repeatable_and_sees_what_is_not_checked() {
    let rows = ROWS.chunks(ROWS.len().div_ceil(4));
    std::thread::scope(|scope| rows.for_each(|rows| drop(scope.spawn(|| rows.iter().for_each(hold)))));
}

fn hold(row: &Row) {
    let sessions: Vec<Tally> = (0..60).map(|seed| row.run(seed, Log::OFF)).collect();
    let tally = sum(sessions.iter().copied());
    nothing_is_lost_or_repeated_without_a_report(row, &tally);
    the_same_seed_is_the_same_session(row, &sessions);
    if row.one_in.is_some() {
        a_check_that_is_not_made_is_found_out(row, tally);
    }
}

fn nothing_is_lost_or_repeated_without_a_report(row: &Row, tally: &Tally) {
    let name = row.name();
    assert!(!tally.is_bad(), "{name}: {tally:?}");
    assert!(!row.sees_too_little(tally), "{name}: {tally:?}");
    // The sessions were bad ones, and every way in which a job may end occurs.
    let faults = tally.faults;
    assert_eq!(tally.sessions, 60);
    assert_eq!(tally.once + tally.not_done + tally.unknown + tally.forged, tally.jobs, "{name}");
    if name.contains("hostile ") {
        // Reports of a hostile end prove nothing, and some have no jobs.
        let moved = faults.splits + faults.stalls + faults.merges;
        let has_no_pieces = [
            "isra-ball/serial, hostile host",
            "kawasaki-msg/udp, hostile pc",
            "val2-viewer/serial, hostile workstation",
        ];
        assert!(moved > 100 || has_no_pieces.contains(&name.as_str()), "{name}: {faults:?}");
        return;
    }
    if name.contains("any ") {
        assert!(tally.once * 4 > tally.jobs && tally.jobs > 500, "{name}: {tally:?}");
        // A poll is one byte, and so is a request of the viewer.
        let has_no_pieces = ["isra-ball/serial, any host", "val2-viewer/serial, any workstation"];
        assert!(faults.splits > 100 || has_no_pieces.contains(&name.as_str()), "{name}: {faults:?}");
        return;
    }
    assert!(tally.once > tally.jobs / 3 && tally.not_done > 10, "{name}: {tally:?}");
    assert!(tally.unknown > 0, "{name}: {tally:?}");
    if name == "kawasaki-msg/udp" {
        assert!(faults.losses > 100 && faults.repeats > 100 && faults.delays > 100, "{name}: {faults:?}");
    } else if row.one_in.is_some() {
        let damage = [faults.flips, faults.lost_bytes, faults.inserts, faults.losses];
        assert!(damage.iter().all(|count| *count > 20), "{name}: {faults:?}");
        assert!(tally.corrupt > 60 && tally.refused > 20, "{name}: {tally:?}");
    } else {
        let network = [faults.splits, faults.delays, faults.disconnects];
        assert!(network.iter().all(|count| *count > 20), "{name}: {faults:?}");
        assert_eq!((faults.corruption(), tally.corrupt), (0, 0), "{name}");
    }
}

#[test]
fn calls_of_a_handle_have_their_outcome() {
    for row in &HANDLES {
        let (name, tally) = (row.name(), run(row, 0..12));
        assert!(!tally.is_bad(), "{name}: {tally:?}");
        assert_eq!(tally.once + tally.not_done + tally.unknown, tally.jobs, "{name}");
        // Some calls were dropped, and connections were lost.
        assert!(tally.once > tally.jobs / 2 && tally.unknown > 0, "{name}: {tally:?}");
        let faults = tally.faults;
        assert!(faults.disconnects > 5, "{name}: {faults:?}");
        let damage = [faults.flips, faults.lost_bytes, faults.inserts, tally.corrupt];
        assert!(row.one_in.is_none() || damage.iter().all(|count| *count > 5), "{name}: {tally:?}");
        assert!(!row.sees_too_little(&tally), "{name}: {tally:?}");
    }
}

fn the_same_seed_is_the_same_session(row: &Row, sessions: &[Tally]) {
    let before = |seeds: core::ops::Range<usize>| sum(sessions[seeds].iter().copied());
    assert_eq!(run(row, 7..12), before(7..12), "{}", row.name());
    assert_ne!(before(7..12), before(8..13), "{}", row.name());
}

/// A server that drops an acknowledged write, and a network that repeats bytes.
#[test]
fn a_weak_end_and_a_weak_network_are_found_out() {
    let [forgets, repeats] = SABOTAGED.map(|row| run(&row, 0..100));
    assert!(forgets.lost > 10 && forgets.repeated == 0, "{forgets:?}");
    assert!(repeats.repeated > 100, "{repeats:?}");
    assert!(forgets.is_bad() && repeats.is_bad());
}

fn a_check_that_is_not_made_is_found_out(row: &Row, tally: Tally) {
    // As if every message with corrupt bytes were passed, and as if every eighth were.
    for part in [1, 8] {
        let passed = tally.refused / part;
        let blind = Tally { unseen: passed, refused: tally.refused - passed, ..tally };
        assert!(row.sees_too_little(&blind) || passed < 20, "{}: {blind:?}", row.name());
    }
}

#[test]
fn rows_have_names() {
    assert!(ROWS[1].is_named("kawasaki-msg") && ROWS[1].is_named("kawasaki-msg/udp"));
    assert!(!ROWS[1].is_named("kawasaki-msg/tcp") && !ROWS[1].is_named("udp"));
}
