//! Conversations over a line that returns the bytes of one end.

use core::ops::Range;

use crate::Stream;

/// The minimum number of pieces that have come back, of ten that were sent.
const OF_TEN: usize = 9;
/// The number of pieces that show an echo.
const MIN_ECHOES: usize = 2;

/// Returns the streams without the echo, if the line returns the bytes that one of two ends sends.
///
/// Needs the times of both streams. Some replies are equal to their requests, so these bytes count as an echo only if a reply
/// follows at least every second time.
pub(crate) fn without_echo(streams: &[Stream]) -> Option<Vec<Stream>> {
    let [first, second] = streams else { return None };
    let cleaned = |sent, received| Some(without(received, &returned(sent, received)?));
    match (cleaned(first, second), cleaned(second, first)) {
        (Some(second), _) => Some(vec![first.clone(), second]),
        (None, Some(first)) => Some(vec![first, second.clone()]),
        (None, None) => None,
    }
}

/// Returns the positions of the pieces of one stream in the other: each in the bytes that arrived there after it was sent.
fn returned(sent: &Stream, received: &Stream) -> Option<Vec<Range<usize>>> {
    let ([sent_bytes], [bytes]) = (sent.parts.as_slice(), received.parts.as_slice()) else { return None };
    let ends = sent.arrivals.iter().skip(1).map(|(begin, _)| *begin).chain([sent_bytes.len()]);
    let (mut found, mut from, mut answered, mut is_open) = (Vec::new(), 0, 0, false);
    for ((begin, at), end) in sent.arrivals.iter().zip(ends) {
        let piece = sent_bytes.get(*begin..end)?;
        let arrived = received.arrivals.iter().find(|(_, arrived)| arrived > at);
        let Some((place, _)) = arrived else { break };
        answered += usize::from(is_open && from < *place);
        let place = from.max(*place);
        is_open = bytes.get(place..).is_some_and(|rest| rest.starts_with(piece));
        if is_open {
            from = place + piece.len();
            found.push(place..from);
        }
    }
    answered += usize::from(is_open && from < bytes.len());
    let is_echo = found.len() >= MIN_ECHOES && found.len() * 10 >= sent.arrivals.len() * OF_TEN;
    (is_echo && answered * 2 >= found.len()).then_some(found)
}

/// Returns a stream of one part without these bytes.
fn without(stream: &Stream, taken: &[Range<usize>]) -> Stream {
    let before =
        |at: usize| taken.iter().map(|range| range.end.min(at).saturating_sub(range.start)).sum::<usize>();
    let is_kept = |at: usize| !taken.iter().any(|range| range.contains(&at));
    let keep = |bytes: &Vec<u8>| {
        let kept = bytes.iter().enumerate().filter(|(at, _)| is_kept(*at));
        kept.map(|(_, byte)| *byte).collect()
    };
    let parts: Vec<Vec<u8>> = stream.parts.iter().map(keep).collect();
    let arrivals = stream.arrivals.iter().map(|(at, time)| (at - before(*at), *time)).collect();
    Stream { sender: stream.sender.clone(), parts, arrivals }
}
