//! The borders: exact lengths, buffers that are one byte short, values at the end of their range, each byte of the format.

use core::time::Duration;

use val2_viewer::robot_session::{Decoder as _, Encode as _};
use val2_viewer::{DecodeError, Decoder, ENQ, EncodeError, PosePacket, timing};

const POSE: [i16; 12] = [16384, 0, 0, 0, -16384, 0, 0, 0, -16384, 12800, -4816, 16];
const LINE: &[u8] = b"$POSE,7,16384,0,0,0,-16384,0,0,0,-16384,12800,-4816,16*30\r\n";
const LIMIT: usize = PosePacket::MAX_LEN;

fn decode(stream: &[u8]) -> Vec<(Result<PosePacket, DecodeError>, u64)> {
    let (mut decoder, mut items) = (Decoder::default(), Vec::new());
    assert_eq!(decoder.push(stream), stream.len());
    decoder.finish();
    while let Some(item) = decoder.next_frame() {
        items.push((item, decoder.position()));
    }
    items
}

#[test]
fn a_packet_is_a_line_of_text() {
    let packet = PosePacket { count: 7, pose: POSE };
    let mut out = [0; LIMIT];
    assert_eq!((packet.encode(&mut out), packet.encoded_len()), (Ok(LINE.len()), LINE.len()));
    assert_eq!(core::str::from_utf8(&out[..LINE.len()]), core::str::from_utf8(LINE));
    assert_eq!(PosePacket::decode(LINE), Ok(Some((packet, LINE.len()))));
    for end in 0..LINE.len() {
        assert_eq!(PosePacket::decode(&LINE[..end]), Ok(None));
        let short = EncodeError::BufferTooSmall { needed: LINE.len(), available: end };
        assert_eq!(packet.encode(&mut vec![0; end]), Err(short));
        let mut buffer = [0; 100];
        assert_eq!(packet.append_to(&mut &mut buffer[..end]), Err(short));
    }
    let mut appended = [0; LINE.len()];
    assert_eq!(packet.append_to(&mut &mut appended[..]), Ok(()), "room for the line and no more");
    assert_eq!(appended, LINE);
    assert_eq!(ENQ, 5);
}

#[test]
fn the_longest_line_is_full() {
    let longest = PosePacket { count: 65_535, pose: [-32_768; 12] };
    let mut out = [0; LIMIT];
    assert_eq!((LIMIT, longest.encode(&mut out)), (100, Ok(100)));
    assert_eq!(PosePacket::decode(&out), Ok(Some((longest, LIMIT))));
    assert_eq!(decode(&out), [(Ok(longest), 100)]);
}

#[test]
fn every_digit_of_a_number_and_of_the_sum_is_written_as_it_is_read() {
    let zeros = [0; 12];
    let round = [0, 1, 9, 10, 99, 100, 999, 1000, 9999, 10_000, -10, -10_000];
    for (count, pose, line) in [
        (78, zeros, "$POSE,78,0,0,0,0,0,0,0,0,0,0,0,0*2A\r\n"),
        (28, zeros, "$POSE,28,0,0,0,0,0,0,0,0,0,0,0,0*2F\r\n"),
        (10, zeros, "$POSE,10,0,0,0,0,0,0,0,0,0,0,0,0*24\r\n"),
        (0, round, "$POSE,0,0,1,9,10,99,100,999,1000,9999,10000,-10,-10000*24\r\n"),
    ] {
        let packet = PosePacket { count, pose };
        let mut out = [0; LIMIT];
        let length = packet.encode(&mut out).unwrap();
        assert_eq!(core::str::from_utf8(&out[..length]), Ok(line));
        assert_eq!(PosePacket::decode(line.as_bytes()), Ok(Some((packet, line.len()))));
    }
}

