//! Frames and corruption at the exact byte: the end of an error, its contents, and the effect of a silence.

use fanuc_hmi_modbus::crc::crc16;
use fanuc_hmi_modbus::robot_session::Decoder as _;
use fanuc_hmi_modbus::{DecodeError, Decoder, Exception, Frame, Framing, Side};

const RTU: Framing = Framing::RTU_OVER_TCP;
/// Read register 1 of unit 1.
const READ: [u8; 12] = [0, 1, 0, 0, 0, 6, 1, 3, 0, 0, 0, 1];

/// A PDU, or the error, and the offset after it.
type Items = Vec<(Result<Vec<u8>, DecodeError>, u64)>;

fn drain(decoder: &mut Decoder, items: &mut Items) {
    while let Some(item) = decoder.next_frame() {
        let item = item.map(|frame| frame.pdu.to_vec());
        items.push((item, decoder.position()));
    }
}

fn pieces<'a>(framing: Framing, side: Side, pieces: impl Iterator<Item = &'a [u8]>) -> Items {
    let (mut decoder, mut items) = (Decoder::new(framing, side), Vec::new());
    for mut piece in pieces {
        while !piece.is_empty() {
            piece = &piece[decoder.push(piece)..];
            drain(&mut decoder, &mut items);
        }
    }
    decoder.finish();
    drain(&mut decoder, &mut items);
    items
}

/// Pushes all of these bytes.
fn push(decoder: &mut Decoder, bytes: &[u8]) {
    assert_eq!(decoder.push(bytes), bytes.len());
}

/// Returns the items of a stream that ends; they are the same when it arrives byte by byte.
fn decode(framing: Framing, side: Side, stream: &[u8]) -> Items {
    let items = pieces(framing, side, [stream].into_iter());
    assert_eq!(pieces(framing, side, stream.chunks(1)), items);
    items
}

/// Returns an RTU frame around these bytes.
fn sealed(body: &[u8]) -> Vec<u8> {
    [body, &crc16(body).to_le_bytes()].concat()
}

fn pdu(frame: &[u8]) -> Result<Vec<u8>, DecodeError> {
    Ok(frame[1..frame.len() - 2].to_vec())
}

/// Within 520 bytes a TCP frame can begin in the last 16, which do not show its length yet; on a line in the last 255.
#[test]
fn an_error_covers_what_no_frame_can_begin_in_any_more() {
    let noise = |length| Err(DecodeError::Noise { length });
    let protocol = Err(DecodeError::Protocol { found: 0xFFFF });
    let tcp = |length| decode(Framing::Tcp, Side::Client, &vec![0xFF; length]);
    assert_eq!(tcp(519), [(protocol.clone(), 519)]);
    assert_eq!(tcp(520), [(protocol.clone(), 504), (noise(16), 520)]);
    assert_eq!(tcp(1500), [(protocol, 504), (noise(504), 1008), (noise(492), 1500)]);

    // Wherever a frame of 16 counted bytes begins, its CRC is wrong.
    let line = |length| decode(RTU, Side::Client, &vec![16; length]);
    let crc = Err(DecodeError::Crc { expected: 0x463A, found: 0x1010, length: 25 });
    assert_eq!(line(519), [(crc.clone(), 519)]);
    assert_eq!(line(520), [(crc.clone(), 265), (noise(255), 520)]);
    let items = [(crc, 265), (noise(265), 530), (noise(265), 795), (noise(265), 1060), (noise(440), 1500)];
    assert_eq!(line(1500), items);
}

#[test]
fn an_error_of_520_bytes_is_given_with_the_last_of_them() {
    let mut decoder = Decoder::new(Framing::Tcp, Side::Client);
    let mut items = Items::new();
    push(&mut decoder, &READ);
    for length in 0..=520 {
        drain(&mut decoder, &mut items);
        assert_eq!(items.len(), if length < 520 { 1 } else { 2 }, "{length}");
        push(&mut decoder, &[0xFF]);
    }
}

