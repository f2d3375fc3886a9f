//! Words of unknown installations.
#![allow(clippy::unwrap_used)]

use super::super::Sender;
use super::*;
use crate::Link;
use crate::identify::identify;

#[test]
fn the_class_of_a_word_is_guessed_from_its_answers() {
    let link = Link::by_name("laser-eb90").unwrap();
    let [mut host, mut controller] = ["host", "controller"].map(|side| Stream {
        sender: Sender::Named(side.into()),
        parts: vec![Vec::new()],
        arrivals: Vec::new(),
    });
    let mut time = Duration::ZERO;
    let mut say = |stream: &mut Stream, side, items: Value, after| {
        time += Duration::from_millis(after);
        stream.arrivals.push((stream.size(), time));
        let codec = (link.codec)(side, &Map::new()).unwrap();
        stream.parts[0].extend(codec.encode(json!({ "items": items })).unwrap());
    };
    for _ in 0..5 {
        say(&mut host, "host", json!([{"i16": [4097]}, {"f32": [1.5]}, {"i16": [4098]}]), 100);
        say(&mut controller, "controller", json!([{"i16": [4097]}]), 20);
        say(&mut host, "host", json!([{"i16": [7]}, {"u8": [1]}]), 100);
        say(&mut controller, "controller", json!([{"i16": [7]}]), 900);
        say(&mut host, "host", json!([{"i16": [300]}]), 100);
        say(&mut controller, "controller", json!([{"i16": [300]}, {"f32": [20.5]}]), 25);
        say(&mut host, "host", json!([{"i16": [4098]}]), 100);
        say(&mut controller, "controller", json!([{"i16": [999]}]), 20);
    }
    let streams = [host, controller];
    let finding = identify(link, &streams).unwrap();
    let text = draft(&finding, &streams).unwrap();
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
