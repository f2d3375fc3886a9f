//! Whole findings: a user sees only their printed text.

use super::*;

/// Compares a finding of identify: the settings, the explained bytes and their certainty, and the evidence for each option.
fn is(link: &str, streams: &[Stream], expected: &str) {
    let finding = identify(Link::by_name(link).unwrap(), streams).unwrap();
    let Finding { settings, options, messages, bytes, bits, senders, .. } = &finding;
    let mut text = format!("{}\n", json!(settings));
    text += &format!("{messages:?} messages, {bytes:?} bytes, {bits:.0} bits, from {senders:?}");
    for (by, decided) in [("bytes", DecidedBy::ByBytes), ("values", DecidedBy::ByValues)] {
        let names = options.iter().filter(|it| it.decided == decided).map(|it| it.name.as_str());
        text += &format!("\nby {by}: {}", names.collect::<Vec<_>>().join(" "));
    }
    for option in options {
        if let DecidedBy::Not { others, message } = &option.decided {
            let message = message.as_deref().unwrap_or("nothing");
            let values: Vec<&Value> = others.iter().map(|it| &it.value).collect();
            text += &format!("\n{}: or {}; {message} decides", option.name, json!(values));
            for OtherValue { value, fewer, inexact } in others.iter().filter(|it| it.fewer + it.inexact > 0) {
                text += &format!("\n{value}: {fewer} bytes less, {inexact} otherwise");
            }
        }
    }
    let plain = |text: &str| text.lines().map(str::trim).collect::<Vec<_>>().join("\n");
    assert_eq!(plain(&text), plain(expected.trim()), "{link}");
}

fn unknown(parts: &[&[u8]]) -> Stream {
    Stream {
        sender: Sender::Unknown,
        parts: parts.iter().map(|part| part.to_vec()).collect(),
        arrivals: vec![],
    }
}

fn alter(side: &str, messages: &[Value]) -> Vec<u8> {
    sent("val2-alter", side, &json!({"leading_dle": 1}), messages)
}

fn noise() -> Vec<u8> {
    (0..200_u8).map(|at| at.wrapping_mul(37) ^ 0x55).collect()
}

#[test]
fn of_several_streams_and_parts() {
    let robot = alter("robot", &motions(5));
    is(
        "val2-alter",
        &[unknown(&[&robot])],
        r#"
        {"leading_dle":1,"negated_sum":false,"stuffed_checksum":false,"ignore_spare_select":false}
        [5, 5] messages, [55, 55] bytes, 46 bits, from [["robot"]]
        by bytes: leading_dle negated_sum
        by values:
        stuffed_checksum: or [true]; a message whose checksum is 10h decides
        ignore_spare_select: or [true]; a reply whose select byte has bit 6 or 7 decides
        "#,
    );
    // An end that sent no messages counts, and missing bytes between parts are not corrupt.
    let parts: &[&[u8]] = &[&[], &robot[..30], &[], &robot[32..]];
    is(
        "val2-alter",
        &[unknown(parts), unknown(&[&noise()])],
        r#"
        {"leading_dle":1,"negated_sum":false,"stuffed_checksum":false,"ignore_spare_select":false}
        [4, 4] messages, [44, 253] bytes, 41 bits, from [["robot"], []]
        by bytes: leading_dle negated_sum
        by values:
        stuffed_checksum: or [true]; a message whose checksum is 10h decides
        ignore_spare_select: or [true]; a reply whose select byte has bit 6 or 7 decides
        "#,
    );
    let reply = json!({"kind": "reply", "exception": 0, "values": [15, null, null, null, null, null]});
    let (mut bad, host) = (robot, alter("host", &[reply.clone(), reply.clone(), reply]));
    bad[20] ^= 1;
    is(
        "val2-alter",
        &[unknown(&[&bad]), unknown(&[&host])],
        r#"
        {"leading_dle":1,"negated_sum":false,"stuffed_checksum":false,"ignore_spare_select":false}
        [7, 7] messages, [71, 82] bytes, 61 bits, from [["robot"], ["host"]]
        by bytes: leading_dle negated_sum
        by values:
        stuffed_checksum: or [true]; a message whose checksum is 10h decides
        true: 17 bytes less, 0 otherwise
        ignore_spare_select: or [true]; a reply whose select byte has bit 6 or 7 decides
        "#,
    );
}