#[test]
fn no_empty_error_is_between_a_long_one_and_the_frame_after_it() {
    // The header whose message shows its length last: at the end of the first error it is not known.
    let write = [0, 1, 0, 0, 0, 13, 1, 23, 0, 0, 0, 1, 0, 0, 0, 1, 2, 0xAB, 0xCD];
    let stream = [&[0xFF; 504][..], &write].concat();
    let protocol = Err(DecodeError::Protocol { found: 0xFFFF });
    assert_eq!(
        decode(Framing::Tcp, Side::Client, &stream),
        [(protocol, 504), (Ok(write[7..].to_vec()), 523)]
    );

    // The longest frame of a line: one byte more than there is after the first error.
    let longest = sealed(&[&[1, 16, 0, 0, 0, 4, 247][..], &[0; 247]].concat());
    let stream = [&[16; 265][..], &longest].concat();
    let crc = Err(DecodeError::Crc { expected: 0x463A, found: 0x1010, length: 25 });
    assert_eq!(decode(RTU, Side::Client, &stream), [(crc, 265), (pdu(&longest), 521)]);
}

#[test]
fn a_frame_of_another_protocol_hides_what_is_within_it() {
    let mut foreign = vec![0, 1, 0, 1, 0, 20, 1, 3];
    foreign.extend(READ);
    foreign.extend([9; 6]);
    let (read, protocol) = (Ok(READ[7..].to_vec()), Err(DecodeError::Protocol { found: 1 }));
    let stream = [&foreign[..], &READ].concat();
    assert_eq!(decode(Framing::Tcp, Side::Client, &stream), [(protocol.clone(), 26), (read.clone(), 38)]);
    let stream = [&READ, &foreign[..], &READ].concat();
    assert_eq!(decode(Framing::Tcp, Side::Client, &stream), [(read.clone(), 12), (protocol, 38), (read, 50)]);
}

/// The error is returned with its sixth byte, however the bytes come.
#[test]
fn a_header_right_after_a_frame_of_another_protocol_ends_its_error() {
    let stream = [&[0, 1, 0, 1, 0, 6, 1, 3, 0, 0, 0, 37][..], &READ[..6]].concat();
    for size in [1, 5, stream.len()] {
        let mut decoder = Decoder::new(Framing::Tcp, Side::Client);
        let mut errors = Vec::new();
        for piece in stream.chunks(size) {
            assert_eq!(decoder.push(piece), piece.len());
            errors.extend(decoder.next_frame().map(|frame| frame.map(drop)));
        }
        assert_eq!((errors, decoder.position()), (vec![Err(DecodeError::Protocol { found: 1 })], 12));
    }
}

/// The header that begins within the first frame has another length than the message after it.
#[test]
fn a_length_that_no_frame_has_costs_its_own_frame_alone() {
    let corrupt = [0, 1, 0, 0, 1, 6, 1, 3, 0, 0, 0, 37];
    let stream = [&corrupt, &READ[..], &READ].concat();
    let (read, error) = (Ok(READ[7..].to_vec()), Err(DecodeError::MbapLength { found: 262 }));
    assert_eq!(decode(Framing::Tcp, Side::Client, &stream), [(error, 12), (read.clone(), 24), (read, 36)]);
}

#[test]
fn a_frame_that_its_connection_cuts_hides_what_is_within_it() {
    let frame = [&[0, 2, 0, 0, 0, 40, 1, 16, 0, 0][..], &READ].concat();
    let cut = Err(DecodeError::Cut { expected: 46, found: 22 });
    assert_eq!(decode(Framing::Tcp, Side::Client, &frame), [(cut.clone(), 22)]);
    let stream = [&READ[..], &frame].concat();
    assert_eq!(decode(Framing::Tcp, Side::Client, &stream), [(Ok(READ[7..].to_vec()), 12), (cut, 34)]);
}

#[test]
fn a_connection_that_ends_within_a_frame_says_so_and_a_reset_forgets_it() {
    for cut in 1..READ.len() {
        let error = DecodeError::Cut { expected: if cut < 6 { 7 } else { 12 }, found: cut };
        assert_eq!(decode(Framing::Tcp, Side::Client, &READ[..cut]), [(Err(error), cut as u64)]);

        let mut decoder = Decoder::new(Framing::Tcp, Side::Client);
        push(&mut decoder, &READ[..cut]);
        assert_eq!(decoder.next_frame(), None);
        decoder.clear();
        assert_eq!(decoder.position(), cut as u64, "what it discards counts");
        push(&mut decoder, &READ);
        assert_eq!(decoder.next_frame().unwrap().unwrap().pdu, &READ[7..]);
    }
}

