//! Captures that the links' own encoders write, with options other than the defaults.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::indexing_slicing, clippy::panic)]

use serde_json::{Map, Value, json};

use super::*;
use cellwire_links::LINKS;
use cellwire_links::link::Carrier;

mod compared;
mod echo;
mod findings;

/// Returns the bytes of messages that a side of a link sends with these settings.
fn sent(link: &str, side: &str, given: &Value, messages: &[Value]) -> Vec<u8> {
    let link = Link::by_name(link).unwrap();
    let codec = (link.codec)(side, given.as_object().unwrap()).unwrap();
    messages.iter().flat_map(|message| codec.encode(message.clone()).unwrap()).collect()
}

fn found(link: &str, streams: &[&[u8]]) -> Finding {
    let stream =
        |bytes: &&[u8]| Stream { sender: Sender::Unknown, parts: vec![bytes.to_vec()], arrivals: vec![] };
    identify(Link::by_name(link).unwrap(), &streams.iter().map(stream).collect::<Vec<_>>()).unwrap()
}

fn option<'a>(finding: &'a Finding, name: &str) -> &'a OpenSetting {
    finding.options.iter().find(|option| option.name == name).unwrap_or_else(|| panic!("{finding:?}"))
}

fn undecided(others: &[Value], message: &str) -> DecidedBy {
    let equal = |value: &Value| OtherValue { value: value.clone(), fewer: 0, inexact: 0 };
    DecidedBy::Not { others: others.iter().map(equal).collect(), message: Some(message.into()) }
}

fn motions(count: u16) -> Vec<Value> {
    let motion = |segment| {
        json!({"kind": "motion", "phase": "running", "error": 0, "segment_status": 2, "segment": segment,
            "percent": 50 * segment, "transform": null})
    };
    (0..count).map(motion).collect()
}

#[test]
fn what_the_bytes_decide_is_named() {
    let given = json!({"leading_dle": 1, "negated_sum": true});
    let finding = found("val2-alter", &[&sent("val2-alter", "robot", &given, &motions(20))]);
    assert!(finding.is_sure(), "{finding:?}");
    assert_eq!((finding.messages, finding.senders.clone()), ([20, 20], vec![vec!["robot"]]));
    assert_eq!(option(&finding, "leading_dle").value, 1);
    assert_eq!(option(&finding, "leading_dle").decided, DecidedBy::ByBytes);
    assert_eq!(option(&finding, "negated_sum").value, true);
    assert_eq!(option(&finding, "negated_sum").decided, DecidedBy::ByBytes);
    let message = "a message whose checksum is 10h";
    assert_eq!(option(&finding, "stuffed_checksum").decided, undecided(&[json!(true)], message));
}

#[test]
fn one_message_decides_where_nothing_is_corrupt() {
    let mut messages = motions(20);
    messages[10]["segment"] = json!(110);
    messages[10]["percent"] = json!(32);
    let given = json!({"stuffed_checksum": true});
    let finding = found("val2-alter", &[&sent("val2-alter", "robot", &given, &messages)]);
    assert_eq!(option(&finding, "stuffed_checksum").value, true);
    assert_eq!(option(&finding, "stuffed_checksum").decided, DecidedBy::ByBytes);
}

#[test]
fn corrupt_bytes_and_a_cut_beginning_do_not_matter() {
    let mut bytes = sent("val2-alter", "robot", &json!({"negated_sum": true}), &motions(40));
    for at in (57..bytes.len()).step_by(101) {
        bytes[at] ^= 0x21;
    }
    let finding = found("val2-alter", &[&bytes[5..]]);
    assert!(finding.is_sure() && finding.share() < 1.0, "{finding:?}");
    assert_eq!(option(&finding, "negated_sum").value, true);
    assert_eq!(option(&finding, "negated_sum").decided, DecidedBy::ByBytes);
}

