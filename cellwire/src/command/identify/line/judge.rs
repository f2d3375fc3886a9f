//! The likelihood of each setting of a line, by the bytes that were received with it.

use anyhow::Result;
use cellwire_identify::{Finding, Sender, Stream, identify};
use cellwire_links::Link;
use serde::Serialize;
use serialport::{DataBits, Parity};

use super::{ReceivedBytes, Setting};

/// The share of broken characters with a right setting.
const RIGHT: f64 = 0.02;
/// A wrong parity is right for every other character; a low bit where a stop bit is due is met a bit less often.
const WRONG_PARITY: f64 = 0.5;
const WRONG_STOP: f64 = 0.3;
/// More characters do not make it surer: they are of the same few messages.
const MAX_CHARACTERS: f64 = 96.0;
/// The highest bit of every character is a stop bit that was taken for a data bit.
const NEVER_LOW: f64 = -20.0;
/// The highest weight of a link that explains the bytes, in bits.
const EXPLAINED: f64 = 40.0;

/// A setting, and the evidence for it.
#[derive(Debug, Clone, Serialize)]
pub(in super::super) struct SettingScore {
    #[serde(flatten)]
    pub(in super::super) setting: Setting,
    /// The number of received characters, and of broken ones among them.
    pub(in super::super) characters: usize,
    pub(in super::super) broken: usize,
    /// The share that a text has: letters, digits, and ends of lines.
    pub(in super::super) text: f64,
    /// The link that explains them.
    pub(in super::super) link: Option<&'static str>,
    /// The likelihood of the setting compared with a wrong one, in powers of 2.
    pub(in super::super) bits: f64,
}

impl SettingScore {
    pub(super) fn of(setting: Setting, heard: &ReceivedBytes) -> Self {
        let real = |count: usize| u32::try_from(count).map_or(f64::MAX, f64::from);
        let (characters, broken) = (heard.count(), heard.broken);
        let wrong = if setting.mode.parity == Parity::None { WRONG_STOP } else { WRONG_PARITY };
        let whole = real(heard.bytes.len()) * ((1.0 - RIGHT) / (1.0 - wrong)).log2();
        let bits = whole + real(broken) * (RIGHT / wrong).log2();
        let bits = bits * (MAX_CHARACTERS / real(characters.max(1))).min(1.0);
        let never_low = setting.mode.data_bits == DataBits::Eight
            && setting.mode.parity == Parity::None
            && heard.is_high();
        let of_text = heard.bytes.iter().filter(|byte| matches!(**byte, b' '..=b'~' | b'\r' | b'\n')).count();
        Self {
            setting,
            characters,
            broken,
            text: real(of_text) / real(heard.bytes.len().max(1)),
            link: None,
            bits: bits + if never_low { NEVER_LOW } else { 0.0 },
        }
    }

    /// Adds a link's reading of the bytes.
    pub(in super::super) fn explain(&mut self, links: &[&'static Link], heard: &ReceivedBytes) -> Result<()> {
        let stream =
            Stream { sender: Sender::Unknown, parts: vec![heard.bytes.clone()], arrivals: Vec::new() };
        let streams = [stream];
        let mut best: Option<Finding> = None;
        for link in links {
            let finding = identify(link, &streams)?;
            if finding.is_sure() && best.as_ref().is_none_or(|best| finding.rank() > best.rank()) {
                best = Some(finding);
            }
        }
        if let Some(best) = best {
            self.link = Some(best.link.short);
            self.bits += (best.bits * best.share()).min(EXPLAINED);
        }
        Ok(())
    }
}
