//! The rules of [`Decoder`].

use core::fmt::Debug;
use std::format;
use std::string::String;
use std::vec;
use std::vec::Vec;

use super::{Rng, chunkings};
use crate::Decoder;

/// A frame or an error as text, and the stream offset just after it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Item {
    /// `Ok` of a frame, `Err` of an error, each as `Debug` shows it.
    pub content: Result<String, String>,
    /// The offset in the stream of the byte after the item, in bytes from the stream's beginning.
    pub end: u64,
}

/// Returns all frames and errors of a stream that arrives in these pieces and then ends.
pub fn decode<D>(decoder: &mut D, pieces: &[&[u8]]) -> Vec<Item>
where
    D: Decoder<Error: Debug>,
    for<'a> D::Frame<'a>: Debug,
{
    decode_noting(decoder, pieces, |_, _| ())
}

/// Decodes as [`decode`] does; `note` gets the number of bytes that were pushed, and the number of items that they gave.
fn decode_noting<D>(decoder: &mut D, pieces: &[&[u8]], mut note: impl FnMut(usize, usize)) -> Vec<Item>
where
    D: Decoder<Error: Debug>,
    for<'a> D::Frame<'a>: Debug,
{
    let (mut items, mut pushed) = (Vec::new(), 0);
    for mut piece in pieces.iter().copied() {
        while !piece.is_empty() {
            let taken = decoder.push(piece);
            let before = items.len();
            drain(decoder, &mut items);
            assert!(taken > 0 || items.len() > before, "the buffer is full, and nothing comes out of it");
            piece = &piece[taken..];
            pushed += taken;
            note(pushed, items.len());
        }
    }
    decoder.finish();
    assert_eq!(decoder.push(&[]), 0, "no bytes were pushed, and the stream stays ended");
    drain(decoder, &mut items);
    items
}

fn drain<D>(decoder: &mut D, items: &mut Vec<Item>)
where
    D: Decoder<Error: Debug>,
    for<'a> D::Frame<'a>: Debug,
{
    loop {
        let Some(found) = decoder.next_frame() else { return };
        let content = found.map(|frame| format!("{frame:?}")).map_err(|error| format!("{error:?}"));
        items.push(Item { content, end: decoder.position() });
    }
}

/// Holds a decoder to the contract over valid frames of its link, each alone, in streams with corrupt bytes, and cut anywhere.
///
/// `spread` is the number of frames next to a corrupt byte that a link may lose with it: 0 if a corrupt byte costs its own
/// frame alone.
pub fn decoder<D>(name: &str, new: impl Fn() -> D, frames: &[Vec<u8>], spread: usize)
where
    D: Decoder<Error: Debug>,
    for<'a> D::Frame<'a>: Debug,
{
    decoder_where(name, new, frames, |_, _| spread);
}

/// As [`decoder`](fn@decoder), if the number of frames that may be lost depends on the corrupt byte: `spread` gets the bytes
/// from the corrupt frame on, and the index of the corrupt byte among them.
pub fn decoder_where<D>(
    name: &str,
    new: impl Fn() -> D,
    frames: &[Vec<u8>],
    spread: impl Fn(&[u8], usize) -> usize,
) where
    D: Decoder<Error: Debug>,
    for<'a> D::Frame<'a>: Debug,
{
    assert!(!frames.is_empty(), "{name}: no frames to try");
    let mut rng = Rng::new(1);
    for frame in frames {
        let whole = items_of(name, &new, frame);
        for pieces in chunkings(frame) {
            assert_eq!(decode(&mut new(), &pieces), whole, "{name}: in pieces: {frame:02X?}");
        }
    }
    for _ in 0..400 {
        let picks: Vec<_> = (0..6).map(|_| &frames[rng.below(frames.len())]).collect();
        let noise: Vec<u8> = (0..rng.below(40)).map(|_| rng.next_u64() as u8).collect();
        let mut stream = picks.iter().flat_map(|frame| frame.iter().copied()).collect::<Vec<_>>();
        let clean = items_of(name, &new, &stream);
        pieces_change_nothing(name, &new, &stream, &clean, &mut rng);
        after_clear(name, &new, &stream, &clean, &mut rng);

        let at = rng.below(stream.len());
        stream[at] ^= 1 << rng.below(8);
        let corrupt = items_of(name, &new, &stream);
        pieces_change_nothing(name, &new, &stream, &corrupt, &mut rng);
        let start =
            clean.iter().map(|item| item.end as usize).take_while(|end| *end <= at).last().unwrap_or(0);
        let spread = spread(&stream[start..], at - start);
        costs_no_more(name, &clean, &corrupt, at as u64, spread);

        let noisy = [&noise[..], &stream].concat();
        let items = items_of(name, &new, &noisy);
        pieces_change_nothing(name, &new, &noisy, &items, &mut rng);
    }
}