#[test]
fn tags_are_found_and_those_that_were_not_seen_are_not_made_up() {
    let given =
        json!({"tail": "etx", "tags": {"f32": 7, "i16": 200, "u8": 9, "char": 3}, "byte_order": "big"});
    let moves = (0..20).map(|at| json!({"items": [{"i16": [257]}, {"f32": [at, 0.5, -250.25, 90, 0, 1]}]}));
    let finding = found("laser-eb90", &[&sent("laser-eb90", "host", &given, &moves.collect::<Vec<_>>())]);
    let value = |name| (option(&finding, name).value.clone(), option(&finding, name).decided.clone());
    assert_eq!(value("tail"), (json!("etx"), DecidedBy::ByBytes));
    assert_eq!(value("tags.f32"), (json!(7), DecidedBy::ByBytes));
    assert_eq!(value("tags.i16"), (json!(200), DecidedBy::ByBytes));
    assert_eq!(value("tags.char").1, undecided(&[], "a frame with a text"));
    assert_eq!(value("byte_order"), (json!("big"), DecidedBy::ByValues));
}

#[test]
fn both_ends_may_be_on_one_line() {
    let (strict, stop) = (json!({}), json!({"itr": true}));
    let mut bytes = Vec::new();
    for _ in 0..10 {
        bytes.extend(sent(
            "mmacell-proto",
            "central",
            &stop,
            &[json!({"command": "STP"}), json!({"command": "STA"})],
        ));
        let status = json!({"reply": "status", "moving": false, "axes": [1.0, 2.0, 3.0, 0.5], "servo": true,
            "override": 80, "error": 0});
        bytes.extend(sent("mmacell-proto", "robot", &strict, &[json!({"reply": "ok"}), status]));
    }
    let finding = found("mmacell-proto", &[&bytes]);
    assert_eq!((finding.messages, finding.bytes[0]), ([40, 40], bytes.len() as u64));
    assert_eq!(option(&finding, "itr").value, true);
    assert_eq!(option(&finding, "blank").decided, DecidedBy::ByBytes);
    assert_eq!(option(&finding, "clos").decided, undecided(&[json!(true)], "a gripper that closes"));
}

#[test]
fn bytes_of_no_link_are_none() {
    let bytes: Vec<u8> =
        (0..4000_u32).map(|at| u8::try_from(at.wrapping_mul(2_654_435_761) >> 24).unwrap()).collect();
    for link in LINKS {
        let finding = found(link.name, &[&bytes]);
        assert!(!finding.is_sure(), "{finding:?}");
    }
}

/// Each setting that a source leaves open has values to try, and each of them a message that shows it.
#[test]
fn every_open_setting_is_shown_by_a_message() {
    for link in LINKS {
        let known = (link.settings)();
        for name in link.open.settings {
            let setting = known.iter().find(|setting| setting.name == *name).unwrap();
            let is_guessed = link.open.guess.is_some_and(|guess| guess.setting == *name);
            assert!(is_guessed || setting.choices.len() > 1, "{}: {name}", link.name);
            for value in setting.choices.iter().filter(|value| **value != setting.default) {
                let mut given = Map::from_iter([((*name).to_owned(), value.clone())]);
                given.extend(link.open.beside.iter().map(|(name, value)| ((*name).into(), (*value).into())));
                let written = |it: &cellwire_links::link::DecidingMessage, given: &Map<String, Value>| {
                    let message = serde_json::from_str(it.message).unwrap();
                    (link.codec)(it.side, given).unwrap().encode(message).ok()
                };
                let mut default = given.clone();
                default.remove(*name);
                let text = value.as_str().map_or_else(|| value.to_string(), str::to_owned);
                let reads_more = link.open.reads_more.iter().any(|(of, more, _)| of == name && *more == text);
                let shown = link.open.deciding.iter().any(|it| written(it, &given) != written(it, &default));
                assert!(shown || reads_more, "{}: no message shows {name}={value}", link.name);
            }
        }
    }
}

