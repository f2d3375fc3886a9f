//! The picture of a run: the acts of each device, attempt after attempt, until there was a part of every fate.

use std::path::Path;
use std::time::Duration;

use anyhow::{Result, anyhow};
use mmacell_task::Step;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::workpiece::{Outcome, Record};
use crate::fine::{self, Area, Drawn, FINE, UNIT};
use cellwire_io::files;

const SIZE: (i32, i32) = (1600 * UNIT, 603 * UNIT);
const LEFT: i32 = 150 * UNIT;
const RIGHT: i32 = 30 * UNIT;
const TOP: i32 = 124 * UNIT;
const LANE: i32 = 52 * UNIT;
const LANES: i32 = 8;
const BAR: i32 = 30 * UNIT;

const INK: RGBColor = RGBColor(40, 44, 52);
const FAINT: RGBColor = RGBColor(205, 210, 218);
const STEP: RGBColor = RGBColor(128, 136, 148);
const ROBOT: RGBColor = RGBColor(66, 113, 174);
const TO_PART: RGBColor = RGBColor(38, 74, 128);
const CARRY: RGBColor = RGBColor(46, 138, 120);
const PLATFORM: RGBColor = RGBColor(126, 106, 176);
const EYES: RGBColor = RGBColor(216, 150, 40);
const AIR: RGBColor = RGBColor(120, 170, 210);
const GOOD: RGBColor = RGBColor(58, 145, 84);
const BAD: RGBColor = RGBColor(198, 66, 60);

/// A bar in a lane.
struct Span {
    from: Duration,
    to: Duration,
    color: RGBColor,
    label: &'static str,
}

/// Draws the run from its beginning until one part was placed, one missed and one lost, or as far as is readable.
pub fn draw(path: &Path, steps: &[(Duration, Step)], record: &Record) -> Result<()> {
    let (from, to) =
        window(steps, record).ok_or_else(|| anyhow!("there is nothing to draw: no part was handled"))?;
    let size = [SIZE.0, SIZE.1].map(|length| (length / UNIT).unsigned_abs());
    let drawn = fine::draw(path.display(), size, |area| Picture { area, from, to }.draw(steps, record))?;
    files::write(path, drawn.as_bytes())
}

/// Returns the times of six attempts: the first in which one part is placed, one missed and one lost, if there are any.
fn window(steps: &[(Duration, Step)], record: &Record) -> Option<(Duration, Duration)> {
    const SHOWN: usize = 6;
    let begins = steps.iter().filter(|(_, step)| *step == Step::GoCamera1).map(|(at, _)| *at);
    let begins: Vec<Duration> = begins.chain([steps.last()?.0]).collect();
    let mut windows =
        begins.windows(SHOWN.min(begins.len() - 1) + 1).filter_map(|w| Some((*w.first()?, *w.last()?)));
    let first = windows.clone().next()?;
    let holds = |(from, to): &(Duration, Duration), fate: Outcome| {
        record.outcomes.iter().any(|(at, outcome)| *outcome == fate && (from..=to).contains(&at))
    };
    let fates = [Outcome::Placed, Outcome::Missed, Outcome::Lost];
    Some(windows.find(|window| fates.into_iter().all(|fate| holds(window, fate))).unwrap_or(first))
}

struct Picture<'a, 'b> {
    area: &'a Area<'b>,
    from: Duration,
    to: Duration,
}

impl Picture<'_, '_> {
    fn draw(&self, steps: &[(Duration, Step)], record: &Record) -> Drawn {
        self.text(
            (LEFT, 30 * UNIT),
            "Pick and place: what each device of the cell does",
            22,
            INK,
            HPos::Left,
        )?;
        let legend = "one attempt between lines; a missed or lost part is retried from step 7";
        self.text((LEFT, 56 * UNIT), legend, 14, INK, HPos::Left)?;
        self.legend()?;
        self.attempts(steps)?;
        self.axis()?;
        let lanes = [
            ("Step", spans(steps, numbers)),
            ("Robot", spans(steps, robot)),
            ("Platform", spans(steps, platform)),
            ("Cameras", spans(steps, cameras)),
            ("Vacuum", levels(&record.vacuum, self.to, AIR)),
            ("Vacuum switch", levels(&record.switch, self.to, CARRY)),
            ("Blow", levels(&record.blow, self.to, EYES)),
        ];
        for (row, (name, spans)) in lanes.iter().enumerate() {
            self.lane(i32::try_from(row).unwrap_or_default(), name, spans)?;
        }
        self.outcomes(&record.outcomes)
    }

