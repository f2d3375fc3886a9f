//! Packets of the feature `arbitrary`: the encoder accepts each of them.
#![allow(unreachable_pub, reason = "a helper of several tests")]

use std::collections::HashSet;

use arbitrary::{Arbitrary, Unstructured};
use proptest::prelude::*;
use proptest::strategy::ValueTree as _;
use proptest::test_runner::TestRunner;
use val2_viewer::PosePacket;
use val2_viewer::robot_session::Encode as _;

/// Values that a fuzzer would make of these bytes.
pub fn arbitrary<T>(bytes: impl Strategy<Value = Vec<u8>>) -> impl Strategy<Value = T>
where
    T: for<'a> Arbitrary<'a> + core::fmt::Debug,
{
    bytes.prop_filter_map("too few bytes", |bytes| T::arbitrary(&mut Unstructured::new(&bytes)).ok())
}

#[test]
fn any_bytes_are_a_packet_that_decodes_to_itself() {
    let packets = arbitrary::<PosePacket>(prop::collection::vec(any::<u8>(), 0..40));
    let (mut runner, mut lengths) = (TestRunner::deterministic(), HashSet::new());
    for _ in 0..5000 {
        let packet = packets.new_tree(&mut runner).unwrap().current();
        let mut line = [0; PosePacket::MAX_LEN];
        let length = packet.encode(&mut line).unwrap();
        assert_eq!(PosePacket::decode(&line[..length]), Ok(Some((packet, length))));
        lengths.insert(length);
    }
    assert!(lengths.len() > 40, "numbers of one to five digits, with a sign or not: {lengths:?}");
}
