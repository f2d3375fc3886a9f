//! A table of messages: the values that it reads from the fields, and the errors.

use core::time::Duration;

use kawasaki_msg::robot_session::Session as _;
use kawasaki_msg::{
    Charset, ConfigError, Dialect, Entry, Field, Line, Message, MessageError, Params, Pc, PcConfig, Robot,
    RobotConfig, RobotEvent, Role, Supply,
};

/// Returns the result of a table for a message with this data part.
fn read(dialect: &Dialect, name: &str, data: &str) -> Result<(Role, Params), MessageError> {
    let wire = format!("<{name}${}#{data}#>", data.len());
    let (message, _) = Message::decode(wire.as_bytes(), dialect.charset()).unwrap().unwrap();
    dialect.read(&message)
}

/// Returns the default table and a command with these fields.
fn with_command(fields: &'static [Field]) -> Dialect {
    let mut table = Dialect::DEFAULT.entries().to_vec();
    let role = Role::Command(1);
    table.push(Entry { role, name: "Nopeus", header: &[], fields });
    Dialect::new(table.leak()).unwrap()
}

/// Only values that may be unknown can be empty: the queued job, the executed job, the order that has ended.
#[test]
fn a_value_may_be_empty_only_where_there_may_be_none() {
    let read = |name, data| read(&Dialect::DEFAULT, name, data).map(|(role, _)| role);
    let empty = |field| Err(MessageError::NotANumber { field });
    assert_eq!(read("TilausAlkaa", "$1"), empty(0));
    assert_eq!(read("TilausAlkaa", "50$"), empty(1));
    assert_eq!(read("Tila", "$2$$$"), empty(0));
    assert_eq!(read("Tila", "50$$$$"), empty(1));
    assert_eq!(read("Tila", "50$2$$$"), Ok(Role::Status));
    assert_eq!(read("TyoTauko", "50$"), Ok(Role::Pause));
    assert_eq!(read("LoppuKuittaus", "$50$"), Ok(Role::EndAck));
    assert_eq!(read("LoppuKuittaus", "1$$2"), empty(1));
}

#[test]
fn a_message_has_as_many_values_as_its_table_says() {
    let count = |expected, found| Err(MessageError::FieldCount { expected, found });
    let default = |name, data| read(&Dialect::DEFAULT, name, data).map(|(role, _)| role);
    assert_eq!(default("TilausKuittaus", ""), count(1, 0));
    assert_eq!(default("TilausKuittaus", "0$0"), count(1, 2));
    assert_eq!(default("Huuhaa", "0"), count(0, 1));
    assert_eq!(default("LoppuKuittaus", "1$2"), count(3, 2));
    // No value and one empty value are the same bytes.
    let one = with_command(&[Field::Value]);
    assert_eq!(read(&one, "Nopeus", "").map(|(role, _)| role), count(1, 0));
    let one = with_command(&[Field::Unused]);
    assert_eq!(read(&one, "Nopeus", ""), Ok((Role::Command(1), Params::default())));
    let two = with_command(&[Field::Unused, Field::Unused]);
    assert_eq!(read(&two, "Nopeus", "").map(|(role, _)| role), count(2, 0));
    assert_eq!(read(&two, "Nopeus", "7").map(|(role, _)| role), count(2, 1));
    assert_eq!(read(&two, "Nopeus", "$"), Ok((Role::Command(1), Params::default())));
}

#[test]
fn a_field_that_is_not_used_may_hold_anything() {
    let dialect = with_command(&[Field::Value, Field::Unused]);
    for unused in ["", "x", "99999999999"] {
        let (_, params) = read(&dialect, "Nopeus", &format!("-3${unused}")).unwrap();
        assert_eq!((params.get(Field::Value), params.get(Field::Unused)), (Some(-3), None));
    }
    assert_eq!(read(&dialect, "Nopeus", "$1").map(drop), Err(MessageError::NotANumber { field: 0 }));
}

#[test]
fn both_ends_of_a_fields_range_are_in_it() {
    let limit = |name, data, field, found, min, max| {
        let error = MessageError::OutOfRange { field, found, min, max };
        assert_eq!(read(&Dialect::DEFAULT, name, data).map(drop), Err(error), "{name} {data}");
    };
    for data in ["0$0$1$1$0", "65535$255$9999$9999$65535"] {
        assert_eq!(read(&Dialect::DEFAULT, "Tila", data).map(|(role, _)| role), Ok(Role::Status), "{data}");
    }
    limit("Tila", "-1$0$1$1$0", 0, -1, 0, 65_535);
    limit("Tila", "65536$0$1$1$0", 0, 65_536, 0, 65_535);
    limit("Tila", "0$-1$1$1$0", 1, -1, 0, 255);
    limit("Tila", "0$256$1$1$0", 1, 256, 0, 255);
    limit("Tila", "0$0$0$1$0", 2, 0, 1, 9999);
    limit("Tila", "0$0$10000$1$0", 2, 10_000, 1, 9999);
    limit("Tila", "0$0$1$0$0", 3, 0, 1, 9999);
    limit("Tila", "0$0$1$1$65536", 4, 65_536, 0, 65_535);
    limit("TyoPyynto", "1$10000", 1, 10_000, 1, 9999);
    limit("Tyo", "1$0$1$0$0$0$0", 1, 0, 1, 9999);
}

