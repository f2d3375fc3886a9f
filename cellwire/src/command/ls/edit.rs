//! `cellwire ls edit`.

use std::io::Write;
use std::ops::RangeInclusive;
use std::path::PathBuf;

use anyhow::{Context, Result, bail, ensure};
use fanuc_ls::{
    Document, Expression, Finding, Index, Instruction, ItemKind, Level, Motion, MotionKind, Operation, Rules,
    Speed, SpeedUnit,
};

use super::check::files;
use super::difference::Change;
use cellwire_io::output::{counted, printable, remark, stdout};

/// Edits LS files, and shows the changes; --write applies them.
///
/// Only the affected words change; all other bytes stay. An edit that would introduce an error is refused.
/// --line and --positions use the numbers before any change; all replacements happen at once, so two items can be swapped.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Args {
    /// Files, or folders with .ls files at any depth
    #[arg(required = true)]
    files: Vec<PathBuf>,
    /// Change the speed of matching motions: a number or `*` with its unit, `L:` before it for one kind of motion; the new speed
    /// can be a factor, such as `*0.5`
    #[arg(long, value_name = "[KIND:]SPEED=SPEED", value_parser = SpeedChange::parse)]
    speed: Vec<SpeedChange>,
    /// Replace a register, input, output, label, position or frame everywhere: R[5]=R[105], UFRAME[1]=UFRAME[2]
    #[arg(long, value_name = "ITEM=ITEM", value_parser = replacement)]
    replace: Vec<(NamedItem, NamedItem)>,
    /// Set the name (comment) of a register, label or position: LBL[3]=retry; an empty name removes it
    #[arg(long, value_name = "ITEM=NAME", value_parser = naming)]
    name: Vec<(NamedItem, String)>,
    /// Shift positions, in mm, each in its own user frame
    #[arg(long, value_name = "X,Y,Z", value_delimiter = ',', num_args = 1, allow_hyphen_values = true)]
    shift: Option<Vec<f64>>,
    /// --shift: only these positions, such as 1-5,9
    #[arg(long, value_name = "NUMBERS", value_delimiter = ',', value_parser = numbers, requires = "shift")]
    positions: Vec<RangeInclusive<u32>>,
    /// Replace the instruction or comment of a line: '12=!new', '13=CALL OPEN'
    #[arg(long, value_name = "LINE=TEXT", value_parser = line)]
    line: Vec<(usize, String)>,
    /// The program's comment, 16 characters at most
    #[arg(long, value_name = "TEXT")]
    comment: Option<String>,
    /// Number the lines from 1
    #[arg(long)]
    renumber: bool,
    /// Write the files
    #[arg(long)]
    write: bool,
}

const EXAMPLES: &str = "\
Examples:
  cellwire ls edit WELD.LS --speed '100mm/sec=80mm/sec' --speed 'J:*%=*0.5'
  cellwire ls edit cell --replace 'R[5]=R[105]' --replace 'UFRAME[1]=UFRAME[3]' --write
  cellwire ls edit WELD.LS --shift 0,0,-2.5 --positions 3-7
  cellwire ls edit WELD.LS --name 'LBL[3]=retry' --line '12=!close the gripper' --renumber";

/// Edits the files; returns false if a file was rejected.
pub(super) fn edit(args: &Args) -> Result<bool> {
    let is_empty = args.speed.is_empty() && args.replace.is_empty() && args.name.is_empty();
    let is_empty = is_empty && args.shift.is_none() && args.line.is_empty() && args.comment.is_none();
    ensure!(
        !is_empty || args.renumber,
        "give at least one of --speed, --replace, --name, --shift, --line, --comment, --renumber"
    );
    let paths = files(&args.files)?;
    // All of them are tried before one is written.
    let (mut changes, mut refused) = (Vec::new(), 0);
    for path in &paths {
        let change = Change::read(path).and_then(|mut change| {
            args.apply(&mut change.document).with_context(|| path.display().to_string())?;
            Ok(change)
        });
        match change {
            Ok(change) => changes.push(change),
            Err(error) => {
                remark(&format!("error: {}", printable(&format!("{error:#}"))));
                refused += 1;
            }
        }
    }
    changes.retain(|change| !change.is_none());
    let mut out = stdout();
    for change in &changes {
        out.write_all(change.shown().as_bytes())?;
    }
    let (count, files) = (changes.len(), counted(paths.len(), "file"));
    if args.write && refused == 0 {
        changes.iter().try_for_each(Change::write)?;
        remark(&format!("{count} of {files} written"));
    } else if args.write {
        remark(&format!("nothing was written: {refused} of {files} refused"));
    } else {
        remark(&format!("{count} of {files} would change; --write applies the changes"));
    }
    Ok(refused == 0)
}

