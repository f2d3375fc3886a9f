//! The one pass and the general way come to the same.

use std::format;
use std::string::String;
use std::vec::Vec;

use proptest::prelude::*;

use super::*;
use crate::message::Message;
use crate::value::Charset;

const BOUNDS: Bounds = Bounds { min: Point::new(-500_000, -9_999_999), max: Point::new(9_999_999, 500_000) };

fn wire(order: u16, Job { number, line }: Job) -> String {
    let Line { kind, start, end } = line;
    let kind = kind.code();
    let data = format!("{order}${number}${kind}${}${}${}${}", start.x, start.y, end.x, end.y);
    format!("<Tyo${}#{data}#>", data.len())
}

fn window(bytes: &[u8]) -> Window {
    let mut window = [0; WINDOW];
    window[..bytes.len()].copy_from_slice(bytes);
    window
}

fn read(bytes: &[u8], next: &mut Next) -> Option<(Job, usize)> {
    let plain = PlainJobs::new(&Dialect::DEFAULT, &BOUNDS, 50).unwrap();
    let (job, used) = plain.read(&window(bytes), next)?;
    (used <= bytes.len()).then_some((job, used))
}

/// The general way.
fn reread(bytes: &[u8]) -> (u16, Job, usize) {
    let (message, used) = Message::decode(bytes, Charset::Ascii).unwrap().unwrap();
    let (role, params) = Dialect::DEFAULT.read(&message).unwrap();
    assert_eq!(role, Role::Job);
    let job = params.job(&Dialect::DEFAULT, &BOUNDS).unwrap();
    (params.number(Field::Order).unwrap(), job, used)
}

fn point() -> impl Strategy<Value = Point> {
    let near = (-500_000..=500_000, -500_000..=500_000);
    prop_oneof![4 => near, 1 => (-500_000..=9_999_999, -9_999_999..=500_000)]
        .prop_map(|(x, y)| Point { x, y })
}

fn kind() -> impl Strategy<Value = JobKind> {
    prop_oneof![Just(JobKind::Draw), Just(JobKind::Move)]
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn what_is_read_in_one_pass_is_what_the_general_way_reads(
        number in 1u16..=9999,
        kind in kind(),
        start in point(),
        end in point(),
        changes in prop::collection::vec((any::<prop::sample::Index>(), prop_oneof![
            3 => prop::sample::select(b"0123456789-$#<> ".to_vec()),
            1 => any::<u8>(),
        ]), 0..3),
        cut in any::<prop::sample::Index>(),
        cuts: bool,
    ) {
        let job = Job { number, line: Line { kind, start, end } };
        let mut bytes = wire(50, job).into_bytes();
        for (at, byte) in &changes {
            let at = at.index(bytes.len());
            bytes[at] = *byte;
        }
        if cuts {
            bytes.truncate(cut.index(bytes.len()));
        }
        let found = read(&bytes, &mut Next::new(number, 9999));
        if let Some((job, used)) = found {
            prop_assert_eq!(reread(&bytes), (50, job, used));
            prop_assert_eq!(job.number, number);
        }
        // Not everything may be left to the general way.
        let plain = format!("{}${}", end.x, end.y).len() <= 16;
        if changes.is_empty() && !cuts && plain {
            prop_assert_eq!(found, Some((job, bytes.len())));
        }
    }

    #[test]
    fn lines_that_begin_where_the_last_one_ended_and_others(
        first in 1u16..=120,
        max in 120u16..=1234,
        points in prop::collection::vec((point(), kind(), any::<bool>()), 2..60),
    ) {
        let (mut next, mut number, mut last) = (Next::new(first, max), first, Point::new(0, 0));
        let mut jobs = Vec::new();
        for (end, kind, joined) in points {
            let start = if joined { last } else { Point::new(end.y / 2, end.x / 30) };
            if format!("{}${}", end.x, end.y).len() > 16 || !(-500_000..=500_000).contains(&start.x) {
                continue;
            }
            last = end;
            let job = Job { number, line: Line { kind, start, end } };
            let bytes = wire(50, job).into_bytes();
            prop_assert_eq!(read(&bytes, &mut next), Some((job, bytes.len())));
            jobs.push(job);
            next.advance();
            number = if number == max { 1 } else { number + 1 };
            prop_assert_eq!(next.number(), number);
        }
    }
}

