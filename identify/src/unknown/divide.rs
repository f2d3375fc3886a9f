//! The beginnings and ends of messages: of all divisions of a stream, those with which it can be encoded in the fewest bits,
//! if each position of a message shows its usual values.
//!
//! Ways to divide: at a mark that begins messages or ends them; where bytes came after a pause, or in another packet.

use std::collections::{BTreeMap, HashMap};
use std::time::Duration;

use super::messages::marks as marks_of;
use super::real;
use super::symbols::{Part, Symbols};
use crate::Stream;

#[cfg(test)]
mod tests;

/// The longest mark that is searched for, in symbols; constant symbols beside it are found later.
const MARK: usize = 4;
/// The number of marks of each length that are tried.
const TRIED: usize = 8;
/// Fewer messages show nothing.
const FEWEST: usize = 5;
/// The number of messages of a division that are examined.
const MESSAGES: usize = 200;
/// The places at the beginning and at the end of messages that are compared: of bytes, and of a text's words.
const PLACES: [usize; 2] = [16, 8];
const PLACES_OF_TEXT: [usize; 2] = [48, 8];
/// The number of positions that may determine the kind of a message.
const KINDS: usize = 6;
/// The number of divisions that are examined.
const LOOKED_AT: usize = 64;
/// The numbers of messages of divisions that are shifted against each other differ by this many.
const SHIFTED: usize = 2;
/// The share of the best score that a division needs: nearly equal ones may be shifted against each other, so the fields of their
/// messages decide.
const NEARLY: f64 = 0.85;
const MAX_DIVISIONS: usize = 4;
/// If messages begin with arrivals, a division needs to save less.
const LESS: f64 = 0.5;
/// The share of beginnings of messages and of arrivals that must coincide.
const MIN_AGREEMENT: f64 = 0.7;
/// The weight of the whole stream's frequencies in the prediction of the next symbol at a place, in symbols.
const PRIOR: f64 = 2.0;
/// The number of bits that must be saved for a place to depend on the kind.
const DEPENDS: f64 = 3.0;

/// The symbol that determines the kind of a message, and a symbol of the message.
type OfKind = (Option<u32>, u32);

/// A stream, divided; messages that are cut off at an end are left out.
pub(super) struct Division {
    pub(super) messages: Vec<Vec<u8>>,
    /// The rank before the messages' fields are compared.
    pub(super) rank: DivisionRank,
}

/// The evidence for a division beside the bits that it saves, the most important first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct DivisionRank {
    /// Messages begin where bytes arrive: a message is sent at once.
    pub(super) together: bool,
    /// The first message begins with the capture.
    pub(super) begins: bool,
    /// The messages of a text end with the end of a line, or a bracket.
    closes: bool,
    /// The share of the messages with the marks of most, in percent.
    alike: usize,
    /// The length of the marks.
    marks: usize,
}

/// Messages as the first and the last symbol of each, by parts.
#[derive(PartialEq)]
struct Bounds {
    /// For each part the places at which it is cut.
    cuts: Vec<Vec<usize>>,
    /// The cuts are arrivals: the first and the last piece are messages too.
    whole: bool,
}

/// Returns the divisions of one end's bytes that explain most, the best first.
pub(super) fn divide(stream: &Stream) -> Vec<Division> {
    let symbols = Symbols::of(&stream.parts);
    let arrivals: Vec<Vec<Vec<usize>>> = pauses(&stream.arrivals)
        .iter()
        .map(|places| symbols.parts.iter().map(|part| part.at(places.iter())).collect())
        .collect();
    let mut all: Vec<Bounds> = marks(&symbols).iter().flat_map(|mark| cut(&symbols, mark)).collect();
    all.extend(arrivals.iter().map(|cuts| Bounds { cuts: cuts.clone(), whole: true }));
    let mut found: Vec<(f64, Bounds)> = Vec::new();
    for bounds in all {
        if !found.iter().any(|(_, known)| *known == bounds) && bounds.count() >= FEWEST {
            found.push((score(&symbols, &bounds, &[None]), bounds));
        }
    }
    found.sort_by(|(a, of_a), (b, of_b)| of_b.whole.cmp(&of_a.whole).then(b.total_cmp(a)));
    found.truncate(LOOKED_AT);
    // Divisions with as many messages are shifted against each other: the kinds of messages are those of the best.
    let kinds: Vec<Option<usize>> = (0..KINDS).map(Some).collect();
    let mut more: Vec<(usize, f64)> = Vec::new();
    for (bits, bounds) in &mut found {
        let count = bounds.count();
        let known = more.iter().find(|(of, _)| of.abs_diff(count) <= SHIFTED).map(|(_, more)| *more);
        let more_bits = known.unwrap_or_else(|| score(&symbols, bounds, &kinds) - *bits);
        more.push((count, more_bits));
        *bits += more_bits;
    }
    let most = found.iter().map(|(bits, _)| *bits).fold(0.0, f64::max);
    let mut found: Vec<(f64, Division)> =
        found.iter().map(|(bits, bounds)| (*bits, bounds.division(&symbols, &arrivals))).collect();
    let least = |it: &Division| most * if it.rank.together { LESS } else { NEARLY };
    found.retain(|(bits, it)| *bits > 0.0 && *bits >= least(it));
    found.sort_by(|(a, of_a), (b, of_b)| of_b.rank.cmp(&of_a.rank).then(b.total_cmp(a)));
    found.truncate(MAX_DIVISIONS);
    found.into_iter().map(|(_, division)| division).collect()
}

