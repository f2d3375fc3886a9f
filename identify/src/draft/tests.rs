//! Words of unknown installations.
#![allow(clippy::unwrap_used, clippy::indexing_slicing, clippy::panic, clippy::print_stdout)]

mod captures;
mod kawasaki;

use super::super::Sender;
use super::*;
use crate::identify;
use cellwire_links::Link;

#[test]
fn the_class_of_a_word_is_guessed_from_its_answers() {
    let mut talk = Talk::new();
    for _ in 0..5 {
        talk.say("host", &json!([{"i16": [4097]}, {"f32": [1.5]}, {"i16": [4098]}]), 100);
        talk.say("controller", &json!([{"i16": [4097]}]), 20);
        talk.say("host", &json!([{"i16": [7]}, {"u8": [1]}]), 100);
        talk.say("controller", &json!([{"i16": [7]}]), 900);
        talk.say("host", &json!([{"i16": [300]}]), 100);
        talk.say("controller", &json!([{"i16": [300]}, {"f32": [20.5]}]), 25);
        talk.say("host", &json!([{"i16": [4098]}]), 100);
        talk.say("controller", &json!([{"i16": [999]}]), 20);
    }
    let finding = identify(Link::by_name("laser-eb90").unwrap(), &talk.streams).unwrap();
    let text = draft(&finding, &talk.streams).unwrap();
    let read: Value = toml::from_str::<toml::Table>(&text).map(|it| json!(it)).unwrap();
    let classes: Vec<(i64, &str)> = read["words"]["commands"]
        .as_array()
        .unwrap()
        .iter()
        .map(|it| (it["first"].as_i64().unwrap(), it["class"].as_str().unwrap()))
        .collect();
    let expected = [(7, "immediate"), (300, "query"), (4097, "interpreted"), (4098, "interpreted")];
    assert_eq!(classes, expected, "{text}");
    assert!(text.contains("= 999 # ? answered 5 times"), "{text}");
}

/// A host and a controller; each message follows the previous one after this many milliseconds.
struct Talk {
    time: Duration,
    streams: [Stream; 2],
}

impl Talk {
    fn new() -> Self {
        let stream = |side: &str| Stream {
            sender: Sender::Named(side.into()),
            parts: vec![Vec::new()],
            arrivals: Vec::new(),
        };
        Self { time: Duration::ZERO, streams: ["host", "controller"].map(stream) }
    }

    fn say(&mut self, side: &str, items: &Value, after: u64) {
        self.time += Duration::from_millis(after);
        let stream = &mut self.streams[usize::from(side == "controller")];
        stream.arrivals.push((stream.size(), self.time));
        let codec = (Link::by_name("laser-eb90").unwrap().codec)(side, &Map::new()).unwrap();
        stream.parts[0].extend(codec.encode(json!({ "items": items })).unwrap());
    }
}

#[test]
fn what_is_said_of_each_word_and_code() {
    let mut talk = Talk::new();
    // A word, and after how long each answer to it came, with values or without.
    for (word, answers) in [
        (10, &[(150, false); 3][..]),
        (11, &[(20, false), (200, false), (20, false), (200, false)]),
        (12, &[(20, false), (200, false), (300, false), (30, false), (400, false)]),
        (13, &[(20, true), (20, true), (25, false), (25, false)]),
        (14, &[(20, true), (20, true), (20, true), (20, false), (20, false)]),
    ] {
        for (after, has_values) in answers {
            talk.say("host", &json!([{"i16": [word]}]), 1000);
            let values =
                if *has_values { json!([{"i16": [word]}, {"f32": [0.5]}]) } else { json!([{"i16": [word]}]) };
            talk.say("controller", &values, *after);
        }
    }
    for code in [-8191, -8191, 999] {
        talk.say("host", &json!([{"i16": [15]}, {"i16": [16]}]), 1000);
        talk.say("controller", &json!([{"i16": [code]}]), 20);
    }
    talk.say("host", &json!([{"i16": [16]}]), 1000);
    talk.say("host", &json!([{"i16": [-8190]}]), 1000);
    let finding = identify(Link::by_name("laser-eb90").unwrap(), &talk.streams).unwrap();
    let expected = r#"# A draft from a capture: correct what has a ?.

[words]
commands = [
  { first = 10, last = 10, class = "interpreted" }, # ? 3 times, answered after 150 ms
  { first = 11, last = 11, class = "interpreted" }, # ? 4 times, answered after 200 ms
  { first = 12, last = 12, class = "immediate" }, # 5 times, answered after 200 ms
  { first = 13, last = 13, class = "interpreted" }, # ? 4 times, answered after 25 ms
  { first = 14, last = 14, class = "query" }, # 5 times, answered after 20 ms, with values
  { first = 15, last = 15, class = "interpreted" }, # 3 times, 3 of them in a frame with others
  { first = 16, last = 16, class = "interpreted" }, # 4 times, 3 of them in a frame with others
  { first = 57346, last = 57346, class = "interpreted" }, # ? once, never answered individually
]

[words.errors]
queue_full = 999 # ? answered once; its meaning is unknown
bad_checksum = 57345 # ? answered 2 times; the code is the default
bad_frame = 57351 # ? not in the capture, where the default is a command word
# unknown_command = 57347 is not in the capture: the default
# bad_batch = 57348 is not in the capture: the default
# bad_parameters = 57349 is not in the capture: the default
"#;
    assert_eq!(draft(&finding, &talk.streams).unwrap(), expected);
}

#[test]
fn a_link_without_words_of_its_own_has_no_draft() {
    let link = Link::by_name("val2-viewer").unwrap();
    let codec = (link.codec)("host", &Map::new()).unwrap();
    let bytes = codec.encode(json!({"count": 1, "pose": vec![0; 12]})).unwrap();
    let streams = [Stream { sender: Sender::Unknown, parts: vec![bytes], arrivals: Vec::new() }];
    let finding = identify(link, &streams).unwrap();
    let error = draft(&finding, &streams).unwrap_err().to_string();
    assert_eq!(error, "val2-viewer has no words of an installation's own: there is nothing to draft");
}
