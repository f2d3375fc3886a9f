//! Lines of unknown rate and format, as bits.

use serialport::{DataBits, Parity};
use testkit::uart::{Format, marked};

use super::*;

const FORMATS: [Mode; 6] = [
    Mode::EIGHT_N_ONE,
    mode(DataBits::Seven, Parity::Even),
    mode(DataBits::Seven, Parity::Odd),
    OTHER_MODES[0],
    OTHER_MODES[1],
    OTHER_MODES[2],
];

/// Adds the characters that a receiver with a setting reads from bytes.
fn hear(heard: &mut ReceivedBytes, from: Format, setting: Setting, bytes: &[u8]) {
    let odd = match setting.mode.parity {
        Parity::None => None,
        Parity::Even => Some(false),
        Parity::Odd => Some(true),
    };
    let data_bits = u8::from(setting.mode.data_bits);
    let to = Format { baud: setting.baud, data_bits, odd, stop_bits: 1 };
    heard.take(Duration::ZERO, &marked(&to.receive(&from.bits(bytes), from.baud)));
}

/// Returns the result of the search on a line on which these messages are sent, with pauses between them, and the number of
/// turns.
fn search(from: Format, messages: &[Vec<u8>]) -> (Vec<SettingScore>, usize) {
    let (mut search, mut listened, mut said) = (Search::default(), 0, messages.iter().cycle());
    while let Some(setting) = search.next(&|_| true).filter(|_| listened < 200) {
        listened += 1;
        let heard = search.listening(setting);
        heard.times += 1;
        // A turn is short: some messages, and sometimes no message.
        for _ in 0..listened % 5 {
            hear(heard, from, setting, said.next().unwrap());
        }
    }
    (search.judged(), listened)
}

fn lines() -> Vec<Vec<u8>> {
    (0..40)
        .map(|at| format!("$POSE,{at},{},{}\r\n", at * 37 % 1000, at * 7919 % 10_000).into_bytes())
        .collect()
}

fn binary() -> Vec<Vec<u8>> {
    let byte = |at: u32| u8::try_from(at.wrapping_mul(2_654_435_761) >> 24).unwrap();
    (0..40).map(|at| (0..20).map(|byte_at| byte(at * 20 + byte_at)).collect()).collect()
}

#[test]
fn every_rate_and_format_is_found_of_text_and_of_bytes() {
    let (mut found, mut all) = (0, 0);
    for baud in RATES {
        for mode in FORMATS {
            let odd = [None, Some(false), Some(true)][match mode.parity {
                Parity::None => 0,
                Parity::Even => 1,
                Parity::Odd => 2,
            }];
            for stop_bits in [1, 2] {
                let from = Format { baud, data_bits: u8::from(mode.data_bits), odd, stop_bits };
                for messages in [lines(), binary()] {
                    let (judged, listened) = search(from, &messages);
                    let likely: Vec<String> =
                        likely(&judged).iter().map(|it| it.setting.to_string()).collect();
                    let right = Setting { baud, mode };
                    assert!(likely.contains(&right.to_string()), "{right} {stop_bits}: {judged:#?}");
                    assert_eq!(judged[0].setting, right, "{stop_bits}: {judged:#?}");
                    assert!(listened < 200, "{right}: {listened}");
                    found += usize::from(likely.len() == 1);
                    all += 1;
                }
            }
        }
    }
    assert_eq!((found, all), (240, 240));
}

#[test]
fn a_silent_line_is_listened_to_with_every_rate_and_format() {
    let mut search = Search::default();
    let mut settings = Vec::new();
    for _ in 0..40 {
        let setting = search.next(&|_| true).unwrap();
        search.listening(setting).times += 1;
        settings.push(setting.to_string());
    }
    settings.sort();
    settings.dedup();
    assert_eq!(settings.len(), 40);
    assert!(search.judged().is_empty());
}

#[test]
fn marks_that_are_divided_are_read() {
    let mut heard = ReceivedBytes::default();
    for byte in [b'a', 0xFF, 0xFF, 0xFF, 0, b'b', b'c'] {
        heard.take(Duration::ZERO, &[byte]);
    }
    assert_eq!((heard.bytes.as_slice(), heard.broken, heard.count()), (&[b'a', 0xFF, b'c'][..], 1, 4));
}

#[test]
fn a_mode_is_written_as_it_is_given() {
    for text in ["8N1", "7E1", "8O2"] {
        assert_eq!(text.parse::<Mode>().unwrap().to_string(), text);
    }
    assert_eq!(
        Setting { baud: 9600, mode: mode(DataBits::Seven, Parity::Odd) }.to_string(),
        "9600 baud, 7O1"
    );
}
