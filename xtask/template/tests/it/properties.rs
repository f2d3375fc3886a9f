//! Properties of every message and every stream.

use arbitrary::Unstructured;
use proptest::prelude::*;
use toy_link::robot_session::{Decoder as _, Encode as _};
use toy_link::{DecodeError, Decoder, EncodeError, Message};

fn messages() -> impl Strategy<Value = Message> {
    let bytes = prop::collection::vec(any::<u8>(), 0..12);
    bytes.prop_filter_map("too few bytes", |bytes| Unstructured::new(&bytes).arbitrary().ok())
}

fn written(message: Message) -> Vec<u8> {
    let mut line = vec![0; message.encoded_len()];
    assert_eq!(message.encode(&mut line), Ok(line.len()));
    line
}

proptest! {
    #[test]
    fn what_is_written_is_read_back(message in messages()) {
        let line = written(message);
        prop_assert!(line.len() <= Message::MAX_LEN);
        prop_assert_eq!(line.last(), Some(&b'\n'));
        prop_assert_eq!(Message::decode(&line[..line.len() - 1]), Ok(message));
        let mut appended = Vec::new();
        message.append_to(&mut appended).unwrap();
        prop_assert_eq!(&appended, &line);
        let (needed, mut short) = (line.len(), vec![0; line.len() - 1]);
        let error = EncodeError::BufferTooSmall { needed, available: needed - 1 };
        prop_assert_eq!(message.encode(&mut short), Err(error));
    }

    #[test]
    fn what_is_read_is_written_in_the_same_bytes(line in "[GV]?-?[0-9]{0,4}=?-?[0-9]{0,11}") {
        if let Ok(message) = Message::decode(line.as_bytes()) {
            prop_assert_eq!(written(message), [line.as_bytes(), b"\n"].concat());
        }
    }
}

#[test]
fn corrupt_lines_cost_themselves_alone() {
    let mut decoder = Decoder::new();
    let stream = b"G1\nG256\nV2=0-1\nV2\nX\nV2=-0\nG0000000000000000000\nG3\nG4";
    let mut rest = &stream[..];
    let mut items = Vec::new();
    while !rest.is_empty() {
        rest = &rest[decoder.push(rest)..];
        items.extend(core::iter::from_fn(|| decoder.next_frame()));
    }
    decoder.finish();
    items.extend(core::iter::from_fn(|| decoder.next_frame()));
    let expected = [
        Ok(Message::Get { register: 1 }),
        Err(DecodeError::Number { offset: 1 }),
        Err(DecodeError::Number { offset: 3 }),
        Err(DecodeError::Separator),
        Err(DecodeError::Letter { found: b'X' }),
        Err(DecodeError::Number { offset: 3 }),
        Err(DecodeError::TooLong { length: 17 }),
        Err(DecodeError::Letter { found: b'0' }),
        Ok(Message::Get { register: 3 }),
        Err(DecodeError::Incomplete { length: 2 }),
    ];
    assert_eq!(items, expected);
    assert_eq!(decoder.position(), stream.len() as u64);
}