/// Checks that every byte is in exactly one item, and that nothing follows after the end.
fn items_of<D>(name: &str, new: &impl Fn() -> D, stream: &[u8]) -> Vec<Item>
where
    D: Decoder<Error: Debug>,
    for<'a> D::Frame<'a>: Debug,
{
    let mut decoder = new();
    assert_eq!(decoder.position(), 0, "{name}");
    let items = decode(&mut decoder, &[stream]);
    let mut before = 0;
    for item in &items {
        assert!(item.end > before, "{name}: an item without bytes: {item:?} in {stream:02X?}");
        before = item.end;
    }
    assert_eq!(before, stream.len() as u64, "{name}: every byte is in one item: {items:?} in {stream:02X?}");
    assert!(decoder.next_frame().is_none(), "{name}: nothing comes after the end");
    decoder.finish();
    assert!(decoder.next_frame().is_none(), "{name}: finishing twice changes nothing");
    items
}

/// Checks that a stream gives the same items in pieces of any size, each as soon as byte by byte.
fn pieces_change_nothing<D>(name: &str, new: &impl Fn() -> D, stream: &[u8], whole: &[Item], rng: &mut Rng)
where
    D: Decoder<Error: Debug>,
    for<'a> D::Frame<'a>: Debug,
{
    let single: Vec<_> = stream.chunks(1).collect();
    let mut shown = vec![0; stream.len() + 1];
    let items = decode_noting(&mut new(), &single, |pushed, items| shown[pushed] = items);
    assert_eq!(items, whole, "{name}: byte by byte: {stream:02X?}");
    let size = 1 + rng.below(stream.len());
    let pieces: Vec<_> = stream.chunks(size).collect();
    let items = decode_noting(&mut new(), &pieces, |pushed, items| {
        let expected = shown[pushed];
        assert_eq!(items, expected, "{name}: items of {pushed} bytes in pieces of {size}: {stream:02X?}");
    });
    assert_eq!(items, whole, "{name}: in pieces of {size}: {stream:02X?}");
}

/// Checks that bytes in the buffer of a decoder that is cleared count in the position, and do not change the following
/// items.
fn after_clear<D>(name: &str, new: &impl Fn() -> D, stream: &[u8], clean: &[Item], rng: &mut Rng)
where
    D: Decoder<Error: Debug>,
    for<'a> D::Frame<'a>: Debug,
{
    let mut decoder = new();
    let cut = rng.below(stream.len());
    let taken = decoder.push(&stream[..cut]) as u64;
    decoder.clear();
    assert_eq!(decoder.position(), taken, "{name}: what is cleared counts");
    assert!(decoder.next_frame().is_none(), "{name}: nothing is left");
    // A frame or an error may contain its offset in the stream.
    let place = |item: &Item, after: u64| (item.content.is_ok(), item.end + after);
    let expected: Vec<_> = clean.iter().map(|item| place(item, taken)).collect();
    let found: Vec<_> = decode(&mut decoder, &[stream]).iter().map(|item| place(item, 0)).collect();
    assert_eq!(found, expected, "{name}: after clear");
}

/// Checks that the frames without a corrupt byte are found at their offsets.
fn costs_no_more(name: &str, clean: &[Item], corrupt: &[Item], at: u64, spread: usize) {
    let touched = clean.partition_point(|item| item.end <= at);
    for (number, item) in clean.iter().enumerate() {
        let near = number.abs_diff(touched) <= spread && number >= touched;
        assert!(
            near || corrupt.contains(item),
            "{name}: byte {at} is corrupt, {item:?} is missing in {corrupt:?}"
        );
    }
}