#[test]
fn corruption_is_known_at_once() {
    let mut decoder = Decoder::new(Framing::Tcp, Side::Server);
    push(&mut decoder, &[0, 1, 0, 0, 0xFF, 0xFF]);
    assert_eq!(decoder.next_frame(), None);
    assert_eq!(decoder.corruption(), Some(DecodeError::MbapLength { found: 0xFFFF }));
}

#[test]
fn two_silences_may_come_before_the_frames_are_drained() {
    let mut decoder = Decoder::new(RTU, Side::Client);
    for _ in 0..3 {
        push(&mut decoder, &[0x55]);
        decoder.finish();
        push(&mut decoder, &sealed(&[1, 65, 7]));
        assert_eq!(decoder.pending(), 6);
        decoder.finish();
        assert_eq!(decoder.next_frame(), Some(Err(DecodeError::Cut { expected: 4, found: 1 })));
        assert_eq!(decoder.next_frame().unwrap().unwrap().pdu, [65, 7]);
        assert_eq!(decoder.next_frame(), None);
        assert_eq!(decoder.pending(), 0);
    }
}

#[test]
fn a_frame_after_corruption_is_there_with_its_last_byte() {
    let read = sealed(&[1, 3, 0, 0, 0, 1]);
    for (framing, frame) in [(Framing::Tcp, &READ[..]), (RTU, &read)] {
        for noise in 8..100 {
            let mut decoder = Decoder::new(framing, Side::Client);
            let mut items = Items::new();
            for byte in [&vec![1; noise][..], frame].concat() {
                assert!(items.len() < 2);
                push(&mut decoder, &[byte]);
                drain(&mut decoder, &mut items);
            }
            let whole = (noise + frame.len()) as u64;
            assert_eq!(items.last().map(|(item, end)| (item.is_ok(), *end)), Some((true, whole)), "{noise}");
        }
    }
}

#[test]
fn an_endless_stream_of_noise_is_tiled_by_errors() {
    for (framing, byte) in [(Framing::Tcp, 0xFF), (RTU, 0x10)] {
        let items = decode(framing, Side::Client, &[byte; 5000]);
        assert!(items.iter().all(|(item, _)| item.is_err()));
        assert!(items.len() < 30, "{items:?}");
        assert_eq!(items.last().unwrap().1, 5000);
    }
}

#[test]
fn a_frame_that_a_silence_cuts_says_how_long_it_would_be() {
    use Side::{Client, Server};
    for (side, bytes, expected) in [
        (Client, &[1][..], 4),
        (Client, &[1, 3, 0], 8),
        (Client, &[1, 15], 9),
        (Client, &[1, 16, 0, 0, 0, 1], 9),
        (Client, &[1, 16, 0, 0, 0, 1, 2], 11),
        (Client, &[1, 22], 10),
        (Client, &[1, 23], 13),
        (Client, &[1, 23, 0, 0, 0, 1, 0, 0, 0, 1, 2], 15),
        (Server, &[1], 4),
        (Server, &[1, 3], 5),
        (Server, &[1, 3, 4], 9),
        (Server, &[1, 5], 8),
        (Server, &[1, 16], 8),
        (Server, &[1, 22], 10),
        (Server, &[1, 23], 5),
        (Server, &[1, 23, 2, 0, 0], 7),
        (Server, &[1, 0x83], 5),
    ] {
        let cut = DecodeError::Cut { expected, found: bytes.len() };
        assert_eq!(decode(RTU, side, bytes), [(Err(cut), bytes.len() as u64)], "{side:?} {bytes:x?}");
        // A frame after the silence is another one.
        let mut decoder = Decoder::new(RTU, side);
        push(&mut decoder, bytes);
        decoder.finish();
        push(&mut decoder, &sealed(&[1, 22, 0, 4, 0, 0xF2, 0, 0x25]));
        assert_eq!(decoder.next_frame(), Some(Err(cut)));
        assert_eq!(decoder.next_frame().unwrap().unwrap().pdu, [22, 0, 4, 0, 0xF2, 0, 0x25]);
    }
}