/// The printed lines are Rust: each text is that of items which compile by themselves.
#[test]
fn the_lines_of_rust_compile() {
    macro_rules! is_rust {
        ($link:literal, $given:tt, $carrier:expr, $($item:item)*) => {
            #[allow(dead_code, unreachable_pub)]
            const _: () = { $($item)* };
            let link = Link::by_name($link).unwrap();
            let plain = |text: &str| text.split_whitespace().collect::<String>();
            let text = (link.open.rust)(json!($given).as_object().unwrap(), $carrier).unwrap();
            let text: Vec<&str> = text.lines().filter(|line| !line.trim_start().starts_with("///")).collect();
            let text = text.join("\n");
            let code = text.split("/*").map(|part| part.split_once("*/").map_or(part, |(_, code)| code));
            assert_eq!(plain(&code.collect::<String>()), plain(concat!($(stringify!($item)),*)), "{}", link.name);
        };
    }
    is_rust! { "val2-alter", {"leading_dle": 1}, Carrier::Unknown,
        use val2_alter::{Framing, LeadingDle};
        pub fn framing() -> Framing {
            Framing {
                leading_dle: LeadingDle::One,
                negated_sum: false,
                stuffed_checksum: false,
                ignore_spare_select: false
            }
        }
    }
    is_rust! { "laser-eb90", {"tail": "etx"}, Carrier::Unknown,
        use laser_eb90::{ByteOrder, Flag, Profile, Tags, Tail, Width};
        pub fn profile() -> Profile {
            Profile {
                tail: Tail::Etx,
                flag: Flag::Separate,
                tags: Tags::new(240, 241, 242, 243).expect("four different bytes"),
                checksum: Width::U8,
                checksum_negated: false,
                checksum_with_flag: false,
                byte_order: ByteOrder::Little
            }
        }
    }
    let job = json!([
        {"name": "type", "kind": "whole", "range": [1, 3]},
        {"name": "X", "kind": "decimal", "places": 2, "range": [-5.0, 12.5]},
        {"name": "tool", "kind": "text", "length": [1, 8]},
    ]);
    is_rust! { "kawasaki-msg", {"job": job}, Carrier::Unknown,
        use kawasaki_msg::{Charset, FieldVisitor, Text, VisitResult, Work};
        pub fn charset() -> Charset {
            Charset::Ascii
        }
        #[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
        pub struct Job {
            pub type_: i32,
            pub x: i32,
            pub tool: Text<8>,
        }
        impl Work for Job {
            type Ranges = ();
            fn fields<F: FieldVisitor>(&mut self, (): &(), fields: &mut F) -> VisitResult {
                fields.decimal("type", &mut self.type_, 0, 1..=3)?;
                fields.decimal("X", &mut self.x, 2, -500..=1250)?;
                fields.text("tool", &mut self.tool, 1..=8)
            }
        }
    }
    is_rust! { "fanuc-hmi-modbus", {"framing": "tcp", "word_order": "high_first"}, Carrier::Network,
        use fanuc_hmi_modbus::{Framing, WordOrder};
        pub fn framing() -> (Framing, WordOrder) {
            (Framing::Tcp, WordOrder::HighFirst)
        }
    }
    for carrier in [Carrier::Network, Carrier::Unknown] {
        is_rust! { "fanuc-hmi-modbus", {"framing": "rtu"}, carrier,
            use fanuc_hmi_modbus::{Framing, WordOrder};
            pub fn framing() -> (Framing, WordOrder) {
                (Framing::RTU_OVER_TCP, WordOrder::LowFirst)
            }
        }
    }
    is_rust! { "fanuc-hmi-modbus", {"framing": "rtu"}, Carrier::Serial(Some(9600)),
        use fanuc_hmi_modbus::{Framing, WordOrder, timing};
        pub fn framing() -> (Framing, WordOrder) {
            (Framing::Rtu { silence: timing::silence(9600) }, WordOrder::LowFirst)
        }
    }
    is_rust! { "fanuc-hmi-modbus", {"framing": "rtu"}, Carrier::Serial(None),
        use fanuc_hmi_modbus::{Framing, WordOrder, timing};
        pub fn framing() -> (Framing, WordOrder) {
            (Framing::Rtu { silence: timing::silence(19200) }, WordOrder::LowFirst)
        }
    }
    is_rust! { "kawasaki-msg", {"charset": "latin1"}, Carrier::Unknown,
        use kawasaki_msg::Charset;
        pub fn charset() -> Charset {
            Charset::Latin1
        }
    }
    is_rust! { "kawasaki-msg", {"messages": {
            "job": {"name": "Ty\u{f6}", "header": ["=M", "order"], "fields": ["number", "work"]},
            "job_request": {"name": "Ask"},
            "job_ack": {"sent": false}, "pause": {"sent": false}, "order_interrupt": {"sent": false}
        }, "charset": "latin1"}, Carrier::Unknown,
        use kawasaki_msg::{Charset, ConfigError, Dialect, Entry, Field, Role};
        static MESSAGES: [Entry; 8] = [
            Entry {
                role: Role::EndAck,
                name: "LoppuKuittaus",
                header: &[],
                fields: &[Field::Ended, Field::Order, Field::Executed],
            },
            Entry {
                role: Role::Filler,
                name: "Huuhaa",
                header: &[],
                fields: &[],
            },
            Entry {
                role: Role::Job,
                name: "Työ",
                header: &[Field::Constant("M"), Field::Order],
                fields: &[Field::Number, Field::Work],
            },
            Entry {
                role: Role::JobRequest,
                name: "Ask",
                header: &[],
                fields: &[Field::Order, Field::Number],
            },
            Entry {
                role: Role::OrderAck,
                name: "TilausKuittaus",
                header: &[],
                fields: &[Field::Order],
            },
            Entry {
                role: Role::OrderEnd,
                name: "TilausLoppuu",
                header: &[],
                fields: &[Field::Order],
            },
            Entry {
                role: Role::OrderStart,
                name: "TilausAlkaa",
                header: &[],
                fields: &[Field::Order, Field::Number],
            },
            Entry {
                role: Role::Status,
                name: "Tila",
                header: &[],
                fields: &[Field::Order, Field::Phase, Field::Queued, Field::Executed, Field::Ended],
            },
        ];
        pub fn dialect() -> Result<Dialect, ConfigError> {
            Ok(Dialect::new(&MESSAGES)?.with_charset(Charset::Latin1))
        }
    }
    is_rust! { "mmacell-proto", {"itr": true}, Carrier::Unknown,
        use mmacell_proto::Dialect;
        pub fn dialect() -> Dialect {
            Dialect {
                itr: true,
                ovrd: false,
                clos: false,
                off: false,
                lone_lf: false,
                blank: false,
                wide_integers: false
            }
        }
    }
}

