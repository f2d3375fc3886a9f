//! How unlikely it is that one combination is true where another explains more.
//!
//! If the second were true, messages that only the first explains would be corrupt messages that are messages of the first by
//! chance. The frequency of such chance is measured with messages as the second writes them, each with a byte changed.

use serde_json::Value;

use super::combination::{Combination, Level, Piece, Reading};

/// Evidence of this many bits rules a combination out.
pub(super) const RULED_OUT_BITS: f64 = 10.0;
/// If nothing else is corrupt, bytes that are unlikely to be a message by chance are not corrupt either.
const CLEAN: f64 = 5.0;
const UNLIKELY: f64 = 1.0 / 32.0;
/// A corrupt value does not come again by chance.
const REPEATED_BITS: f64 = 12.0;
/// The number of corrupt messages that are tried: a few, and if they do not decide, many.
const TRIALS: [u32; 2] = [64, 8192];
/// The number of messages that are examined.
const MESSAGES: usize = 200;

/// Returns whether the evidence for `a` rules `b` out, less that against it.
pub(super) fn rules_out(a: &mut Combination, of_a: &Reading, b: &mut Combination, of_b: &Reading) -> bool {
    let bits = evidence(a, of_a, b, of_b);
    bits >= RULED_OUT_BITS && bits - evidence(b, of_b, a, of_a) >= RULED_OUT_BITS
}

/// Returns the evidence for `a` against `b`, in bits, from the bytes that `a` explains better.
pub(super) fn evidence(a: &mut Combination, of_a: &Reading, b: &mut Combination, of_b: &Reading) -> f64 {
    let better = |piece: &&Piece| match of_b.same(piece) {
        Some(same) => piece.level > same.level,
        None => of_b.overlapping(piece).iter().all(|other| piece.explains_more_than(other)),
    };
    let only: Vec<&Piece> = of_a.pieces.iter().filter(better).collect();
    let as_written = only.iter().filter(|piece| piece.level == Level::Written).count();
    // One that is only read may be one whose mark is corrupt.
    if only.is_empty() || as_written == 0 && only.len() == 1 {
        return 0.0;
    }
    let count = only.len();
    let again = repeated(&only, b) * REPEATED_BITS;
    let base = base(of_a, b);
    let mut bits = 0.0;
    for trials in TRIALS {
        let chance = chance(a, b, &base, trials);
        let clean = if of_a.corrupt == 0 && chance < UNLIKELY { CLEAN } else { 0.0 };
        bits = tail(count, count + of_a.corrupt, chance) + clean + again;
        if bits >= RULED_OUT_BITS {
            break;
        }
    }
    bits
}

/// Returns messages as the second combination writes them, each with the next one, because its end may depend on that.
fn base(of_a: &Reading, b: &mut Combination) -> Vec<(&'static str, Vec<u8>)> {
    let step = of_a.pieces.len() / MESSAGES + 1;
    let looked_at = || of_a.pieces.iter().enumerate().step_by(step);
    let mut written = |piece: &Piece| b.encode(piece.side, piece.value());
    let mut pairs = Vec::new();
    for (at, piece) in looked_at() {
        let behind = of_a.pieces.get(at + 1).filter(|next| next.stream == piece.stream);
        if let Some(first) = written(piece) {
            let second = behind.and_then(&mut written).unwrap_or_default();
            pairs.push((piece.side, [first, second].concat()));
        }
    }
    if pairs.is_empty() {
        pairs = looked_at().map(|(_, piece)| (piece.side, piece.bytes.clone())).collect();
    }
    pairs
}

