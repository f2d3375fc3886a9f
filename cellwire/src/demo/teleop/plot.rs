//! The source's Figure 9 from a run: the values of the hand, and the limited values.

use anyhow::{Result, ensure};
use plotters::prelude::*;
use val2_alter::{Limits, Scale, timing};

use crate::demo::DemoOptions;
use crate::demo::teleop::cell::{CellConfig, CellRecord};
use crate::demo::teleop::cycles::Cycle;
use crate::fine::{self, Area, Drawn, FINE, FRAME, UNIT};
use cellwire_io::files;

const ASKED: RGBColor = RGBColor(200, 90, 40);
const LIMITED: RGBColor = RGBColor(20, 80, 160);

const AXES: [&str; 6] = ["along X", "along Y", "along Z", "about X", "about Y", "about Z"];

/// One curve: a time in seconds and a value; a new piece from rest for each ALTER, after each cycle in which the
/// arm stood, and where the robot's subroutine has stopped it.
type Curve = Vec<Vec<(f64, f64)>>;

/// Draws the run of a cell where the options name a file: the velocity in each axis, and the acceleration along X.
///
/// # Errors
/// If the file cannot be written, or there is nothing to draw.
pub(super) fn write(options: &DemoOptions, config: &CellConfig, record: &CellRecord) -> Result<()> {
    let Some(path) = &options.out else { return Ok(()) };
    let cycles = record.host.cycles.speeds();
    ensure!(!cycles.is_empty(), "there is nothing to draw: ALTER never ran");
    let drawn = fine::draw(path.display(), [1100, 1240], |root| draw(root, &cycles, &config.alter.limits))?;
    files::write(path, drawn.as_bytes())
}

fn draw(root: &Area<'_>, cycles: &[Cycle], limits: &Limits) -> Drawn {
    let (Some(first), Some(last)) = (cycles.first(), cycles.last()) else { return Ok(()) };
    let cycle = timing::CYCLE.as_secs_f64();
    let span = first.at.as_secs_f64()..last.at.as_secs_f64();
    let (top, bottom) = root.split_vertically(900 * UNIT);
    let areas = top.split_evenly((3, 2));
    for (axis, (name, limit)) in AXES.into_iter().zip(limits.velocity).enumerate() {
        // Translations are on the left, rotations on the right.
        let (place, unit, per_unit) = match axis {
            0..3 => (2 * axis, "mm/s", Scale::PUMA_562.per_mm),
            _ => (2 * axis - 5, "°/s", Scale::PUMA_562.per_degree),
        };
        let velocity = |words: f64| words / per_unit / cycle;
        let of = |values: [i16; 6]| values.get(axis).copied().unwrap_or_default();
        let panel = Panel {
            title: format!("Velocity {name}"),
            unit,
            limit: velocity(limit.into()),
            asked: scaled(&curve(cycles, |cycle| of(cycle.demand)), velocity),
            limited: scaled(&curve(cycles, |cycle| of(cycle.values)), velocity),
        };
        let Some(area) = areas.get(place) else { continue };
        panel.draw(area, span.clone())?;
    }
    let acceleration = |words: f64| words / Scale::PUMA_562.per_mm / (cycle * cycle);
    let panel = Panel {
        title: "Acceleration along X (clipped: the requested value at release is many times the limit)"
            .into(),
        unit: "mm/s²",
        limit: acceleration(limits.acceleration[0].into()),
        asked: scaled(&steps(&curve(cycles, |cycle| cycle.demand[0])), acceleration),
        limited: scaled(&steps(&curve(cycles, |cycle| cycle.values[0])), acceleration),
    };
    panel.draw(&bottom, span)
}

struct Panel {
    title: String,
    unit: &'static str,
    limit: f64,
    asked: Curve,
    limited: Curve,
}

impl Panel {
    fn draw(&self, area: &Area<'_>, span: core::ops::Range<f64>) -> Drawn {
        let range = -self.limit * 2.0..self.limit * 2.0;
        let ranges = [span.clone(), range.clone()];
        let mut chart = fine::chart(area, &self.title, ["time, s", self.unit], ranges, [1, 0])?;
        for limit in [self.limit, -self.limit] {
            let ends = [(span.start, limit), (span.end, limit)];
            let series = chart.draw_series(DashedLineSeries::new(
                ends,
                6 * FINE,
                4 * FINE,
                FRAME.stroke_width(FINE),
            ))?;
            if limit > 0.0 {
                let dash = |x, y| PathElement::new([(x, y), (x + 6 * UNIT, y)], FRAME.stroke_width(FINE));
                series.label("limit").legend(move |(x, y)| {
                    EmptyElement::at((x, y)) + dash(0, 0) + dash(8 * UNIT, 0) + dash(16 * UNIT, 0)
                });
            }
        }
        for (curve, style, label) in [
            (&self.asked, ASKED.stroke_width(FINE), "target"),
            (&self.limited, LIMITED.stroke_width(2 * FINE), "reply"),
        ] {
            let mut labelled = false;
            for piece in curve {
                let clipped = piece.iter().map(|(at, value)| (*at, value.clamp(range.start, range.end)));
                let series = chart.draw_series(LineSeries::new(clipped, style))?;
                if !core::mem::replace(&mut labelled, true) {
                    series
                        .label(label)
                        .legend(move |(x, y)| PathElement::new([(x, y), (x + 22 * UNIT, y)], style));
                }
            }
        }
        chart
            .configure_series_labels()
            .position(SeriesLabelPosition::LowerLeft)
            .background_style(WHITE.mix(0.85))
            .border_style(FRAME.stroke_width(FINE))
            .legend_area_size(30 * UNIT)
            .margin(10 * UNIT)
            .label_font(("sans-serif", 13 * UNIT))
            .draw()
    }
}

fn curve(cycles: &[Cycle], value: impl Fn(&Cycle) -> i16) -> Curve {
    let pieces =
        cycles.chunk_by(|a, b| (a.session, a.stood, a.interrupted) == (b.session, b.stood, b.interrupted));
    pieces.map(|piece| piece.iter().map(|c| (c.at.as_secs_f64(), value(c).into())).collect()).collect()
}

/// Returns the step into each value, from rest at the beginning of a piece.
fn steps(curve: &Curve) -> Curve {
    let step = |piece: &Vec<(f64, f64)>| {
        let before = core::iter::once(0.0).chain(piece.iter().map(|(_, value)| *value));
        piece.iter().zip(before).map(|((at, value), before)| (*at, value - before)).collect()
    };
    curve.iter().map(step).collect()
}

fn scaled(curve: &Curve, scale: impl Fn(f64) -> f64) -> Curve {
    curve.iter().map(|piece| piece.iter().map(|(at, value)| (*at, scale(*value))).collect()).collect()
}