/// The floats of a robot at its origin show no order of words; its counter does.
#[test]
fn a_counter_decides_the_order_of_words() {
    for order in ["low_first", "high_first"] {
        let given = json!({"view": "telemetry", "framing": "rtu", "word_order": order});
        let block = |counter: u32| {
            let zeros = |count| vec![0.0; count];
            json!({"unit": 1, "function": 3, "telemetry": {"life_counter": counter, "override": 100, "position": zeros(3),
                "wpr": zeros(3), "quaternion": zeros(4), "velocity": zeros(3), "quaternion_rate": zeros(4)}})
        };
        let blocks: Vec<Value> = (0..20).map(|at| block(70_000 + 3 * at)).collect();
        let finding = found("fanuc-hmi-modbus", &[&sent("fanuc-hmi-modbus", "server", &given, &blocks)]);
        let found = option(&finding, "word_order");
        assert_eq!((&found.value, &found.decided), (&json!(order), &DecidedBy::ByValues), "{finding:?}");
    }
}

/// A corrupt byte made a number of one block none: no reading of the other order is the better for it.
#[test]
fn a_number_that_is_none_does_not_decide_the_order_of_words() {
    let given = json!({"view": "telemetry", "framing": "tcp", "word_order": "low_first"});
    let block = |at: u16| {
        let some =
            |count: u16| (0..count).map(|n| 123.456 + f64::from(n * 20 + at) / 7.0).collect::<Vec<_>>();
        json!({"transaction": at, "unit": 1, "function": 3, "telemetry": {"life_counter": 70_000 + u32::from(at),
            "override": 100, "position": some(3), "wpr": some(3), "quaternion": some(4), "velocity": some(3),
            "quaternion_rate": some(4)}})
    };
    let blocks: Vec<Value> = (0..7).map(block).collect();
    let mut bytes = sent("fanuc-hmi-modbus", "server", &given, &blocks);
    // Of the first block's second float, the high word.
    let [high @ .., _, _] = (123.456_f32 + 20.0 / 7.0).to_be_bytes();
    let at = bytes.windows(2).position(|it| it == high).unwrap();
    bytes[at..at + 2].copy_from_slice(&[0x7F, 0xC1]);
    let finding = found("fanuc-hmi-modbus", &[&bytes]);
    let found = option(&finding, "word_order");
    assert_eq!((&found.value, &found.decided), (&json!("low_first"), &DecidedBy::ByValues), "{finding:?}");
}

