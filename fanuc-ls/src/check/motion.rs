//! Motions: their targets, speeds and options.

use super::Found;
use crate::expression::{Index, Item, ItemKind};
use crate::grammar;
use crate::mistake::{Expected, Mistake};
use crate::motion::{Motion, Speed, Target, Termination};

pub(super) fn check(motion: &Motion, place: &str, found: &mut Found<'_>) {
    for target in [motion.via.as_ref(), Some(&motion.target)].into_iter().flatten() {
        if let Some(mistake) = wrong(target) {
            found.add(place, mistake);
        }
    }
    match &motion.speed {
        Speed::Register { register, .. } => register_of_number(register, place, found),
        Speed::Named(name) => {
            let name = name.to_ascii_lowercase();
            if !name.contains("speed") && !name.contains("geschw") {
                found.add(place, Mistake::UnknownOption);
            }
        }
        Speed::Fixed { .. } => {}
    }
    match &motion.termination {
        Some(Termination::ContinuousRegister(register)) => register_of_number(register, place, found),
        Some(_) => {}
        // A corner distance stands in its place, or an application's own word, which is a finding.
        None if motion.options.starts_with("CD") || grammar::options(&motion.options).is_err() => {}
        None => found.add(place, Mistake::Termination),
    }
    if grammar::options(&motion.via_options).is_err_and(|trouble| trouble.mistake != Mistake::UnknownOption) {
        found.add(place, Mistake::UnknownOption);
    }
    let options = Motion::options_place(place);
    if let Err(trouble) = grammar::options(options) {
        let missing = if trouble.at.is_empty() { place.get(place.len()..).unwrap_or("") } else { trouble.at };
        found.add(missing, trouble.mistake);
    }
}

/// What is wrong with a target.
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

fn register_of_number(text: &str, place: &str, found: &mut Found<'_>) {
    if text == "..." {
        return found.add(place, Mistake::Untaught);
    }
    let is_one = grammar::item(text)
        .is_ok_and(|(_, item)| matches!(item.kind, ItemKind::Register | ItemKind::Argument));
    if !is_one {
        found.add(place, Mistake::Expected { what: Expected::Register });
    }
}
