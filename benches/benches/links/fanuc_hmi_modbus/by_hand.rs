//! The same work by hand, for one function each, with the checks of the general function and nothing else.

use core::hint::black_box;

use super::work::{N, reply_bytes, request_bytes};

pub(super) fn decode(rounds: u64) {
    let bytes = reply_bytes();
    let mut out = [0u16; N];
    for _ in 0..rounds {
        let (transaction, unit, count) = read_reply(black_box(&bytes), &mut out).expect("good");
        assert_eq!(count, N);
        black_box((transaction, unit, &out));
    }
}

/// Checks the header, the function, and an even byte count of 2 to 250 that agrees with the length; then reads the
/// registers.
#[inline(always)]
fn read_reply(bytes: &[u8], out: &mut [u16; N]) -> Option<(u16, u8, usize)> {
    let [t0, t1, 0, 0, l0, l1, unit, 3, count, data @ ..] = bytes else { return None };
    let (length, count) = (usize::from(u16::from_be_bytes([*l0, *l1])), usize::from(*count));
    let is_good = length <= 254 && length == count + 3 && count % 2 == 0 && (1..=250).contains(&count);
    let words = data.get(..count).filter(|_| is_good)?.as_chunks().0;
    swap(words, out, u16::from_be_bytes);
    Some((u16::from_be_bytes([*t0, *t1]), *unit, words.len()))
}

pub(super) fn serve(rounds: u64) {
    let (request, bank) = (request_bytes(), black_box([7u16; 100]));
    let mut out = [0; 260];
    for _ in 0..rounds {
        let len = answer(black_box(&request), &bank, black_box(&mut out));
        assert_eq!(len, Some(9 + 2 * N));
        black_box(&out);
    }
}

/// Checks the header, the function, and a quantity of 1 to 125 within 65536 and within the bank; then writes the reply.
#[inline(always)]
fn answer(bytes: &[u8], bank: &[u16; 100], out: &mut [u8; 260]) -> Option<usize> {
    let [t0, t1, 0, 0, 0, 6, unit, 3, a0, a1, q0, q1, ..] = *bytes else { return None };
    let (address, quantity) = (u16::from_be_bytes([a0, a1]), u16::from_be_bytes([q0, q1]));
    let (first, count) = (usize::from(address), usize::from(quantity));
    if !(1..=125).contains(&count) || first + count > 0x1_0000 {
        return None;
    }
    let words = bank.get(first..first + count)?;
    let (head, data) = out.split_first_chunk_mut()?;
    let [l0, l1] = (quantity * 2 + 3).to_be_bytes();
    let [_, byte_count] = (quantity * 2).to_be_bytes();
    *head = [t0, t1, 0, 0, l0, l1, unit, 3, byte_count];
    swap(words, data.get_mut(..2 * count)?.as_chunks_mut().0, u16::to_be_bytes);
    Some(9 + 2 * count)
}

/// Swaps eight at once; the last eight once more.
#[inline(always)]
fn swap<A: Copy, B>(from: &[A], to: &mut [B], swapped: impl Fn(A) -> B + Copy) {
    match (from.last_chunk::<8>(), to.get_mut(..from.len()).and_then(<[B]>::last_chunk_mut)) {
        (Some(from), Some(to)) => *to = from.map(swapped),
        _ => to.iter_mut().zip(from).for_each(|(to, from)| *to = swapped(*from)),
    }
    for (to, from) in to.as_chunks_mut::<8>().0.iter_mut().zip(from.as_chunks::<8>().0) {
        *to = from.map(swapped);
    }
}