#[test]
fn where_the_block_is_read_is_said() {
    let requests: Vec<Value> =
        (0..8).map(|_| json!({"unit": 1, "function": 3, "address": 1, "quantity": 37})).collect();
    let bytes = sent("fanuc-hmi-modbus", "client", &json!({"framing": "rtu"}), &requests);
    let finding = found("fanuc-hmi-modbus", &[&bytes]);
    let notes = (finding.link.open.notes)(&finding.read);
    assert!(notes.len() == 1 && notes[0].starts_with("the block is read at address 1: either"), "{notes:?}");
    let places = |finding: &Finding| {
        let places = (finding.link.open.places)(&finding.read);
        places.iter().map(|(name, value, _)| (*name, *value)).collect::<Vec<_>>()
    };
    assert_eq!(places(&finding), [("unit", 1), ("address", 1)]);
    // With several, there is none to write.
    let requests: Vec<Value> = (0..8)
        .map(|at| json!({"unit": 1 + at % 2, "function": 3, "address": 1 + at % 3, "quantity": 37}))
        .collect();
    let bytes = sent("fanuc-hmi-modbus", "client", &json!({"framing": "rtu"}), &requests);
    assert_eq!(places(&found("fanuc-hmi-modbus", &[&bytes])), []);
}

/// The bytes of few floats in the wrong order are implausible numbers.
#[test]
fn one_move_decides_the_order_of_bytes() {
    let items = json!({"items": [{"i16": [257]}, {"f32": [100.0, -50.5, 250.0, 0.5, 90.0, -45.25]}]});
    for order in ["little", "big"] {
        let short = json!({"items": [{"i16": [257]}]});
        let messages: Vec<Value> =
            core::iter::once(items.clone()).chain((0..12).map(|_| short.clone())).collect();
        let bytes = sent("laser-eb90", "host", &json!({"byte_order": order}), &messages);
        let finding = found("laser-eb90", &[&bytes]);
        let found = option(&finding, "byte_order");
        assert_eq!((&found.value, &found.decided), (&json!(order), &DecidedBy::ByValues), "{finding:?}");
    }
}

/// One message with a letter beyond ASCII may be corrupt: the character set that explains it is chosen, and the finding states
/// how much less the other one explains.
#[test]
fn the_value_that_explains_more_is_chosen_and_the_others_say_how_much_less() {
    let job = |name: &str| json!({"name": name, "fields": ["1", "2"]});
    let messages: Vec<Value> = ["Job", "Job", "Job", "Job", "Job", "J\u{f6}b", "Job"].map(job).to_vec();
    let bytes = sent("kawasaki-msg", "pc", &json!({"charset": "latin1"}), &messages);
    let finding = found("kawasaki-msg", &[&bytes]);
    let OpenSetting { value, decided, .. } = option(&finding, "charset");
    assert_eq!((value, finding.bytes), (&json!("latin1"), [bytes.len() as u64; 2]));
    let DecidedBy::Not { others, .. } = decided else { panic!("{decided:?}") };
    let less = u64::try_from(bytes.len() / 7).unwrap();
    assert_eq!(*others, [OtherValue { value: json!("ascii"), fewer: less, inexact: 0 }]);
    let text = draft(&finding, &[Stream { sender: Sender::Unknown, parts: vec![bytes], arrivals: vec![] }]);
    assert!(text.unwrap().contains("charset = \"latin1\" # ? "));
}
