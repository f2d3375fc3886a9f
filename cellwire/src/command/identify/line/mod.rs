//! The division of a serial line's bits into bytes: the rates and formats to listen with in turn, and those that explain the
//! received bytes. No port is opened here: see [`cellwire_io::marked`].

mod judge;
#[cfg(test)]
mod tests;

use core::fmt;
use std::time::Duration;

use serde::Serialize;
use serialport::{DataBits, Parity, StopBits};

use cellwire_io::serial::Mode;

pub(super) use judge::SettingScore;

/// The rates, those first that are met most often.
pub(super) const RATES: [u32; 10] = [9600, 19_200, 38_400, 115_200, 4800, 57_600, 2400, 1200, 600, 300];
/// The number of characters that show whether a rate and a format are right.
const ENOUGH_CHARACTERS: usize = 96;
/// The number of characters that are a beginning.
const SOME: usize = 24;
/// The highest share of broken characters with the right format, in percent, including characters that a change of format splits.
const CLEAN: usize = 10;
/// The lead of the best setting over the next one with which it is found, in bits.
const MIN_LEAD: f64 = 12.0;
/// The evidence that the best setting itself needs, in bits.
const LIKELY: f64 = 16.0;

/// A rate and a format.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Setting {
    pub(super) baud: u32,
    pub(super) mode: Mode,
}

/// The bytes that were received with a setting.
#[derive(Debug, Clone, Default)]
pub(super) struct ReceivedBytes {
    /// The characters that are whole.
    pub(super) bytes: Vec<u8>,
    /// When some of them were read: which byte was the first.
    pub(super) arrivals: Vec<(usize, Duration)>,
    /// The number of broken characters: with the wrong parity, or without a stop bit.
    pub(super) broken: usize,
    /// The number of times that the setting was listened with.
    pub(super) times: usize,
    /// The beginning of a mark.
    pending: Vec<u8>,
}

/// The search for the setting of a line.
#[derive(Debug, Default)]
pub(super) struct Search {
    heard: Vec<(Setting, ReceivedBytes)>,
}

/// Returns the mode with one stop bit: a receiver that expects one reads two as well.
pub(super) const fn mode(data_bits: DataBits, parity: Parity) -> Mode {
    Mode { data_bits, parity, stop_bits: StopBits::One }
}

/// The formats beside 8N1 that must be listened with. Seven bits and a parity are eight bits: 8N1 shows them as they are.
pub(super) const OTHER_MODES: [Mode; 3] = [
    mode(DataBits::Eight, Parity::Even),
    mode(DataBits::Eight, Parity::Odd),
    mode(DataBits::Seven, Parity::None),
];

impl Setting {
    pub(super) const fn eight_n_one(baud: u32) -> Self {
        Self { baud, mode: Mode::EIGHT_N_ONE }
    }

    const fn with(self, mode: Mode) -> Self {
        Self { mode, ..self }
    }

    /// Returns the setting with which to listen for it.
    pub(super) fn heard_as(self) -> Self {
        match (self.mode.data_bits, self.mode.parity) {
            (DataBits::Seven, Parity::Even | Parity::Odd) => self.with(Mode::EIGHT_N_ONE),
            _ => self,
        }
    }
}

/// As `--baud` and `--mode` have it.
impl fmt::Display for Setting {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} baud, {}", self.baud, self.mode)
    }
}

impl Serialize for Setting {
    fn serialize<S: serde::Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        use serde::ser::SerializeStruct as _;
        let mut object = to.serialize_struct("Setting", 2)?;
        object.serialize_field("baud", &self.baud)?;
        object.serialize_field("mode", &self.mode.to_string())?;
        object.end()
    }
}

impl ReceivedBytes {
    /// Takes the bytes of a port that marks errors: FF 00 and a broken character, FF FF for FF.
    pub(super) fn take(&mut self, time: Duration, marked: &[u8]) {
        self.arrivals.push((self.bytes.len(), time));
        for byte in marked {
            self.pending.push(*byte);
            match self.pending.as_slice() {
                [0xFF] | [0xFF, 0] => continue,
                [0xFF, 0, _] => self.broken += 1,
                _ => self.bytes.push(*byte),
            }
            self.pending.clear();
        }
    }

    /// Converts bytes that were received as 8N1 to seven bits and a parity.
    pub(super) fn of_seven(&self, parity: Parity) -> Self {
        let is_right = |byte: &u8| byte.count_ones().is_multiple_of(2) == (parity == Parity::Even);
        let mut heard = Self { broken: self.broken, ..Self::default() };
        let mut arrivals = self.arrivals.iter().copied().peekable();
        for (at, byte) in self.bytes.iter().enumerate() {
            while let Some((_, time)) = arrivals.next_if(|(place, _)| *place <= at) {
                heard.arrivals.push((heard.bytes.len(), time));
            }
            match is_right(byte) {
                true => heard.bytes.push(byte & 0x7F),
                false => heard.broken += 1,
            }
        }
        heard
    }

    /// Returns the number of characters, whole and broken.
    pub(super) fn count(&self) -> usize {
        self.bytes.len() + self.broken
    }

