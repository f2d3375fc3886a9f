//! Text: a message of kawasaki-msg and a line of mmacell-proto against other parsers of such text.
//!
//! No other crate reads these two. The nearest are nmea0183-parser, which checks the frame of a sentence and lets its caller read
//! the content, and code that an integrator would write: the same grammar in nom, or splitting and `str::parse` by hand.

use std::hint::black_box;

use kawasaki_msg::{Bounds, Charset, Dialect, Line as Drawn, Message};
use mmacell_proto::{Line, Reply, RobotPose};
use nmea0183_parser::{ChecksumMode, LineEndingMode, Nmea0183ParserBuilder};
use nom::bytes::complete::{tag, take};
use nom::character::complete::{char, i32, one_of, u32};
use nom::combinator::{eof, map_res};
use nom::error::{FromExternalError, ParseError};
use nom::number::complete::double;
use nom::sequence::preceded;
use nom::{IResult, Parser};

use crate::race::race;

/// The common conditions of these races, and the differences.
const NOTES: &str = "\
Every contender checks the frame and returns numbers. Not the same: kawasaki-msg finds the message in its table of names
and checks each number's range, mmacell-proto returns exact numbers of its own scale and refuses any other width, sign or
order; both report the position of an error. nmea0183-parser checks a sum, which the two links do not have.
";

pub(crate) fn races() {
    race(
        "read a job: a name and seven numbers, 36 bytes",
        [
            ("kawasaki-msg", job_ours),
            ("the same grammar in nom 8", job_nom),
            ("split and parsed by hand", job_by_hand),
            ("nmea0183-parser 0.3, a sentence with the same fields", job_nmea),
        ],
    );
    race(
        "read a status: four axes, three flags and numbers, 50 bytes",
        [
            ("mmacell-proto", status_ours),
            ("the same grammar in nom 8, axes as f64", status_nom),
            ("split and parsed by hand, axes as f64", status_by_hand),
            ("nmea0183-parser 0.3, a sentence with the same fields", status_nmea),
        ],
    );
    println!("{NOTES}");
}

const JOB: &[u8] = b"<Tyo$26#50$1$1$-3000$550$-2993$537#>";
const STATUS: &[u8] = b"OKF+010.000-002.000+005.999-01.2322T+00080+00000\r\n";

type Job = [i32; 7];
const THE_JOB: Job = [50, 1, 1, -3000, 550, -2993, 537];

/// Moving, axes, servo, override, error.
type Status = (bool, [f64; 4], bool, i32, i32);
const THE_STATUS: Status = (false, [10.0, -2.0, 5.999, -1.2322], true, 80, 0);

fn job_ours(rounds: u64) {
    let dialect = Dialect::DEFAULT;
    for _ in 0..rounds {
        let (message, _) = Message::decode(black_box(JOB), Charset::Ascii).expect("good").expect("whole");
        black_box(&dialect.read_job::<Drawn>(&message, &Bounds::WIDEST).expect("a job"));
    }
}

fn job_nom(rounds: u64) {
    fn job(input: &[u8]) -> IResult<&[u8], Job> {
        let (input, (_, length, _)) = (tag("<Tyo$"), u32, char('#')).parse(input)?;
        let (input, data) = take(length).parse(input)?;
        let (input, _) = tag("#>").parse(input)?;
        Ok((input, numbers('$', data)?.1))
    }
    for _ in 0..rounds {
        assert_eq!(black_box(job(black_box(JOB)).expect("good").1), THE_JOB);
    }
}

