//! The borders: exact lengths, buffers that are one byte short, values at the end of their range.

use isra_ball::robot_session::{Decoder as _, Encode as _};
use isra_ball::{DecodeError, Decoder, ENQ, EncodeError, Frame, Keys, Packet, Status};

const PACKET: Packet = Packet {
    sensor_type: 7,
    sensor: 5,
    status: Status::Old,
    force: [127, -128, 0],
    moment: [1, -1, 17],
    keys: Keys(0x81),
};
/// The same by hand: ID 1·111·0·101, the checksum makes the sum of 8, the data and itself 0 modulo 256.
const BYTES: [u8; 12] = [0x08, 0xF8, 0x5D, 0xF5, 0x7F, 0x80, 0x00, 0x01, 0xFF, 0x11, 0x81, 0x72];

#[test]
fn a_packet_fits_twelve_bytes_and_no_fewer() {
    assert_eq!((Packet::LEN, Frame::MAX_LEN, PACKET.encoded_len()), (12, 259, 12));
    let (frame, used) = Frame::decode(&BYTES).unwrap().unwrap();
    assert_eq!((frame.packet(), used, frame.encoded_len()), (Ok(PACKET), 12, 12));
    let mut out = [0; 12];
    let short = Err(EncodeError::BufferTooSmall { needed: 12, available: 11 });
    assert_eq!((PACKET.encode(&mut out[..11]), frame.encode(&mut out[..11])), (short, short));
    assert_eq!((PACKET.encode(&mut out), out), (Ok(12), BYTES));
    let mut again = [0; 12];
    assert_eq!((frame.encode(&mut again), again), (Ok(12), BYTES));
    for (room, expected) in
        [(11, Err(EncodeError::BufferTooSmall { needed: 12, available: 11 })), (12, Ok(())), (13, Ok(()))]
    {
        let mut buffer = [0; 13];
        assert_eq!(PACKET.append_to(&mut &mut buffer[..room]), expected, "{room}");
        assert_eq!(buffer[..12] == BYTES, expected.is_ok());
    }
}

#[test]
fn an_identity_of_more_than_three_bits_is_refused() {
    let packet = Packet { sensor_type: 8, ..PACKET };
    assert_eq!(packet.to_bytes(), Err(EncodeError::SensorType { found: 8 }));
    assert_eq!(packet.encode(&mut [0; 12]), Err(EncodeError::SensorType { found: 8 }));
    assert_eq!(ENQ, 5);
}

#[test]
fn a_packet_of_one_byte_is_found_after_noise() {
    // A length of 1 has a header whose bits the XOR turns off as well as on.
    let packet = [0x01, 0xFF, 0x54, 0xAA, 0x55];
    let frame = Frame::new(&[0xAA]).unwrap();
    assert_eq!((Frame::decode(&packet), frame.encoded_len()), (Ok(Some((frame, 5))), 5));
    assert_eq!(frame.encode(&mut [0; 300]), Err(EncodeError::Layout { expected: 8, found: 1 }));
    let wrong = DecodeError::Header { offset: 2, expected: 0x54, found: 0x55 };
    assert_eq!(Frame::decode(&[0x01, 0xFF, 0x55]), Err(wrong));
    let mut decoder = Decoder::default();
    assert_eq!((decoder.push(&[0xAA]), decoder.push(&packet)), (1, 5));
    assert_eq!(decoder.next_frame(), Some(Err(DecodeError::Noise { length: 1 })));
    assert_eq!(decoder.next_frame(), Some(Ok(Frame::new(&[0xAA]).unwrap())));
    assert_eq!(decoder.next_frame(), None);
    assert_eq!(decoder.position(), 6);
}

#[test]
fn to_push_nothing_ends_nothing_and_takes_back_no_end() {
    let mut decoder = Decoder::new();
    assert_eq!(decoder.push(&BYTES[..5]), 5);
    assert_eq!((decoder.push(&[]), decoder.next_frame()), (0, None));
    decoder.finish();
    assert_eq!(decoder.push(&[]), 0);
    assert_eq!(decoder.next_frame(), Some(Err(DecodeError::Incomplete { expected: 12, found: 5 })));
}

#[test]
fn noise_that_comes_byte_by_byte_is_given_as_soon_as_a_whole_piece_or_the_end_has_come() {
    let mut decoder = Decoder::new();
    for byte in 0..261 {
        assert_eq!((decoder.push(&[0xAA]), decoder.next_frame()), (1, None), "{byte}");
    }
    assert_eq!(decoder.push(&[0xAA]), 1);
    assert_eq!(decoder.next_frame(), Some(Err(DecodeError::Noise { length: 259 })));
    assert_eq!((decoder.push(&[0xAA]), decoder.next_frame()), (1, None));
    assert_eq!(decoder.push(&[0xAA]), 1);
    decoder.finish();
    assert_eq!(decoder.next_frame(), Some(Err(DecodeError::Noise { length: 5 })));
    assert_eq!(decoder.next_frame(), None);
}

#[test]
fn noise_as_long_as_one_error_can_cover_costs_no_packet_after_it() {
    for (length, size) in (250..=530).flat_map(|length| [1, 5, 64, 600].map(|size| (length, size))) {
        let mut decoder = Decoder::new();
        let stream = [&vec![0xAA; length][..], &BYTES].concat();
        let mut found = Vec::new();
        for mut piece in stream.chunks(size) {
            while !piece.is_empty() {
                piece = &piece[decoder.push(piece)..];
                while let Some(item) = decoder.next_frame() {
                    found.push(item.map(|frame| frame.packet()));
                }
            }
        }
        let whole = length.saturating_sub(1) / 259;
        let mut expected = vec![Err(DecodeError::Noise { length: 259 }); whole];
        expected.extend([Err(DecodeError::Noise { length: length - 259 * whole }), Ok(Ok(PACKET))]);
        assert_eq!(found, expected, "{length} in pieces of {size}");
    }
}

#[test]
fn a_key_that_is_down_twice_is_down() {
    assert_eq!(Keys::NONE.with(1).with(8).with(1), Keys(0x81));
    assert_eq!(Keys(0x81).with(9), Keys(0x81));
    assert_eq!(Keys(0x81).iter().collect::<Vec<_>>(), [1, 8]);
    assert_eq!([0, 1, 2, 8, 9].map(|key| Keys(0x81).is_down(key)), [false, true, false, true, false]);
}

#[test]
fn cleared_bytes_count_in_the_position_and_end_with_the_stream_before() {
    let mut decoder = Decoder::new();
    assert_eq!(decoder.push(&BYTES[..5]), 5);
    decoder.finish();
    decoder.clear();
    assert_eq!(decoder.next_frame(), None);
    assert_eq!(decoder.position(), 5);
    assert_eq!(decoder.push(&BYTES[..5]), 5);
    assert_eq!(decoder.next_frame(), None, "more bytes may come");
    assert_eq!(decoder.push(&BYTES[5..]), 7);
    assert_eq!(decoder.next_frame().unwrap().unwrap().packet(), Ok(PACKET));
    assert_eq!(decoder.position(), 17);
}
