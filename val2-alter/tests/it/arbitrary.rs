//! Messages of the feature `arbitrary`: the encoder accepts each of them.
#![allow(unreachable_pub, reason = "a helper of several tests")]

use core::fmt::Debug;
use std::collections::HashSet;

use arbitrary::{Arbitrary, Unstructured};
use proptest::prelude::*;
use proptest::strategy::ValueTree as _;
use proptest::test_runner::TestRunner;
use val2_alter::{Exception, Frame, Framing, HostMessage, Message, RobotMessage, SegmentStatus};

/// Values that a fuzzer would make of these bytes.
pub fn arbitrary<T>(bytes: impl Strategy<Value = Vec<u8>>) -> impl Strategy<Value = T>
where
    T: for<'a> Arbitrary<'a> + Debug,
{
    bytes.prop_filter_map("too few bytes", |bytes| T::arbitrary(&mut Unstructured::new(&bytes)).ok())
}

/// Reads 5000 messages back, each in an arbitrary framing. Returns the kinds of messages and framings.
fn decoded<M: Message>(kinds_of: impl Fn(&M) -> [String; 2]) -> HashSet<String> {
    let messages = arbitrary::<(Framing, M)>(prop::collection::vec(any::<u8>(), 0..64));
    let (mut runner, mut kinds) = (TestRunner::deterministic(), HashSet::new());
    for _ in 0..5000 {
        let (framing, message) = messages.new_tree(&mut runner).unwrap().current();
        let mut wire = [0; Frame::MAX_LEN];
        let length = message.encode(framing, &mut wire).unwrap();
        assert_eq!(M::decode_frame(&wire[..length], framing), Ok(Some((message, length))));
        kinds.extend(kinds_of(&message));
        kinds.insert(format!("{framing:?}"));
    }
    kinds
}

#[test]
fn any_bytes_are_a_message_of_the_robot_that_decodes_to_itself() {
    let kinds = decoded(|message: &RobotMessage| match message {
        RobotMessage::Start(start) => {
            [format!("start {:?}", start.error), format!("{} words", start.data.words().len())]
        }
        RobotMessage::Motion(motion) => {
            let status = match motion.segment_status {
                SegmentStatus::Other(_) => "other".into(),
                status => format!("{status:?}"),
            };
            [format!("{:?} {:?} {}", motion.phase, motion.error, motion.transform.is_some()), status]
        }
        RobotMessage::End(end) => [format!("{end:?}"), "end".into()],
    });
    let (framings, starts, motions, ends) = (2 * 2 * 2 * 2, 8 + 15, 2 * 8 * 2 + 14, 8 + 1);
    assert_eq!(kinds.len(), framings + starts + motions + ends, "{kinds:?}");
}

#[test]
fn any_bytes_are_a_message_of_the_host_that_decodes_to_itself() {
    let kinds = decoded(|message: &HostMessage| match message {
        HostMessage::StartReply(code) => [format!("{code:?}"), "start".into()],
        HostMessage::Reply(reply) => {
            let exception = match reply.exception {
                Exception::Other(_) => "other".into(),
                exception => format!("{exception:?}"),
            };
            [format!("values {:06b}", reply.select()), exception]
        }
    });
    let (framings, starts, replies) = (2 * 2 * 2 * 2, 3 + 1, 64 + 4);
    assert_eq!(kinds.len(), framings + starts + replies, "{kinds:?}");
}