/// Reads seven numbers and nothing after them.
fn numbers<'a, E: ParseError<&'a [u8]>>(separator: char, data: &'a [u8]) -> IResult<&'a [u8], Job, E> {
    let (mut data, first) = i32(data)?;
    let mut values = [first; 7];
    for value in &mut values[1..] {
        (data, *value) = preceded(char(separator), i32).parse(data)?;
    }
    let (data, _) = eof(data)?;
    Ok((data, values))
}

fn job_by_hand(rounds: u64) {
    fn job(bytes: &[u8]) -> Option<Job> {
        let text = std::str::from_utf8(bytes).ok()?;
        let (length, data) = text.strip_prefix("<Tyo$")?.strip_suffix("#>")?.split_once('#')?;
        if length.parse() != Ok(data.len()) {
            return None;
        }
        let mut fields = data.split('$');
        let mut values = [0; 7];
        for value in &mut values {
            *value = fields.next()?.parse().ok()?;
        }
        fields.next().is_none().then_some(values)
    }
    for _ in 0..rounds {
        assert_eq!(black_box(job(black_box(JOB))), Some(THE_JOB));
    }
}

fn job_nmea(rounds: u64) {
    fn content(input: &[u8]) -> nmea0183_parser::IResult<&[u8], Job> {
        numbers(',', tag("Tyo,").parse(input)?.0)
    }
    let text = sentence("Tyo,50,1,1,-3000,550,-2993,537");
    let mut parser = nmea().build(content);
    for _ in 0..rounds {
        assert_eq!(black_box(parser(black_box(&text)).expect("good").1), THE_JOB);
    }
}

fn status_ours(rounds: u64) {
    for _ in 0..rounds {
        let (line, _) =
            Line::decode(black_box(STATUS), &mmacell_proto::Dialect::STRICT).expect("good").expect("whole");
        black_box(&Reply::<RobotPose>::decode(line, &mmacell_proto::Dialect::STRICT).expect("a status"));
    }
}

fn status_nom(rounds: u64) {
    fn status(input: &[u8]) -> IResult<&[u8], Status> {
        let (input, moving) = preceded(tag("OK"), flag).parse(input)?;
        let (input, (x, y, z, c)) = (fixed(8), fixed(8), fixed(8), fixed(8)).parse(input)?;
        let (input, servo) = flag(input)?;
        let (input, (percent, error, _)) = (fixed(6), fixed(6), tag("\r\n")).parse(input)?;
        Ok((input, (moving, [x, y, z, c], servo, percent, error)))
    }
    for _ in 0..rounds {
        assert_eq!(black_box(status(black_box(STATUS)).expect("good").1), THE_STATUS);
    }
}

fn flag<'a, E: ParseError<&'a [u8]>>(input: &'a [u8]) -> IResult<&'a [u8], bool, E> {
    one_of("TF").map(|letter| letter == 'T').parse(input)
}

/// Returns a parser of a number of `width` characters.
fn fixed<'a, T: std::str::FromStr, E>(width: u8) -> impl Parser<&'a [u8], Output = T, Error = E>
where
    E: ParseError<&'a [u8]> + FromExternalError<&'a [u8], ()>,
{
    let number =
        |digits: &[u8]| std::str::from_utf8(digits).ok().and_then(|text| text.parse().ok()).ok_or(());
    map_res(take(width), number)
}

fn status_by_hand(rounds: u64) {
    fn status(bytes: &[u8]) -> Option<Status> {
        let text = std::str::from_utf8(bytes).ok()?.strip_prefix("OK")?.strip_suffix("\r\n")?;
        let flag = |at| match text.as_bytes().get(at) {
            Some(b'T') => Some(true),
            Some(b'F') => Some(false),
            _ => None,
        };
        let mut axes = [0.0; 4];
        for (index, axis) in axes.iter_mut().enumerate() {
            *axis = text.get(1 + 8 * index..9 + 8 * index)?.parse().ok()?;
        }
        let number = |digits: &str| digits.parse().ok();
        Some((flag(0)?, axes, flag(33)?, number(text.get(34..40)?)?, number(text.get(40..)?)?))
    }
    for _ in 0..rounds {
        assert_eq!(black_box(status(black_box(STATUS))), Some(THE_STATUS));
    }
}

fn status_nmea(rounds: u64) {
    fn content(input: &[u8]) -> nmea0183_parser::IResult<&[u8], Status> {
        let (mut input, moving) = preceded(tag("OK,"), flag).parse(input)?;
        let mut axes = [0.0; 4];
        for axis in &mut axes {
            (input, *axis) = preceded(char(','), double).parse(input)?;
        }
        let (input, servo) = preceded(char(','), flag).parse(input)?;
        let (input, (_, percent, _, error)) = (char(','), i32, char(','), i32).parse(input)?;
        Ok((eof(input)?.0, (moving, axes, servo, percent, error)))
    }
    let text = sentence("OK,F,+010.000,-002.000,+005.999,-01.2322,T,+00080,+00000");
    let mut parser = nmea().build(content);
    for _ in 0..rounds {
        assert_eq!(black_box(parser(black_box(&text)).expect("good").1), THE_STATUS);
    }
}

fn nmea() -> Nmea0183ParserBuilder {
    Nmea0183ParserBuilder::new()
        .checksum_mode(ChecksumMode::Required)
        .line_ending_mode(LineEndingMode::Required)
}

fn sentence(content: &str) -> Vec<u8> {
    let sum = content.bytes().fold(0, |sum, byte| sum ^ byte);
    format!("${content}*{sum:02X}\r\n").into_bytes()
}