impl Args {
    fn apply(&self, document: &mut Document) -> Result<()> {
        let before = errors(document);
        for (number, text) in &self.line {
            let mut lines = document.statements();
            let index = lines.position(|line| line.number() == Some(*number) && !line.is_nested());
            drop(lines);
            let index = index.with_context(|| format!("there is no line {number}"))?;
            document.set_instruction(index, text)?;
        }
        document.set_speeds(|motion| self.speed.iter().find_map(|change| change.of(motion)))?;
        let there = document.items();
        for (from, to) in &self.replace {
            let is_taken = there.contains(to) && !self.replace.iter().any(|(from, _)| from == to);
            // Two labels or positions of one number are refused below.
            let is_refused = matches!(to.0, ItemKind::Label | ItemKind::Position);
            if is_taken && there.contains(from) && !is_refused {
                let ((from, n), (to, m)) = (from, to);
                remark(&format!("warning: {to}[{m}] is in {} as well as {from}[{n}]", document.name()));
            }
        }
        document.replace_items(|kind, number| {
            self.replace.iter().find(|(from, _)| *from == (kind, number)).map(|(_, to)| *to)
        })?;
        for ((kind, number), name) in &self.name {
            document.set_item_name(*kind, *number, name)?;
        }
        if let Some(by) = &self.shift {
            let by =
                by.as_slice().try_into().context("--shift needs three numbers, with commas between them")?;
            let is_meant = |number: u32| {
                self.positions.is_empty() || self.positions.iter().any(|range| range.contains(&number))
            };
            let (_, others) = document.shift_positions(by, |position| is_meant(position.number))?;
            if !others.is_empty() {
                let others: Vec<String> = others.iter().map(|number| format!("P[{number}]")).collect();
                let (name, others) = (document.name(), others.join(", "));
                remark(&format!("warning: {name}: not shifted, without X, Y and Z: {others}"));
            }
        }
        if let Some(comment) = &self.comment {
            let length = comment.chars().count();
            ensure!(
                length <= fanuc_ls::COMMENT_LENGTH,
                "--comment has {length} characters, the controller keeps 16"
            );
            document.set_attribute("COMMENT", &format!("\"{comment}\""))?;
        }
        if self.renumber {
            document.renumber_lines()?;
        }
        let after = errors(document);
        if after.len() > before.len() {
            let is_new = |error: &&Finding| !before.iter().any(|old| old.problem == error.problem);
            let new = after.iter().find(is_new).or(after.first());
            let Some(Finding { problem, line, .. }) = new else { bail!("this would be an error") };
            let text = document.to_string();
            let line = text.lines().nth(line - 1).unwrap_or_default();
            bail!("this would be an error: {problem}, in `{}`", line.trim());
        }
        Ok(())
    }
}

fn errors(document: &Document) -> Vec<Finding> {
    let mut found = document.findings(&Rules::default());
    found.retain(|finding| finding.problem.level() == Level::Error);
    found
}

type NamedItem = (ItemKind, u32);

/// The selected motions, and their new speed.
#[derive(Debug, Clone)]
struct SpeedChange {
    kind: Option<MotionKind>,
    /// None: any number.
    value: Option<f64>,
    /// None: any unit.
    unit: Option<SpeedUnit>,
    to: NewSpeed,
}

#[derive(Debug, Clone)]
enum NewSpeed {
    Factor(f64),
    Is(Speed),
}

