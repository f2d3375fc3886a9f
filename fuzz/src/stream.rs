//! What all targets do alike: a stream is read in pieces, and a script is followed step by step.

use core::fmt::Debug;
use core::ops::Range;

use robot_session::Decoder;

/// A frame or an error, and the stream offset after it.
pub(crate) type Item<D, T> = (Result<T, <D as Decoder>::Error>, u64);

/// The items of a stream that is read `size` bytes at a time.
pub(crate) fn items<D: Decoder, T>(
    decoder: &mut D,
    own: impl Fn(D::Frame<'_>) -> T,
    stream: &[u8],
    size: usize,
) -> Vec<Item<D, T>> {
    let mut items = Vec::new();
    let mut drain = |decoder: &mut D| {
        while let Some(item) = decoder.next_frame().map(|item| item.map(&own)) {
            items.push((item, decoder.position()));
        }
    };
    for mut chunk in stream.chunks(size) {
        while !chunk.is_empty() {
            let taken = decoder.push(chunk);
            assert!(taken > 0, "a drained decoder has room");
            chunk = &chunk[taken..];
            drain(decoder);
        }
    }
    decoder.finish();
    drain(decoder);
    items
}

/// The same; and a frame that comes after the end, given as its bytes and what is read of it, is read.
pub(crate) fn items_and_next<D: Decoder<Error: PartialEq>, T: Debug + PartialEq>(
    mut decoder: D,
    own: impl Fn(D::Frame<'_>) -> T,
    stream: &[u8],
    size: usize,
    (bytes, frame): (&[u8], &T),
) -> Vec<Item<D, T>> {
    let items = items(&mut decoder, &own, stream, size);
    assert_eq!(decoder.push(bytes), bytes.len());
    let next = decoder.next_frame().map(|item| item.map(&own));
    assert_eq!(next.as_ref().map(Result::as_ref), Some(Ok(frame)), "what comes after the end is read");
    items
}

/// Reads a stream `size` bytes at a time and at once: the items are the same and tile it. Each is checked with the place of its bytes.
pub(crate) fn tile<D: Decoder<Error: PartialEq>, T: Debug + PartialEq>(
    new: impl Fn() -> D,
    own: impl Fn(D::Frame<'_>) -> T,
    stream: &[u8],
    size: u8,
    next: (&[u8], &T),
    check: impl Fn(Result<T, D::Error>, Range<usize>),
) {
    let items = items_and_next(new(), &own, stream, usize::from(size).max(1), next);
    let whole = items_and_next(new(), &own, stream, usize::MAX, next);
    assert_eq!(items, whole, "how the stream is cut changes nothing");
    let mut at = 0;
    for (item, end) in items {
        let end = usize::try_from(end).unwrap();
        assert!(end > at, "the decoder stands still at byte {at}");
        check(item, at..end);
        at = end;
    }
    assert_eq!(at, stream.len(), "every byte is in one item");
}

/// The next step of a script: `N` bytes, of which the last says how many more there are, and these.
pub(crate) fn step<'a, const N: usize>(script: &mut &'a [u8]) -> Option<([u8; N], &'a [u8])> {
    let (step, rest) = script.split_first_chunk::<N>()?;
    let bytes;
    (bytes, *script) = rest.split_at(usize::from(step[N - 1]).min(rest.len()));
    Some((*step, bytes))
}