    /// Draws the meaning of the colours, beside the labels of the bars.
    fn legend(&self) -> Drawn {
        let mut left = LEFT;
        for (color, text) in [
            (ROBOT, "robot without a part"),
            (TO_PART, "robot at the part"),
            (CARRY, "robot with the part, part on the gripper"),
            (PLATFORM, "platform turns"),
            (EYES, "camera looks, valve blows"),
            (AIR, "vacuum on"),
            (STEP, "other steps"),
            (GOOD, "placed"),
            (BAD, "missed, lost, dropped, given up"),
        ] {
            let corners = [(left, 73 * UNIT), (left + 14 * UNIT, 87 * UNIT)];
            self.area.draw(&Rectangle::new(corners, color.filled()))?;
            self.text((left + 20 * UNIT, 80 * UNIT), text, 13, INK, HPos::Left)?;
            left += 44 * UNIT + i32::try_from(text.len()).unwrap_or_default() * 28 * UNIT / 5;
        }
        Ok(())
    }

    fn attempts(&self, steps: &[(Duration, Step)]) -> Drawn {
        for (at, _) in steps.iter().filter(|(at, step)| *step == Step::GoCamera1 && self.shows(*at)) {
            let x = self.x(*at);
            self.area
                .draw(&PathElement::new([(x, TOP - 14 * UNIT), (x, TOP + LANES * LANE)], thin(FAINT)))?;
        }
        Ok(())
    }

    fn axis(&self) -> Drawn {
        let bottom = TOP + LANES * LANE;
        self.area.draw(&PathElement::new([(LEFT, bottom), (SIZE.0 - RIGHT, bottom)], thin(INK)))?;
        let span = (self.to - self.from).as_secs_f64();
        let every = [1u32, 2, 5, 10, 20, 50].into_iter().find(|every| span / f64::from(*every) <= 20.0);
        let seconds =
            (0u32..).map(|n| n * every.unwrap_or(100)).take_while(|second| f64::from(*second) <= span);
        for second in seconds {
            let x = self.x(self.from + Duration::from_secs(second.into()));
            self.area.draw(&PathElement::new([(x, bottom), (x, bottom + 5 * UNIT)], thin(INK)))?;
            self.text((x, bottom + 16 * UNIT), &format!("{second} s"), 13, INK, HPos::Center)?;
        }
        self.text(((LEFT + SIZE.0 - RIGHT) / 2, bottom + 38 * UNIT), "cell time", 14, INK, HPos::Center)
    }

    fn lane(&self, row: i32, name: &str, spans: &[Span]) -> Drawn {
        let middle = TOP + row * LANE + LANE / 2;
        self.text((LEFT - 14 * UNIT, middle), name, 15, INK, HPos::Right)?;
        self.area.draw(&PathElement::new([(LEFT, middle), (SIZE.0 - RIGHT, middle)], thin(FAINT)))?;
        for span in spans.iter().filter(|span| span.to > self.from && span.from < self.to) {
            // A white line between neighbours.
            let (left, right) =
                (self.x(span.from), (self.x(span.to) - UNIT).max(self.x(span.from) + 2 * UNIT));
            let corners = [(left, middle - BAR / 2), (right, middle + BAR / 2)];
            self.area.draw(&Rectangle::new(corners, span.color.filled()))?;
            let width = i32::try_from(span.label.chars().count()).unwrap_or_default() * 6 * UNIT;
            if width > 0 && width < right - left {
                self.text(((left + right) / 2, middle), span.label, 12, WHITE, HPos::Center)?;
            }
        }
        Ok(())
    }

    fn outcomes(&self, outcomes: &[(Duration, Outcome)]) -> Drawn {
        let middle = TOP + (LANES - 1) * LANE + LANE / 2;
        self.text((LEFT - 14 * UNIT, middle), "The part is", 15, INK, HPos::Right)?;
        for (at, outcome) in outcomes.iter().filter(|(at, _)| self.shows(*at)) {
            let (color, label) = match outcome {
                Outcome::Placed => (GOOD, "placed"),
                Outcome::Missed => (BAD, "missed"),
                Outcome::Lost => (BAD, "lost"),
                Outcome::Dropped => (BAD, "dropped"),
            };
            let x = self.x(*at);
            self.area.draw(&PathElement::new(
                [(x, TOP), (x, middle - 8 * UNIT)],
                color.mix(0.45).stroke_width(FINE),
            ))?;
            self.area.draw(&Circle::new((x, middle), 6 * UNIT, color.filled()))?;
            self.text((x - 12 * UNIT, middle), label, 14, color, HPos::Right)?;
        }
        Ok(())
    }

