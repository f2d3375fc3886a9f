//! Jobs that are expected, in every cut and with every damage.

use std::vec::Vec;

use robot_session::Decoder as _;

use super::*;
use crate::dialect::{Dialect, Entry};
use crate::job::{Bounds, Expected, Fields, Job, Line, Text, Unfit, Work};
use crate::role::Field;

const JOBS: &[u8] = b"<Tyo$14#50$1$1$0$0$3$4#><Tyo$14#50$2$2$3$4$5$6#><Tyo$14#50$3$1$5$6$7$8#>";

fn from_first() -> Expected {
    Expected::new(&Dialect::DEFAULT, 50, 1, 9999).unwrap()
}

/// The numbers that a decoder gives one after the other, up to the first that is refused.
fn numbers(decoder: &mut Decoder, expected: &mut Expected, refused: u16) -> Vec<u16> {
    let mut numbers = Vec::new();
    decoder.read_in_place(&[], false, |bytes| {
        expected.read::<Line, 4096>(bytes, &Bounds::WIDEST, |job| {
            numbers.push(job.number);
            job.number != refused
        })
    });
    numbers
}

#[test]
fn expected_jobs_are_given_up_to_the_last_whole_one() {
    for (length, given) in [(JOBS.len(), 3), (JOBS.len() - 1, 2), (25, 1), (24, 1), (23, 0)] {
        let mut decoder = Decoder::new(Charset::Ascii);
        assert_eq!(decoder.push(&JOBS[..length]), length);
        let expected = &mut from_first();
        assert_eq!(numbers(&mut decoder, expected, 9), [1, 2, 3][..given], "of {length} bytes");
        assert_eq!((decoder.position(), usize::from(expected.number())), (24 * given as u64, given + 1));
        let _ = decoder.push(&JOBS[length..]);
        assert_eq!(numbers(&mut decoder, expected, 9), [1, 2, 3][given..]);
        assert_eq!((decoder.position(), decoder.is_inside_message()), (72, false));
    }
}

#[test]
fn a_job_is_not_made_whole_by_what_is_left_of_another() {
    let mut decoder = Decoder::new(Charset::Ascii);
    let _ = decoder.push(&JOBS[..24]);
    assert_eq!(numbers(&mut decoder, &mut from_first(), 9), [1]);
    decoder.clear();
    for cut in [20, 0] {
        let _ = decoder.push(&JOBS[..cut]);
        assert_eq!(numbers(&mut decoder, &mut from_first(), 9), [], "{cut} bytes");
    }
}

#[test]
fn a_job_that_is_refused_is_the_next_message() {
    let mut decoder = Decoder::new(Charset::Ascii);
    let _ = decoder.push(JOBS);
    let expected = &mut from_first();
    assert_eq!(numbers(&mut decoder, expected, 2), [1, 2]);
    assert_eq!((decoder.position(), expected.number()), (24, 2));
    let message = decoder.next_frame().unwrap().unwrap();
    assert_eq!(message.fields.get(1).unwrap(), "2");
}

/// Whether this job, as we write it, is the next one that a decoder gives without finding its message first.
fn is_given<W: Work + PartialEq>(
    decoder: &mut Decoder,
    expected: &mut Expected,
    dialect: &Dialect<'_>,
    job: &Job<W>,
    ranges: &W::Ranges,
) -> bool {
    let mut wire = [0; 1024];
    let length = dialect.write_job(job, ranges, &mut wire).unwrap();
    assert_eq!(decoder.push(&wire[..length]), length);
    let mut given = None;
    decoder.read_in_place(&[], false, |bytes| {
        expected.read::<W, 4096>(bytes, ranges, |job| given.replace(*job).is_none())
    });
    given == Some(*job)
}