/// Returns the probability that a corrupt message is one that `a` explains better.
fn chance(a: &mut Combination, b: &mut Combination, base: &[(&'static str, Vec<u8>)], trials: u32) -> f64 {
    let (mut random, mut better) = (Random(1), 0);
    for _ in 0..trials {
        let Some((side, bytes)) = base.get(random.below(base.len())) else { continue };
        let mut bytes = bytes.clone();
        corrupt(&mut bytes, &mut random);
        // Beside a corrupt byte there may be a whole message.
        if a.within(side, &bytes).weight > b.within(side, &bytes).weight {
            better += 1;
        }
    }
    (f64::from(better) + 0.5) / (f64::from(trials) + 1.0)
}

/// Changes one byte, and sometimes a second one.
pub(super) fn corrupt(bytes: &mut [u8], random: &mut Random) {
    let count = if random.below(5) == 0 { 2 } else { 1 };
    for _ in 0..count {
        let (at, by) = (random.below(bytes.len()), random.below(255));
        if let (Some(byte), Ok(by)) = (bytes.get_mut(at), u8::try_from(by)) {
            *byte = byte.wrapping_add(by + 1);
        }
    }
}

/// Returns the bits of at least `k` out of `n` if each has this chance: an upper bound of the exact figure.
fn tail(k: usize, n: usize, chance: f64) -> f64 {
    let real = |count: usize| u32::try_from(count).map_or(f64::MAX, f64::from);
    let ways: f64 = (0..k).map(|i| (real(n - i) / real(i + 1)).log2()).sum();
    (-ways - real(k) * chance.log2()).max(0.0)
}

/// Returns how often a value comes again that the second combination cannot write.
fn repeated(only: &[&Piece], b: &mut Combination) -> f64 {
    let mut culprits: Vec<String> = Vec::new();
    let mut again = 0.0;
    for piece in only.iter().take(MESSAGES) {
        let message = piece.value();
        if b.encode(piece.side, message.clone()).is_some() {
            continue;
        }
        for pointer in leaves(&message) {
            let mut plain = message.clone();
            let Some(leaf) = plain.pointer_mut(&pointer) else { continue };
            let culprit = format!("{pointer}={leaf}");
            *leaf = if leaf.is_string() { "a".into() } else { 1.into() };
            if b.encode(piece.side, plain).is_some() {
                again += if culprits.contains(&culprit) { 1.0 } else { 0.0 };
                culprits.push(culprit);
            }
        }
    }
    again
}

/// Returns the paths of the numbers and texts of a message.
fn leaves(value: &Value) -> Vec<String> {
    let below = |key: String, value| leaves(value).into_iter().map(move |rest| format!("/{key}{rest}"));
    match value {
        Value::Array(values) => {
            values.iter().enumerate().flat_map(|(at, value)| below(at.to_string(), value)).collect()
        }
        Value::Object(fields) => fields
            .iter()
            .flat_map(|(key, value)| below(key.replace('~', "~0").replace('/', "~1"), value))
            .collect(),
        Value::String(_) | Value::Number(_) => vec![String::new()],
        _ => Vec::new(),
    }
}

/// The same numbers each time.
pub(super) struct Random(pub(super) u64);

impl Random {
    /// Returns a number below this; 0 if `end` is 0.
    pub(super) fn below(&mut self, end: usize) -> usize {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let high = usize::try_from(self.0 >> 33).unwrap_or_default();
        high.checked_rem(end).unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use serde_json::json;

    use super::super::{Sender, Stream};
    use super::*;
    use cellwire_links::Link;

    #[test]
    fn the_bits_of_a_tail() {
        assert!((tail(1, 1, 0.5) - 1.0).abs() < 1e-9);
        assert!((tail(20, 20, 0.25) - 40.0).abs() < 1e-9);
        // Five places for one.
        assert!((tail(1, 5, 1.0 / 1024.0) - (10.0 - 5_f64.log2())).abs() < 1e-9);
        assert!(tail(1, 5, 0.5).abs() < 1e-9);
    }

    fn of(link: &str, given: &Value) -> Combination {
        Combination::new(Link::by_name(link).unwrap(), given.as_object().unwrap().clone()).unwrap()
    }

    fn sent(by: &Combination, side: &str, messages: &[Value]) -> Stream {
        let codec = (by.link.codec)(side, &by.settings).unwrap();
        let bytes = messages.iter().flat_map(|it| codec.encode(it.clone()).unwrap()).collect();
        Stream { sender: Sender::Named(side.into()), parts: vec![bytes], arrivals: Vec::new() }
    }

    #[test]
    fn the_messages_that_are_corrupted_are_written_by_the_other_settings() {
        let (mut strict, mut lone) =
            (of("mmacell-proto", &json!({})), of("mmacell-proto", &json!({"lone_lf": true})));
        let (sta, on) = (json!({"command": "STA"}), json!({"command": "SRV", "on": true}));
        let streams = [vec![sta.clone(), on], vec![sta.clone()]].map(|it| sent(&strict, "central", &it));
        let pairs = base(&strict.read(&streams, true).unwrap(), &mut lone);
        assert_eq!(pairs, ["STA\nSRVON\n", "SRVON\n", "STA\n"].map(|it| ("central", it.into())));
        for (count, looked_at) in [(199, 199), (200, 100), (601, 151)] {
            let many = [sent(&strict, "central", &vec![sta.clone(); count])];
            assert_eq!(base(&strict.read(&many, true).unwrap(), &mut lone).len(), looked_at, "of {count}");
        }
        // A message that the second combination cannot write has the bytes that were read.
        let [mut latin1, mut ascii] =
            ["latin1", "ascii"].map(|it| of("kawasaki-msg", &json!({ "charset": it })));
        let streams = [sent(&latin1, "pc", &[json!({"name": "ä", "fields": ["1"]})])];
        let pairs = base(&latin1.read(&streams, true).unwrap(), &mut ascii);
        assert_eq!(pairs[0].1, b"<\xE4$1#1#>");
    }

    #[test]
    fn one_byte_is_another_or_two_are() {
        let (mut random, mut changed) = (Random(1), [0; 3]);
        for _ in 0..1000 {
            let mut bytes = [7; 100];
            corrupt(&mut bytes, &mut random);
            changed[bytes.iter().filter(|byte| **byte != 7).count()] += 1;
        }
        assert!(changed[0] == 0 && (150..250).contains(&changed[2]), "{changed:?}");
        let numbers: Vec<usize> = (0..100).map(|_| random.below(4)).collect();
        assert!((0..4).all(|number| numbers.contains(&number)), "{numbers:?}");
        assert_eq!(random.below(0), 0);
    }

    /// The number of messages among this many corrupt messages of the other settings, and the evidence from it.
    #[test]
    fn what_is_read_proves_more_the_less_it_is_read_by_chance() {
        let motion = |segment: u8| {
            json!({"kind": "motion", "phase": "running", "error": 0, "segment_status": 2, "segment": segment,
                "percent": 50, "transform": null})
        };
        let jobs = |texts: &str| -> Vec<Value> {
            texts.chars().map(|it| json!({"name": "Job", "fields": [it.to_string(), "1"]})).collect()
        };
        let (plain, dle) = (json!({"leading_dle": 2}), json!({"leading_dle": 1}));
        let (latin1, ascii) = (json!({"charset": "latin1"}), json!({"charset": "ascii"}));
        for (messages, given, corrupt, better, bits, is_out) in [
            // With 5 bits where nothing is corrupt and chance is small.
            (vec![motion(1)], [&plain, &dle], 0, 0, "12.0", true),
            (vec![motion(1); 2], [&plain, &dle], 2, 0, "11.5", true),
            (vec![motion(1)], [&dle, &plain], 0, 5, "3.7", false),
            (jobs("aaäö"), [&latin1, &ascii], 1, 22, "2.4", false),
            // With 12 for each value that comes again.
            (jobs("aaää"), [&latin1, &ascii], 1, 22, "13.5", true),
            (jobs("aaäää"), [&latin1, &ascii], 0, 22, "28.6", true),
            (jobs("aa"), [&ascii, &latin1], 0, 0, "0.0", false),
        ] {
            let (link, side) = match messages[0].get("kind") {
                Some(_) => ("val2-alter", "robot"),
                None => ("kawasaki-msg", "pc"),
            };
            let [mut a, mut b] = given.map(|given| of(link, given));
            let streams = [sent(&a, side, &messages)];
            let mut of_a = a.read(&streams, true).unwrap();
            of_a.corrupt = corrupt;
            let of_b = b.read(&streams, true).unwrap();
            let base = base(&of_a, &mut b);
            let chance = chance(&mut a, &mut b, &base, 64) * 65.0 - 0.5;
            assert!((chance - f64::from(better)).abs() < 1e-9, "{chance} {messages:?}");
            let found = evidence(&mut a, &of_a, &mut b, &of_b);
            let found = (format!("{found:.1}"), rules_out(&mut a, &of_a, &mut b, &of_b));
            assert_eq!(found, (bits.to_owned(), is_out), "{messages:?}");
        }
        // Messages that only the other combination explains count against the first.
        let [mut a, mut b] = [&dle, &plain].map(|given| of("val2-alter", given));
        let [more, less] = [(&a, 20), (&b, 3)].map(|(by, count)| sent(by, "robot", &vec![motion(1); count]));
        let [of_a, of_b] = [&mut a, &mut b].map(|it| it.read(&[more.clone(), less.clone()], true).unwrap());
        assert!(rules_out(&mut a, &of_a, &mut b, &of_b));
        assert!(!rules_out(&mut b, &of_b, &mut a, &of_a));
    }

    /// A packet of another layout is read, and never written: its mark may be corrupt, but not that of two.
    #[test]
    fn one_message_that_is_only_read_proves_nothing() {
        let packet = [0x07, 0xF9, 0x52, 0x00, 0x01, 0x02, 0x03, 0x04, 0x05, 0x06, 0xE4];
        for (count, is_out) in [(1, false), (2, true)] {
            let [mut a, mut b] = [(); 2].map(|()| of("isra-ball", &json!({})));
            let stream = Stream { parts: vec![packet.repeat(count)], ..sent(&a, "ball", &[]) };
            let of_a = a.read(&[stream], true).unwrap();
            assert_eq!(rules_out(&mut a, &of_a, &mut b, &Reading::default()), is_out, "{count}");
        }
    }

    #[test]
    fn leaves_are_numbers_and_texts() {
        let value = serde_json::json!({"a": [1, {"b/c": "x"}], "d": null, "e": true});
        assert_eq!(leaves(&value), ["/a/0", "/a/1/b~1c"]);
    }
}
