//! The configurations of the table, in the form that `reference/` has: all their fields, by their names, listed and read.

use core::fmt::Debug;
use core::time::Duration;

use cellwire_links::fanuc_hmi_modbus::ClientSettings;
use cellwire_links::link::Config;
use cellwire_links::settings::{Configure, Form, Setting, list, list_as, read_as};
use cellwire_links::{LINKS, Link};
use serde_json::{Map, Value, json};

/// Returns every configuration of the table, each with its owner.
fn configs() -> Vec<(String, &'static Config)> {
    let of = |link: &'static Link| {
        link.configs.iter().map(|config| (format!("{} {}", link.name, config.name), config))
    };
    assert!(LINKS.iter().all(|link| !link.configs.is_empty()));
    LINKS.iter().flat_map(of).collect()
}

/// Returns the fields of a configuration, after values were given.
fn fields(config: &Config, given: Value) -> Result<Vec<Setting>, String> {
    (config.fields)(given.as_object().unwrap()).map_err(|error| error.to_string())
}

/// Returns other values of the same kind, some of which a field accepts.
fn others(value: &Value, range: &str) -> Vec<Value> {
    match value {
        Value::Null => vec![json!(1)],
        Value::Bool(value) => vec![json!(!value)],
        Value::Number(number) => {
            let number = number.as_i64().unwrap();
            vec![json!(number - 1), json!(number + 1)]
        }
        Value::String(_) => range.split(", ").map(Value::from).collect(),
        Value::Array(values) if values.is_empty() => vec![json!([7])],
        Value::Array(values) => {
            let first = others(&values[0], "").into_iter();
            first.map(|first| [&[first], &values[1..]].concat().into()).collect()
        }
        Value::Object(fields) => {
            let changed = |(name, value)| {
                let of = |other| {
                    let mut fields = fields.clone();
                    fields.insert(String::clone(name), other);
                    Value::from(fields)
                };
                others(value, "").into_iter().map(of).collect::<Vec<_>>()
            };
            fields.iter().flat_map(changed).collect()
        }
    }
}

#[test]
fn what_is_listed_and_given_back_changes_nothing() {
    for (name, config) in configs() {
        let listed = fields(config, json!({})).unwrap();
        let values = listed.iter().filter(|field| field.unit != "code");
        let given: Map<_, _> = values.map(|field| (field.name.clone(), field.default.clone())).collect();
        assert_eq!(fields(config, given.into()).unwrap(), listed, "{name}");
    }
}

#[test]
fn each_field_is_read_by_its_name() {
    for (name, config) in configs() {
        let listed = fields(config, json!({})).unwrap();
        for (place, field) in listed.iter().enumerate().filter(|(_, field)| field.unit != "code") {
            let others = others(&field.default, &field.values);
            let change = others.iter().filter(|other| **other != field.default).find_map(|other| {
                let given = Map::from_iter([(field.name.clone(), other.clone())]);
                Some((other, fields(config, given.into()).ok()?))
            });
            let (other, after) = change.unwrap_or_else(|| panic!("{name} takes no other {}", field.name));
            for (at, (before, after)) in listed.iter().zip(&after).enumerate() {
                let expected = if at == place { other } else { &before.default };
                assert_eq!(after.default, *expected, "{name}, {} = {other}: {}", field.name, before.name);
            }
        }
    }
}

/// Returns the fields of a struct, in its `Debug` form, without those that only the model uses: `rules`, and the number of
/// transactions.
fn declared(config: &impl Debug) -> Vec<String> {
    let text = format!("{config:#?}");
    let lines = text.lines().filter(|line| line.starts_with("    ") && !line.starts_with("     "));
    let names = lines.filter_map(|line| line.trim().split_once(':')).map(|(name, _)| name.to_owned());
    let mut names: Vec<_> = names.filter(|name| !["rules", "transactions"].contains(&&**name)).collect();
    names.sort();
    names
}

/// Asserts that a field is listed under its name.
fn named(config: impl Configure + Debug) {
    let declared = declared(&config);
    let mut names: Vec<String> =
        list_as(Form::Nanoseconds, config).into_iter().map(|field| field.name).collect();
    names.sort();
    assert_eq!(names, declared);
}

