//! The limits of the layout of a job, of a text and of a number.

use kawasaki_msg::robot_session::Session;
use kawasaki_msg::{
    Bounds, Charset, ConfigError, Decimal, Dialect, EncodeError, FieldError, FieldFault, FieldVisitor, Job,
    LargePc, Limits, Line, Message, MessageError, Name, Pc, PcConfig, Point, Robot, RobotConfig, Supply,
    Text, Unfit, Work, Writer,
};

/// Two texts, of the lengths in its ranges.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct Texts {
    first: [Text<255>; 3],
    last: Text<300>,
}

impl Work for Texts {
    /// The last one's length.
    type Ranges = Lengths;

    fn fields<F: FieldVisitor>(&mut self, lengths: &Lengths, fields: &mut F) -> Result<(), Unfit> {
        for text in &mut self.first {
            fields.text("first", text, 0..=lengths.first)?;
        }
        fields.text("last", &mut self.last, lengths.least..=lengths.most)
    }
}

#[derive(Debug, Clone, Copy, Default)]
struct Lengths {
    first: usize,
    least: usize,
    most: usize,
}

fn refused(first: usize, least: usize, most: usize) -> Option<ConfigError> {
    let ranges = Lengths { first, least, most };
    LargePc::<fn(u32) -> Supply<Texts>>::with_ranges(PcConfig::tcp(), ranges).err()
}

#[test]
fn a_range_of_one_length_is_not_empty_and_the_longest_job_has_960_bytes() {
    assert_eq!(refused(3, 3, 3), None);
    assert_eq!(refused(3, 4, 3), Some(ConfigError::EmptyRange { field: Name::of("last") }));
    assert_eq!(refused(255, 0, 191), None);
    assert_eq!(refused(255, 0, 192), Some(ConfigError::JobTooLong { found: 961, limit: 960 }));
}

/// The length of a text is a byte.
#[test]
fn a_text_has_255_characters_at_most() {
    let ranges = Lengths { first: 0, least: 0, most: 300 };
    for (length, fits) in [(255, true), (256, false), (300, false)] {
        let data = format!("50$1$$$${}", "x".repeat(length));
        let wire = format!("<Tyo${}#{data}#>", data.len());
        let (message, _) = Message::decode(wire.as_bytes(), Charset::Ascii).unwrap().unwrap();
        let read = Dialect::DEFAULT.read_job::<Texts>(&message, &ranges);
        let fault = FieldFault::Length { found: length, min: 0, max: 300 };
        let error = MessageError::Field(FieldError { field: Name::of("last"), fault });
        assert_eq!(
            read.map(|Job { work, .. }| work.last.as_bytes().len()),
            if fits { Ok(length) } else { Err(error) }
        );
    }
}

#[test]
fn a_text_is_equal_to_its_characters_alone() {
    let grip = Text::<8>::new("grip").unwrap();
    assert!(grip == "grip" && grip != "grab" && grip != "gri" && grip == *"grip" && grip != *"grips");
    assert!(!grip.is_empty() && Text::<8>::EMPTY.is_empty());
    assert_eq!(format!("{grip:?}"), "\"grip\"");
}

#[test]
fn a_decimal_has_nine_places_at_most_and_zero_has_no_sign() {
    assert_eq!(Decimal::nearest(1.0, 9), Some(Decimal { units: 1_000_000_000, places: 9 }));
    assert_eq!(Decimal::nearest(1.0, 10), None);
    let shown = [0, -1, 1].map(|units| Decimal { units, places: 3 }.to_string());
    assert_eq!(shown, ["0.000", "-0.001", "0.001"]);
}

/// A character without a byte in the charset counts as one byte.
#[test]
fn every_character_of_a_message_is_a_byte() {
    let mut out = [b'!'; 9];
    let writer = Writer::new(&mut out, Charset::Latin1, "a\u{100}b");
    assert_eq!(writer.finish(), Err(EncodeError::Character { found: '\u{100}' }));
    assert_eq!(&out, b"<a!b$0##>");
}

#[test]
fn the_documented_values_of_the_configurations() {
    assert_eq!(Bounds::WIDEST.min, Point::new(-9_999_999, -9_999_999));
    assert!(Bounds::WIDEST.contains(Point::new(-9_999_999, 9_999_999)));
    let (pc, robot) = (PcConfig::udp(), RobotConfig::udp());
    assert_eq!(
        (pc.limits, pc.datagrams, robot.limits, robot.datagrams),
        (Limits::UDP, true, Limits::UDP, true)
    );
    assert_eq!(PcConfig { limits: Limits::TCP, datagrams: false, ..pc }, PcConfig::tcp());
    // A datagram that is longer than any message is noticed.
    assert_eq!(<Pc<&[Line]> as Session>::MAX_INPUT, 2 * Message::MAX_LEN);
    assert_eq!(<Robot<'_, Line> as Session>::MAX_INPUT, 2 * Message::MAX_LEN);
}