/// Names and fields of a job in front of, around and after its own.
const LAYOUTS: [(&str, &[Field<'_>]); 3] = [
    ("T", &[Field::Order, Field::Number, Field::Work]),
    ("Tyo", &[Field::Number, Field::Order, Field::Work, Field::Constant("end of job")]),
    (
        "TyoJollaOnPitkaNimi",
        &[Field::Constant("station 7"), Field::Number, Field::Constant("x"), Field::Order, Field::Work],
    ),
];

fn table((name, fields): (&'static str, &'static [Field<'static>])) -> Vec<Entry<'static>> {
    let mut table = Dialect::DEFAULT.entries().to_vec();
    table[0] = Entry { name, fields, ..table[0] };
    table
}

#[test]
fn a_byte_that_is_another_is_seen_wherever_it_is() {
    for table in LAYOUTS.map(table) {
        let dialect = Dialect::new(&table).unwrap();
        let mut wire = [0; 100];
        let job = Job { order: 50, number: 12, work: Line::default() };
        let length = dialect.write_job(&job, &Bounds::WIDEST, &mut wire).unwrap();
        for at in 0..length {
            for byte in [b'~', b'1', b'$', b'#', b'<', b'>'] {
                let mut changed = wire;
                changed[at] = byte;
                let mut decoder = Decoder::new(Charset::Ascii);
                let _ = decoder.push(&changed[..length]);
                let mut given = None;
                let expected = &mut Expected::new(&dialect, 50, 12, 9999).unwrap();
                decoder.read_in_place(&[], false, |bytes| {
                    expected.read::<Line, 4096>(bytes, &Bounds::WIDEST, |job| given.replace(*job).is_none())
                });
                let message = Message::decode(&changed[..length], Charset::Ascii).ok().flatten();
                let read = message.and_then(|(message, _)| dialect.read_job(&message, &Bounds::WIDEST).ok());
                assert!(given.is_none() || given == read, "{}", changed[..length].escape_ascii());
                assert!(given.is_some() || byte != wire[at]);
            }
        }
    }
}

#[test]
fn every_number_is_expected_after_the_one_before() {
    for table in LAYOUTS.map(table) {
        let dialect = Dialect::new(&table).unwrap();
        for (order, max) in [(5, 2), (50, 9), (500, 10), (5000, 100), (65_535, 105), (7, 9999)] {
            let mut expected = Expected::new(&dialect, order, 1, max).unwrap();
            let mut decoder = Decoder::new(Charset::Ascii);
            for number in (1..=max).chain([1, 2]) {
                let job = Job { order, number, work: Line::default() };
                let given = is_given(&mut decoder, &mut expected, &dialect, &job, &Bounds::WIDEST);
                assert!(given, "{}: order {order}, job {number}", table[0].name);
            }
        }
    }
}

/// Text of every length, and a number with as many decimals as the range says.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct Any([Text<255>; 2], i32);

impl Work for Any {
    type Ranges = u8;

    fn fields<F: Fields>(&mut self, places: &u8, fields: &mut F) -> Result<(), Unfit> {
        fields.text("first", &mut self.0[0], 0..=255)?;
        fields.decimal("number", &mut self.1, *places, i32::MIN..=i32::MAX)?;
        fields.text("last", &mut self.0[1], 0..=255)
    }
}

#[test]
fn jobs_of_any_length_and_number_are_expected_as_we_write_them() {
    let text = |length| Text::new(&"x".repeat(length)).unwrap();
    let lengths = (0..=255).map(|length| [text(length), text(length / 2)]);
    let works = lengths.map(|texts| (Any(texts, -7), 0));
    let numbers = [0, 1, -1, 9, 10, -99, 100, 12_345, -999_999, 9_999_999, 10_000_000, i32::MAX];
    let numbers = numbers.into_iter().flat_map(|number| (0..=9).map(move |places| (number, places)));
    let works = works.chain(numbers.map(|(number, places)| (Any([text(3); 2], number), places)));
    let mut decoder = Decoder::new(Charset::Ascii);
    for (work, places) in works {
        let job = Job { order: 50, number: 1, work };
        assert!(is_given(&mut decoder, &mut from_first(), &Dialect::DEFAULT, &job, &places), "{work:?}");
    }
}