#[test]
fn of_bytes_that_are_no_messages() {
    is(
        "val2-alter",
        &[unknown(&[]), unknown(&[&[]])],
        r#"
        {"leading_dle":2,"negated_sum":false,"stuffed_checksum":false,"ignore_spare_select":false}
        [0, 0] messages, [0, 0] bytes, 0 bits, from [[], []]
        by bytes:
        by values:
        "#,
    );
    is(
        "val2-alter",
        &[unknown(&[&noise()])],
        r#"
        {"leading_dle":2,"negated_sum":false,"stuffed_checksum":false,"ignore_spare_select":false}
        [0, 0] messages, [0, 200] bytes, 0 bits, from [[]]
        by bytes:
        by values:
        "#,
    );
}

/// On a link with one end that sends messages, the other end's bytes do not count.
#[test]
fn of_a_link_that_sends_one_way() {
    let packet = |at: u8| json!({"sensor_type": 0, "sensor": 0, "status": "fresh", "force": [at, 2, 3], "moment": [4, 5, 6], "keys": 1});
    let mut ball = sent("isra-ball", "ball", &json!({}), &(0..4).map(packet).collect::<Vec<_>>());
    // A packet of another layout is read, but it is not one that is written.
    ball.extend([0x07, 0xF9, 0x52, 0x00, 0x01, 0x02, 0x03, 0x04, 0x05, 0x06, 0xE4]);
    is(
        "isra-ball",
        &[unknown(&[&ball]), unknown(&[&noise()])],
        r#"
        {}
        [5, 4] messages, [59, 59] bytes, 52 bits, from [["ball"], []]
        by bytes:
        by values:
        "#,
    );
    let traced = |sent| Stream { sender: Sender::Traced { name: "ball".into(), sent }, ..unknown(&[&ball]) };
    is(
        "isra-ball",
        &[traced(true), traced(false)],
        r#"
        {}
        [5, 4] messages, [59, 59] bytes, 57 bits, from [["ball"], []]
        by bytes:
        by values:
        "#,
    );
}

/// Chance reads short lines, too: one of them is not sure.
#[test]
fn of_short_lines() {
    let lines = |count| sent("mmacell-proto", "central", &json!({}), &vec![json!({"command": "STA"}); count]);
    for (count, read) in
        [(1, "[1, 1] messages, [5, 5] bytes, 7 bits"), (2, "[2, 2] messages, [10, 10] bytes, 23 bits")]
    {
        let expected = format!(
            r#"
        {{"itr":false,"ovrd":false,"clos":false,"off":false,"lone_lf":false,"blank":false,"wide_integers":false}}
        {read}, from [["central"]]
        by bytes: lone_lf
        by values:
        itr: or [true]; a stop decides
        ovrd: or [true]; an override decides
        clos: or [true]; a gripper that closes decides
        off: or [true]; the servo motors switched off decides
        blank: or [true]; an override decides
        wide_integers: or [true]; an integer above 32767, such as an error number decides
        "#
        );
        is("mmacell-proto", &[unknown(&[&lines(count)])], &expected);
    }
}

#[test]
fn of_requests_alone() {
    let requests: Vec<Value> = (1..4)
        .map(|at| json!({"transaction": at, "unit": 1, "function": 3, "address": 0, "quantity": 37}))
        .collect();
    is(
        "fanuc-hmi-modbus",
        &[unknown(&[&sent("fanuc-hmi-modbus", "client", &json!({}), &requests)])],
        r#"
        {"view":"telemetry","framing":"tcp","word_order":"low_first"}
        [3, 3] messages, [36, 36] bytes, 14 bits, from [["client"]]
        by bytes: framing
        by values:
        word_order: or ["high_first"]; a reply of the 37 registers of the telemetry block, of a robot that is not at its origin, or several while its counter counts decides
        "#,
    );
}