    fn text(&self, at: (i32, i32), text: &str, size: i32, color: RGBColor, side: HPos) -> Drawn {
        let style =
            TextStyle::from(("sans-serif", size * UNIT)).color(&color).pos(Pos::new(side, VPos::Center));
        self.area.draw_text(text, &style, at)
    }

    fn shows(&self, at: Duration) -> bool {
        (self.from..=self.to).contains(&at)
    }

    #[expect(clippy::cast_possible_truncation, reason = "a coordinate within the picture")]
    fn x(&self, at: Duration) -> i32 {
        let share = at.clamp(self.from, self.to).saturating_sub(self.from).as_secs_f64();
        let share = share / (self.to - self.from).as_secs_f64().max(1e-9);
        LEFT + (share * f64::from(SIZE.0 - LEFT - RIGHT)) as i32
    }
}

/// Returns a line of one pixel.
fn thin(color: RGBColor) -> ShapeStyle {
    color.stroke_width(FINE)
}

/// Returns the spans of the steps in which a device has something to do; adjacent spans with one label are merged.
fn spans(steps: &[(Duration, Step)], of: impl Fn(Step) -> Option<(RGBColor, &'static str)>) -> Vec<Span> {
    let mut spans: Vec<Span> = Vec::new();
    for pair in steps.windows(2) {
        let [(from, step), (to, _)] = pair else { continue };
        let Some((color, label)) = of(*step) else { continue };
        match spans.last_mut().filter(|last| last.to == *from && last.label == label) {
            Some(last) => last.to = *to,
            None => spans.push(Span { from: *from, to: *to, color, label }),
        }
    }
    spans
}

/// Returns the colour and name of the group of a step; groups are long enough to be visible.
fn numbers(step: Step) -> Option<(RGBColor, &'static str)> {
    Some(match step.number()? {
        ..=6 => (STEP, "1–6"),
        7 | 8 => (STEP, "7–8"),
        9 => (EYES, "9"),
        10..=12 => (STEP, "10–12"),
        13 => (EYES, "13"),
        14..=16 => (STEP, "14–16"),
        17 => (CARRY, "17"),
        18 | 19 => (CARRY, "18–19"),
        20 => (BAD, "20"),
        _ => (GOOD, "21"),
    })
}

fn robot(step: Step) -> Option<(RGBColor, &'static str)> {
    Some(match step {
        Step::GoHome | Step::AwaitHome | Step::Resetting => (ROBOT, "home"),
        Step::GoCamera1 | Step::AwaitCamera1 => (ROBOT, "camera 1"),
        Step::GoCamera2 | Step::AwaitCamera2 => (ROBOT, "camera 2"),
        Step::GoPick | Step::VacuumOn | Step::AwaitPick | Step::GripDwell => (TO_PART, "to part"),
        Step::StopAtPart => (BAD, ""),
        Step::GoPlace | Step::AwaitPlace | Step::PlaceDwell => (CARRY, "to place"),
        Step::GiveUp | Step::Faulted => (BAD, "stop"),
        _ => return None,
    })
}

fn cameras(step: Step) -> Option<(RGBColor, &'static str)> {
    Some(match step {
        Step::FindPart => (EYES, "1"),
        Step::FindSlot => (EYES, "2"),
        _ => return None,
    })
}

/// The platform turns from step 10 on, and is at rest at the latest at the end of step 12.
fn platform(step: Step) -> Option<(RGBColor, &'static str)> {
    Some(match step {
        Step::GoHome | Step::AwaitHome | Step::Resetting => (PLATFORM, "home"),
        Step::TurnPlatform | Step::GoCamera2 | Step::AwaitCamera2 => (PLATFORM, "turn"),
        _ => return None,
    })
}

fn levels(changes: &[(Duration, bool)], end: Duration, color: RGBColor) -> Vec<Span> {
    let ends = changes.iter().skip(1).map(|(at, _)| *at).chain([end]);
    let on = changes.iter().zip(ends).filter(|((_, level), _)| *level);
    on.map(|((from, _), to)| Span { from: *from, to, color, label: "" }).collect()
}
