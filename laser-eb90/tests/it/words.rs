//! Words and configurations: their meanings, invalid ones, and loading.

use laser_eb90::{
    Class, ConfigError, Controller, ControllerConfig, ErrorCodes, Host, HostConfig, Instruction, Refusal,
    Words,
};

#[test]
fn each_refusal_says_what_it_is() {
    for (refusal, text) in [
        (Refusal::BadChecksum, "wrong checksum"),
        (Refusal::BadFrame, "malformed frame"),
        (Refusal::UnknownCommand, "unknown command word"),
        (Refusal::BadBatch, "too many instructions in a frame, or one that must be alone"),
        (Refusal::BadParameters, "wrong parameters, or the execution failed"),
        (Refusal::QueueFull, "queue full"),
    ] {
        assert_eq!(refusal.to_string(), text);
    }
}

#[test]
fn every_word_has_one_meaning() {
    let message = |words: Result<Words, ConfigError>| words.unwrap_err().to_string();
    let twice = [(1..=9, Class::Interpreted), (5..=20, Class::Immediate)];
    assert_eq!(
        message(Words::new(twice, ErrorCodes::default())),
        "0005h is a command word and a command word at once"
    );
    assert_eq!(
        message(Words::new([(0xE000..=0xE00F, Class::Query)], ErrorCodes::default())),
        "E001h is a command word and an error code at once"
    );
    let codes = ErrorCodes { queue_full: 0xE001, ..ErrorCodes::default() };
    assert_eq!(message(Words::new([], codes)), "E001h is an error code and an error code at once");
    let many = (0..33).map(|word| (word..=word, Class::Query));
    assert_eq!(
        message(Words::new(many, ErrorCodes::default())),
        "a set of words has at most 32 ranges of command words"
    );
    let words = Words::default();
    assert_eq!(
        [0x00FF, 0x0100, 0x01FF, 0x0200, 0x02FF, 0x0300, 0x03FF, 0x0400].map(|word| words.class(word)),
        [
            None,
            Some(Class::Interpreted),
            Some(Class::Interpreted),
            Some(Class::Immediate),
            Some(Class::Immediate),
            Some(Class::Query),
            Some(Class::Query),
            None
        ]
    );
}

#[test]
fn a_set_of_words_keeps_its_codes() {
    let errors = ErrorCodes { queue_full: 0xE0FF, ..ErrorCodes::default() };
    let words = Words::new([(0x0400..=0x0400, Class::Query)], errors).unwrap();
    assert_eq!((words.class(0x0400), words.class(0x0401)), (Some(Class::Query), None));
    assert_eq!(words.errors().code(Refusal::QueueFull), 0xE0FF);
    assert_eq!(
        [0xE0FF, 0xE005, 0xE006, 0x0400].map(|code| words.errors().refusal(code)),
        [Some(Refusal::QueueFull), Some(Refusal::BadParameters), None, None]
    );
}

#[cfg(feature = "serde")]
#[test]
fn words_are_loaded_at_run_time() {
    let json = r#"{"commands":[{"first":16,"last":31,"class":"interpreted"},{"first":32,"last":32,"class":"query"}],
        "errors":{"bad_checksum":1}}"#;
    let words: Words = serde_json::from_str(json).unwrap();
    assert_eq!([16, 31, 32, 33].map(|word| words.class(word).is_some()), [true, true, true, false]);
    assert_eq!(words.class(32), Some(Class::Query));
    assert_eq!((words.errors().bad_checksum, words.errors().bad_frame), (1, 0xE002));
    assert_eq!(serde_json::from_str::<Words>(&serde_json::to_string(&words).unwrap()).unwrap(), words);
    let default = serde_json::to_string(&Words::default()).unwrap();
    assert_eq!(serde_json::from_str::<Words>(&default).unwrap(), Words::default());
    let many = vec![r#"{"first":9,"last":1,"class":"query"}"#; 33].join(",");
    for (json, expected) in [
        ("{}", "missing field `commands`"),
        (r#"{"commands":1}"#, "invalid type: integer `1`, expected a list of ranges of command words"),
        (
            r#"{"commands":[{"first":1,"last":57345,"class":"query"}]}"#,
            "E001h is a command word and an error code",
        ),
        (
            r#"{"commands":[],"errors":{"bad_frame":57345}}"#,
            "E001h is an error code and an error code at once",
        ),
        (&format!(r#"{{"commands":[{many}]}}"#), "a set of words has at most 32 ranges of command words"),
    ] {
        let error = serde_json::from_str::<Words>(json).unwrap_err().to_string();
        assert!(error.starts_with(expected), "{json}: {error}");
    }
}

struct AnyInstruction;

impl TryFrom<Instruction<'_>> for AnyInstruction {
    type Error = ();

    fn try_from(_: Instruction<'_>) -> Result<Self, ()> {
        Ok(Self)
    }
}

#[test]
fn what_cannot_work_is_no_configuration() {
    let host = |config| Host::new(config).map(drop);
    assert_eq!(host(HostConfig { batch: 0, ..HostConfig::default() }), Err(ConfigError::NoBatch));
    assert_eq!(host(HostConfig { baud: 0, ..HostConfig::default() }), Err(ConfigError::NoBaud));
    assert_eq!(host(HostConfig::default()), Ok(()));
    let (writer, _reader) = robot_work_queue::boxed::<AnyInstruction>(4, 99).unwrap();
    let config = ControllerConfig { batch: 0, ..ControllerConfig::default() };
    assert_eq!(Controller::new(config, writer).map(drop), Err(ConfigError::NoBatch));
}
