//! The functions of the library that show bytes and settings to people.

use cellwire_links::codec::{Item, Kind};
use cellwire_links::explain::explain;
use cellwire_links::fanuc_hmi_modbus::client_settings;
use cellwire_links::kawasaki_msg::layout::Layout;
use cellwire_links::kawasaki_msg::{pc_settings, robot_settings};
use cellwire_links::settings::{self, Configure, FieldVisitor, Setting, line_of};
use kawasaki_msg::{Charset, PcConfig, RobotConfig};
use serde_json::json;

use crate::link;

#[test]
fn the_line_of_a_setting_is_told_or_that_of_its_table() {
    let text = "a = 1\n\n[b]\nc = 2\nd = [3, 4]\n\n[[e]]\nf = 5\n\n[[e]]\nf = 6\n";
    for (name, line) in [
        ("a", Some(1)),
        ("b", Some(3)),
        ("b.c", Some(4)),
        ("b.x", Some(3)),
        ("b.d.1", Some(5)),
        ("e.1", Some(10)),
        ("e.1.f", Some(11)),
        ("e.2.f", Some(7)),
        ("x", None),
    ] {
        assert_eq!(line_of(text, name), line, "{name}");
    }
    assert_eq!(line_of("a = ", "a"), None);
}

#[test]
fn who_keeps_a_record_is_who_asks_or_what_is_called_a_pc() {
    let asked = |name, kept| [true, false].map(|by_keeper| link(name).keeper(kept, by_keeper).unwrap());
    assert_eq!(asked("laser-eb90", None), [Some("host"), Some("controller")]);
    assert_eq!(asked("laser-eb90", Some("controller")), [Some("controller"), Some("host")]);
    assert_eq!(asked("kawasaki-msg", None), [Some("pc"), Some("robot")]);
    assert_eq!(asked("isra-ball", None), [None, Some("ball")]);
    assert_eq!(asked("val2-viewer", Some("host")), [Some("host"), None]);
    link("laser-eb90").keeper(Some("robot"), true).unwrap_err();
}

#[test]
fn the_device_of_a_cell_is_told_by_its_port() {
    let sender = |is_client, port| (link("mmacell-proto").sender)(is_client, port);
    let platform = mmacell_proto::port::PLATFORM;
    assert_eq!([sender(false, platform), sender(false, 1)], [Some("platform"), Some("robot")]);
    assert_eq!([sender(true, platform), sender(true, 1)], [Some("central"); 2]);
}

#[test]
fn an_item_is_a_line() {
    let line = |kind, label| {
        let mut line = Vec::new();
        let item = Item { offset: 7, length: 2, kind, json: b"{}" };
        item.write_line(label, &mut line).unwrap();
        String::from_utf8(line).unwrap()
    };
    assert_eq!(line(Kind::Message, ""), "{\"offset\":7,\"length\":2,\"message\":{}}\n");
    assert_eq!(line(Kind::Error, "\"a\":1,"), "{\"a\":1,\"offset\":7,\"length\":2,\"error\":{}}\n");
}

/// Both ends of a plant.
struct Both(RobotConfig, PcConfig);

impl Configure for Both {
    fn configure(&mut self, fields: &mut impl FieldVisitor) {
        fields.group("robot", |fields| robot_settings(fields, &mut self.0));
        fields.group("pc", |fields| pc_settings(fields, &mut self.1));
    }
}

#[test]
fn what_the_plant_decides_is_set_of_no_end() {
    let names = |settings: Vec<Setting>| settings.into_iter().map(|it| it.name).collect::<Vec<_>>().join(" ");
    let both = "robot.low_water robot.recovery.resends robot.recovery.pauses robot.recovery.clears robot.patience robot.pause \
        robot.reply_timeout robot.exchange robot.silent_cycles robot.reconnect_delay robot.status_period \
        robot.refuse_repeated_start robot.end_foreign_order \
        pc.reply_delay pc.silence pc.takeover pc.start_retries pc.end_when_done";
    assert_eq!(names(settings::list(Both(RobotConfig::tcp(), PcConfig::tcp()))), both);
    // The settings on every kind of port, each once.
    assert_eq!(
        names(client_settings()),
        "timeout any_unit broadcast turnaround settle pause echo silence stall"
    );
}

#[test]
fn a_job_s_fields_have_places() {
    let whole = |name: &str| json!({"name": name, "kind": "whole", "range": [-9, 9]});
    let text = json!({"name": "text", "kind": "text", "length": [0, 9]});
    let layout = Layout::read(&[whole("x"), whole("y"), text], Charset::Ascii).unwrap();
    assert_eq!(["x", "y", "text", "z"].map(|name| layout.place(name)), [Some(0), Some(1), Some(2), None]);
    let work = layout.job(&["2", "-7", "5"], Charset::Ascii).unwrap();
    assert_eq!([0, 1, 2].map(|place| work.number(place)), [2, -7, 0]);
    let error = layout.job(&["2", "10", "5"], Charset::Ascii).unwrap_err();
    assert_eq!(error.to_string(), "field 'y' is 10, not from -9 to 9");
}

#[test]
fn the_parts_of_a_telemetry_block_are_its_values() {
    let reply = [&[0, 1, 0, 0, 0, 77, 1, 3, 74][..], &[0; 74]].concat();
    let settings = json!({"view": "telemetry"});
    let found =
        explain(link("fanuc-hmi-modbus"), "server", settings.as_object().unwrap(), &reply).unwrap().remove(0);
    let parts: Vec<String> =
        found.parts[6..].iter().map(|it| format!("{} {:?} {}", it.name, it.bytes, it.clause)).collect();
    let mut expected =
        vec!["/telemetry/life_counter 9..13 FM-71".to_owned(), "/telemetry/override 13..15 FM-71".into()];
    let lists = [("position", 3), ("wpr", 3), ("quaternion", 4), ("velocity", 3), ("quaternion_rate", 4)];
    let names = lists.iter().flat_map(|(name, count)| (0..*count).map(move |at| format!("{name}/{at}")));
    expected.extend(
        names.zip((15..).step_by(4)).map(|(name, at)| format!("/telemetry/{name} {at}..{} FM-71", at + 4)),
    );
    assert_eq!(parts, expected);
}
