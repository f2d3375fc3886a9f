//! A plant of Kawasaki's messages: its table, its jobs, and both ends' configurations in it.

use cellwire_links::Link;
use cellwire_links::kawasaki_msg::layout::{Field, FieldType, Layout};
use cellwire_links::kawasaki_msg::plant::Plant;
use cellwire_links::link::Carrier;
use cellwire_links::settings::{self, RefusedSetting};
use cellwire_links::shadow::Setup;
use kawasaki_msg::{Acks, Charset, FieldFault, Limits, PcConfig, RobotConfig, Role, Takeover};
use serde_json::{Map, Value, json};

fn plant(given: Value) -> Result<Plant, RefusedSetting> {
    settings::read("kawasaki-msg", Plant::default(), given.as_object().unwrap())
}

#[test]
fn both_ends_have_what_the_plant_has_agreed_on() {
    for (acks, cumulative_acks) in [(json!(5), true), (json!("individual"), false)] {
        let start = json!({"name": "TA", "fields": ["number", "order", "=x"]});
        let messages = json!({"order_start": start});
        let plant =
            plant(json!({"udp": true, "max_number": 200, "acks": acks, "messages": messages})).unwrap();
        let dialect = plant.dialect().unwrap();
        let start = dialect.entry(Role::OrderStart).unwrap();
        assert_eq!(
            (start.name, format!("{:?}", start.fields)),
            ("TA", r#"[Number, Order, Constant("x")]"#.into())
        );
        let (limits, datagrams, max_number) = (Limits::UDP, true, 200);
        let pc = PcConfig { dialect, limits, datagrams, max_number, cumulative_acks, ..PcConfig::tcp() };
        assert_eq!(plant.pc(PcConfig::tcp()).unwrap(), pc);
        let acks = if cumulative_acks {
            Acks::Cumulative { every: 5.try_into().unwrap() }
        } else {
            Acks::Individual
        };
        let robot = RobotConfig { dialect, limits, datagrams, max_number, acks, ..RobotConfig::tcp() };
        assert_eq!(plant.robot(RobotConfig::tcp()).unwrap(), robot);
    }
}

#[test]
fn acknowledgements_of_single_jobs_need_their_message() {
    let messages = json!({"job_ack": {"sent": false}});
    let refused =
        plant(json!({"acks": "individual", "messages": messages})).unwrap().pc(PcConfig::tcp()).unwrap_err();
    let text = "messages.job_ack: the table lacks the role JobAck, which the configuration needs; with acks=1 it does not";
    assert_eq!(refused.to_string(), text);
}

#[test]
fn what_no_table_can_have_is_refused_with_advice() {
    for (messages, text) in [
        (
            json!({"job": {"sent": false}}),
            "messages.job: the table must have the role Job once; set messages.job.name",
        ),
        (
            json!({"pause": {"name": "Tyo"}}),
            "messages.job: the name of the role Job is empty, duplicate or unencodable; \
             set messages.job.name to a name that no other message has",
        ),
        (
            json!({"job_request": {"fields": ["order"]}}),
            "messages.job_request: the message of the role JobRequest lacks the field Number; \
             write number in messages.job_request.fields or messages.job_request.header, at its place in the message",
        ),
        (
            json!({"job_request": {"fields": ["order", "number", "number"]}}),
            "messages.job_request: the message of the role JobRequest has a duplicate or invalid field; \
             messages.job_request.header and messages.job_request.fields may have order once, number once, unused, \
             and =TEXT for a constant",
        ),
    ] {
        let refused = plant(json!({"messages": messages})).unwrap().check().unwrap_err();
        assert_eq!(refused.to_string(), text, "{messages}");
    }
}

/// A message that only an interrupting PC needs may be missing for all other ends.
#[test]
fn a_plant_may_lack_what_a_pc_alone_needs() {
    let given = json!({"messages": {"order_interrupt": {"sent": false}}});
    let without = plant(given.clone()).unwrap();
    let refused = without.pc(PcConfig::tcp()).unwrap_err().to_string();
    assert!(
        refused.starts_with("messages.order_interrupt: ")
            && refused.ends_with("; with takeover=end or never it does not"),
        "{refused}"
    );
    assert!(without.pc(PcConfig { takeover: Takeover::Never, ..PcConfig::tcp() }).is_ok());
    assert!(without.robot(RobotConfig::tcp()).is_ok() && without.check().is_ok());
    let link = Link::by_name("kawasaki-msg").unwrap();
    let settings = given.as_object().unwrap();
    assert!((link.codec)("pc", settings).is_ok());
    let setup = Setup { settings, configs: &Map::new(), baud: None, is_serial: false };
    assert!((link.shadow)(&setup).is_ok());
}

#[test]
fn the_fields_of_a_message_are_shown_and_read_by_their_names() {
    let listed = settings::list(Plant::default());
    let fields = listed.iter().find(|it| it.name == "messages.order_start.fields").unwrap();
    assert_eq!(fields.default, json!(["order", "number"]));
    let refused = plant(json!({"messages": {"order_start": {"fields": ["order", "nummer"]}}})).unwrap_err();
    assert!(refused.text.contains("`nummer` is not a field"), "{refused}");
}

fn read(table: &Value) -> Result<Layout, RefusedSetting> {
    Layout::read(core::slice::from_ref(table), Charset::Ascii)
}

#[test]
fn a_job_s_fields_are_given_as_they_were_read() {
    let tables = [
        json!({"name": "parts", "kind": "whole", "range": [-5, 7], "default": "3"}),
        json!({"name": "speed", "kind": "decimal", "places": 2, "range": ["-1.50", "20.00"], "default": "0.25"}),
        json!({"name": "tool", "kind": "text", "length": [1, 1], "default": "a"}),
        json!({"name": "exactly15letter", "kind": "text", "length": [0, 32]}),
    ];
    assert_eq!(Layout::read(&tables, Charset::Ascii).unwrap().given(), tables);
    let within = plant(json!({"bounds": {"min": {"x": -5}, "max": {"x": 7}}})).unwrap().layout().unwrap();
    let x = FieldType::Number { places: 0, min: -5, max: 7 };
    assert_eq!(within.fields()[1], Field { name: "x1".into(), holds: x, default: None });
    let any = read(&json!({"name": "parts", "kind": "whole"})).unwrap();
    let widest = FieldType::Number { places: 0, min: -9_999_999, max: 9_999_999 };
    assert_eq!(any.fields()[0].holds, widest);
    for (table, why) in [
        (json!({"name": "", "kind": "text"}), "a name has 1 to 15 letters, digits and _"),
        (json!({"name": "a b", "kind": "text"}), "a name has 1 to 15 letters, digits and _"),
        (json!({"name": "a", "kind": "text", "places": 1}), "`places` is of a field of the kind decimal"),
        (json!({"name": "a", "kind": "whole", "length": [1, 2]}), "`length` is of a field of the kind text"),
        (json!({"name": "a", "kind": "text", "length": [2, 1]}), "give [LEAST, MOST] characters, of 0 to 32"),
        (
            json!({"name": "a", "kind": "text", "length": [0, 33]}),
            "give [LEAST, MOST] characters, of 0 to 32",
        ),
    ] {
        let refused = read(&table).unwrap_err().text;
        assert!(refused.ends_with(why), "{table}: {refused}");
    }
}

#[test]
fn a_job_of_the_five_numbers_of_a_line_is_a_line() {
    let is_line = |names: &[&str]| {
        let tables: Vec<_> = names.iter().map(|name| json!({"name": name, "kind": "whole"})).collect();
        Layout::read(&tables, Charset::Ascii).unwrap().is_line()
    };
    let line = ["kind", "x1", "y1", "x2", "y2"];
    assert!(is_line(&line) && plant(json!({})).unwrap().layout().unwrap().is_line());
    assert!(!is_line(&line[..4]) && !is_line(&["kind", "x1", "y1", "x2", "z2"]));
    let decimals = line.map(|name| json!({"name": name, "kind": "decimal", "places": 1}));
    assert!(!Layout::read(&decimals, Charset::Ascii).unwrap().is_line());
    let fields = |count: usize| {
        let table = |number| json!({"name": format!("n{number}"), "kind": "whole"});
        Layout::read(&(0..count).map(table).collect::<Vec<_>>(), Charset::Ascii)
    };
    assert!(fields(24).is_ok());
    assert_eq!(fields(25).unwrap_err().text, "a job has 1 to 24 fields, not 25");
}

#[test]
fn a_program_has_the_table_and_the_job_that_are_not_the_default() {
    let program = |given: Value| {
        let rust = Link::by_name("kawasaki-msg").unwrap().open.rust;
        rust(given.as_object().unwrap(), Carrier::default()).unwrap()
    };
    assert_eq!(
        program(json!({})),
        "use kawasaki_msg::Charset;\n\npub fn charset() -> Charset {\n    Charset::Ascii\n}"
    );
    assert!(program(json!({"messages": {"job": {"name": "Line"}}})).contains("name: \"Line\","));
    let job = json!([
        {"name": "1st", "kind": "whole", "range": [0, 9]},
        {"name": "speed", "kind": "decimal", "places": 2, "range": ["0.50", "20.00"]},
        {"name": "Type", "kind": "whole", "range": [0, 1]},
        {"name": "_", "kind": "whole", "range": [0, 1]},
    ]);
    let text = program(json!({"job": job}));
    assert!(text.contains("    /// 0 to 9.\n    pub field_1st: i32,\n"), "{text}");
    assert!(text.contains("    pub type_: i32,\n") && text.contains("    pub __: i32,\n"), "{text}");
    assert!(text.contains("    /// 0.50 to 20.00, in units of 1e-2.\n    pub speed: i32,\n"), "{text}");
}

#[test]
fn a_mark_in_a_job_s_text_is_refused_whatever_the_field_holds() {
    for kind in ["text", "whole"] {
        let layout = read(&json!({"name": "tool", "kind": kind})).unwrap();
        let fault = |text: &str| layout.job(&[text], Charset::Ascii).unwrap_err().fault;
        for found in *b"<>$#" {
            assert_eq!(fault(&char::from(found).to_string()), FieldFault::Reserved { found });
        }
        assert_eq!(fault("\u{20AC}"), FieldFault::Character { found: '\u{20AC}' });
    }
}

#[test]
fn a_role_is_encoded_with_its_fields_and_no_others() {
    let settings = json!({"roles": true});
    let codec = (Link::by_name("kawasaki-msg").unwrap().codec)("pc", settings.as_object().unwrap()).unwrap();
    let encode = |values: Value| codec.encode(json!({"role": "order_end", "values": values}));
    assert_eq!(encode(json!({"order": 1})).unwrap(), b"<TilausLoppuu$1#1#>");
    let refused = encode(json!({"order": 1, "phase": 2})).unwrap_err().to_string();
    assert!(refused.starts_with("a value is not a field of the message `TilausLoppuu`"), "{refused}");
}
