//! What a packet of jobs takes in a loop that is written by hand for one layout and one table of messages, with the checks of the
//! general one: marks, length, order, the next number, ranges, decimals, room in the queue and in the packet. Read byte after byte;
//! written two digits at a time, after what is the same in all jobs of an order.

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
        out.number(self.kind.code(), 0, (1, 2))?;
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
        let head = Head::new(black_box(50));
        length = 0;
        for number in 1.. {
            let work = black_box(work(number));
            if out.job(&head, number, &work).is_none() {
                break;
            }
            length = out.length;
        }
    }
    buffer[..length].to_vec()
}

/// `<Tyo$00#order$`: what all jobs of an order begin with.
struct Head {
    text: [u8; 16],
    length: usize,
}

impl Head {
    fn new(order: u16) -> Self {
        let head = format!("<Tyo$00#{order}$");
        let mut text = [0; 16];
        text[..head.len()].copy_from_slice(head.as_bytes());
        Self { text, length: head.len() }
    }
}

/// A packet that is being built.
struct Out<'b> {
    bytes: &'b mut [u8],
    length: usize,
}

impl Out<'_> {
    /// `None`: there is no room for all of it.
    #[inline(never)]
    fn job<W: Layout>(&mut self, head: &Head, number: u16, work: &W) -> Option<()> {
        if let Some(place) = self.bytes.get_mut(self.length..).and_then(<[u8]>::first_chunk_mut) {
            self.length += Window::write(place, head, number, work)?;
            return Some(());
        }
        // At the end of the packet.
        let mut window = [0; WINDOW];
        let length = Window::write(&mut window, head, number, work)?;
        self.bytes.get_mut(self.length..self.length + length)?.copy_from_slice(&window[..length]);
        self.length += length;
        Some(())
    }
}

/// The longest of the layouts' jobs, and the eight bytes after it that are written at once.
const WINDOW: usize = 128;

/// The digits of each number below 100.
static PAIRS: [[u8; 2]; 100] = {
    let mut pairs = [[0; 2]; 100];
    let mut number = 0;
    while number < 100 {
        pairs[number] = [b'0' + number as u8 / 10, b'0' + number as u8 % 10];
        number += 1;
    }
    pairs
};

/// The place of a job's message.
pub(super) struct Window<'b> {
    bytes: &'b mut [u8; WINDOW],
    at: usize,
}

impl Window<'_> {
    #[inline(always)]
    fn write<W: Layout>(bytes: &mut [u8; WINDOW], head: &Head, number: u16, work: &W) -> Option<usize> {
        *bytes.first_chunk_mut()? = head.text;
        let mut window = Window { bytes, at: head.length };
        window.digits(u32::from(number))?;
        work.write(&mut window)?;
        let data = window.at - "<Tyo$00#".len();
        window.word(u64::from(u16::from_le_bytes(*b"#>")), 2)?;
        let length = window.at;
        match data {
            0..10 => {
                bytes.copy_within(7..7 + 16, 6);
                bytes[5] = b'0' + data as u8;
                Some(length - 1)
            }
            10..100 => {
                [bytes[5], bytes[6]] = PAIRS[data];
                Some(length)
            }
            _ => None,
        }
    }

    /// So many of eight bytes.
    #[inline(always)]
    fn word(&mut self, word: u64, length: usize) -> Option<()> {
        *self.bytes.get_mut(self.at..)?.first_chunk_mut()? = word.to_le_bytes();
        self.at += length;
        Some(())
    }

    #[inline(always)]
    fn digits(&mut self, number: u32) -> Option<()> {
        let one = |number: u32| u64::from(number) + u64::from(b'0');
        let two = |number: u32| u64::from(u16::from_le_bytes(PAIRS[number as usize]));
        let four = |number: u32| two(number / 100) | two(number % 100) << 16;
        let (text, length) = match number {
            0..10_000 => match number {
                0..10 => (one(number), 1),
                10..100 => (two(number), 2),
                100..1000 => (one(number / 100) | two(number % 100) << 8, 3),
                _ => (four(number), 4),
            },
            10_000..100_000 => (one(number / 10_000) | four(number % 10_000) << 8, 5),
            100_000..1_000_000 => (two(number / 10_000) | four(number % 10_000) << 16, 6),
            1_000_000..10_000_000 => {
                let (first, last) = (number / 10_000, number % 10_000);
                (one(first / 100) | two(first % 100) << 8 | four(last) << 24, 7)
            }
            _ => return None,
        };
        self.word(text, length)
    }

    /// A mark, and a number with no decimals or with three.
    #[inline(always)]
    pub(super) fn number(&mut self, number: i32, places: usize, (min, max): (i32, i32)) -> Option<()> {
        if !(min..=max).contains(&number) {
            return None;
        }
        // A minus that is not there is written over.
        self.word(u64::from(u16::from_le_bytes(*b"$-")), 1 + usize::from(number < 0))?;
        let number = number.unsigned_abs();
        if places == 0 {
            return self.digits(number);
        }
        self.digits(number / 1000)?;
        let [[_, hundreds], [tens, ones]] =
            [number % 1000 / 100, number % 100].map(|pair| PAIRS[pair as usize]);
        self.word(u64::from(u32::from_le_bytes([b'.', hundreds, tens, ones])), 4)
    }

    /// A mark, and a text of up to eight bytes.
    #[inline(always)]
    pub(super) fn text(&mut self, text: &[u8]) -> Option<()> {
        self.word(u64::from(b'$'), 1)?;
        let (Some(first), Some(last)) = (text.first_chunk::<4>(), text.last_chunk::<4>()) else {
            // No text holds a mark.
            return text
                .iter()
                .try_for_each(|byte| self.word(byte.is_ascii().then_some(u64::from(*byte))?, 1));
        };
        let [first, last] = [first, last].map(|bytes| u32::from_le_bytes(*bytes));
        if (first | last) & 0x8080_8080 != 0 {
            return None;
        }
        let rest = text.len() - 4;
        self.word(first.into(), rest)?;
        self.word(last.into(), 4)
    }
}
