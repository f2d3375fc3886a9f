//! Every way to cut a stream that a decoder must not notice.

use std::vec;
use std::vec::Vec;

/// Returns the ways to read `bytes` that must all give the same frames: whole, byte by byte, and in two pieces at every byte.
pub fn chunkings(bytes: &[u8]) -> impl Iterator<Item = Vec<&[u8]>> {
    let whole = core::iter::once(vec![bytes]);
    let single = core::iter::once(bytes.chunks(1).collect());
    let halves = (1..bytes.len()).map(|at| {
        let (head, tail) = bytes.split_at(at);
        vec![head, tail]
    });
    whole.chain(single).chain(halves)
}

/// Returns `bytes` after every non-empty beginning of `cut`: a frame that is truncated anywhere, then a valid one.
pub fn after_a_cut(cut: &[u8], bytes: &[u8]) -> impl Iterator<Item = Vec<u8>> {
    (1..cut.len()).map(move |at| [&cut[..at], bytes].concat())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_chunking_holds_every_byte_in_order() {
        let bytes = b"abcd";
        let all: Vec<_> = chunkings(bytes).collect();
        assert_eq!(all.len(), 2 + 3);
        assert!(all.iter().all(|chunks| chunks.concat() == bytes));
        assert_eq!(all[1], [b"a", b"b", b"c", b"d"]);
        assert_eq!(all[3], [&b"ab"[..], b"cd"]);
    }

    #[test]
    fn a_cut_frame_precedes_the_valid_one() {
        let streams: Vec<_> = after_a_cut(b"xyz", b"ok").collect();
        assert_eq!(streams, [b"xok".to_vec(), b"xyok".to_vec()]);
    }
}
