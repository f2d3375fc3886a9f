use core::time::Duration;

use serde_json::json;

use super::*;

#[derive(Debug, Clone, PartialEq)]
struct Config {
    baud: u32,
    mode: u8,
    clamp: bool,
    pause: Duration,
    gap: Option<Duration>,
    tail: char,
    limits: [u16; 2],
    low_water: Option<usize>,
    payload: f64,
    journal: Option<String>,
}

const CONFIG: Config = Config {
    baud: 9600,
    mode: 23,
    clamp: false,
    pause: Duration::from_millis(1500),
    gap: None,
    tail: 'a',
    limits: [1, 2],
    low_water: None,
    payload: 0.5,
    journal: None,
};

impl Configure for Config {
    fn configure(&mut self, fields: &mut impl FieldVisitor) {
        let Self { baud, mode, clamp, pause, gap, tail, limits, low_water, payload, journal } = self;
        fields.baud(LINE, baud);
        fields.whole("mode", 0..=31, "", "five bits", mode);
        fields.group("arm", |fields| {
            fields.flag("clamp", "it has one", clamp);
            fields.wholes("limits", 0..=9, "mm", "of each axis", limits);
        });
        fields.time("pause", Duration::from_millis(1)..=Duration::MAX, "a pause", pause);
        fields.time_or("gap", SOME_TIME, "off", "a gap", gap);
        fields.choice("tail", &[("a", 'a'), ("b", 'b')], "the end", tail);
        fields.whole_or("low_water", 0..=9, "jobs", "half", "asks again", low_water);
        fields.real("payload", 0.0..=2.5, "kg", "what it carries", payload);
        fields.text("journal", "a file", "nothing is kept", "what was done", journal);
    }
}

fn given(settings: &[&str]) -> Map<String, Value> {
    let mut map = Map::new();
    for setting in settings {
        let (name, value) = parse(setting).unwrap();
        insert(&mut map, &name, value).unwrap();
    }
    map
}

fn error(setting: &str) -> String {
    read("puma", CONFIG, &given(&[setting])).unwrap_err().to_string()
}

#[test]
fn every_kind_is_read() {
    let settings = [
        "baud=19200",
        "mode=7",
        "arm.clamp=true",
        "arm.limits=[3,4]",
        "pause=2.25s",
        "gap=4ms",
        "tail=b",
        "low_water=5",
        "payload=2.5",
        "journal=7",
    ];
    let expected = Config {
        baud: 19_200,
        mode: 7,
        clamp: true,
        pause: Duration::from_millis(2250),
        gap: Some(Duration::from_millis(4)),
        tail: 'b',
        limits: [3, 4],
        low_water: Some(5),
        payload: 2.5,
        journal: Some("7".into()),
    };
    assert_eq!(read("puma", CONFIG, &given(&settings)).unwrap(), expected);
    assert_eq!(read("puma", CONFIG, &Map::new()).unwrap(), CONFIG);
    let back = given(&["gap=off", "low_water=half"]);
    let back = read("puma", expected, &back).unwrap();
    assert_eq!((back.gap, back.low_water), (None, None));
}

#[test]
fn times_have_a_unit() {
    for (text, time) in [
        ("0", Duration::ZERO + Duration::from_millis(1)),
        ("1.5s", Duration::from_millis(1500)),
        ("250 ms", Duration::from_millis(250)),
        ("1h 30m", Duration::from_secs(5400)),
        ("2h30m", Duration::from_secs(9000)),
        ("never", Duration::MAX),
    ] {
        match read("puma", CONFIG, &given(&[&format!("pause={text}")])) {
            Ok(config) => assert_eq!(config.pause, time, "{text}"),
            Err(error) => {
                assert_eq!(error.to_string(), "pause=0: out of range, give a time from 1ms, or never");
            }
        }
    }
}

#[test]
fn what_is_wrong_names_the_values() {
    assert_eq!(error("baud=7"), "baud=7: out of range, give 50 to 4000000 baud");
    assert_eq!(error("mode=32"), "mode=32: out of range, give 0 to 31");
    assert_eq!(error("mode=1.5"), "mode=1.5: not a whole number, give 0 to 31");
    assert_eq!(error("mode=1e30"), "mode=1e+30: not a whole number, give 0 to 31");
    assert_eq!(error("arm.clamp=on"), "arm.clamp=on: neither true nor false, give true or false");
    assert_eq!(
        error("arm.limits=[1]"),
        "arm.limits=[1]: not as many numbers, give [2 numbers], each 0 to 9 mm"
    );
    assert_eq!(error("pause=0s"), "pause=0s: out of range, give a time from 1ms, or never");
    assert_eq!(error("tail=c"), "tail=c: not one of the choices, give a, b");
    let names = "baud, mode, arm.clamp, arm.limits, pause, gap, tail, low_water, payload, journal";
    assert_eq!(error("speed=1"), format!("puma has no setting `speed`: it has {names}"));
    assert_eq!(error("arm.speed=1"), format!("puma has no setting `arm.speed`: it has {names}"));
    assert_eq!(error("leg.speed=1"), format!("puma has no setting `leg`: it has {names}"));
    for (wrong, meant) in [
        ("tial=b", "`tial`; did you mean `tail`?"),
        ("clamp=true", "`clamp`; did you mean `arm.clamp`?"),
        ("arm.clmap=true", "`arm.clmap`; did you mean `arm.clamp`?"),
        ("army.clamp=true", "`army`; did you mean `arm`?"),
    ] {
        assert_eq!(error(wrong), format!("puma has no setting {meant}"));
    }
    let many: Vec<String> = (0..15).map(|at| format!("n{at}")).collect();
    let expected =
        "it has no setting `speed`: it has n0, n1, n2, n3, n4, n5, n6, n7, n8, n9, n10, n11, and 3 more";
    assert_eq!(no_setting("it", "speed", &many), expected);
    let expected = expected.replace(", and 3 more", "");
    assert_eq!(no_setting("it", "speed", &many[..12]), expected);
    assert_eq!(error("payload=2.6"), "payload=2.6: out of range, give 0 to 2.5 kg");
    assert_eq!(error("payload=much"), "payload=much: not a number, give 0 to 2.5 kg");
    assert_eq!(error("journal=[1]"), "journal=[1]: not a text, give a file; without it nothing is kept");
    assert_eq!(error("arm=1"), "puma has no setting `arm`: it is a table of clamp, limits");
    let error = read("viewer", (), &given(&["speed=1"])).unwrap_err().to_string();
    assert_eq!(error, "viewer has no setting `speed`: it has no settings");
    let dotted = Map::from_iter([("arm.clamp".into(), json!(true))]);
    let error = read("puma", CONFIG, &dotted).unwrap_err().to_string();
    assert_eq!(error, "arm.clamp in one name: give what is before a dot as a table");
}