/// A job that follows one which ended there.
fn after(end: Point) -> Next {
    let (line, mut next) = (Line { kind: JobKind::Move, start: Point::new(1, 1), end }, Next::new(98, 9999));
    read(wire(50, Job { number: 98, line }).as_bytes(), &mut next).unwrap();
    next.advance();
    next
}

#[test]
fn every_other_byte_in_every_place_is_read_as_the_general_way_reads_it_or_left_to_it() {
    let last = Point::new(-50_012, 499_999);
    for (start, end) in [(last, Point::new(7, -12_345)), (Point::new(0, 0), Point::new(9_999_999, 9))] {
        let job = Job { number: 99, line: Line { kind: JobKind::Draw, start, end } };
        let bytes = wire(50, job).into_bytes();
        assert_eq!(read(&bytes, &mut after(last)), Some((job, bytes.len())));
        for at in 0..bytes.len() {
            assert_eq!(read(&bytes[..at], &mut after(last)), None);
            for byte in 0..=u8::MAX {
                let mut bytes = bytes.clone();
                bytes[at] = byte;
                for mut next in [after(last), Next::new(99, 9999)] {
                    if let Some((job, used)) = read(&bytes, &mut next) {
                        assert_eq!(reread(&bytes), (50, job, used));
                    }
                }
            }
        }
    }
}

#[test]
fn a_line_may_begin_at_a_point_that_looks_like_the_end_of_the_last_one() {
    let last = Point::new(12, 34);
    for (x, y) in [(12, 34), (12, 3), (12, 345), (1, 34), (1, 234), (-12, 34), (13, 34), (12, 35)] {
        let line = Line { kind: JobKind::Draw, start: Point { x, y }, end: Point::new(5, 6) };
        let job = Job { number: 99, line };
        let bytes = wire(50, job).into_bytes();
        assert_eq!(read(&bytes, &mut after(last)), Some((job, bytes.len())));
    }
}

#[test]
fn where_the_last_line_ended_is_compared_with_its_text() {
    let start = after(Point::new(-12, 345)).start;
    assert_eq!(start.skip(&window(b"-12$345$"), 0), Some(8));
    assert_eq!(start.skip(&window(b"xxx-12$345$"), 3), Some(11));
    for other in ["-12$345#", "-12$3456$", "-12$34$", "-13$345$", "-22$345$", "12$345$"] {
        assert_eq!(start.skip(&window(other.as_bytes()), 0), None, "{other}");
    }
    assert_eq!(PointText::NONE.skip(&window(b"$"), 0), None);
}

#[test]
fn a_dialect_of_its_own_is_read_the_general_way() {
    let mut table = Dialect::DEFAULT.entries().to_vec();
    let job = table.iter_mut().find(|entry| entry.role == Role::Job).unwrap();
    job.name = "Piirros";
    let long = Dialect::new(table.clone().leak()).unwrap();
    assert!(PlainJobs::new(&long, &BOUNDS, 50).is_none());
    let job = table.iter_mut().find(|entry| entry.role == Role::Job).unwrap();
    job.name = "Piirto";
    let short = Dialect::new(table.leak()).unwrap();
    assert!(PlainJobs::new(&short, &BOUNDS, 50).is_some());
    assert!(PlainJobs::new(&short, &BOUNDS, 0).is_none());
}

#[test]
fn texts_of_numbers() {
    for number in [1, 9, 10, 99, 100, 999, 1000, 9999, 10_000, 65_535] {
        let text = Text::number(number);
        let expected = format!("{number}$");
        assert_eq!(&text.word.to_le_bytes()[..text.length], expected.as_bytes());
        assert_eq!((text.length, text.mask), (expected.len(), u64::MAX >> (64 - 8 * expected.len())));
    }
}