/// Returns places at which bytes came after a pause: all arrivals, and those after a pause that is much longer than others.
fn pauses(arrivals: &[(usize, Duration)]) -> Vec<Vec<usize>> {
    let gaps: Vec<(usize, Duration)> = arrivals
        .iter()
        .zip(arrivals.iter().skip(1))
        .map(|((_, before), (place, after))| (*place, after.saturating_sub(*before)))
        .collect();
    let Some((first, _)) = arrivals.first() else { return Vec::new() };
    let mut sorted: Vec<Duration> = gaps.iter().map(|(_, gap)| *gap).collect();
    sorted.sort_unstable();
    // The longest step between two pauses that follow each other in length.
    let steps = sorted.iter().zip(sorted.iter().skip(1)).enumerate();
    let ratio = |before: &Duration, after: &Duration| after.as_secs_f64() / before.as_secs_f64().max(1e-4);
    let longest = steps
        .filter(|(at, _)| sorted.len() - at > FEWEST)
        .map(|(_, (before, after))| (ratio(before, after), *after))
        .max_by(|(a, _), (b, _)| a.total_cmp(b));
    let behind = |least: Duration| {
        let places = gaps.iter().filter(|(_, gap)| *gap >= least).map(|(place, _)| *place);
        core::iter::once(*first).chain(places).collect::<Vec<usize>>()
    };
    let mut found = vec![behind(Duration::ZERO)];
    found.extend(longest.filter(|(ratio, _)| *ratio >= 2.0).map(|(_, least)| behind(least)));
    found
}

/// Returns the most frequent strings of a few symbols.
fn marks(symbols: &Symbols) -> Vec<Vec<u32>> {
    let mut found = Vec::new();
    for length in 1..=MARK {
        let mut counts: HashMap<&[u32], usize> = HashMap::new();
        for part in &symbols.parts {
            for window in part.symbols.windows(length) {
                *counts.entry(window).or_default() += 1;
            }
        }
        let mut counts: Vec<(usize, &[u32])> = counts
            .into_iter()
            .filter(|(_, count)| *count >= FEWEST)
            .map(|(mark, count)| (count, mark))
            .collect();
        counts.sort_by_key(|(count, mark)| (core::cmp::Reverse(*count), *mark));
        // Marks that are in all messages are adjacent in this sequence.
        found.extend(counts.into_iter().take(TRIED * length).map(|(_, mark)| mark.to_vec()));
    }
    found
}

/// Cuts before a mark; in a text also after it.
fn cut(symbols: &Symbols, mark: &[u32]) -> Vec<Bounds> {
    let places = |part: &Part| {
        let (mut places, mut at) = (Vec::new(), 0);
        while let Some(next) =
            part.symbols.get(at..).and_then(|rest| rest.windows(mark.len()).position(|it| it == mark))
        {
            // A mark after another one does not begin a message.
            if next > 0 || at == 0 {
                places.push(at + next);
            }
            at += next + mark.len();
        }
        places
    };
    let before: Vec<Vec<usize>> = symbols.parts.iter().map(places).collect();
    if !symbols.is_text {
        return vec![Bounds { cuts: before, whole: false }];
    }
    let behind = |(part, places): (&Part, &Vec<usize>)| {
        let mut cuts: Vec<usize> = places.iter().map(|at| at + mark.len()).collect();
        // The first bytes of the capture are a message if they begin like the others; otherwise the message is truncated.
        let firsts: Vec<&u32> = cuts.iter().filter_map(|at| part.symbols.get(*at)).collect();
        let first = part.symbols.first();
        if firsts.iter().filter(|it| Some(**it) == first).count() * 10 >= firsts.len() {
            cuts.insert(0, 0);
        }
        cuts
    };
    let behind = symbols.parts.iter().zip(&before).map(behind).collect();
    vec![Bounds { cuts: before, whole: false }, Bounds { cuts: behind, whole: false }]
}

impl Bounds {
    fn count(&self) -> usize {
        self.cuts.iter().map(|cuts| cuts.len().saturating_sub(1)).sum()
    }