#[test]
fn fields_are_listed_by_the_names_that_they_have() {
    named(fanuc_hmi_modbus::ClientConfig::tcp());
    named(fanuc_hmi_modbus::ServerConfig::tcp());
    named(isra_ball::BallConfig::default());
    named(isra_ball::HostConfig::default());
    named(kawasaki_msg::Limits::TCP);
    named(kawasaki_msg::PcConfig::tcp());
    named(kawasaki_msg::RecoveryLimits::default());
    named(kawasaki_msg::RobotConfig::tcp());
    named(laser_eb90::ControllerConfig::default());
    named(laser_eb90::ErrorCodes::default());
    named(laser_eb90::HostConfig::default());
    named(laser_eb90::Profile::default());
    named(mmacell_proto::CentralConfig::DEFAULT);
    named(mmacell_proto::DeviceConfig::DEFAULT);
    named(mmacell_proto::Dialect::STRICT);
    named(mmacell_task::TaskConfig::DEFAULT);
    named(val2_alter::ControllerConfig::default());
    named(val2_alter::Framing::DEFAULT);
    named(val2_alter::HostConfig::default());
    named(val2_alter::Limits::GENTLE);
    named(val2_viewer::HostConfig::default());
    named(val2_viewer::WorkstationConfig::default());
}

fn read<C: Configure>(config: C, given: Value) -> Result<C, String> {
    let given = given.as_object().unwrap();
    read_as(Form::Nanoseconds, "the host", config, given).map_err(|error| error.to_string())
}

#[test]
fn times_are_nanoseconds_and_parts_are_objects() {
    use laser_eb90::{HostConfig, Profile, Width};

    let given = json!({"settle": 1_500, "backoff": null, "profile": {"checksum": "u16_le"}});
    let profile = Profile { checksum: Width::U16Le, ..Profile::default() };
    let (settle, backoff) = (Duration::from_nanos(1_500), Duration::MAX);
    let expected = HostConfig { settle, backoff, profile, ..HostConfig::default() };
    assert_eq!(read(HostConfig::default(), given), Ok(expected));

    let alter = val2_alter::HostConfig::default();
    assert_eq!(read(alter, json!({"gap": null})).unwrap().gap, None);
    assert_eq!(read(alter, json!({"gap": 0})).unwrap().gap, Some(Duration::ZERO));
    assert_eq!(read(alter, json!({"gap": u64::MAX})).unwrap().gap, Some(Duration::MAX));
    assert_eq!(
        read(alter, json!({"gap": "4ms"})),
        Err("gap=4ms: not in nanoseconds, give from 0; null: off".into())
    );
    assert_eq!(
        read(alter, json!({"limits": {"speed": 1}})).unwrap_err().split(':').next(),
        Some("the host has no setting `limits.speed`")
    );
    let robot = kawasaki_msg::RobotConfig::tcp();
    for individual in [json!("individual"), Value::Null] {
        let robot = read(robot, json!({"acks": individual})).unwrap();
        assert_eq!(robot.acks, kawasaki_msg::Acks::Individual);
    }
    let bounds = read(kawasaki_msg::Bounds::WIDEST, json!({"min": {"x": -5}, "max": {"y": 7}})).unwrap();
    let widest = kawasaki_msg::Bounds::WIDEST;
    let corners = [bounds.min, bounds.max].map(|point| (point.x, point.y));
    assert_eq!(corners, [(-5, widest.min.y), (widest.max.x, 7)]);
    let ball = isra_ball::HostConfig::default();
    assert_eq!(read(ball, json!({"baud": 0})).unwrap_err(), "baud=0: out of range, give from 1");
    let pause = read(val2_viewer::WorkstationConfig::default(), json!({"pause": 200_000_000}));
    assert_eq!(pause.unwrap_err(), "pause=200000000: out of range, give above 200ms; null: never");
}

