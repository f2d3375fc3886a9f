//! A limit for lines of which a peer can cause any number.

use core::time::Duration;
use std::collections::BTreeMap;

/// The most lines of a kind in a second.
pub(super) const PER_SECOND: u32 = 10;

/// The printed and the omitted lines of each kind.
#[derive(Debug)]
pub(super) struct Limiter(BTreeMap<String, Kind>);

#[derive(Debug, Default)]
struct Kind {
    /// The begin of the current second.
    begin: Duration,
    printed: u32,
    left_out: u64,
}

impl Limiter {
    pub(super) const NEW: Self = Self(BTreeMap::new());

    /// Returns whether a line of this kind is to be printed; counts it if not.
    pub(super) fn admits(&mut self, now: Duration, kind: &str) -> bool {
        let Some(known) = self.0.get_mut(kind) else {
            self.0.insert(kind.to_owned(), Kind { begin: now, printed: 1, left_out: 0 });
            return true;
        };
        if now.saturating_sub(known.begin) >= Duration::from_secs(1) {
            (known.begin, known.printed) = (now, 0);
        }
        let admits = known.printed < PER_SECOND;
        if admits {
            known.printed += 1;
        } else {
            known.left_out += 1;
        }
        admits
    }

    /// Returns the number of lines that were left out since the last call, by kind.
    pub(super) fn take_left_out(&mut self) -> impl Iterator<Item = (&str, u64)> {
        self.0.iter_mut().filter_map(|(kind, counts)| {
            let left_out = core::mem::take(&mut counts.left_out);
            (left_out > 0).then_some((kind.as_str(), left_out))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_kind_has_ten_lines_a_second_and_the_others_are_counted() {
        let mut limiter = Limiter::NEW;
        let admitted = |limiter: &mut Limiter, ms: u64, kind| {
            (0..25).filter(|_| limiter.admits(Duration::from_millis(ms), kind)).count()
        };
        assert_eq!(admitted(&mut limiter, 5000, "corrupt"), 10);
        assert_eq!(admitted(&mut limiter, 5999, "corrupt"), 0);
        assert_eq!(admitted(&mut limiter, 5999, "read"), 10);
        assert_eq!(limiter.take_left_out().collect::<Vec<_>>(), [("corrupt", 40), ("read", 15)]);
        assert_eq!(limiter.take_left_out().count(), 0);
        // The second in which they were counted has passed.
        assert_eq!(admitted(&mut limiter, 6000, "corrupt"), 10);
        assert_eq!(admitted(&mut limiter, 6000, "read"), 0);
        assert_eq!(limiter.take_left_out().collect::<Vec<_>>(), [("corrupt", 15), ("read", 25)]);
    }
}
