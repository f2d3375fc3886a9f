use super::*;
use crate::payload::{Kind, Metric};
use crate::store::Store;

fn write(text: &str, at: u64) -> Payload {
    let metric = Metric::new(REQUEST, Kind::String, at, Some(Value::String(text.into())));
    Payload { timestamp: Some(1), metrics: vec![metric], seq: None }
}

const RATE: Rate = Rate { per_second: 10.0, burst: 100 };

fn to<'a>(cell: &'a str, payload: &'a Payload) -> Write<'a> {
    Write { cell, is_allowed: true, payload, unfit: None, is_shared: false, unread: None }
}

fn outcome(decision: &Decision) -> (&'static str, String) {
    let (kind, named) = match decision {
        Decision::Give(_, named) => ("give", named),
        Decision::Report(named) => ("report", named),
        Decision::Refuse(reason, named) => (*reason, named),
        Decision::Malformed(why) => return ("strange", why.clone()),
    };
    let of = |name| {
        named.iter().find_map(|(found, value)| match value {
            Value::String(text) if *found == name => Some(text.clone()),
            _ => None,
        })
    };
    (kind, format!("{} {}: {}", of(COMMAND).unwrap(), of(OUTCOME).unwrap(), of(DETAIL).unwrap()))
}

#[test]
fn an_id_is_given_to_the_cell_once_also_by_the_next_process() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("store");
    let age = Duration::from_secs(30);
    let (mut store, mut batch) = (Store::open(&path, 1 << 16).unwrap(), Batch::default());
    let (mut commands, unknown) =
        Commands::open(|prefix| store.names(prefix), age, RATE, &mut batch).unwrap();
    assert!(unknown.is_empty());
    let request = write(r#"{"id":"a","write_register":{"address":1,"value":2}}"#, 1_000_000);
    let decision = commands.decide(to("cell", &request), 1_000_900, &mut batch);
    let Decision::Give(command, _) = &decision else { panic!("{decision:?}") };
    assert_eq!((command.id.as_str(), command.order.len(), command.until), ("a", 1, 1_030_000));
    assert_eq!(outcome(&decision), ("give", "a accepted: ".into()));
    let again = commands.decide(to("cell", &request), 1_000_901, &mut batch);
    assert_eq!(outcome(&again), ("report", "a accepted: ".into()));
    // The same id is another command at another cell.
    assert_eq!(outcome(&commands.decide(to("other", &request), 1_000_902, &mut batch)).0, "give");
    commands.finish("other", "a", Outcome::Done, String::new(), &mut batch);
    store.write(&batch, &|_| Vec::new()).unwrap();
    drop((store, commands));

    // The process was killed: a command without an outcome is unknown, and is not given again, however late it is sent again.
    let (mut store, mut batch) = (Store::open(&path, 1 << 16).unwrap(), Batch::default());
    let (mut commands, unknown) =
        Commands::open(|prefix| store.names(prefix), age, RATE, &mut batch).unwrap();
    let why = "a unknown: the bridge ended before the outcome";
    let [InterruptedCommand { cell, report }] = &unknown[..] else { panic!("{unknown:?}") };
    assert_eq!((cell.as_str(), outcome(&Decision::Report(report.clone())).1), ("cell", why.into()));
    for (cell, outcome_then) in [("cell", why), ("other", "a done: ")] {
        let decision = commands.decide(to(cell, &request), 9_000_000, &mut batch);
        assert_eq!(outcome(&decision), ("report", outcome_then.into()));
    }
    store.write(&batch, &|_| Vec::new()).unwrap();
    // A day later the command is still known, even if it is sent with another time.
    let (later, mut batch) = (1_000_902 + 86_400_001, Batch::default());
    commands.forget(later, &mut batch);
    assert_eq!(batch.names.len(), 0);
    let again = write(r#"{"id":"a","write_register":{"address":1,"value":2}}"#, later);
    assert_eq!(outcome(&commands.decide(to("cell", &again), later, &mut batch)), ("report", why.into()));
}

#[test]
fn an_id_with_a_time_is_forgotten_after_a_day_and_then_too_old() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(&folder.path().join("store"), 1 << 16).unwrap();
    let (age, mut batch) = (Duration::from_secs(30), Batch::default());
    let (mut commands, _) = Commands::open(|prefix| store.names(prefix), age, RATE, &mut batch).unwrap();
    // The time of the message differs each time, and has no effect.
    let id = "00000000-03e8-7123-8abc-0123456789ab";
    let order = |at| write(&format!(r#"{{"id":"{id}"}}"#), at);
    let decision = commands.decide(to("c", &order(9_000_000)), 30_900, &mut batch);
    let Decision::Give(command, _) = &decision else { panic!("{decision:?}") };
    assert_eq!(command.until, 31_000);
    commands.finish("c", id, Outcome::Done, String::new(), &mut batch);
    let later = 30_900 + 86_400_001;
    commands.forget(later - 1, &mut batch);
    let again = commands.decide(to("c", &order(later)), later, &mut batch);
    assert_eq!(outcome(&again), ("report", format!("{id} done: ")));
    commands.forget(later, &mut batch);
    let (kind, text) = outcome(&commands.decide(to("c", &order(later)), later, &mut batch));
    let why = format!("{id} refused: timestamp 1000 is more than 30 s before");
    assert!(kind == "late" && text.starts_with(&why), "{text}");
    // With a clock that was wrong for a while, too.
    let (again, why) =
        (order(30_900), "its timestamp 1000 is not after 1000, up to which commands are forgotten");
    let other = Write { cell: "d", ..to("d", &again) };
    commands.decide(other, 30_900, &mut batch);
    commands.finish("d", id, Outcome::Done, String::new(), &mut batch);
    commands.forget(later, &mut batch);
    let (kind, text) = outcome(&commands.decide(other, 30_900, &mut batch));
    assert!(kind == "forgotten" && text.contains(why), "{text}");
}

#[test]
fn no_number_of_other_ids_makes_an_executed_one_new() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(&folder.path().join("store"), 1 << 16).unwrap();
    let (age, rate) = (Duration::from_secs(30), Rate { per_second: 1e9, burst: u32::MAX });
    let (mut commands, _) =
        Commands::open(|prefix| store.names(prefix), age, rate, &mut Batch::default()).unwrap();
    let mut decide = |id: &str, now, is_allowed| {
        let (mut batch, order) = (Batch::default(), write(&format!(r#"{{"id":"{id}"}}"#), now));
        let decision = commands.decide(Write { is_allowed, ..to("c", &order) }, now, &mut batch);
        if matches!(decision, Decision::Give(..)) {
            commands.finish("c", id, Outcome::Done, String::new(), &mut batch);
        }
        outcome(&decision).0
    };
    let (most, day) = (history::MAX_EXECUTED, 86_400_000);
    assert_eq!(decide("first", 1_000_000, true), "give");
    for number in 1..most {
        assert_eq!(decide(&format!("refused {number}"), 1_000_000, false), "not_allowed");
        assert_eq!(decide(&number.to_string(), 1_000_001, true), "give");
    }
    // A further one of them within a day is refused, unless its id has a time.
    assert_eq!(decide("first", 1_000_500, true), "report");
    assert_eq!(decide("further", 1_000_500, true), "full");
    assert_eq!(decide("00000000-03e8-7123-8abc-0123456789ab", 30_000, true), "forgotten");
    assert_eq!(decide("00000010-03e8-7123-8abc-0123456789ab", 1_049_576, true), "give");
    // Then the oldest make room.
    assert_eq!(decide("another", 1_000_000 + day, true), "full");
    assert_eq!(decide("next", 1_000_002 + day, true), "give");
    assert_eq!(decide("first", 1_000_003 + day, true), "give");
    assert_eq!(decide(&(most - 1).to_string(), 1_000_003 + day, true), "report");
}

#[test]
fn a_clock_that_was_wrong_for_a_while_makes_no_command_new() {
    const DAY: u64 = 86_400_000;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("store");
    let age = Duration::from_secs(30);
    let (mut store, mut batch) = (Store::open(&path, 1 << 16).unwrap(), Batch::default());
    let (mut commands, _) = Commands::open(|prefix| store.names(prefix), age, RATE, &mut batch).unwrap();
    let request = write(r#"{"id":"a"}"#, 1_000_000);
    assert_eq!(outcome(&commands.decide(to("c", &request), 1_000_000, &mut batch)).0, "give");
    commands.finish("c", "a", Outcome::Done, String::new(), &mut batch);
    // Two days too late, and right again.
    commands.forget(1_000_000 + 2 * DAY, &mut batch);
    store.write(&batch, &|_| Vec::new()).unwrap();
    let again = write(r#"{"id":"a"}"#, 1_000_400);
    assert_eq!(
        outcome(&commands.decide(to("c", &again), 1_000_500, &mut batch)),
        ("report", "a done: ".into())
    );
    drop(commands);
    let (mut commands, _) = Commands::open(|prefix| store.names(prefix), age, RATE, &mut batch).unwrap();
    assert_eq!(outcome(&commands.decide(to("c", &again), 1_000_500, &mut batch)).0, "report");
    let next = write(r#"{"id":"b"}"#, 1_000_001);
    assert_eq!(outcome(&commands.decide(to("c", &next), 1_000_500, &mut batch)).0, "give");
}

#[test]
fn what_is_no_command_is_refused_with_advice() {
    let folder = tempfile::tempdir().unwrap();
    let (store, mut batch) = (Store::open(&folder.path().join("store"), 1 << 16).unwrap(), Batch::default());
    let (mut commands, _) =
        Commands::open(|prefix| store.names(prefix), Duration::from_secs(30), RATE, &mut batch).unwrap();
    let mut decide = |payload: &Payload, is_allowed| {
        let write = Write { is_allowed, ..to("c", payload) };
        let (kind, text) = outcome(&commands.decide(write, 100_000, &mut batch));
        format!("{kind} {text}")
    };
    let id = "strange Command/Request has no \"id\": give a unique string of 1 to 64 bytes";
    assert_eq!(decide(&write("{}", 100_000), true), id);
    assert_eq!(decide(&write(r#"{"id":""}"#, 100_000), true), id);
    assert!(
        decide(&write("[]", 100_000), true).starts_with("strange Command/Request is not a JSON object: ")
    );
    let twice = r#"strange Command/Request is not a JSON object: "id" is given twice at line 1 column 25"#;
    assert_eq!(decide(&write(r#"{"id":"a","x":1,"id":"b"}"#, 100_000), true), twice);
    assert_eq!(decide(&Payload::default(), true), "strange write only the metric Command/Request");
    let mut none = write(r#"{"id":"none"}"#, 0);
    (none.metrics[0].timestamp, none.timestamp) = (None, None);
    assert_eq!(decide(&none, true), "no_time none refused: the command has no timestamp");
    let allowed = "not_allowed no refused: the site file does not allow commands to this cell";
    assert_eq!(decide(&write(r#"{"id":"no"}"#, 100_000), false), allowed);
    let late =
        "late late refused: timestamp 69999 is more than 30 s before 100000: too late, or a clock is wrong";
    assert_eq!(decide(&write(r#"{"id":"late"}"#, 69_999), true), late);
    let early = decide(&write(r#"{"id":"early"}"#, 130_001), true);
    assert!(
        early.starts_with("early early refused: timestamp 130001 is more than 30 s ahead of 100000"),
        "{early}"
    );
    assert_eq!(decide(&write(r#"{"id":"b"}"#, 70_000), true), "give b accepted: ");
    assert_eq!(decide(&write(r#"{"id":"c"}"#, 130_000), true), "give c accepted: ");
}

#[test]
fn what_was_refused_is_refused_for_good_also_by_the_next_process() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("store");
    let age = Duration::from_secs(30);
    let (mut store, mut batch) = (Store::open(&path, 1 << 16).unwrap(), Batch::default());
    let (mut commands, _) = Commands::open(|prefix| store.names(prefix), age, RATE, &mut batch).unwrap();
    let early = write(r#"{"id":"early"}"#, 200_000);
    let (kind, why) = outcome(&commands.decide(to("c", &early), 100_000, &mut batch));
    assert_eq!(kind, "early");
    let (long, retained) = (write(r#"{"id":"long"}"#, 100_000), write(r#"{"id":"kept"}"#, 100_000));
    for (payload, unfit) in [(&long, "too long"), (&retained, "retained")] {
        let write = Write { unfit: Some(unfit), ..to("c", payload) };
        assert_eq!(outcome(&commands.decide(write, 100_000, &mut batch)).0, "unfit");
    }
    let nothing = Payload::default();
    let unreadable = Write { unfit: Some("too long"), ..to("c", &nothing) };
    let decision = commands.decide(unreadable, 100_000, &mut batch);
    assert_eq!(decision, Decision::Malformed("too long".into()));
    // The same bytes when their time has come.
    let again = commands.decide(to("c", &early), 200_000, &mut batch);
    assert_eq!(outcome(&again), ("report", why.clone()));
    store.write(&batch, &|_| Vec::new()).unwrap();
    let (mut commands, unknown) =
        Commands::open(|prefix| store.names(prefix), age, RATE, &mut batch).unwrap();
    assert!(unknown.is_empty());
    assert_eq!(outcome(&commands.decide(to("c", &early), 200_000, &mut batch)), ("report", why));
    assert_eq!(outcome(&commands.decide(to("c", &long), 100_000, &mut batch)).0, "report");
}

#[test]
fn a_flood_of_one_cell_is_refused_and_the_others_are_not() {
    let folder = tempfile::tempdir().unwrap();
    let (store, mut batch) = (Store::open(&folder.path().join("store"), 1 << 16).unwrap(), Batch::default());
    let rate = Rate { per_second: 2.0, burst: 5 };
    let (mut commands, _) =
        Commands::open(|prefix| store.names(prefix), Duration::from_secs(30), rate, &mut batch).unwrap();
    let mut kinds = |cell: &str, ids: core::ops::Range<u32>, now| {
        let given = ids.filter(|id| {
            let payload = write(&format!(r#"{{"id":"{id}"}}"#), now);
            let (kind, text) = outcome(&commands.decide(to(cell, &payload), now, &mut batch));
            let why = "refused: this cell accepts 2 commands per second, 5 at once: see commands.rate";
            assert!(kind == "give" || kind == "rate" && text.ends_with(why), "{text}");
            kind == "give"
        });
        given.count()
    };
    assert_eq!(kinds("flooded", 0..1000, 100_000), 5);
    assert_eq!(kinds("other", 0..5, 100_000), 5);
    assert_eq!(kinds("flooded", 1000..2000, 101_000), 2);
}

#[test]
fn what_another_bridge_was_given_is_not_given_here_and_is_unknown_when_the_cell_is_taken() {
    let folder = tempfile::tempdir().unwrap();
    let (path, age) = (folder.path().join("store"), Duration::from_secs(30));
    let (mut store, mut batch) = (Store::open(&path, 1 << 16).unwrap(), Batch::default());
    let (mut commands, _) = Commands::open(|prefix| store.names(prefix), age, RATE, &mut batch).unwrap();
    let order = |id: &str, at| write(&format!(r#"{{"id":"{id}"}}"#), at);
    let by = |outcome, sent| Entry {
        at: 1_000_000,
        sent,
        outcome,
        detail: String::new(),
        by: "other".into(),
        number: 0,
    };
    let (now, mut merge) = (1_000_000, |commands: &mut Commands, id: &str, entry| {
        commands.merge_report("c", id, entry, 1_000_000, &mut batch);
    });
    merge(&mut commands, "begun", by(Outcome::Accepted, now));
    merge(&mut commands, "over", by(Outcome::Accepted, now + 1));
    merge(&mut commands, "over", by(Outcome::Done, now + 1));
    // A third one thinks that it is unknown.
    merge(&mut commands, "over", by(Outcome::Unknown, now + 1));
    assert_eq!(commands.latest(), now + 1);
    // One that was refused here, because the cell is there, and was given there; and one that was given here, and refused there.
    let mut batch = Batch::default();
    let both = order("both", now);
    let elsewhere = Write { unfit: Some("not here"), ..to("c", &both) };
    assert_eq!(outcome(&commands.decide(elsewhere, now, &mut batch)).0, "unfit");
    commands.merge_report("c", "both", by(Outcome::Accepted, now), now, &mut batch);
    assert_eq!(outcome(&commands.decide(to("c", &order("own", now)), now, &mut batch)).0, "give");
    commands.merge_report("c", "own", by(Outcome::Refused, now), now, &mut batch);
    for (id, said) in [("both", "accepted"), ("own", "accepted"), ("over", "done")] {
        let report = outcome(&commands.decide(to("c", &order(id, now)), now, &mut batch));
        assert_eq!(report, ("report", format!("{id} {said}: ")));
    }
    // The other bridge is gone. A command that it may have given without this bridge's knowledge is not given.
    let mut taken: Vec<_> = commands
        .take("c", now + 500, &mut batch)
        .into_iter()
        .map(|it| outcome(&Decision::Report(it)).1)
        .collect();
    taken.sort_unstable();
    let why = "unknown: other lost the cell before the outcome";
    assert_eq!(taken, [format!("begun {why}"), format!("both {why}")]);
    assert_eq!(outcome(&commands.decide(to("c", &order("new", now + 500)), now, &mut batch)).0, "forgotten");
    assert_eq!(outcome(&commands.decide(to("c", &order("newer", now + 501)), now, &mut batch)).0, "give");
    store.write(&batch, &|_| Vec::new()).unwrap();
    drop(commands);
    // When this bridge ends, the outcomes of its own commands become unknown, but not those of another bridge.
    let mut batch = Batch::default();
    let (mut commands, _) = Commands::open(|prefix| store.names(prefix), age, RATE, &mut batch).unwrap();
    commands.merge_report("c", "theirs", by(Outcome::Accepted, now), now, &mut batch);
    store.write(&batch, &|_| Vec::new()).unwrap();
    drop(commands);
    let (commands, unknown) =
        Commands::open(|prefix| store.names(prefix), age, RATE, &mut Batch::default()).unwrap();
    assert_eq!(unknown, []);
    assert_eq!(commands.entry("c", "theirs").unwrap().outcome, Outcome::Accepted);
}
