//! Positions: checks that each has the values that a controller requires.

use super::Findings;
use crate::mistake::Mistake;
use crate::parts::{Parts, at};
use crate::position::{AxisName, AxisUnit, Group};

const CARTESIAN: [AxisName; 6] =
    [AxisName::X, AxisName::Y, AxisName::Z, AxisName::W, AxisName::P, AxisName::R];

pub(super) fn check(text: &str, parts: &Parts, mask: Option<&[bool]>, found: &mut Findings<'_>) {
    for (position, block) in parts.positions(text).zip(&parts.blocks) {
        let (Ok(position), place) = (position, at(text, block)) else { continue };
        let number = position.number;
        if let Some(mistake) = position.groups.iter().find_map(|group| wrong(number, group)) {
            found.add(place, mistake);
            continue;
        }
        let has = |group: usize| position.groups.iter().any(|found| usize::from(found.number) == group);
        let is_other = |mask: &[bool]| {
            (1..).zip(mask).any(|(group, moves)| *moves && !has(group))
                || position.groups.iter().any(|group| {
                    !mask.get(usize::from(group.number).wrapping_sub(1)).copied().unwrap_or(false)
                })
        };
        // A program without motions may have positions.
        if mask.is_some_and(|mask| mask.contains(&true) && is_other(mask)) {
            found.add(place, Mistake::Groups { number });
        }
    }
}

fn wrong(number: u32, group: &Group) -> Option<Mistake> {
    let has = |name: AxisName| group.axes.iter().any(|axis| axis.name == name);
    for (index, axis) in group.axes.iter().enumerate() {
        let name = axis.name;
        if group.axes.iter().skip(index + 1).any(|other| other.name == name) {
            return Some(Mistake::ForeignAxis { number, axis: name });
        }
        if matches!(name, AxisName::J(_))
            && axis.unit == AxisUnit::Deg
            && axis.value.is_some_and(|value| value.abs() > 720.0)
        {
            return Some(Mistake::Joint { number, axis: name });
        }
        let is_foreign = match name {
            AxisName::J(_) => has(AxisName::X),
            AxisName::E(_) => false,
            _ => has(AxisName::J(1)),
        };
        if is_foreign {
            return Some(Mistake::ForeignAxis { number, axis: name });
        }
        let unit = match name {
            AxisName::X | AxisName::Y | AxisName::Z | AxisName::RX | AxisName::RY | AxisName::RZ => {
                Some(AxisUnit::Mm)
            }
            AxisName::W | AxisName::P | AxisName::R | AxisName::RW | AxisName::RP | AxisName::RR => {
                Some(AxisUnit::Deg)
            }
            // They turn, or go along a rail.
            AxisName::J(_) | AxisName::E(_) => None,
        };
        if unit.is_some_and(|unit| unit != axis.unit) {
            return Some(Mistake::AxisUnit { number, axis: name });
        }
    }
    if CARTESIAN.iter().any(|name| has(*name))
        && let Some(axis) = CARTESIAN.into_iter().find(|name| !has(*name))
    {
        return Some(Mistake::MissingAxis { number, axis });
    }
    let joints = group.axes.iter().filter(|axis| matches!(axis.name, AxisName::J(_))).count();
    let expected = (1..=9).map(AxisName::J).take(joints);
    if let Some(axis) = { expected }.find(|name| !has(*name)) {
        return Some(Mistake::MissingAxis { number, axis });
    }
    let configuration = group.configuration.as_ref()?;
    (!is_configuration(&configuration.text)).then_some(Mistake::Configuration { number })
}

/// Returns whether a text is a configuration such as `N U T, 0, 0, 0`: each letter once, then turns.
fn is_configuration(text: &str) -> bool {
    let mut parts = text.split(',');
    let letters = parts.next().unwrap_or("");
    let choices = ["NF", "UD", "TB", "LR"];
    let mut seen = [false; 4];
    for word in letters.split_whitespace() {
        let found = choices.iter().position(|choice| word.len() == 1 && choice.contains(word));
        match found.and_then(|found| seen.get_mut(found)) {
            Some(seen) if !*seen => *seen = true,
            _ => return false,
        }
    }
    parts.all(|turn| turn.trim().parse::<i8>().is_ok_and(|turn| (-8..=7).contains(&turn)))
}