#[test]
fn what_is_no_packet_is_refused() {
    let cases: [(&[u8], DecodeError); 9] = [
        (b"POSE,7\r\n", DecodeError::Format { offset: 0 }),
        (b"$POSE,\r\n", DecodeError::Number { offset: 6 }),
        (b"$POSE,65536,1", DecodeError::Number { offset: 6 }),
        (b"$POSE,-1,1", DecodeError::Number { offset: 6 }),
        (b"$POSE,07,1", DecodeError::Number { offset: 6 }),
        (b"$POSE,7,32768,", DecodeError::Number { offset: 8 }),
        (b"$POSE,7,-0,", DecodeError::Number { offset: 8 }),
        (b"$POSE,7,1,2;", DecodeError::Format { offset: 11 }),
        (b"$POSE,7,0,0,0,0,0,0,0,0,0,0,0,0*2g", DecodeError::Format { offset: 33 }),
    ];
    for (line, error) in cases {
        let line = [line, b"\n"].concat();
        assert_eq!(PosePacket::decode(&line), Err(error), "{}", line.escape_ascii());
        assert!(error.is_line());
    }
    let mut line = LINE.to_vec();
    line[9] = b'7';
    assert_eq!(PosePacket::decode(&line), Err(DecodeError::Checksum { expected: 0x31, found: 0x30 }));
    assert_eq!(PosePacket::decode(&[b'$'; 200]), Err(DecodeError::TooLong { limit: LIMIT }));
    assert_eq!(PosePacket::decode(&[b'$'; LIMIT - 1]), Ok(None));
    let trailing = [&LINE[..LINE.len() - 1], b" \n"].concat();
    assert_eq!(PosePacket::decode(&trailing), Err(DecodeError::Format { offset: LINE.len() - 1 }));
}

#[test]
fn each_part_of_a_line_is_checked_in_its_place() {
    let mut line = [0; LIMIT];
    let packet = PosePacket { count: 65_535, pose: [-32_768; 12] };
    let length = packet.encode(&mut line).unwrap();
    let with = |at: usize, byte: u8| {
        let mut line = line;
        line[at] = byte;
        PosePacket::decode(&line)
    };
    let star = length - 5;
    assert_eq!(with(star, b'+'), Err(DecodeError::Format { offset: star }));
    assert_eq!(with(star + 1, b'g'), Err(DecodeError::Format { offset: star + 1 }));
    assert_eq!(with(star + 2, b'G'), Err(DecodeError::Format { offset: star + 2 }));
    assert_eq!(with(star + 3, b' '), Err(DecodeError::Format { offset: star + 3 }));
    assert_eq!(with(star + 4, b' '), Err(DecodeError::TooLong { limit: LIMIT }));
    assert_eq!(with(6, b'7'), Err(DecodeError::Number { offset: 6 }), "75535 packets");
}

/// Even if the sum is right: the packet has another meaning then, or none at all.
#[test]
fn no_byte_above_127_is_a_digit() {
    for byte in 0x80..=0xFF {
        let text = [b"POSE,1", &[byte][..], b",0,0,0,0,0,0,0,0,0,0,0,0"].concat();
        let sum = text.iter().fold(0, |sum, byte| sum ^ byte);
        let line = [b"$", &text[..], format!("*{sum:02X}\r\n").as_bytes()].concat();
        assert_eq!(PosePacket::decode(&line), Err(DecodeError::Format { offset: 7 }), "{byte:02X}");
    }
}

#[test]
fn a_byte_that_comes_alone_before_the_end_of_the_stream_is_of_the_last_item() {
    let mut decoder = Decoder::new();
    for byte in *b"POS" {
        assert_eq!((decoder.next_frame(), decoder.push(&[byte])), (None, 1));
    }
    decoder.finish();
    assert_eq!(decoder.push(b""), 0, "no byte, and the stream is still at its end");
    assert_eq!(decoder.next_frame(), Some(Err(DecodeError::Noise { length: 3 })));
    assert_eq!((decoder.next_frame(), decoder.position()), (None, 3));
}

