//! Every length of a payload and every place of a 90h in it, against loops over single bytes.

use laser_eb90::robot_session::Encode as _;
use laser_eb90::{DecodeError, Frame, MAX_PAYLOAD, Profile, Width};

const MAX_FRAME_LEN: usize = 256;

/// Returns a tag, and bytes none of which is 90h, and most of which weigh differently in the sum.
fn payload(length: usize) -> Vec<u8> {
    let bytes = (1..length).map(|at| 0x91 + u8::try_from(at * 37 % 0x6F).unwrap());
    [0xF2].into_iter().chain(bytes).collect()
}

/// Returns the frame of a payload, byte by byte, and its checksum.
fn frame(payload: &[u8]) -> (Vec<u8>, u16) {
    let (mut bytes, mut sum) = (vec![0xEB, 0x90, 0x82, 0xF0], 0);
    for byte in payload {
        bytes.push(*byte);
        if *byte == 0x90 {
            bytes.push(0x90);
        }
        sum += u16::from(*byte);
    }
    bytes.extend([0x90, 0x82]);
    bytes.extend(sum.to_le_bytes());
    (bytes, sum)
}

/// Checks that the frame is read, whatever comes after it, and written again; with any other checksum, or cut off, it
/// is not read.
fn is_read(payload: &[u8]) {
    let profile = Profile { checksum: Width::U16Le, ..Profile::default() };
    let mut buffer = [0; MAX_PAYLOAD];
    let (mut bytes, sum) = frame(payload);
    let length = bytes.len();
    assert_eq!(Frame::decode(&bytes[..length - 1], &mut buffer, &profile), Ok(None));
    for after in [0, 3, 100] {
        bytes.resize(length + after, 0xEB);
        let (frame, used) = Frame::decode(&bytes, &mut buffer, &profile).unwrap().unwrap();
        assert_eq!((frame.payload(), used), (payload, length));
        let mut out = [0; Frame::MAX_LEN];
        assert_eq!((frame.encoded_len(), frame.encode(&mut out)), (length, Ok(length)));
        assert_eq!(out[..length], bytes[..length]);
    }
    let found = sum ^ 0x0101;
    bytes[length - 2..length].copy_from_slice(&found.to_le_bytes());
    let error = DecodeError::Checksum { offset: length - 2, expected: sum, found };
    assert_eq!(Frame::decode(&bytes, &mut buffer, &profile), Err(error));
}

#[test]
fn a_payload_of_each_length_is_read() {
    (1..=MAX_FRAME_LEN).for_each(|length| is_read(&payload(length)));
}

#[test]
fn a_90h_at_each_place_is_read_and_the_byte_after_it_as_well() {
    for length in 2..=MAX_FRAME_LEN {
        for place in 1..length {
            let mut marked = payload(length);
            marked[place] = 0x90;
            is_read(&marked);
        }
    }
}

#[test]
fn a_90h_at_each_two_places_is_read() {
    for first in 1..48 {
        for second in first + 1..48 {
            let mut marked = payload(48);
            (marked[first], marked[second]) = (0x90, 0x90);
            is_read(&marked);
        }
    }
}

#[test]
fn a_90h_that_is_not_doubled_is_found_at_each_place() {
    for place in 1..MAX_FRAME_LEN {
        let (mut bytes, _) = frame(&payload(MAX_FRAME_LEN));
        bytes[4 + place] = 0x90;
        // The checksum is right.
        let sum: u16 = bytes[4..4 + MAX_FRAME_LEN].iter().map(|byte| u16::from(*byte)).sum();
        bytes[4 + MAX_FRAME_LEN + 2..].copy_from_slice(&sum.to_le_bytes());
        let error = DecodeError::Stuffing { offset: 5 + place, found: bytes[5 + place] };
        // The last one is followed by the mark of the tail: it is a doubled one, and the byte after them is one more.
        let expected = if place == MAX_FRAME_LEN - 1 { Ok(None) } else { Err(error) };
        assert_eq!(Frame::decode(&bytes, &mut [0; MAX_PAYLOAD], &Profile::default()), expected);
    }
}

#[test]
fn one_checksum_of_256_is_right() {
    for length in [1, 15, 16, 17, 63, 64, 65, 80, 128, 200] {
        let (mut bytes, sum) = frame(&payload(length));
        for found in 0..=0xFF {
            bytes[4 + length + 2] = found;
            let decoded = Frame::decode(&bytes, &mut [0; MAX_PAYLOAD], &Profile::default()).map(drop);
            let (offset, expected) = (4 + length + 2, sum & 0xFF);
            let error = DecodeError::Checksum { offset, expected, found: found.into() };
            assert_eq!(decoded, if u16::from(found) == expected { Ok(()) } else { Err(error) });
        }
    }
}

#[test]
fn without_a_90h_before_it_no_byte_ends_a_payload() {
    for (length, sum) in (1..=80).flat_map(|length| (0..=0xFF).map(move |sum| (length, sum))) {
        let mut payload = payload(length);
        payload.extend([1, 0x82, sum]);
        let (bytes, _) = frame(&payload);
        let mut buffer = [0; MAX_PAYLOAD];
        let (frame, used) = Frame::decode(&bytes, &mut buffer, &Profile::default()).unwrap().unwrap();
        assert_eq!((frame.payload(), used), (&payload[..], bytes.len() - 1));
    }
}
