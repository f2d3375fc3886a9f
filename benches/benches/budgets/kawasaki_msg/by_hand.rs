//! What a packet of jobs takes in a loop that is written by hand for one layout and one table of messages, byte after byte, with
//! the checks of the general one: marks, length, order, the next number, ranges, decimals, room in the queue and in the packet.

use core::hint::black_box;

use robot_work_queue::{Reader, Writer};

use super::{JobKind, Line, PalletMove, Point, Short};

const BEGIN: &[u8] = b"<Tyo$";

/// A job's own fields.
pub(super) trait Layout: Copy + Send + 'static {
    /// What the queue holds.
    type Queued: Send + 'static;

    /// The fields from a place on, which is then after the mark that follows them.
    fn read(bytes: &[u8], at: &mut usize) -> Option<Self::Queued>;

    /// A mark before each.
    fn write(&self, out: &mut Out<'_>) -> Option<()>;
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
    fn write(&self, out: &mut Out<'_>) -> Option<()> {
        out.number(self.kind.code(), 0, (1, 2))?;
        let ends = [self.start.x, self.start.y, self.end.x, self.end.y];
        ends.iter().try_for_each(|end| out.number(*end, 0, BOARD))
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
    fn write(&self, out: &mut Out<'_>) -> Option<()> {
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
    fn write(&self, out: &mut Out<'_>) -> Option<()> {
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

/// The name and the data part of the message that comes first, and what is after it; a header of a name and two digits.
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

/// Eight bytes at a time, the last ones twice perhaps.
#[inline(always)]
fn is_text(text: &[u8]) -> bool {
    const ONES: u64 = u64::from_le_bytes([1; 8]);
    let marks = |word: &[u8; 8]| {
        let word = u64::from_le_bytes(*word);
        let below = |mark: u8| (word ^ (ONES * u64::from(mark))).wrapping_sub(ONES);
        (word | below(b'<') | below(b'>') | below(b'#')) & (ONES << 7)
    };
    let Some(last) = text.last_chunk() else {
        return !text.iter().any(|byte| matches!(byte, b'<' | b'>' | b'#' | 128..));
    };
    let mut found = marks(last);
    for word in text.as_chunks().0 {
        found |= marks(word);
    }
    found == 0
}

struct Job<W> {
    order: u16,
    number: u16,
    work: W,
}

/// Queues a packet's jobs from the first number on, as far as each is the next one; how many.
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

pub(super) fn queue<W: Layout>(rounds: u64, (packet, jobs): (Vec<u8>, u16)) {
    const MOST: usize = 1000;
    type Ends<W> = (Writer<'static, Job<W>>, Reader<'static, Job<W>>);
    let mut queues: Vec<Ends<W::Queued>> =
        (0..MOST).map(|_| robot_work_queue::boxed(256, 9999).expect("a queue")).collect();
    for (writer, _) in queues.iter_mut().take(rounds as usize) {
        assert_eq!(queue_packet::<W>(black_box(&packet), black_box((50, 1, 9999)), writer), jobs);
    }
    let last = queues.first().and_then(|(_, reader)| reader.iter().last());
    assert!(last.is_some_and(|(_, job)| (job.order, job.number) == (50, jobs)));
    black_box(last.map(|(_, job)| &job.work));
    core::mem::forget(queues); // dropping what is queued is no part of it
}

/// Builds packets as long as there is room; the bytes of the last one.
pub(super) fn build<W: Layout>(rounds: u64, work: impl Fn(u16) -> W) -> Vec<u8> {
    let mut buffer = [0; 4096];
    let mut length = 0;
    for _ in 0..rounds {
        let mut out = Out { bytes: black_box(&mut buffer), length: 0 };
        length = 0;
        for number in 1.. {
            let work = black_box(work(number));
            if out.job(50, number, &work).is_none() {
                break;
            }
            length = out.length;
        }
    }
    buffer[..length].to_vec()
}

/// A packet that is being built.
pub(super) struct Out<'b> {
    bytes: &'b mut [u8],
    length: usize,
}

impl Out<'_> {
    /// `None`: there is no room for all of it.
    #[inline(never)]
    fn job<W: Layout>(&mut self, order: u16, number: u16, work: &W) -> Option<()> {
        BEGIN.iter().try_for_each(|byte| self.push(*byte))?;
        let length_at = self.length;
        // The length of most jobs has two digits.
        b"00".iter().try_for_each(|byte| self.push(*byte))?;
        self.push(b'#')?;
        let data_at = self.length;
        self.digits(u32::from(order), 0)?;
        self.push(b'$')?;
        self.digits(u32::from(number), 0)?;
        work.write(self)?;
        let data = self.length - data_at;
        self.push(b'#')?;
        self.push(b'>')?;
        match self.bytes.get_mut(length_at..) {
            Some([tens, ones, ..]) if (10..100).contains(&data) => {
                (*tens, *ones) = (b'0' + (data / 10) as u8, b'0' + (data % 10) as u8);
            }
            Some([ones, ..]) if data < 10 => {
                *ones = b'0' + data as u8;
                self.bytes.copy_within(length_at + 2..self.length, length_at + 1);
                self.length -= 1;
            }
            _ => return None,
        }
        Some(())
    }

    #[inline(always)]
    fn push(&mut self, byte: u8) -> Option<()> {
        *self.bytes.get_mut(self.length)? = byte;
        self.length += 1;
        Some(())
    }

    #[inline(always)]
    fn digits(&mut self, mut rest: u32, places: usize) -> Option<()> {
        let (mut digits, mut first) = ([b'0'; 10], 10);
        while rest > 0 || first > 9 - places {
            first -= 1;
            digits[first] = b'0' + (rest % 10) as u8;
            rest /= 10;
        }
        let (whole, decimals) = digits.split_at(10 - places);
        whole[first..].iter().try_for_each(|digit| self.push(*digit))?;
        if places > 0 {
            self.push(b'.')?;
        }
        decimals.iter().try_for_each(|digit| self.push(*digit))
    }

    #[inline(always)]
    fn number(&mut self, number: i32, places: usize, (min, max): (i32, i32)) -> Option<()> {
        if !(min..=max).contains(&number) {
            return None;
        }
        self.push(b'$')?;
        if number < 0 {
            self.push(b'-')?;
        }
        self.digits(number.unsigned_abs(), places)
    }

    #[inline(always)]
    fn text(&mut self, text: &[u8]) -> Option<()> {
        self.push(b'$')?;
        text.iter().try_for_each(|byte| match byte {
            b'$' | b'#' | b'<' | b'>' | 128.. => None,
            byte => self.push(*byte),
        })
    }
}
