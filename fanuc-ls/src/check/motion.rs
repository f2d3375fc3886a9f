//! Motions: their targets, speeds and options.

use super::Findings;
use crate::expression::{Index, Item, ItemKind};
use crate::grammar;
use crate::mistake::{Expected, Mistake};
use crate::motion::{Motion, Speed, SpeedUnit, Target, Termination};

pub(super) fn check(motion: &Motion, place: &str, found: &mut Findings<'_>) {
    for target in [motion.via.as_ref(), Some(&motion.target)].into_iter().flatten() {
        if let Some(mistake) = wrong(target) {
            found.add(place, mistake);
        }
    }
    match &motion.speed {
        Speed::Register { register, .. } => register_of_number(register, place, found),
        Speed::Named(name) => {
            let lower = name.to_ascii_lowercase();
            if !lower.contains("speed") && !lower.contains("geschw") {
                found.add_unknown(place, name, Mistake::UnknownOption);
            }
        }
        Speed::Fixed { value, unit } => {
            if let Some(highest) = highest(*unit).filter(|highest| *value > f64::from(*highest)) {
                found.add(place, Mistake::HighSpeed { highest, unit: *unit });
            }
        }
    }
    match &motion.termination {
        Some(Termination::ContinuousRegister(register)) => register_of_number(register, place, found),
        Some(_) => {}
        // A corner distance stands in its place, or an application's own word, which is a finding.
        None if ["CD", "CR", "CTV"].iter().any(|word| motion.options.starts_with(word)) => {}
        None if grammar::options(&motion.options).is_err() => {}
        None => found.add(place, Mistake::Termination),
    }
    if grammar::options(&motion.via_options).is_err_and(|trouble| trouble.mistake != Mistake::UnknownOption) {
        found.add(place, Mistake::UnknownOption);
    }
    let options = Motion::options_place(place);
    if let Err(trouble) = grammar::options(options) {
        let missing = if trouble.at.is_empty() { place.get(place.len()..).unwrap_or("") } else { trouble.at };
        found.add_unknown(missing, trouble.at, trouble.mistake);
    }
    for option in motion.each_option() {
        let percent = option.strip_prefix("ACC").and_then(|percent| percent.trim().parse::<u16>().ok());
        if let Some(percent) = percent.filter(|percent| (HIGHEST_ACCELERATION + 1..=500).contains(percent)) {
            let at = options.find(option).and_then(|at| options.get(at..)).unwrap_or(place);
            found.add(at, Mistake::Acceleration { found: percent.into() });
        }
    }
}

/// The greatest ACC in percent of published exports; the manuals name 150.
const HIGHEST_ACCELERATION: u16 = 250;

/// Returns twice the greatest speed of the manuals, because some robots are faster than the range printed there.
fn highest(unit: SpeedUnit) -> Option<u32> {
    match unit {
        SpeedUnit::MmPerSec => Some(4000),
        SpeedUnit::CmPerMin => Some(24_000),
        SpeedUnit::InchPerMin => Some(9448),
        SpeedUnit::DegPerSec => Some(1000),
        SpeedUnit::Percent | SpeedUnit::Sec | SpeedUnit::Msec => None,
    }
}

/// Returns the mistake in a target.
fn wrong(target: &Target) -> Option<Mistake> {
    let number = match target {
        Target::Position { number, .. } | Target::Register { number, .. } => *number,
        Target::Other(text) => match grammar::item(text) {
            Ok(("", Item { kind: ItemKind::Position | ItemKind::PositionRegister, index, .. })) => {
                match index {
                    Index::Number(number) => number,
                    Index::Item(_) => return None,
                    Index::Untaught => return Some(Mistake::Untaught),
                }
            }
            _ => return Some(Mistake::Expected { what: Expected::Position }),
        },
    };
    let range = ItemKind::Position.range();
    (!range.contains(&number)).then_some(Mistake::Range { low: 1, high: 32767 })
}

fn register_of_number(text: &str, place: &str, found: &mut Findings<'_>) {
    if text == "..." {
        return found.add(place, Mistake::Untaught);
    }
    let is_one = grammar::item(text)
        .is_ok_and(|(_, item)| matches!(item.kind, ItemKind::Register | ItemKind::Argument));
    if !is_one {
        found.add(place, Mistake::Expected { what: Expected::Register });
    }
}