/// Returns the default table with this name.
fn with_name(role: Role, name: &'static str) -> Dialect {
    let mut table = Dialect::DEFAULT.entries().to_vec();
    table.iter_mut().filter(|entry| entry.role == role).for_each(|entry| entry.name = name);
    Dialect::new(table.leak()).unwrap()
}

/// The thesis is Finnish: its letters are one byte each on the wire, whatever their encoding in the program.
#[test]
fn a_name_is_compared_by_its_characters() {
    let dialect = with_name(Role::Filler, "Hölynpöly").with_charset(Charset::Latin1);
    let mut wire = [0; 64];
    let length = dialect.write(Role::Filler, &Params::default(), &mut wire).unwrap();
    assert_eq!(&wire[..length], b"<H\xf6lynp\xf6ly$0##>");
    let (message, _) = Message::decode(&wire[..length], Charset::Latin1).unwrap().unwrap();
    assert_eq!(dialect.read(&message), Ok((Role::Filler, Params::default())));
    // The bytes of the name in the program are other characters.
    let (message, _) = Message::decode("<Hölynpöly$0##>".as_bytes(), Charset::Latin1).unwrap().unwrap();
    assert!(matches!(dialect.read(&message), Err(MessageError::UnknownName { .. })));
}

#[test]
fn so_is_the_name_of_a_job() {
    let (writer, _reader) = robot_work_queue::boxed(8, 9999).unwrap();
    let dialect = with_name(Role::Job, "Työ").with_charset(Charset::Latin1);
    let mut robot = Robot::<Line>::new(RobotConfig { dialect, ..RobotConfig::tcp() }, writer).unwrap();
    robot.handle_timeout(Duration::ZERO);
    robot.handle_connected(Duration::ZERO);
    robot.handle_input(Duration::ZERO, b"<TilausAlkaa$4#50$1#>");
    robot.handle_input(Duration::ZERO, b"<Ty\xf6$14#50$1$1$0$0$1$1#>");
    assert_eq!(robot.queued(), 1);
    while robot.poll_event().is_some() {}
    robot.handle_input(Duration::ZERO, "<Työ$14#50$2$1$1$1$2$2#>".as_bytes());
    assert_eq!(robot.queued(), 1);
    let Some(RobotEvent::Rejected(MessageError::UnknownName { name })) = robot.poll_event() else { panic!() };
    assert_eq!(name.to_string(), "Ty\u{c3}\u{b6}");
}

/// Otherwise the session could only be silent about the error.
#[test]
fn a_session_is_not_made_with_a_name_that_it_could_not_write() {
    for (name, charset, writable) in [
        ("Työ", Charset::Ascii, false),
        ("Työ", Charset::Latin1, true),
        ("Ty\u{142}", Charset::Latin1, false),
        ("Ty<o", Charset::Ascii, false),
        ("Tyo", Charset::Ascii, true),
    ] {
        let dialect = with_name(Role::Job, name).with_charset(charset);
        let error = (!writable).then_some(ConfigError::Name { role: Role::Job });
        let (writer, _reader) = robot_work_queue::boxed(8, 9999).unwrap();
        assert_eq!(
            Robot::<Line>::new(RobotConfig { dialect, ..RobotConfig::tcp() }, writer).err(),
            error,
            "{name}"
        );
        let pc = Pc::<fn(u32) -> Supply<Line>>::new(PcConfig { dialect, ..PcConfig::tcp() });
        assert_eq!(pc.err(), error, "{name}");
    }
    let sentence = "the name of the role Job is empty, duplicate or unencodable";
    assert_eq!(ConfigError::Name { role: Role::Job }.to_string(), sentence);
}

/// A command's own fields are the application's.
#[test]
fn a_job_alone_has_own_fields() {
    let dialect = with_command(&[Field::Value, Field::Work]);
    let own = |wire: &[u8]| {
        let (message, _) = Message::decode(wire, Charset::Ascii).unwrap().unwrap();
        dialect.work_values(&message).map(|value| value.to_string()).collect::<Vec<_>>()
    };
    assert_eq!(own(b"<Tyo$10#50$1$-5$ab#>"), ["-5", "ab"]);
    assert_eq!(own(b"<Nopeus$4#7$-5#>"), [""; 0]);
}
