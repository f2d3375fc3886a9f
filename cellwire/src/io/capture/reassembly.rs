//! The segments of one direction of a TCP connection, put back in order.

use std::collections::{BTreeMap, VecDeque};

use anyhow::Result;

/// The numbers of segments, and of bytes, that may wait for an earlier one; with more, the earlier one counts as lost.
const MAX_WAITING: usize = 256;
const MAX_WAITING_BYTES: usize = 1 << 20;
/// The number of gaps that are remembered: bytes that come for one later are reported.
const MAX_GAPS: usize = 16;
/// The position of the first byte: earlier bytes have a position, too.
const ORIGIN: u64 = 1 << 32;

/// A piece of the stream.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Piece<'a> {
    /// The next bytes of the stream.
    Bytes(&'a [u8]),
    /// This number of next bytes is not in the capture: no packet has them.
    Gap(u64),
    /// This number of next bytes is not in the capture: it has cut them off a packet.
    Cut(u64),
    /// This number of bytes belongs into a gap that was reported before.
    Late(u64),
    /// This number of bytes belongs before the first that was captured.
    BeforeStart(u64),
}

/// One direction of one connection. It holds at most `MAX_WAITING_BYTES` and a segment.
#[derive(Debug, Default)]
pub struct Reassembly {
    started: Option<StreamStart>,
    /// The bytes that wait, by their position, and the number of bytes after them that were cut off.
    waiting: BTreeMap<u64, (Vec<u8>, u64)>,
    waiting_bytes: usize,
    gaps: VecDeque<(u64, u64)>,
}

#[derive(Debug, Clone, Copy)]
struct StreamStart {
    /// The sequence number of the first byte.
    first: u32,
    /// The place of the next byte.
    next: u64,
}

impl Reassembly {
    /// Called when the connection is opened: its first byte has this number. Returns whether another connection had begun
    /// here.
    pub fn open(&mut self, sequence: u32) -> bool {
        let started = self.started.get_or_insert(StreamStart { first: sequence, next: ORIGIN });
        started.first != sequence
    }

    /// Returns whether the position of the first byte is known.
    pub fn has_begun(&self) -> bool {
        self.started.is_some()
    }

