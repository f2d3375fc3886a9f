//! Messages of the feature `arbitrary`: the encoder accepts each of them.

use std::collections::HashSet;

use arbitrary::Unstructured;
use fanuc_hmi_modbus::robot_session::Encode as _;
use fanuc_hmi_modbus::{
    Frame, Pdu, PduBuf, PositionRegister, Reply, Request, TelemetryBlock, WordOrder, function, limit,
};
use proptest::prelude::*;
use proptest::strategy::ValueTree as _;
use proptest::test_runner::TestRunner;

/// Returns the bytes of a fuzzer.
fn inputs(count: usize) -> impl Iterator<Item = Vec<u8>> {
    let (mut runner, bytes) = (TestRunner::deterministic(), prop::collection::vec(any::<u8>(), 0..300));
    (0..count).map(move |_| bytes.new_tree(&mut runner).unwrap().current())
}

fn wire(frame: &Frame<impl Pdu>) -> Vec<u8> {
    let mut wire = vec![0; frame.encoded_len()];
    assert_eq!(frame.encode(&mut wire), Ok(wire.len()));
    wire
}

fn decoded(wire: &[u8], is_tcp: bool) -> Frame<&[u8]> {
    if is_tcp { Frame::decode_tcp(wire).unwrap().unwrap().0 } else { Frame::decode_rtu_whole(wire).unwrap() }
}

#[test]
fn any_bytes_are_a_request_and_a_reply_that_decode_to_themselves() {
    let (mut requests, mut replies, mut exceptions, mut count) =
        (HashSet::new(), HashSet::new(), HashSet::new(), 0);
    for bytes in inputs(20_000) {
        if let Ok(frame) = Unstructured::new(&bytes).arbitrary::<Frame<Request<'_>>>() {
            assert_eq!(decoded(&wire(&frame), frame.transaction.is_some()).request(), Ok(frame));
            let (pdu, function) = (PduBuf::new(&frame.pdu).unwrap(), frame.pdu.function());
            let (half, quantity) = (pdu.as_bytes()[1..].first() >= Some(&0x80), frame.pdu.quantity_read());
            let values = (half, quantity.div_ceil(250), pdu.encoded_len() / 32);
            requests.insert((function, Some(values).filter(|_| function::is_typed(function))));
            count += 1;
        }
        if let Ok(frame) = Unstructured::new(&bytes).arbitrary::<Frame<Reply<'_>>>() {
            assert_eq!(decoded(&wire(&frame), frame.transaction.is_some()).reply(), Ok(frame));
            let (length, function) = (frame.pdu.encoded_len() / 32, frame.pdu.function());
            replies.insert(match frame.pdu {
                Reply::Exception { exception, .. } => {
                    exceptions.insert(u8::from(exception).clamp(1, 12));
                    (function, None)
                }
                _ => (function, Some(length).filter(|_| function::is_typed(function)).or(Some(99))),
            });
            count += 1;
        }
    }
    // Both halves of each table, of the subfunctions, or of the queues; every eighth of the bits that are read, or of the
    // length of the written data; the requests of functions 7, 11, 12, 17 and 43; one length of 20, and two of 21.
    let (bits, registers, single, written, other) = (2 * 8, 2, 2, 2 * 8, 108);
    assert_eq!(
        requests.len(),
        2 * bits + 2 * registers + 4 * single + 4 * written + 5 + 3 + other,
        "{requests:?}"
    );
    let (read, echo) = (8, 1);
    // A log and a queue have up to 72 bytes; those of function 21 that are not random have 15 and 222.
    let (status, log, files) = (2, 2 * 3, 6);
    assert_eq!(
        (replies.len(), exceptions.len()),
        (9 * read + 5 * echo + status + log + files + other + 127, 12),
        "{replies:?}"
    );
    assert!(count > 39_000, "{count} of 40000 inputs are long enough");
}

#[test]
fn the_data_of_a_function_without_a_type_fill_the_pdu() {
    let longest = (0..=255).map(|length| {
        let bytes = [&[19, 93, length][..], &[7; 300]].concat();
        let Ok(request @ Request::Other { function: 100, .. }) = Unstructured::new(&bytes).arbitrary() else {
            panic!("function 100, and a length")
        };
        PduBuf::new(&request).unwrap().encoded_len()
    });
    assert_eq!(longest.max(), Some(limit::PDU));
}

#[test]
fn any_bytes_are_values_that_registers_hold() {
    for bytes in inputs(2000) {
        let mut u = Unstructured::new(&bytes);
        let (block, position): (TelemetryBlock, PositionRegister) = u.arbitrary().unwrap();
        for order in [WordOrder::LowFirst, WordOrder::HighFirst] {
            let read = TelemetryBlock::from_registers(&block.to_registers(order), order);
            // A real that is not a number is not equal to itself.
            assert_eq!(format!("{read:?}"), format!("{block:?}"));
            let read = PositionRegister::from_registers(&position.to_registers(order), order);
            assert_eq!(format!("{read:?}"), format!("{position:?}"));
        }
    }
}