#[test]
fn a_transport_is_chosen_with_its_time() {
    use fanuc_hmi_modbus::{ClientConfig, Framing};

    let framing = |config, given| read(config, given).map(|config: ClientConfig| config.framing);
    let stall = Duration::from_millis(2);
    let given = json!({"framing": "rtu_over_tcp", "stall": 2_000_000});
    assert_eq!(framing(ClientConfig::tcp(), given), Ok(Framing::RtuOverTcp { stall }));
    let rtu = ClientConfig::rtu(9600);
    assert_eq!(framing(rtu, json!({"framing": "rtu"})), Ok(rtu.framing));
    assert_eq!(framing(rtu, json!({"framing": "tcp"})), Ok(Framing::Tcp));
    assert!(framing(ClientConfig::tcp(), json!({"stall": 1})).is_err());
}

#[test]
fn what_else_decides_is_no_setting() {
    let names = |settings: Vec<Setting>| settings.into_iter().map(|it| it.name).collect::<Vec<_>>();
    let client = names(list(ClientSettings(&mut fanuc_hmi_modbus::ClientConfig::rtu(9600))));
    assert_eq!(
        client,
        ["timeout", "any_unit", "broadcast", "turnaround", "settle", "pause", "echo", "silence"]
    );
    assert_eq!(
        names(list(val2_viewer::HostConfig::default())),
        ["interval", "max_age", "max_hold", "echo"],
        "a format is code"
    );
    // In a user's settings the framing has no table of its own.
    let alter = names(list(val2_alter::ControllerConfig::default()));
    let alter: Vec<_> = alter.iter().skip(6).collect();
    assert_eq!(alter, ["gap", "leading_dle", "negated_sum", "stuffed_checksum", "ignore_spare_select"]);
}

/// An end's fields in a program's own file, with units; missing fields have the defaults.
#[test]
fn a_configuration_is_part_of_a_program_s_own() {
    #[derive(serde::Deserialize)]
    struct Site {
        robot: kawasaki_msg::RobotConfig,
        plc: fanuc_hmi_modbus::ClientConfig,
        arm: val2_alter::HostConfig,
    }
    let file = r#"
        [robot]
        patience = "1m30s"
        [plc]
        framing = "rtu"
        timeout = "250ms"
        settle = "never"
        [arm]
        baud = 19200
    "#;
    let Site { robot, plc, arm } = toml::from_str(file).unwrap();
    assert_eq!(robot.patience, Duration::from_secs(90));
    assert_eq!((plc.timeout, plc.settle), (Duration::from_millis(250), Duration::MAX));
    assert_eq!((arm.baud, arm.mode), (19_200, val2_alter::HostConfig::default().mode));
    for (wrong, why) in [
        ("timeout = 250", "timeout=250: not a time with its unit, such as 250ms or 1.5s"),
        ("timeout = '0s'", "timeout=0s: out of range, give a time above 0, or never"),
        ("time_out = '1s'", "ClientConfig has no setting `time_out`; did you mean `timeout`?"),
    ] {
        let error = toml::from_str::<fanuc_hmi_modbus::ClientConfig>(wrong).unwrap_err().to_string();
        assert!(error.contains(why), "{error}");
    }
}

/// Every configuration of an end.
#[test]
fn a_configuration_of_which_nothing_is_given_is_the_default() {
    fn same<C: for<'de> serde::Deserialize<'de> + Debug>(default: &C) {
        let read = serde_json::from_str::<C>("{}").unwrap();
        assert_eq!(format!("{read:?}"), format!("{default:?}"));
        assert!(serde_json::from_str::<C>(r#"{"no such": 1}"#).is_err(), "{default:?}");
    }
    same(&fanuc_hmi_modbus::ClientConfig::default());
    same(&fanuc_hmi_modbus::ServerConfig::default());
    same(&isra_ball::BallConfig::default());
    same(&isra_ball::HostConfig::default());
    same(&kawasaki_msg::PcConfig::tcp());
    same(&kawasaki_msg::RobotConfig::tcp());
    same(&laser_eb90::ControllerConfig::default());
    same(&laser_eb90::HostConfig::default());
    same(&mmacell_proto::CentralConfig::DEFAULT);
    same(&mmacell_proto::DeviceConfig::DEFAULT);
    same(&mmacell_task::TaskConfig::DEFAULT);
    same(&val2_alter::ControllerConfig::default());
    same(&val2_alter::HostConfig::default());
    same(&val2_viewer::HostConfig::default());
    same(&val2_viewer::WorkstationConfig::default());
}