#[test]
fn names_are_similar_within_a_table_and_within_bounds() {
    let all = ["mode", "arm.clamp"];
    for (unknown, names, meant) in [
        // The table is known, and has no such name.
        ("arm.mdoe", all, ""),
        ("amr.clamp", all, "; did you mean `arm.clamp`?"),
        // 0.75 is too little.
        ("abcd", ["abcuvw", "other"], ""),
        // 0.05 less than the most similar name.
        ("abcd", ["abcx", "abcuv"], "; did you mean `abcx`?"),
    ] {
        assert_eq!(did_you_mean(unknown, &names), meant, "{unknown}");
    }
}

#[test]
fn a_setting_given_twice_is_the_last_one() {
    let mut file = Map::from_iter([("arm".into(), json!({"clamp": true, "limits": [1, 1]}))]);
    insert(&mut file, "arm.clamp", json!(false)).unwrap();
    assert_eq!(Value::from(file.clone()), json!({"arm": {"clamp": false, "limits": [1, 1]}}));
    insert(&mut file, "baud", json!(300)).unwrap();
    insert(&mut file, "arm", json!({"limits": [2, 2], "speed": 1})).unwrap();
    assert_eq!(
        file["arm"],
        json!({"clamp": false, "limits": [2, 2], "speed": 1}),
        "a table adds to the one before"
    );
    let error = insert(&mut file, "baud.rate", json!(1)).unwrap_err().to_string();
    assert_eq!(error, "baud.rate: `baud` is 300, which has no settings in it");
    for text in ["", "baud", "=1", "arm.=1"] {
        assert!(parse(text).is_err(), "{text}");
    }
}

/// Times of each kind of range.
#[derive(Debug, Clone)]
struct Times {
    any: Duration,
    some: Duration,
    short: Duration,
    never: Duration,
}

impl Configure for Times {
    fn configure(&mut self, fields: &mut impl FieldVisitor) {
        let Self { any, some, short, never } = self;
        fields.time("any", ANY_TIME, "may be nothing", any);
        fields.time("some", SOME_TIME, "is something", some);
        fields.time("short", Duration::ZERO..=Duration::from_secs(2), "has a most", short);
        fields.time("never", Duration::from_millis(1)..=Duration::MAX, "has a least", never);
    }
}

#[test]
fn the_list_says_which_times_there_are_in_either_form() {
    let second = Duration::from_secs(1);
    let times = Times { any: Duration::ZERO, some: second, short: second, never: Duration::MAX };
    let shown = |form| {
        let list = list_as(form, times.clone());
        list.into_iter().map(|it| (it.values, it.default)).collect::<Vec<_>>()
    };
    let lines = |all: [(&str, Value); 4]| all.map(|(values, default)| (values.to_owned(), default));
    let text = [
        ("a time, or never", json!("0s")),
        ("a time above 0, or never", json!("1s")),
        ("0s to 2s", json!("1s")),
        ("a time from 1ms, or never", json!("never")),
    ];
    assert_eq!(shown(Form::Text), lines(text));
    let nanoseconds = [
        ("from 0; null: never", json!(0)),
        ("above 0; null: never", json!(1_000_000_000)),
        ("0s to 2s", json!(1_000_000_000)),
        ("from 1ms; null: never", json!(null)),
    ];
    assert_eq!(shown(Form::Nanoseconds), lines(nanoseconds));
}

#[test]
fn the_list_is_what_a_help_shows() {
    let list = list(CONFIG);
    let lines: Vec<_> = list.iter().map(|it| (&*it.name, &*it.values, it.default_text())).collect();
    let line = |at: usize| (lines[at].0, lines[at].1, &*lines[at].2);
    assert_eq!(line(0), ("baud", "50 to 4000000 baud", "9600"));
    assert_eq!(line(3), ("arm.limits", "[2 numbers], each 0 to 9 mm", "[1,2]"));
    assert_eq!(line(4), ("pause", "a time from 1ms, or never", "1s500ms"));
    assert_eq!(line(5), ("gap", "a time above 0, or never, or off", "off"));
    assert_eq!(line(6), ("tail", "a, b", "a"));
    assert_eq!(line(7), ("low_water", "0 to 9 jobs, or half", "half"));
    assert_eq!(line(8), ("payload", "0 to 2.5 kg", "0.5"));
    assert_eq!(line(9), ("journal", "a file; without it nothing is kept", ""));
}
