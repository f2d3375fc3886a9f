//! Messages of the feature `arbitrary`: the encoder accepts each of them.
#![allow(unreachable_pub, reason = "a helper of several tests")]

use core::fmt::Debug;
use std::collections::HashSet;

use arbitrary::{Arbitrary, Unstructured};
use mmacell_proto::robot_session::Encode;
use mmacell_proto::{
    AnyPose, Command, DecodeError, Dialect, EncodeError, ErrorCode, InDialect, Line, NoPose, Reply,
};
use proptest::prelude::*;
use proptest::strategy::ValueTree as _;
use proptest::test_runner::TestRunner;

/// Values that a fuzzer would make of these bytes.
pub fn arbitrary<T>(bytes: impl Strategy<Value = Vec<u8>>) -> impl Strategy<Value = T>
where
    T: for<'a> Arbitrary<'a> + Debug,
{
    bytes.prop_filter_map("too few bytes", |bytes| T::arbitrary(&mut Unstructured::new(&bytes)).ok())
}

/// Reads 5000 messages back, each in an arbitrary dialect. Returns the kinds of messages and dialects.
fn decoded<M: for<'a> Arbitrary<'a> + Copy + Debug + PartialEq>(
    in_dialect: impl Fn(M, Dialect) -> InDialect<M>,
    decode: impl Fn(Line<'_>, &Dialect) -> Result<M, DecodeError>,
    kind: impl Fn(&M) -> String,
) -> HashSet<String>
where
    InDialect<M>: Encode<Error = EncodeError>,
{
    let messages = arbitrary::<(Dialect, M)>(prop::collection::vec(any::<u8>(), 0..64));
    let (mut runner, mut kinds) = (TestRunner::deterministic(), HashSet::new());
    for _ in 0..5000 {
        let (dialect, message) = messages.new_tree(&mut runner).unwrap().current();
        let mut buffer = [0; 64];
        let length = in_dialect(message, dialect).encode(&mut buffer).unwrap();
        let (line, used) = Line::decode(&buffer[..length], &dialect).unwrap().unwrap();
        assert_eq!((decode(line, &dialect), used), (Ok(message), length));
        kinds.extend([kind(&message), format!("{dialect:?}")]);
    }
    kinds
}

/// Returns the kind of a pose, and the rough position of two of its axes: -1, 0 or 1 each.
fn place(pose: &AnyPose) -> String {
    let (kind, [first, last]) = match pose {
        AnyPose::Robot(pose) => ("robot", [pose.x.um(), pose.c.tenths_mrad()]),
        AnyPose::Platform(pose) => ("platform", pose.units()),
    };
    format!("{kind} {} {}", first / 500_000, last / 500_000)
}

/// Returns the name of a command, its words, and its rough values.
fn command<P>(command: &Command<P>, place: impl Fn(&P) -> String) -> String
where
    Command<P>: Debug,
{
    match command {
        Command::Override { percent } => format!("override {}", percent / 26),
        Command::Move { mode, pose } => format!("{mode:?} {}", place(pose)),
        Command::Acquire { .. } => "acquire".into(),
        Command::Grip { open, .. } => format!("grip {open}"),
        other => format!("{other:?}"),
    }
}

#[test]
fn any_bytes_are_a_command_that_decodes_to_itself() {
    let kinds = decoded(Command::<AnyPose>::in_dialect, Command::decode, |it| command(it, place));
    let (overrides, moves) = (4, 2 * 2 * 3 * 3);
    assert_eq!(kinds.len(), 128 + 4 + 2 + overrides + moves + 1 + 2, "{kinds:?}");
    let kinds =
        decoded(Command::<NoPose>::in_dialect, Command::decode, |it| command(it, |pose| match *pose {}));
    assert_eq!(kinds.len(), 128 + 4 + 2 + overrides + 1 + 2, "{kinds:?}");
}

#[test]
fn any_bytes_are_a_reply_that_decodes_to_itself() {
    let code = |error| match error {
        ErrorCode::Other(_) => "other".into(),
        error => format!("{error:?}"),
    };
    let kinds = decoded(Reply::<AnyPose>::in_dialect, Reply::decode, |reply| match reply {
        Reply::Ok => "ok".into(),
        Reply::Error { error } => format!("error {}", code(*error)),
        Reply::Status(status) => {
            let is_robot = matches!(status.pose, AnyPose::Robot(_));
            format!("{} {} {is_robot} {}", code(status.error), status.moving, status.percent / 51)
        }
    });
    assert_eq!(kinds.len(), 128 + 1 + 4 + 5 * 2 * 2 * 2, "{kinds:?}");
}