impl SpeedChange {
    fn parse(text: &str) -> Result<Self> {
        let (from, to) = text.split_once('=').context("give SPEED=SPEED, such as 100mm/sec=80mm/sec")?;
        let kinds = [
            MotionKind::Joint,
            MotionKind::Linear,
            MotionKind::Circular,
            MotionKind::Arc,
            MotionKind::Spline,
        ];
        let (kind, from) = match from.split_once(':') {
            Some((letter, from)) => {
                let kind = kinds.into_iter().find(|kind| kind.letter().to_string() == letter.trim());
                (
                    Some(kind.with_context(|| format!("{letter} is not a motion: J, L, C, A or S"))?),
                    from.trim(),
                )
            }
            None => (None, from.trim()),
        };
        let (value, unit) = match from.strip_prefix('*') {
            Some("") => (None, None),
            Some(unit) => (None, speed(&format!("1{unit}"))?.unit()),
            None => match speed(from)? {
                Speed::Fixed { value, unit } => (Some(value), Some(unit)),
                _ => bail!("{from} is not a number with a unit"),
            },
        };
        let to = match to.trim().strip_prefix('*') {
            Some(factor) => {
                let factor: f64 = factor.trim().parse().context("a factor is a number, such as *0.5")?;
                ensure!(factor.is_finite() && factor > 0.0, "a factor is above 0");
                NewSpeed::Factor(factor)
            }
            None => NewSpeed::Is(speed(to.trim())?),
        };
        Ok(Self { kind, value, unit, to })
    }

    /// Returns the new speed of a motion; `None` if the motion is not selected.
    fn of(&self, motion: &Motion) -> Option<Speed> {
        let Speed::Fixed { value, unit } = motion.speed else { return None };
        #[expect(clippy::float_cmp, reason = "the same decimals are the same number")]
        let is_meant = self.kind.is_none_or(|kind| kind == motion.kind)
            && self.value.is_none_or(|meant| meant == value)
            && self.unit.is_none_or(|meant| meant == unit);
        match &self.to {
            _ if !is_meant => None,
            NewSpeed::Is(speed) => Some(speed.clone()),
            NewSpeed::Factor(factor) => {
                // As finely as a controller has them.
                let step = if unit == SpeedUnit::Percent { 1.0 } else { 10.0 };
                let value = ((value * factor * step).round() / step).max(1.0 / step);
                Some(Speed::Fixed { value, unit })
            }
        }
    }
}

/// Parses a speed in the form of a motion.
fn speed(text: &str) -> Result<Speed> {
    match Instruction::from_text(&format!("L P[1] {text} FINE")) {
        Some(Instruction::Motion(motion)) if motion.options.is_empty() => Ok(motion.speed),
        _ => bail!("{text} is not a speed such as 100mm/sec, 20%, 0.5sec or R[1]mm/sec"),
    }
}

fn named(text: &str) -> Result<NamedItem> {
    match Operation::decode(&format!("R[1]={}", text.trim())) {
        Some(Operation::Assign(_, Expression::Item(item))) => match item.index {
            Index::Number(number) if item.element.is_none() => Ok((item.kind, number)),
            _ => bail!("{text} has no number"),
        },
        _ => bail!("{text} is not an item such as R[1], PR[1], DI[1], LBL[1], P[1], UFRAME[1]"),
    }
}

fn replacement(text: &str) -> Result<(NamedItem, NamedItem)> {
    let (from, to) = text.split_once('=').context("give ITEM=ITEM, such as R[5]=R[105]")?;
    let (from, to) = (named(from)?, named(to)?);
    let keeps = [ItemKind::Label, ItemKind::Position, ItemKind::UserFrame, ItemKind::UserTool];
    let is_other = from.0 != to.0 && (keeps.contains(&from.0) || keeps.contains(&to.0));
    ensure!(!is_other, "{}[{}] cannot become {}[{}]", from.0, from.1, to.0, to.1);
    Ok((from, to))
}

fn naming(text: &str) -> Result<(NamedItem, String)> {
    let (item, name) = text.split_once('=').context("give ITEM=NAME, such as LBL[3]=retry")?;
    Ok((named(item)?, name.trim().to_owned()))
}

fn numbers(text: &str) -> Result<RangeInclusive<u32>> {
    let (first, last) = text.split_once('-').unwrap_or((text, text));
    let number = |text: &str| text.trim().parse::<u32>().with_context(|| format!("{text} is not a number"));
    Ok(number(first)?..=number(last)?)
}

fn line(text: &str) -> Result<(usize, String)> {
    let (number, text) = text.split_once('=').context("give LINE=TEXT, such as '12=!new'")?;
    Ok((number.trim().parse().context("the line number is missing")?, text.to_owned()))
}
