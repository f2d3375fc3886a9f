//! Payloads and profiles of the feature `arbitrary`: the encoder accepts each of them.
#![allow(unreachable_pub, reason = "a helper of several tests")]

use std::collections::HashSet;

use arbitrary::{Arbitrary, Error, Unstructured};
use laser_eb90::robot_session::Encode as _;
use laser_eb90::{Frame, Instructions, Item, MAX_PAYLOAD, Payload, Profile, Words};
use proptest::prelude::*;
use proptest::strategy::ValueTree as _;
use proptest::test_runner::TestRunner;

/// Values that a fuzzer would make of these bytes.
pub fn arbitrary<T>(bytes: impl Strategy<Value = Vec<u8>>) -> impl Strategy<Value = T>
where
    T: for<'a> Arbitrary<'a> + core::fmt::Debug,
{
    bytes.prop_filter_map("too few bytes", |bytes| T::arbitrary(&mut Unstructured::new(&bytes)).ok())
}

#[test]
fn any_bytes_are_a_payload_that_decodes_to_itself() {
    let inputs = prop::collection::vec(any::<u8>(), 0..600);
    let (mut runner, mut kinds, mut commands) = (TestRunner::deterministic(), HashSet::new(), 0);
    for _ in 0..5000 {
        let input = inputs.new_tree(&mut runner).unwrap().current();
        let (mut u, mut buffer) = (Unstructured::new(&input), [0; MAX_PAYLOAD]);
        let profile = Profile::arbitrary(&mut u).unwrap();
        let payload = Payload::arbitrary(&mut u, &mut buffer, &profile).unwrap();
        let frame = payload.frame().unwrap();
        let mut wire = vec![0; frame.encoded_len()];
        assert_eq!(frame.encode(&mut wire), Ok(wire.len()));
        let mut unstuffed = [0; MAX_PAYLOAD];
        assert_eq!(Frame::decode(&wire, &mut unstuffed, &profile), Ok(Some((frame, wire.len()))));
        for item in frame.items() {
            kinds.insert(match item.unwrap() {
                Item::F32(values) => format!("{} floats", values.len().min(9)),
                Item::I16(values) => format!("{} shorts", values.len().min(9)),
                Item::U8(values) => format!("{} bytes", values.len().min(20)),
                Item::Char(values) => format!("{} characters", values.len().min(20)),
            });
        }
        let first = Instructions::new(frame.items()).next().unwrap();
        commands += usize::from(first.is_ok_and(|first| Words::default().class(first.word).is_some()));
        let Profile { tail, flag, checksum, checksum_negated, checksum_with_flag, byte_order, .. } = profile;
        kinds.insert(format!("{tail:?} {flag:?} {checksum:?} {checksum_negated}"));
        kinds.insert(format!("{byte_order:?} {checksum_with_flag}"));
        let tags = format!("{:?}", profile.tags);
        let is_usual = ["240", "241", "242", "243"].iter().all(|tag| tags.contains(tag));
        kinds.insert(if is_usual { tags } else { "other tags".into() });
    }
    let (profiles, items) = (3 * 2 * 3 * 2 + 2 * 2 + 24 + 1, 10 + 10 + 21 + 21);
    assert_eq!(kinds.len(), profiles + items, "{kinds:?}");
    assert!(commands > 3000, "{commands} of 5000 begin with a command word");
}

/// Where the bytes say so, or end.
#[test]
fn a_payload_ends_before_its_buffer() {
    for (input, words) in [(&[0xFF, 1, 0x23, 0, 0][..], 1), (&[0xFF, 1, 0x23, 0], 1), (&[], 1)] {
        let (mut u, mut buffer) = (Unstructured::new(input), [0; MAX_PAYLOAD]);
        let payload = Payload::arbitrary(&mut u, &mut buffer, &Profile::default()).unwrap();
        assert_eq!(payload.frame().unwrap().items().count(), words, "{input:?}");
    }
}

#[test]
fn a_buffer_without_space_for_an_item_has_no_payload() {
    for (length, expected) in [(3, None), (4, Some(4))] {
        let (mut u, mut buffer) = (Unstructured::new(&[1; 8]), [0; 4]);
        let payload = Payload::arbitrary(&mut u, &mut buffer[..length], &Profile::default());
        let written = payload.as_ref().ok().map(|payload| payload.as_bytes().len());
        assert_eq!(
            (written, payload.err()),
            (expected, expected.is_none().then_some(Error::IncorrectFormat))
        );
    }
}
