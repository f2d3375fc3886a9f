//! The work on a packet of jobs in a loop that is written by hand for one layout and one table of messages, with the checks
//! of the general one: marks, length, order, the next number, ranges, decimals, free space in the queue and in the packet.
//! Byte after byte.

use core::any::Any;
use core::hint::black_box;
use core::time::Duration;
use std::time::Instant;

use robot_work_queue::{Reader, Writer};

use super::{JobKind, Line, PalletMove, Point, QUEUES, Short};

const BEGIN: &[u8] = b"<Tyo$";

/// A job's own fields.
pub(super) trait Layout: Copy + Send + 'static {
    /// The type of a queued job.
    type Queued: Send + 'static;

    /// Reads the fields from `at` on, which is then after the mark that follows them.
    fn read(bytes: &[u8], at: &mut usize) -> Option<Self::Queued>;

    /// Writes the fields, with a mark before each.
    fn write(&self, out: &mut Window<'_>) -> Option<()>;
}

const BOARD: (i32, i32) = (-9_999_999, 9_999_999);
const ANGLE: (i32, i32) = (-360_000, 360_000);

impl Layout for Line {
    type Queued = Line;

    #[inline(always)]
    fn read(bytes: &[u8], at: &mut usize) -> Option<Line> {
        let kind = if number(bytes, at, 0, (1, 2))? == 1 { JobKind::Draw } else { JobKind::Move };
        let mut point = || Some(Point::new(number(bytes, at, 0, BOARD)?, number(bytes, at, 0, BOARD)?));
        Some(Line { kind, start: point()?, end: point()? })
    }

    #[inline(always)]
    fn write(&self, out: &mut Window<'_>) -> Option<()> {
        out.number(self.kind.into(), 0, (1, 2))?;
        out.number(self.start.x, 0, BOARD)?;
        out.number(self.start.y, 0, BOARD)?;
        out.number(self.end.x, 0, BOARD)?;
        out.number(self.end.y, 0, BOARD)
    }
}

#[expect(dead_code, reason = "nobody executes it")]
pub(super) struct QueuedMove {
    joints: [i32; 6],
    tool: ([u8; 8], usize),
    speed: u8,
}

impl Layout for PalletMove {
    type Queued = QueuedMove;

    #[inline(always)]
    fn read(bytes: &[u8], at: &mut usize) -> Option<QueuedMove> {
        let mut joints = [0; 6];
        for joint in &mut joints {
            *joint = number(bytes, at, 3, ANGLE)?;
        }
        let tool = text(bytes, at)?;
        Some(QueuedMove { joints, tool, speed: number(bytes, at, 0, (1, 100))? as u8 })
    }

    #[inline(always)]
    fn write(&self, out: &mut Window<'_>) -> Option<()> {
        self.joints.iter().try_for_each(|joint| out.number(*joint, 3, ANGLE))?;
        out.text(self.tool.as_bytes())?;
        out.number(i32::from(self.speed), 0, (1, 100))
    }
}

impl Layout for Short {
    type Queued = u8;

    #[inline(always)]
    fn read(bytes: &[u8], at: &mut usize) -> Option<u8> {
        Some(number(bytes, at, 0, (0, 9))? as u8)
    }

    #[inline(always)]
    fn write(&self, out: &mut Window<'_>) -> Option<()> {
        out.number(i32::from(self.0), 0, (0, 9))
    }
}

#[inline(always)]
fn number(bytes: &[u8], at: &mut usize, places: usize, (min, max): (i32, i32)) -> Option<i32> {
    let negative = *bytes.get(*at)? == b'-';
    let first = *at + usize::from(negative);
    let (mut place, mut number, mut point) = (first, 0i32, None);
    let mark = loop {
        let byte = *bytes.get(place)?;
        let digit = byte.wrapping_sub(b'0');
        if digit <= 9 {
            // Their count bounds it.
            number = number.wrapping_mul(10).wrapping_add(i32::from(digit));
        } else if places > 0 && byte == b'.' && point.is_none() {
            point = Some(place);
        } else {
            break byte;
        }
        place += 1;
    };
    let decimals = point.map_or(0, |point| place - point - 1);
    let number = if negative { -number } else { number };
    *at = place + 1;
    let is_good = matches!(mark, b'$' | b'#')
        && (1..=9).contains(&(place - first))
        && decimals == places
        && (min..=max).contains(&number);
    is_good.then_some(number)
}

#[inline(always)]
fn text(bytes: &[u8], at: &mut usize) -> Option<([u8; 8], usize)> {
    let (mut text, mut length) = ([0; 8], 0);
    loop {
        match *bytes.get(*at + length)? {
            b'$' | b'#' => break,
            b'<' | b'>' | 128.. => return None,
            byte => *text.get_mut(length)? = byte,
        }
        length += 1;
    }
    *at += length + 1;
    (length > 0).then_some((text, length))
}

/// Returns the name and the data part of the first message, and the bytes after it; a header of a name and two digits.
#[inline(always)]
pub(super) fn find(bytes: &[u8]) -> Option<[&[u8]; 3]> {
    let [b'<', rest @ ..] = bytes else { return None };
    let name = rest.iter().position(|byte| *byte == b'$')?;
    let (name, rest) = rest.split_at_checked(name)?;
    let [b'$', tens @ b'0'..=b'9', ones @ b'0'..=b'9', b'#', rest @ ..] = rest else { return None };
    let (data, rest) = rest.split_at_checked(usize::from(10 * (tens - b'0') + ones - b'0'))?;
    let [b'#', b'>', rest @ ..] = rest else { return None };
    (is_text(name) && is_text(data)).then_some([name, data, rest])
}