    /// Returns the messages: the part, the first symbol, and the symbol after the last one.
    fn messages<'a>(&'a self, symbols: &'a Symbols) -> impl Iterator<Item = (&'a Part, usize, usize)> {
        symbols.parts.iter().zip(&self.cuts).flat_map(move |(part, cuts)| {
            let ends = cuts.iter().copied().skip(1);
            let ends = ends.chain(self.whole.then_some(part.symbols.len()));
            cuts.iter()
                .copied()
                .zip(ends)
                .filter(|(from, to)| from < to)
                .map(move |(from, to)| (part, from, to))
        })
    }

    fn division(&self, symbols: &Symbols, arrivals: &[Vec<Vec<usize>>]) -> Division {
        let messages: Vec<Vec<u8>> =
            self.messages(symbols).map(|(part, from, to)| part.bytes(from, to).to_vec()).collect();
        let all: Vec<&[u8]> = messages.iter().map(Vec::as_slice).take(MESSAGES).collect();
        let (begin, end) = marks_of(&all);
        let alike = all.iter().filter(|it| it.starts_with(&begin) && it.ends_with(&end)).count();
        let closing = |byte: &u8| byte.is_ascii_control() || b">)]};".contains(byte);
        let rank = DivisionRank {
            together: arrivals.iter().any(|arrivals| self.agreement(arrivals) >= MIN_AGREEMENT),
            begins: self.cuts.first().and_then(|cuts| cuts.first()) == Some(&0),
            closes: symbols.is_text && end.last().is_some_and(closing),
            alike: alike * 100 / all.len().max(1),
            marks: begin.len() + end.len(),
        };
        Division { messages, rank }
    }

    /// Returns the share of offsets at which both a message and an arrival begin, among those at which one of them begins.
    fn agreement(&self, arrivals: &[Vec<usize>]) -> f64 {
        let both = |(cuts, arrivals): (&Vec<usize>, &Vec<usize>)| {
            cuts.iter().filter(|at| arrivals.binary_search(at).is_ok()).count()
        };
        let both: usize = self.cuts.iter().zip(arrivals).map(both).sum();
        let count = |of: &[Vec<usize>]| of.iter().map(Vec::len).sum::<usize>();
        real(both) / real((count(&self.cuts) + count(arrivals) - both).max(1))
    }
}

/// Returns the number of bits that a division saves with the best position of the kinds.
fn score(symbols: &Symbols, bounds: &Bounds, kinds: &[Option<usize>]) -> f64 {
    let all = bounds.messages(symbols).count();
    let messages: Vec<&[u32]> = bounds
        .messages(symbols)
        .take(MESSAGES)
        .map(|(part, from, to)| part.symbols.get(from..to).unwrap_or_default())
        .collect();
    let longest = messages.iter().map(|it| it.len()).max().unwrap_or_default().max(2);
    let lengths = messages.iter().map(|it| u32::try_from(it.len()).unwrap_or(u32::MAX));
    let even = 1.0 / real(longest);
    let lengths =
        -saved(lengths.map(|length| (None, length)), &|_| even) + real(messages.len()) * -even.log2();
    let plain = places(symbols, &messages, None);
    let best = kinds.iter().map(|kind| {
        let with = places(symbols, &messages, *kind);
        let best = |place: &(bool, usize)| {
            let plain = plain.get(place).copied().unwrap_or_default();
            let with = if *kind == Some(place.1) && !place.0 {
                0.0
            } else {
                with.get(place).copied().unwrap_or_default()
            };
            plain.max(with - DEPENDS).max(0.0)
        };
        plain.keys().map(best).sum::<f64>()
    });
    // Arrivals give the length of each message.
    let lengths = if bounds.whole { 0.0 } else { lengths };
    (best.fold(0.0, f64::max) - lengths) * real(all) / real(messages.len().max(1))
}

/// Returns the number of bits saved at each position, counted from the beginning or from the end, that depends on the kind;
/// sorted, so that their sum is the same each time.
fn places(symbols: &Symbols, messages: &[&[u32]], kind: Option<usize>) -> BTreeMap<(bool, usize), f64> {
    let [first, last] = if symbols.is_text { PLACES_OF_TEXT } else { PLACES };
    let mut values: BTreeMap<(bool, usize), Vec<OfKind>> = BTreeMap::new();
    for message in messages {
        let of = kind.and_then(|at| message.get(at)).copied();
        let last = last.min(message.len() / 2);
        let first = first.min(message.len() - last);
        for (at, symbol) in message.iter().take(first).enumerate() {
            values.entry((false, at)).or_default().push((of, *symbol));
        }
        for (at, symbol) in message.iter().rev().take(last).enumerate() {
            values.entry((true, at)).or_default().push((of, *symbol));
        }
    }
    let saved = |values: Vec<OfKind>| saved(values.into_iter(), &|symbol| symbols.share(symbol));
    values.into_iter().map(|(place, values)| (place, saved(values))).collect()
}

/// Returns the number of bits saved if each value is encoded after the earlier values of the same kind.
fn saved(values: impl Iterator<Item = OfKind>, share: &dyn Fn(u32) -> f64) -> f64 {
    let (mut counts, mut totals) = (HashMap::<OfKind, f64>::new(), HashMap::<Option<u32>, f64>::new());
    let mut bits = 0.0;
    for (kind, value) in values {
        let (count, total) = (counts.entry((kind, value)).or_default(), totals.entry(kind).or_default());
        bits += ((*count / share(value) + PRIOR) / (*total + PRIOR)).log2();
        *count += 1.0;
        *total += 1.0;
    }
    bits
}
