//! Several ranges of registers in few requests.

use core::ops::Range;
use core::time::Duration;
use std::vec;
use std::vec::Vec;

use crate::message::limit;

/// The registers of a range, and the time of their read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Block {
    /// One register for each address.
    pub registers: Vec<u16>,
    /// The time of the reply, by [`now`](robot_session::now): equal for ranges of one request. Of a range of more than 125
    /// registers, the last reply.
    pub at: Duration,
}

/// A request for holding registers, and the ranges that are in it, by their indices in the caller's list.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct JoinedRequest {
    pub(crate) addresses: Range<u32>,
    pub(crate) ranges: Vec<usize>,
}

impl JoinedRequest {
    /// Returns the registers of `range` that this request has read.
    pub(crate) fn part_of<'a>(&self, range: &Range<u32>, read: &'a [u16]) -> &'a [u16] {
        let begin = range.start.saturating_sub(self.addresses.start);
        let end = range.end.saturating_sub(self.addresses.start);
        let [begin, end] = [begin, end].map(|at| usize::try_from(at).unwrap_or(usize::MAX).min(read.len()));
        read.get(begin..end).unwrap_or_default()
    }
}

/// Returns the requests for these ranges, by address: a range of up to 125 registers is in one request, together with others
/// that overlap it or are at most `gap` registers away, as far as they fit. A longer range needs several requests, an empty
/// one no request.
pub(crate) fn join(ranges: &[Range<u32>], gap: u16) -> Vec<JoinedRequest> {
    let most = u32::from(limit::READ_REGISTERS);
    let mut order: Vec<usize> = (0..ranges.len()).collect();
    order.sort_by_key(|at| ranges.get(*at).map(|range| range.start));
    let mut requests: Vec<JoinedRequest> = Vec::new();
    for (at, range) in order.into_iter().filter_map(|at| Some((at, ranges.get(at)?))) {
        let has_room = |JoinedRequest { addresses, .. }: &&mut JoinedRequest| {
            addresses.start <= range.start
                && range.start <= addresses.end.saturating_add(gap.into())
                && range.end.max(addresses.end) - addresses.start <= most
        };
        if range.is_empty() {
            continue;
        }
        if let Some(joined) = requests.iter_mut().rev().find(has_room) {
            joined.addresses.end = joined.addresses.end.max(range.end);
            joined.ranges.push(at);
            continue;
        }
        let mut start = range.start;
        while start < range.end {
            let end = range.end.min(start + most);
            requests.push(JoinedRequest { addresses: start..end, ranges: vec![at] });
            start = end;
        }
    }
    requests
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn joined(ranges: &[Range<u32>], gap: u16) -> Vec<(Range<u32>, Vec<usize>)> {
        join(ranges, gap).into_iter().map(|it| (it.addresses, it.ranges)).collect()
    }

    #[test]
    fn near_ranges_share_a_request_as_far_as_they_fit() {
        assert_eq!(joined(&[0..10, 12..20], 1), [(0..10, vec![0]), (12..20, vec![1])]);
        assert_eq!(joined(&[12..20, 0..10], 2), [(0..20, vec![1, 0])]);
        // Each range is whole, although 150 registers would take two requests in any case.
        assert_eq!(joined(&[0..100, 50..150, 3..3], 0), [(0..100, vec![0]), (50..150, vec![1])]);
        assert_eq!(joined(&[0..100, 5..6, 100..126], 0), [(0..100, vec![0, 1]), (100..126, vec![2])]);
        assert_eq!(
            joined(&[0..300, 310..320], 10),
            [(0..125, vec![0]), (125..250, vec![0]), (250..320, vec![0, 1])]
        );
    }

    proptest! {
        #[test]
        fn every_register_is_read_once_for_its_range(
            ranges in proptest::collection::vec((0..400_u32, 0..200_u32).prop_map(|(at, n)| at..at + n), 0..12),
            gap in 0..20_u16,
        ) {
            let requests = join(&ranges, gap);
            let mut found = vec![Vec::new(); ranges.len()];
            for request in &requests {
                prop_assert!((1..=125).contains(&request.addresses.len()));
                let read: Vec<u16> = request.addresses.clone().map(|it| u16::try_from(it).unwrap()).collect();
                for at in &request.ranges {
                    found[*at].extend_from_slice(request.part_of(&ranges[*at], &read));
                }
            }
            for (range, found) in ranges.iter().zip(&found) {
                prop_assert!(range.clone().eq(found.iter().copied().map(u32::from)), "{range:?}: {found:?}");
                let requests = requests.iter().filter(|it| it.ranges.iter().any(|at| ranges[*at] == *range));
                prop_assert!(range.len() > 125 || requests.count() <= ranges.iter().filter(|it| *it == range).count());
            }
        }
    }
}