#[test]
fn a_frame_that_is_whole_when_the_silence_is_told_is_not_cut() {
    let frame = sealed(&[1, 3, 0, 0, 0, 1]);
    let mut decoder = Decoder::new(RTU, Side::Client);
    push(&mut decoder, &frame);
    // Given twice, it is one silence.
    decoder.finish();
    decoder.finish();
    assert_eq!(decoder.next_frame().unwrap().unwrap().pdu, [3, 0, 0, 0, 1]);
    assert_eq!(decoder.next_frame(), None);
    push(&mut decoder, &frame[..5]);
    assert_eq!(decoder.next_frame(), None);
    assert_eq!(decoder.pending(), 5);
    push(&mut decoder, &frame[5..]);
    assert_eq!(decoder.next_frame().unwrap().unwrap().pdu, [3, 0, 0, 0, 1]);
    assert_eq!(decoder.next_frame(), None);
    assert_eq!((decoder.pending(), decoder.position()), (0, 16));
}

#[test]
fn the_frame_after_corruption_is_the_first_to_end_and_the_longest_of_those() {
    // Four registers are written, of which the last three and the CRC are a read of unit 2, and its CRC as well.
    let frame = [1, 16, 0, 0, 0, 4, 8, 0x5D, 0x43, 2, 3, 0, 0, 0, 1, 0x84, 0x39];
    let read = &frame[9..];
    let stream = [&[0x55][..], &frame, read].concat();
    let items = decode(RTU, Side::Client, &stream);
    assert!(matches!(items[0], (Err(DecodeError::Crc { length: 8, .. }), 1)), "{items:?}");
    assert_eq!(items[1..], [(pdu(&frame), 18), (pdu(read), 26)]);
}

#[test]
fn a_line_carries_frames_of_256_bytes_and_no_longer_ones() {
    // A function without a type of its own ends with the silence.
    let own = sealed(&[&[1, 100][..], &[0; 252]].concat());
    assert_eq!(decode(RTU, Side::Client, &own), [(pdu(&own), 256)]);
    let long = sealed(&[&[1, 100][..], &[0; 253]].concat());
    let too_long = |found| DecodeError::TooLong { found };
    assert_eq!(decode(RTU, Side::Client, &long), [(Err(too_long(257)), 257)]);
    let mut decoder = Decoder::new(RTU, Side::Client);
    push(&mut decoder, &long);
    assert_eq!(decoder.next_frame(), None);
    assert_eq!(decoder.corruption(), Some(too_long(257)));
    assert_eq!(Frame::decode_rtu(&long[..256], Side::Client), Ok(None));
    assert_eq!(Frame::decode_rtu(&long, Side::Client), Err(too_long(257)));
    assert_eq!(Frame::decode_rtu(&[100; 300], Side::Client), Err(too_long(257)), "however many there are");

    // One with a byte count is known to be too long when that is there.
    let counted = sealed(&[&[1, 16, 0, 0, 0, 4, 247][..], &[0; 247]].concat());
    let (frame, used) = Frame::decode_rtu(&counted, Side::Client).unwrap().unwrap();
    assert_eq!((frame.pdu, used), (&counted[1..254], 256));
    for (count, length) in [(248, 257), (249, 258), (255, 264)] {
        let head = [1, 16, 0, 0, 0, 4, count];
        assert_eq!(Frame::decode_rtu(&head, Side::Client), Err(too_long(length)));
    }
    for length in [257, 258, 300] {
        assert_eq!(Frame::decode_rtu_whole(&vec![0; length]), Err(too_long(length)));
    }
}

/// 128 is the exception to function 0, which does not exist: nothing shows the length of such a reply.
#[test]
fn a_reply_with_function_code_128_ends_with_the_silence() {
    for body in [&[1, 128][..], &[1, 128, 2], &[1, 128, 2, 3, 4]] {
        let frame = sealed(body);
        assert_eq!(decode(RTU, Side::Server, &frame), [(pdu(&frame), frame.len() as u64)]);
        let frame = Frame::decode_rtu_whole(&frame).unwrap();
        assert_eq!(frame.reply().unwrap_err(), DecodeError::Function { found: 128 });
    }
}

#[test]
fn a_full_decoder_takes_nothing_until_a_frame_is_drained() {
    let stream = READ.repeat(100);
    let mut decoder = Decoder::new(Framing::Tcp, Side::Client);
    assert_eq!(decoder.push(&stream), 1024);
    assert_eq!((decoder.push(&stream[1024..]), decoder.pending()), (0, 1024));
    assert!(decoder.next_frame().unwrap().is_ok());
    assert_eq!((decoder.pending(), decoder.position()), (1012, 12));
    assert_eq!(decoder.push(&stream[1024..]), 12);
    assert_eq!((decoder.push(&[7]), decoder.pending(), decoder.position()), (0, 1024, 12));
    let mut items = Vec::new();
    drain(&mut decoder, &mut items);
    assert!(items.iter().all(|(item, _)| item.is_ok()));
    assert_eq!((items.len(), decoder.pending(), decoder.position()), (85, 4, 1032));
}