#[inline(always)]
fn is_text(text: &[u8]) -> bool {
    !text.iter().any(|byte| matches!(byte, b'<' | b'>' | b'#' | 128..))
}

struct Job<W> {
    order: u16,
    number: u16,
    work: W,
}

/// Queues a packet's jobs from the first number on, as far as each is the next one; returns how many.
#[inline(never)]
fn queue_packet<W: Layout>(
    packet: &[u8],
    (order, first, max): (u16, u16, u16),
    writer: &mut Writer<'_, Job<W::Queued>>,
) -> u16 {
    let (mut at, mut next) = (0, first);
    let mut read = |next: u16| {
        let mut place = at + BEGIN.len();
        if packet.get(at..place)? != BEGIN {
            return None;
        }
        let length = number(packet, &mut place, 0, (0, 4096))?;
        let data = place;
        let is_next = number(packet, &mut place, 0, (1, 65_535))? == i32::from(order)
            && number(packet, &mut place, 0, (1, i32::from(max)))? == i32::from(next);
        let work = W::read(packet, &mut place)?;
        at = place + 1;
        let is_whole = place - data == length as usize + 1 && packet.get(place - 1..=place)? == b"#>";
        (is_next && is_whole).then_some(Job { order, number: next, work })
    };
    while let (Ok(claim), Some(job)) = (writer.claim(), read(next)) {
        claim.push(job);
        next = if next < max { next + 1 } else { 1 };
    }
    next - first
}

pub(super) fn queue<W: Layout>(rounds: u64, (packet, jobs): (Vec<u8>, u16)) -> (Duration, Box<dyn Any>) {
    type Ends<W> = (Writer<'static, Job<W>>, Reader<'static, Job<W>>);
    let mut queues: Vec<Ends<W::Queued>> =
        (0..QUEUES).map(|_| robot_work_queue::boxed(256, 9999).expect("a queue")).collect();
    let used = queues.get_mut(..rounds as usize).expect("no more rounds than queues");
    let start = Instant::now();
    for (writer, _) in used {
        assert_eq!(queue_packet::<W>(black_box(&packet), black_box((50, 1, 9999)), writer), jobs);
    }
    let time = start.elapsed();
    let last = queues.first().and_then(|(_, reader)| reader.iter().last());
    assert!(last.is_some_and(|(_, job)| (job.order, job.number) == (50, jobs)));
    black_box(last.map(|(_, job)| &job.work));
    (time, Box::new(queues))
}

/// Builds packets from as many jobs as fit; returns the bytes of the last one.
pub(super) fn build<W: Layout>(rounds: u64, work: impl Fn(u16) -> W) -> Vec<u8> {
    let mut buffer = [0; 4096];
    let mut length = 0;
    for _ in 0..rounds {
        let mut out = Window { bytes: black_box(&mut buffer), at: 0 };
        length = 0;
        for number in 1.. {
            let work = black_box(work(number));
            if out.job(black_box(50), number, &work).is_none() {
                break;
            }
            length = out.at;
        }
    }
    buffer[..length].to_vec()
}

/// A packet that is being built.
pub(super) struct Window<'b> {
    bytes: &'b mut [u8],
    at: usize,
}

impl Window<'_> {
    /// Returns `None` if the job does not fit.
    #[inline(never)]
    fn job<W: Layout>(&mut self, order: u16, number: u16, work: &W) -> Option<()> {
        self.put(b"<Tyo$")?;
        let length_at = self.at;
        self.put(b"00#")?;
        let data_at = self.at;
        self.digits(u32::from(order), 0)?;
        self.put(b"$")?;
        self.digits(u32::from(number), 0)?;
        work.write(self)?;
        let data = self.at - data_at;
        if data < 10 {
            self.bytes.copy_within(length_at + 2..self.at, length_at + 1);
            self.at -= 1;
        }
        let end = self.at;
        self.at = length_at;
        self.digits(data as u32, 0)?;
        self.at = end;
        self.put(b"#>")
    }

    #[inline(always)]
    fn put(&mut self, bytes: &[u8]) -> Option<()> {
        let end = self.at + bytes.len();
        self.bytes.get_mut(self.at..end)?.copy_from_slice(bytes);
        self.at = end;
        Some(())
    }

    /// Writes digits with a point before the last `places` of them.
    #[inline(always)]
    fn digits(&mut self, number: u32, places: usize) -> Option<()> {
        let digits =
            (number.checked_ilog10().unwrap_or(0) as usize + 1).max(if places > 0 { places + 1 } else { 0 });
        let end = self.at + digits + usize::from(places > 0);
        let mut rest = number;
        for (at, place) in self.bytes.get_mut(self.at..end)?.iter_mut().rev().enumerate() {
            if places > 0 && at == places {
                *place = b'.';
                continue;
            }
            *place = b'0' + (rest % 10) as u8;
            rest /= 10;
        }
        self.at = end;
        Some(())
    }

    /// Reads a mark, and a number with no or three decimals.
    #[inline(always)]
    pub(super) fn number(&mut self, number: i32, places: usize, (min, max): (i32, i32)) -> Option<()> {
        if !(min..=max).contains(&number) {
            return None;
        }
        self.put(if number < 0 { b"$-" } else { b"$" })?;
        self.digits(number.unsigned_abs(), places)
    }

    /// Reads a mark and a text.
    #[inline(always)]
    pub(super) fn text(&mut self, text: &[u8]) -> Option<()> {
        self.put(b"$")?;
        // No text holds a mark.
        text.iter().try_for_each(|byte| self.put(byte.is_ascii().then_some(&[*byte])?))
    }
}
