//! Packets of the feature `arbitrary`: the encoder accepts each of them.
#![allow(unreachable_pub, reason = "a helper of several tests")]

use std::collections::HashSet;

use arbitrary::{Arbitrary, Unstructured};
use isra_ball::{Frame, Packet};
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
fn any_bytes_are_a_packet_that_decodes_to_itself() {
    let packets = arbitrary::<Packet>(prop::collection::vec(any::<u8>(), 0..32));
    let (mut runner, mut kinds) = (TestRunner::deterministic(), HashSet::new());
    for _ in 0..5000 {
        let packet = packets.new_tree(&mut runner).unwrap().current();
        let bytes = packet.to_bytes().unwrap();
        let (frame, used) = Frame::decode(&bytes).unwrap().unwrap();
        assert_eq!((frame.packet(), used), (Ok(packet), Packet::LEN));
        kinds.insert((packet.status, packet.sensor_type, packet.sensor));
    }
    assert_eq!(kinds.len(), 4 * 8 * 8, "every status, type and number");
}
