//! How statements hang together: blocks, labels, lines that nothing leads to, frames that are chosen.

use alloc::collections::{BTreeMap, BTreeSet};
use alloc::vec::Vec;

use super::{Findings, Line, LineKind};
use crate::expression::{Expression, Index, Item, ItemKind};
use crate::grammar;
use crate::mistake::{Block, Mistake};
use crate::motion::{Motion, Target};
use crate::operation::Operation;
use crate::position::Position;

/// A block that is open.
struct OpenBlock<'a> {
    block: Block,
    place: &'a str,
    has_else: bool,
}

pub(super) fn blocks(lines: &[Line<'_>], found: &mut Findings<'_>) {
    let mut open: Vec<OpenBlock<'_>> = Vec::new();
    let mut in_select = false;
    for line in lines {
        let begin = |block| OpenBlock { block, place: line.place, has_else: false };
        let LineKind::Operation(operation) = &line.what else {
            // A comment may stand among the cases; an instruction that is not understood may be a case, or begin a block.
            in_select &= !matches!(line.what, LineKind::Motion(_));
            if matches!(line.what, LineKind::Unknown)
                && line.place.starts_with("IF")
                && line.place.ends_with("THEN")
            {
                open.push(begin(Block::If));
            } else if matches!(line.what, LineKind::Unknown) && line.place.starts_with("FOR") {
                open.push(begin(Block::For));
            }
            continue;
        };
        match operation {
            Operation::IfThen(_) => open.push(begin(Block::If)),
            Operation::For { from, to, down, .. } => {
                open.push(begin(Block::For));
                let (first, last) = if *down { (to, from) } else { (from, to) };
                if first.constant().zip(last.constant()).is_some_and(|(first, last)| first > last) {
                    found.add(line.place, Mistake::EmptyLoop);
                }
            }
            Operation::Else => match open.last_mut() {
                Some(OpenBlock { block: Block::If, has_else, .. }) => {
                    if *has_else {
                        found.add(line.place, Mistake::RepeatedElse);
                    }
                    *has_else = true;
                }
                inner => {
                    let inner = inner.map(|open| open.block);
                    let is_within = inner.is_some() && open.iter().any(|open| open.block == Block::If);
                    found.add(
                        line.place,
                        match inner {
                            Some(block) if is_within => Mistake::Crossed { block },
                            _ => Mistake::NotOpen { block: Block::If },
                        },
                    );
                }
            },
            Operation::EndIf => close(Block::If, &mut open, line.place, found),
            Operation::EndFor => close(Block::For, &mut open, line.place, found),
            Operation::Case(..) | Operation::Otherwise(_) if !in_select => {
                found.add(line.place, Mistake::NotOpen { block: Block::Select });
            }
            _ => {}
        }
        in_select = matches!(operation, Operation::Select(..) | Operation::Case(..));
    }
    for OpenBlock { block, place, .. } in open {
        found.add(place, Mistake::Open { block });
    }
}

fn close(block: Block, open: &mut Vec<OpenBlock<'_>>, place: &str, found: &mut Findings<'_>) {
    match open.iter().rposition(|open| open.block == block) {
        None => found.add(place, Mistake::NotOpen { block }),
        Some(at) => {
            if let Some(inner) = open.get(at + 1) {
                found.add(place, Mistake::Crossed { block: inner.block });
            }
            open.truncate(at);
        }
    }
}

pub(super) fn labels(lines: &[Line<'_>], found: &mut Findings<'_>) {
    let mut labels = BTreeSet::new();
    for line in lines {
        if let LineKind::Operation(Operation::Label(Item { index: Index::Number(number), .. })) = line.what
            && !labels.insert(number)
        {
            found.add(line.place, Mistake::RepeatedLabel { number });
        }
    }
    // One of these lines may be the label.
    if lines.iter().any(|line| matches!(line.what, LineKind::Unknown) && line.place.contains("LBL[")) {
        return;
    }
    for line in lines {
        for number in jumps(line) {
            if !labels.contains(&number) {
                found.add(line.place, Mistake::UndefinedLabel { number });
            }
        }
    }
}

/// Returns the labels that a statement may jump to.
fn jumps(line: &Line<'_>) -> Vec<u32> {
    let number = |item: &Item| match (item.kind, &item.index) {
        (ItemKind::Label, Index::Number(number)) => Some(*number),
        _ => None,
    };
    match &line.what {
        LineKind::Operation(operation) => match operation.action() {
            Operation::Jump(label) | Operation::WaitFor { timeout: Some(label), .. } => {
                number(label).into_iter().collect()
            }
            Operation::Command { text, .. } => named_labels(text).iter().filter_map(number).collect(),
            _ => Vec::new(),
        },
        LineKind::Motion(motion) => named_labels(&motion.options).iter().filter_map(number).collect(),
        _ => Vec::new(),
    }
}

/// Returns the labels in a text, as in `Skip,LBL[1]` and `JMP LBL[1]`.
fn named_labels(text: &str) -> Vec<Item> {
    let places = ["LBL[", "LABEL["].into_iter().flat_map(|word| text.match_indices(word));
    places.filter_map(|(at, _)| grammar::item(text.get(at..)?).ok()).map(|(_, item)| item).collect()
}

/// Reports the first unreachable line after each jump.
pub(super) fn unreachable(lines: &[Line<'_>], found: &mut Findings<'_>) {
    let mut is_dead = false;
    for line in lines {
        match &line.what {
            LineKind::Nothing => {}
            LineKind::Operation(operation) => match operation {
                Operation::Label(_)
                | Operation::Else
                | Operation::EndIf
                | Operation::EndFor
                | Operation::Case(..)
                | Operation::Otherwise(_)
                | Operation::When(..) => is_dead = false,
                _ => {
                    // Many programs finish with END even after the last reachable instruction.
                    let is_end = matches!(operation, Operation::End | Operation::Abort | Operation::Jump(_));
                    if is_dead && !is_end {
                        found.add(line.place, Mistake::Unreachable);
                        is_dead = false;
                    }
                    is_dead |= is_end;
                }
            },
            LineKind::Motion(_) => {
                if is_dead {
                    found.add(line.place, Mistake::Unreachable);
                }
                is_dead = false;
            }
            LineKind::Unknown => is_dead = false,
        }
    }
}

/// Finds the first motion with Skip that no condition precedes.
pub(super) fn skips(lines: &[Line<'_>], found: &mut Findings<'_>) {
    for line in lines {
        match &line.what {
            LineKind::Operation(
                Operation::Command { name: "SKIP CONDITION", .. } | Operation::Call { .. },
            ) => {
                return;
            }
            LineKind::Motion(motion) if motion.options.contains("Skip,") => {
                return found.add(line.place, Mistake::SkipCondition);
            }
            _ => {}
        }
    }
}

/// Finds motions to a position of another frame than the program has selected.
pub(super) fn frames(lines: &[Line<'_>], positions: &BTreeMap<u32, Position>, found: &mut Findings<'_>) {
    let (mut frame, mut tool) = (None, None);
    let mut told = BTreeSet::new();
    for line in lines {
        match &line.what {
            LineKind::Nothing => {}
            LineKind::Motion(Motion { via, target, .. }) => {
                for target in via.iter().chain([target]) {
                    let Target::Position { number, .. } = target else { continue };
                    let group = positions.get(number).and_then(|position| position.groups.first());
                    let (Some(group), number) = (group, *number) else { continue };
                    // Once for each pair: if one position is of another frame, all of them may be.
                    let mut other = |is_tool: bool, chosen: Option<u16>, found: Option<u16>| {
                        let pair = chosen.zip(found).filter(|(chosen, found)| chosen != found);
                        pair.filter(|pair| told.insert((is_tool, *pair)))
                    };
                    if let Some((chosen, of)) = other(false, frame, group.user_frame) {
                        found.add(line.place, Mistake::Frame { number, found: of, chosen });
                    }
                    if let Some((chosen, of)) = other(true, tool, group.user_tool) {
                        found.add(line.place, Mistake::Tool { number, found: of, chosen });
                    }
                }
            }
            LineKind::Operation(Operation::UserFrame(value)) => frame = whole(value),
            LineKind::Operation(Operation::UserTool(value)) => tool = whole(value),
            LineKind::Operation(operation) => match operation.action() {
                Operation::Assign(..)
                | Operation::Pulse(..)
                | Operation::Timer(..)
                | Operation::Wait(_)
                | Operation::WaitFor { timeout: None, .. }
                | Operation::Message(_)
                | Operation::Payload(_)
                | Operation::Override(_)
                | Operation::Jump(_) => {}
                // A called program, or one that jumps to this label, may have selected another frame or tool.
                _ => (frame, tool) = (None, None),
            },
            LineKind::Unknown => (frame, tool) = (None, None),
        }
    }
}

fn whole(value: &Expression) -> Option<u16> {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "in its range")]
    value.constant().filter(|number| (0.0..1000.0).contains(number)).map(|number| number as u16)
}