/// Tags that nothing shows are the defaults: of those that explain the same, the fewest others.
#[test]
fn of_frames_with_some_of_the_tags() {
    let frames = |given: &Value, items: &[Value]| {
        let items: Vec<Value> = items.iter().map(|items| json!({ "items": items })).collect();
        unknown(&[&sent("laser-eb90", "host", given, &items)])
    };
    let given = json!({"tags": {"f32": 7, "i16": 241, "u8": 242, "char": 243}});
    let items: Vec<Value> =
        (0..6).map(|at| json!([{"i16": [257]}, {"f32": [at, 2, 3]}, {"u8": [49, 50]}])).collect();
    is(
        "laser-eb90",
        &[frames(&given, &items)],
        r#"
        {"tail":"printed","flag":"separate","tags":{"f32":7,"i16":241,"u8":242,"char":243},"checksum":"u8","checksum_negated":false,"checksum_with_flag":false,"byte_order":"little"}
        [6, 6] messages, [174, 174] bytes, 67 bits, from [["host"]]
        by bytes: flag tags.f32 tags.i16 checksum checksum_negated checksum_with_flag
        by values: byte_order
        tail: or ["either"]; a frame that ends 90 83 decides
        tags.u8: or []; a frame with a text decides
        tags.char: or []; a frame with a text decides
        "#,
    );
    is(
        "laser-eb90",
        &[frames(&json!({"tail": "either"}), &vec![json!([{"i16": [257]}]); 6])],
        r#"
        {"tail":"printed","flag":"separate","tags":{"f32":240,"i16":241,"u8":242,"char":243},"checksum":"u8","checksum_negated":false,"checksum_with_flag":false,"byte_order":"little"}
        [6, 6] messages, [66, 66] bytes, 75 bits, from [["host"]]
        by bytes: flag tags.i16 checksum checksum_negated checksum_with_flag
        by values:
        tail: or ["either"]; a frame that ends 90 83 decides
        tags.f32: or []; a frame with floats decides
        tags.u8: or []; a frame with bytes that are not text decides
        tags.char: or []; a frame with a text decides
        byte_order: or ["big"]; a frame with floats decides
        "#,
    );
}

#[test]
fn of_more_bytes_than_all_settings_are_tried_on() {
    let jobs = |texts: &[&str]| {
        let job = |it: &&str| json!({"name": "Job", "fields": [it, "1", "123456789012345678901234567890"]});
        sent("kawasaki-msg", "pc", &json!({"charset": "latin1"}), &texts.iter().map(job).collect::<Vec<_>>())
    };
    is(
        "kawasaki-msg",
        &[unknown(&[&jobs(&["a", "a", "ä"])])],
        r#"
        {"charset":"latin1"}
        [3, 3] messages, [132, 132] bytes, 32 bits, from [["pc"]]
        by bytes:
        by values:
        charset: or ["ascii"]; a name or field with a letter beyond ASCII decides
        "ascii": 44 bytes less, 0 otherwise
        "#,
    );
    let mut texts = vec!["a"; 400];
    is(
        "kawasaki-msg",
        &[unknown(&[&jobs(&texts)])],
        r#"
        {"charset":"ascii"}
        [400, 400] messages, [17600, 17600] bytes, 3761 bits, from [["pc"]]
        by bytes:
        by values:
        charset: or ["latin1"]; a name or field with a letter beyond ASCII decides
        "#,
    );
    texts[396..].fill("ä");
    let (begin, end) = (jobs(&texts[..200]), jobs(&texts[200..]));
    is(
        "kawasaki-msg",
        &[unknown(&[&begin, &end])],
        r#"
        {"charset":"latin1"}
        [400, 400] messages, [17600, 17600] bytes, 3761 bits, from [["pc"]]
        by bytes: charset
        by values:
        "#,
    );
}

#[test]
fn what_is_sure() {
    let bytes = sent("isra-ball", "ball", &json!({}), &[]);
    let empty = found("isra-ball", &[&bytes]);
    assert!(empty.share() < 0.1 && !empty.is_sure(), "{empty:?}");
    for (bits, bytes, is_sure) in [(20.0, [10, 100], true), (19.9, [10, 100], false), (20.0, [9, 100], false)]
    {
        assert_eq!(Finding { bits, bytes, ..empty.clone() }.is_sure(), is_sure, "{bits} {bytes:?}");
    }
}