    fn is_clean(&self) -> bool {
        self.count() >= SOME && self.broken * 100 <= self.count() * CLEAN
    }

    /// Returns whether the highest bit is always set: it may be a stop bit that was taken for a data bit.
    fn is_high(&self) -> bool {
        self.count() >= SOME && self.bytes.iter().all(|byte| *byte >= 0x80)
    }
}

impl Search {
    pub(super) fn heard(&self, setting: Setting) -> Option<&ReceivedBytes> {
        self.heard.iter().find(|(known, _)| *known == setting).map(|(_, heard)| heard)
    }

    /// Returns whether a setting has been listened to for long enough.
    pub(super) fn has_enough(heard: &ReceivedBytes) -> bool {
        heard.count() >= ENOUGH_CHARACTERS
    }

    /// Returns the record of the bytes that are received with a setting.
    pub(super) fn listening(&mut self, setting: Setting) -> &mut ReceivedBytes {
        if self.heard(setting).is_none() {
            self.heard.push((setting, ReceivedBytes::default()));
        }
        let at = self.heard.iter().position(|(known, _)| *known == setting).unwrap_or_default();
        #[expect(clippy::indexing_slicing, reason = "it was pushed if it was not there")]
        &mut self.heard[at].1
    }

    /// Returns the next setting to listen with: the one with the fewest turns first; `None` when more bytes would not decide.
    /// `has` returns whether the port has a format.
    ///
    /// First all rates as 8N1. If one of them is clean, a character is ten bits long; otherwise it may be eleven, or nine.
    pub(super) fn next(&self, has: &dyn Fn(Mode) -> bool) -> Option<Setting> {
        let wanting = |setting: &Setting| self.heard(*setting).is_none_or(|heard| !Self::has_enough(heard));
        let times = |setting: &Setting| self.heard(*setting).map_or(0, |heard| heard.times);
        let plain = RATES.map(Setting::eight_n_one);
        if let Some(first) = plain.iter().find(|it| times(it) == 0) {
            return Some(*first);
        }
        let is = |what: fn(&ReceivedBytes) -> bool| move |it: &&Setting| self.heard(**it).is_some_and(what);
        let none_is_clean = !plain.iter().any(|it| is(ReceivedBytes::is_clean)(&it));
        let of = |mode: Mode| {
            let rates = plain.iter().filter(move |it| {
                none_is_clean || mode.data_bits == DataBits::Seven && is(ReceivedBytes::is_high)(it)
            });
            rates.map(move |it| it.with(mode))
        };
        let others = OTHER_MODES.into_iter().filter(|mode| has(*mode)).flat_map(of);
        let next = others.chain(plain).filter(wanting).min_by_key(times)?;
        (times(&next) == 0 || !self.is_decided()).then_some(next)
    }

    fn is_decided(&self) -> bool {
        let judged = self.judged();
        let Some(best) = judged.first() else { return false };
        let plain = self.heard(best.setting.with(Mode::EIGHT_N_ONE));
        let is_apart = judged.get(1).is_none_or(|second| best.bits - second.bits >= MIN_LEAD);
        best.bits >= LIKELY && is_apart && plain.is_some_and(|heard| heard.count() >= SOME)
    }

    /// Returns the bytes that were received with a setting, or would have been.
    pub(super) fn heard_with(&self, setting: Setting) -> Option<ReceivedBytes> {
        let heard = self.heard(setting.heard_as())?;
        Some(if setting == setting.heard_as() { heard.clone() } else { heard.of_seven(setting.mode.parity) })
    }

    /// Returns the settings with which bytes were received, the likeliest first.
    pub(super) fn judged(&self) -> Vec<SettingScore> {
        let seven = |setting: &Setting| {
            let parities =
                if setting.mode == Mode::EIGHT_N_ONE { &[Parity::Even, Parity::Odd][..] } else { &[] };
            let setting = *setting;
            parities.iter().map(move |parity| setting.with(mode(DataBits::Seven, *parity)))
        };
        let settings =
            self.heard.iter().flat_map(|(setting, _)| core::iter::once(*setting).chain(seven(setting)));
        // With characters of ten bits, a parity bit after the eighth data bit is a stop bit: always high.
        let has_ten =
            |it: &Setting| self.heard(it.with(Mode::EIGHT_N_ONE)).is_some_and(ReceivedBytes::is_clean);
        let is_longer = |it: &Setting| it.mode.data_bits == DataBits::Eight && it.mode.parity != Parity::None;
        let mut judged: Vec<SettingScore> = settings
            .filter(|it| !(is_longer(it) && has_ten(it)))
            .filter_map(|it| {
                Some(SettingScore::of(it, &self.heard_with(it).filter(|heard| heard.count() > 0)?))
            })
            .collect();
        judged.sort_by(|a, b| b.bits.total_cmp(&a.bits));
        judged
    }
}

/// Returns the settings that the best one does not rule out, beginning with itself.
pub(super) fn likely(judged: &[SettingScore]) -> &[SettingScore] {
    let most = judged.first().map_or(0.0, |best| best.bits);
    let count = judged.iter().take_while(|it| it.bits > most - MIN_LEAD).count();
    judged.get(..count).unwrap_or_default()
}