/// The frame of a reply to transaction 2.
const NEXT: [u8; 11] = [0, 2, 0, 0, 0, 5, 1, 3, 2, 0, 7];

fn of_server(stream: &[u8]) -> Items {
    let items = decode(Framing::Tcp, Side::Server, stream);
    for at in 1..stream.len() {
        let halves = [&stream[..at], &stream[at..]];
        assert_eq!(pieces(Framing::Tcp, Side::Server, halves.into_iter()), items, "{at}");
    }
    items
}

/// FM-89: an exception has two bytes of PDU, regardless of its header.
#[test]
fn an_exception_with_a_wrong_length_is_one_frame_and_costs_no_other() {
    let wrong = |found| {
        let exception = Exception::IllegalDataAddress;
        DecodeError::ExceptionLength { transaction: 1, unit: 9, function: 3, exception, expected: 3, found }
    };
    for length in [4, 5, 6, 20, 254] {
        let exception = [0, 1, 0, 0, 0, length, 9, 0x83, 2];
        let mut decoder = Decoder::new(Framing::Tcp, Side::Server);
        push(&mut decoder, &exception);
        assert_eq!(decoder.next_frame(), Some(Err(wrong(length.into()))), "without a tenth byte");
        assert_eq!((decoder.position(), decoder.corruption()), (9, None));

        let next = (Ok(NEXT[7..].to_vec()), 20);
        let stream = [&exception[..], &NEXT].concat();
        assert_eq!(of_server(&stream), [(Err(wrong(length.into())), 9), next]);
        for more in 1..=usize::from(length) - 3 {
            let stream = [&exception[..], &vec![0; more], &NEXT].concat();
            let noise = (Err(DecodeError::Noise { length: more }), 9 + more as u64);
            let next = (Ok(NEXT[7..].to_vec()), 20 + more as u64);
            let items = if more < 6 || length == 20 {
                of_server(&stream)
            } else {
                decode(Framing::Tcp, Side::Server, &stream)
            };
            assert_eq!(items, [(Err(wrong(length.into())), 9), noise, next], "{length}, {more} bytes more");
        }
    }
    assert_eq!(
        wrong(4).to_string(),
        "exception 2 (illegal data address) for function 3 with the length field 4, not 3 (at byte 4)"
    );
    // A function without a shape may have longer exceptions, and a client sends none.
    let raw = [0, 1, 0, 0, 0, 4, 9, 0xC1, 2, 0];
    assert_eq!(of_server(&raw), [(Ok(vec![0xC1, 2, 0]), 10)]);
    let request = [0, 1, 0, 0, 0, 4, 9, 0x83, 2, 0];
    assert_eq!(decode(Framing::Tcp, Side::Client, &request), [(Ok(vec![0x83, 2, 0]), 10)]);
}

#[test]
fn an_exception_without_its_code_is_one_frame_whether_the_code_comes_or_not() {
    let exception = [0, 1, 0, 0, 0, 2, 9, 0x83];
    let alone = [&exception[..], &NEXT].concat();
    assert_eq!(of_server(&alone), [(Ok(vec![0x83]), 8), (Ok(NEXT[7..].to_vec()), 19)]);
    let with_code = [&exception[..], &[2], &NEXT].concat();
    let noise = (Err(DecodeError::Noise { length: 1 }), 9);
    assert_eq!(of_server(&with_code), [(Ok(vec![0x83]), 8), noise, (Ok(NEXT[7..].to_vec()), 20)]);
}

/// The bytes that an exception may have in addition are examined, and no more.
#[test]
fn behind_an_exception_with_a_wrong_length_a_bad_header_is_one() {
    let stream = [&[0, 1, 0, 0, 0, 5, 9, 0x83, 2][..], b"GET / HTTP", &NEXT].concat();
    let items = of_server(&stream);
    assert_eq!(items[1], (Err(DecodeError::Noise { length: 2 }), 11));
    assert_eq!(items[2], (Err(DecodeError::Protocol { found: 0x2F20 }), 19));
    assert_eq!(items[3], (Ok(NEXT[7..].to_vec()), 30));
}