    /// Takes a segment, `cut` bytes of which the capture has cut off; `take` gets the bytes that are now in sequence.
    ///
    /// # Errors
    /// The error that `take` returns.
    pub fn push(
        &mut self,
        sequence: u32,
        payload: &[u8],
        cut: u64,
        mut take: impl FnMut(Piece<'_>) -> Result<()>,
    ) -> Result<()> {
        if payload.is_empty() && cut == 0 {
            return Ok(());
        }
        let StreamStart { first, next } =
            *self.started.get_or_insert(StreamStart { first: sequence, next: ORIGIN });
        // Half of the sequence numbers are before `next`, half are after it.
        let number = first.wrapping_add(wrapped(next.wrapping_sub(ORIGIN)));
        let start = next.saturating_add_signed(i64::from(sequence.wrapping_sub(number).cast_signed()));
        let end = start + payload.len() as u64;
        if start < ORIGIN && !(payload.len() <= 1 && start + 1 == next) {
            // Otherwise it is a keepalive: the byte before the next is sent again.
            take(Piece::BeforeStart(end.min(ORIGIN) - start))?;
        }
        self.report_late(start, end, &mut take)?;
        if start > next {
            self.wait(start, payload, cut);
            while self.waiting.len() > MAX_WAITING || self.waiting_bytes > MAX_WAITING_BYTES {
                self.pass_gap(&mut take)?;
            }
            return Ok(());
        }
        self.deliver(start, payload, cut, &mut take)?;
        self.in_order(&mut take)
    }

    /// Called at the end of the connection or of the capture: passes on the segments that still wait, with the gaps before
    /// them.
    ///
    /// # Errors
    /// The error that `take` returns.
    pub fn finish(&mut self, mut take: impl FnMut(Piece<'_>) -> Result<()>) -> Result<()> {
        while !self.waiting.is_empty() {
            self.pass_gap(&mut take)?;
        }
        Ok(())
    }

    /// Stores a segment that waits; of two copies the longer one.
    fn wait(&mut self, start: u64, payload: &[u8], cut: u64) {
        let kept = self.waiting.entry(start).or_default();
        if kept.0.len() < payload.len() || kept.0.is_empty() {
            self.waiting_bytes = self.waiting_bytes - kept.0.len() + payload.len();
            *kept = (payload.to_vec(), cut);
        }
    }

    /// Passes the next bytes to `take`, without those that were passed already and sent again.
    fn deliver(
        &mut self,
        start: u64,
        payload: &[u8],
        cut: u64,
        take: &mut impl FnMut(Piece<'_>) -> Result<()>,
    ) -> Result<()> {
        let Some(started) = &mut self.started else { return Ok(()) };
        let again = usize::try_from(started.next - start).unwrap_or(usize::MAX);
        let end = start + payload.len() as u64;
        let bytes = payload.get(again..).unwrap_or_default();
        let whole = started.next.max(end);
        started.next = whole.max(end + cut);
        let missing = started.next - whole;
        if !bytes.is_empty() {
            take(Piece::Bytes(bytes))?;
        }
        if missing > 0 {
            self.remember(whole, whole + missing);
            take(Piece::Cut(missing))?;
        }
        Ok(())
    }

    fn in_order(&mut self, take: &mut impl FnMut(Piece<'_>) -> Result<()>) -> Result<()> {
        while let (Some(entry), Some(StreamStart { next, .. })) = (self.waiting.first_entry(), self.started) {
            if *entry.key() > next {
                break;
            }
            let (start, (bytes, cut)) = entry.remove_entry();
            self.waiting_bytes -= bytes.len();
            self.deliver(start, &bytes, cut, take)?;
        }
        Ok(())
    }

    /// Skips the missing bytes before the first segment that waits.
    fn pass_gap(&mut self, take: &mut impl FnMut(Piece<'_>) -> Result<()>) -> Result<()> {
        let (Some((&start, _)), Some(started)) = (self.waiting.first_key_value(), &mut self.started) else {
            return Ok(());
        };
        let (from, missing) = (started.next, start.saturating_sub(started.next));
        started.next += missing;
        self.remember(from, start);
        take(Piece::Gap(missing))?;
        self.in_order(take)
    }

    fn remember(&mut self, from: u64, to: u64) {
        self.gaps.push_back((from, to));
        if self.gaps.len() > MAX_GAPS {
            self.gaps.pop_front();
        }
    }

    fn report_late(
        &self,
        start: u64,
        end: u64,
        take: &mut impl FnMut(Piece<'_>) -> Result<()>,
    ) -> Result<()> {
        let inside = |(from, to): &(u64, u64)| end.min(*to).saturating_sub(start.max(*from));
        match self.gaps.iter().map(inside).sum() {
            0 => Ok(()),
            late => take(Piece::Late(late)),
        }
    }
}

#[expect(clippy::cast_possible_truncation, reason = "sequence numbers wrap at 2^32")]
fn wrapped(distance: u64) -> u32 {
    distance as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the pieces of these segments as text: bytes as they are, the others in brackets.
    fn pieces(tcp: &mut Reassembly, segments: &[(u32, &str, u64)], ends: bool) -> String {
        let mut text = String::new();
        let mut take = |piece: Piece<'_>| {
            match piece {
                Piece::Bytes(bytes) => text.push_str(std::str::from_utf8(bytes)?),
                other => text.push_str(&format!("[{other:?}]")),
            }
            Ok(())
        };
        for (sequence, payload, cut) in segments {
            tcp.push(*sequence, payload.as_bytes(), *cut, &mut take).unwrap();
        }
        if ends {
            tcp.finish(&mut take).unwrap();
        }
        text
    }

    #[test]
    fn each_byte_is_returned_once_and_in_order() {
        let start = u32::MAX - 2; // wraps in the middle
        let at = |offset: u32| start.wrapping_add(offset);
        let mut tcp = Reassembly::default();
        assert!(!tcp.open(start));
        let segments = [
            (at(0), "abcd", 0),
            (at(6), "gh", 0),
            (at(0), "abcd", 0), // sent again
            (at(9), "jk", 0),
            (at(3), "def", 0), // overlaps
            (at(8), "ijkl", 0),
            (at(11), "l", 0), // is it alive
        ];
        assert_eq!(pieces(&mut tcp, &segments, true), "abcdefghijkl");
        assert!(!tcp.open(start) && tcp.open(start.wrapping_add(1)), "another connection");
    }

    #[test]
    fn what_is_missing_is_said_and_what_comes_too_late() {
        let text = pieces(&mut Reassembly::default(), &[(100, "ab", 0), (105, "fg", 0)], true);
        assert_eq!(text, "ab[Gap(3)]fg");
        let mut tcp = Reassembly::default();
        pieces(&mut tcp, &[(100, "ab", 0), (105, "fg", 0)], true);
        assert_eq!(pieces(&mut tcp, &[(101, "bcdef", 0), (107, "h", 0)], true), "[Late(3)]h");
        let text = pieces(&mut Reassembly::default(), &[(100, "cd", 0), (98, "abc", 0), (102, "e", 0)], true);
        assert_eq!(text, "cd[BeforeStart(2)]e");
    }

    #[test]
    fn what_the_capture_cut_off_is_said_at_its_place() {
        let text = pieces(&mut Reassembly::default(), &[(100, "ab", 4), (106, "gh", 0)], true);
        assert_eq!(text, "ab[Cut(4)]gh");
        let text =
            pieces(&mut Reassembly::default(), &[(100, "ab", 4), (100, "abcdef", 0), (106, "g", 0)], true);
        assert_eq!(text, "ab[Cut(4)][Late(4)]g");
        let text = pieces(&mut Reassembly::default(), &[(100, "a", 0), (103, "d", 2), (101, "bc", 0)], true);
        assert_eq!(text, "abcd[Cut(2)]");
    }

    #[test]
    fn what_waits_is_bounded() {
        let mut tcp = Reassembly::default();
        let mut text = pieces(&mut tcp, &[(0, "a", 0)], false);
        for n in 0..=u32::try_from(MAX_WAITING).unwrap() {
            text += &pieces(&mut tcp, &[(2 + n, "b", 0)], false);
        }
        assert_eq!(text, format!("a[Gap(1)]{}", "b".repeat(MAX_WAITING + 1)));
        let long = "c".repeat(MAX_WAITING_BYTES / 2 + 1);
        let mut tcp = Reassembly::default();
        let far = 1 << 21;
        let text = pieces(&mut tcp, &[(0, "a", 0), (2, &long, 0), (far, &long, 0)], false);
        assert_eq!(text.len(), "a[Gap(1)]".len() + long.len());
    }
}