#[test]
fn an_error_ends_where_a_line_may_begin() {
    let good = Ok(PosePacket { count: 7, pose: POSE });
    let with = |before: &[u8]| decode(&[before, LINE].concat());
    let length = LINE.len() as u64;
    assert_eq!(with(b""), [(good, length)]);
    assert_eq!(with(b"xy"), [(Err(DecodeError::Noise { length: 2 }), 2), (good, 2 + length)]);
    assert_eq!(with(b"$"), [(Err(DecodeError::Incomplete { length: 1 }), 1), (good, 1 + length)]);
    assert_eq!(with(b"\n"), [(Err(DecodeError::Format { offset: 0 }), 1), (good, 1 + length)]);
    let first = LINE.len();
    assert_eq!(
        with(&LINE[1..]),
        [(Err(DecodeError::Format { offset: 0 }), length - 1), (good, 2 * length - 1)]
    );
    assert_eq!(
        with(&LINE[..first - 1]),
        [(Err(DecodeError::Incomplete { length: first - 1 }), length - 1), (good, 2 * length - 1)]
    );
    assert_eq!(decode(&LINE[..9]), [(Err(DecodeError::Incomplete { length: 9 }), 9)]);
    assert_eq!(decode(b"POS"), [(Err(DecodeError::Noise { length: 3 }), 3)]);
    for (byte, error) in
        [(b'1', DecodeError::Noise { length: LIMIT }), (b'\r', DecodeError::Noise { length: LIMIT })]
    {
        let items = decode(&[byte; LIMIT + 1]);
        assert_eq!(items, [(Err(error), 100), (Err(DecodeError::Noise { length: 1 }), 101)]);
    }
    let mut long = [b'1'; LIMIT + 1];
    long[0] = b'$';
    let [too_long, noise] = [DecodeError::TooLong { limit: LIMIT }, DecodeError::Noise { length: 1 }];
    assert_eq!(decode(&long), [(Err(too_long), 100), (Err(noise), 101)]);
    assert!(too_long.is_line() && !noise.is_line() && !DecodeError::Incomplete { length: 1 }.is_line());
}

#[test]
fn a_full_decoder_takes_no_more_until_it_is_read() {
    let mut decoder = Decoder::new();
    assert_eq!(decoder.push(&[b'x'; 300]), 256);
    assert_eq!(decoder.push(b"x"), 0);
    assert_eq!(decoder.next_frame(), Some(Err(DecodeError::Noise { length: 100 })));
    assert_eq!(decoder.push(&[b'x'; 300]), 100);
    decoder.clear();
    assert_eq!((decoder.position(), decoder.next_frame()), (356, None));
    decoder.finish();
    assert_eq!(decoder.next_frame(), None);
}

#[test]
fn counts_show_how_many_packets_were_lost() {
    let packet = |count| PosePacket { count, pose: POSE };
    assert_eq!([1, 2, 3].map(|count| packet(count).lost_since(0)), [0, 1, 2]);
    assert_eq!([0, 1].map(|count| packet(count).lost_since(65_535)), [0, 1]);
}

#[test]
fn the_line_takes_as_long_as_its_rate_says() {
    assert_eq!(timing::exchange_time(timing::BAUD).as_micros(), 52_604);
    assert_eq!(timing::transmission_time(1, 10_000), Duration::from_millis(1));
    assert_eq!(timing::transmission_time(1, 0), Duration::MAX);
    assert!(timing::exchange_time(timing::BAUD) < timing::CYCLE);
}

#[test]
fn errors_read_as_a_sentence() {
    let texts = [
        DecodeError::Format { offset: 3 }.to_string(),
        DecodeError::Number { offset: 6 }.to_string(),
        DecodeError::Checksum { expected: 0x31, found: 0x30 }.to_string(),
        DecodeError::TooLong { limit: 100 }.to_string(),
        DecodeError::Incomplete { length: 9 }.to_string(),
        DecodeError::Noise { length: 2 }.to_string(),
        EncodeError::BufferTooSmall { needed: 59, available: 58 }.to_string(),
    ];
    assert_eq!(
        texts,
        [
            "byte 3 of the line does not match the format",
            "the number at byte 6 of the line is missing or out of range",
            "checksum is 0x30, the line gives 0x31",
            "line has more than 100 bytes",
            "line ends after 9 bytes",
            "2 bytes without a line",
            "output has room for 58 bytes, 59 are needed",
        ]
    );
}
