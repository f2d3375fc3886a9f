//! A turn-around in a loop for a standard message with its transformation and a reply of six values, with the checks of the
//! general one: marks, doubled DLEs, lengths, the sum, the control byte, the limits. If no byte is a DLE it takes 16 bytes at
//! a time, and the fields at their fixed offsets; otherwise byte by byte.

use core::hint::black_box;

const DLE: u8 = 0x10;
const STX: u8 = 0x02;
const ETX: u8 = 0x03;

/// The contents of a standard message.
struct Motion {
    interrupted: bool,
    error: u8,
    status: u8,
    segment: u16,
    percent: u16,
    transform: [i16; 12],
}

pub(super) fn turn(request: &[u8], target: [i16; 6], rounds: u64) {
    let (most, change, mut speed) = black_box(([i16::MAX; 6], [i16::MAX; 6], [0i16; 6]));
    let mut out = [0; 67];
    for _ in 0..rounds {
        let motion = read(black_box(request)).expect("a good request");
        black_box((motion.interrupted, motion.error, motion.status, motion.segment, motion.percent));
        black_box(&motion.transform);
        let limits = most.iter().zip(&change);
        for ((speed, target), (most, change)) in speed.iter_mut().zip(black_box(&target)).zip(limits) {
            let wanted = (*target).max(-most).min(*most);
            *speed = wanted.max(speed.saturating_sub(*change)).min(speed.saturating_add(*change));
        }
        black_box(write(&speed, black_box(&mut out)).expect("it fits"));
    }
}

#[inline(never)]
fn read(bytes: &[u8]) -> Option<Motion> {
    if let [DLE, DLE, STX, rest @ ..] = bytes
        && let Some((data, [DLE, ETX, found, ..])) = rest.split_first_chunk::<30>()
        && !data.iter().fold(false, |any, byte| any | (*byte == DLE))
    {
        let sum = data.iter().fold(0u8, |sum, byte| sum.wrapping_add(*byte));
        return (*found == sum).then(|| fields(data)).flatten();
    }
    read_bytes(bytes)
}

fn read_bytes(bytes: &[u8]) -> Option<Motion> {
    let [DLE, DLE, STX, rest @ ..] = bytes else { return None };
    let (mut data, mut sum) = ([0u8; 30], 0u8);
    let (mut room, mut rest) = (data.iter_mut(), rest.iter());
    loop {
        let byte = *rest.next()?;
        if byte == DLE {
            match *rest.next()? {
                DLE => {}
                ETX => break,
                _ => return None,
            }
        }
        *room.next()? = byte;
        sum = sum.wrapping_add(byte);
    }
    let is_full = room.next().is_none();
    if *rest.next()? == sum && is_full { fields(&data) } else { None }
}

fn fields(data: &[u8; 30]) -> Option<Motion> {
    let [control, status, s0, s1, p0, p1, transform @ ..] = data;
    let mut words = [0; 12];
    for (word, pair) in words.iter_mut().zip(transform.as_chunks().0) {
        *word = i16::from_le_bytes(*pair);
    }
    (control & 0b1011_1000 == 0b1000_0000).then_some(Motion {
        interrupted: control & 0x40 != 0,
        error: control & 7,
        status: *status,
        segment: u16::from_le_bytes([*s0, *s1]),
        percent: u16::from_le_bytes([*p0, *p1]),
        transform: words,
    })
}

#[inline(never)]
fn write(values: &[i16; 6], out: &mut [u8; 67]) -> Option<usize> {
    let mut data = [0; 12];
    for (pair, value) in data.as_chunks_mut().0.iter_mut().zip(values) {
        *pair = value.to_le_bytes();
    }
    if !data.iter().fold(false, |any, byte| any | (*byte == DLE)) {
        let sum = data.iter().fold(0x3Fu8, |sum, byte| sum.wrapping_add(*byte));
        let [head @ .., _, _, _] = out.first_chunk_mut::<20>()?;
        let (mark, room) = head.split_first_chunk_mut()?;
        *mark = [DLE, DLE, STX, 0, 0x3F];
        room.copy_from_slice(&data);
        *out.get_mut(17..)?.first_chunk_mut()? = [DLE, ETX, sum];
        return Some(20);
    }
    let (head, room) = out.split_first_chunk_mut()?;
    *head = [DLE, DLE, STX, 0, 0x3F];
    let (mut sum, mut room) = (0x3Fu8, room.iter_mut());
    for value in values {
        for byte in value.to_le_bytes() {
            *room.next()? = byte;
            sum = sum.wrapping_add(byte);
            if byte == DLE {
                *room.next()? = byte;
            }
        }
    }
    let room = room.into_slice();
    *room.first_chunk_mut()? = [DLE, ETX, sum];
    Some(67 - room.len() + 3)
}
