//! The bits of a serial line, as formats send and receive them.

use testkit::uart::{Format, Received, marked};

const N: Format = Format { baud: 9600, data_bits: 8, odd: None, stop_bits: 1 };
const E: Format = Format { odd: Some(false), ..N };

fn through(from: Format, to: Format, bytes: &[u8]) -> Vec<(u8, bool)> {
    let received = to.receive(&from.bits(bytes), from.baud);
    received.into_iter().map(|it| (it.byte, it.is_broken)).collect()
}

#[test]
fn every_format_reads_what_it_writes() {
    let bytes: Vec<u8> = (0..=255).collect();
    for odd in [None, Some(false), Some(true)] {
        for (data_bits, baud) in [(8, 300), (8, 115_200), (7, 9600)] {
            let format = Format { baud, data_bits, odd, stop_bits: 2 };
            let sent: Vec<u8> = bytes.iter().map(|byte| byte & (0xFF >> (8 - data_bits))).collect();
            let whole: Vec<(u8, bool)> = sent.iter().map(|byte| (*byte, false)).collect();
            assert_eq!(through(format, format, &sent), whole, "{format:?}");
            // A receiver looks at one stop bit.
            assert_eq!(through(format, Format { stop_bits: 1, ..format }, &sent), whole);
        }
    }
}

#[test]
fn another_rate_reads_other_bytes() {
    // The start bit and the first data bit are one low bit of half the rate.
    assert_eq!(through(N, Format { baud: 4800, ..N }, &[0xFE]), [(0xFF, false)]);
    // Start, then each data bit twice from the start bit on: 0, 1 1, 0 0, 1 1, and the next bit, low, where a stop bit is due.
    assert_eq!(through(N, Format { baud: 19_200, ..N }, &[0x55]).first(), Some(&(0x66, true)));
}

#[test]
fn a_parity_bit_is_a_stop_bit_to_who_expects_none() {
    // An even number of ones: the parity bit is low.
    assert_eq!(through(E, N, &[0x03]).first(), Some(&(0x03, true)));
    assert_eq!(through(E, N, &[0x07]), [(0x07, false)]);
    assert_eq!(through(N, E, &[0x03]), [(0x03, true)]);
    let seven = Format { data_bits: 7, ..E };
    assert_eq!(through(seven, N, b"AC"), [(b'A', false), (b'C' | 0x80, false)]);
    assert_eq!(through(seven, Format { odd: Some(true), ..seven }, b"A"), [(b'A', true)]);
}

#[test]
fn errors_are_marked_as_termios_says() {
    let received = |byte, is_broken| Received { byte, is_broken };
    assert_eq!(
        marked(&[received(1, false), received(0xFF, false), received(2, true)]),
        [1, 0xFF, 0xFF, 0xFF, 0, 2]
    );
}
