//! The source's Figure 9 from a run: the values of the hand, and the limited values.

use std::path::Path;

use anyhow::{Result, anyhow};
use plotters::coord::Shift;
use plotters::prelude::*;
use val2_alter::{Limits, Scale, timing};

use crate::demo::DemoOptions;
use crate::demo::teleop::cell::{CellConfig, CellRecord};
use crate::demo::teleop::cycles::Cycle;
use crate::fine::{self, FINE, UNIT};
use cellwire_io::files;

const ASKED: RGBColor = RGBColor(200, 90, 40);
const LIMITED: RGBColor = RGBColor(20, 80, 160);
const LIMIT: RGBColor = RGBColor(130, 130, 130);

const AXES: [&str; 6] = ["along X", "along Y", "along Z", "about X", "about Y", "about Z"];

/// One curve: a time in seconds and a value; a new piece from rest for each ALTER, after each cycle in which the
/// arm stood, and where the robot's subroutine has stopped it.
type Curve = Vec<Vec<(f64, f64)>>;

/// Draws the run of a cell where the options name a file.
///
/// # Errors
/// The errors of [`draw`].
pub(super) fn write(options: &DemoOptions, config: &CellConfig, record: &CellRecord) -> Result<()> {
    let Some(path) = &options.out else { return Ok(()) };
    draw(path, &record.host.cycles.speeds(), &config.alter.limits)
}

/// Draws the velocity in each axis, and the acceleration along X.
///
/// # Errors
/// If the file cannot be written, or there is nothing to draw.
pub(super) fn draw(path: &Path, cycles: &[Cycle], limits: &Limits) -> Result<()> {
    let (Some(first), Some(last)) = (cycles.first(), cycles.last()) else {
        return Err(anyhow!("there is nothing to draw: ALTER never ran"));
    };
    let cycle = timing::CYCLE.as_secs_f64();
    let span = first.at.as_secs_f64()..last.at.as_secs_f64();

    let mut picture = String::new();
    let root = SVGBackend::with_string(&mut picture, (1100 * FINE, 1240 * FINE)).into_drawing_area();
    let failed = |error| anyhow!("cannot draw {}: {error}", path.display());
    root.fill(&WHITE).map_err(failed)?;
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
        panel.draw(area, span.clone()).map_err(failed)?;
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
    panel.draw(&bottom, span).map_err(failed)?;
    root.present().map_err(failed)?;
    drop((root, top, bottom, areas));
    files::write(path, fine::shown(&picture).as_bytes())
}

struct Panel {
    title: String,
    unit: &'static str,
    limit: f64,
    asked: Curve,
    limited: Curve,
}

impl Panel {
    fn draw(
        &self,
        area: &DrawingArea<SVGBackend<'_>, Shift>,
        span: core::ops::Range<f64>,
    ) -> Result<(), DrawingAreaErrorKind<std::io::Error>> {
        let range = -self.limit * 2.0..self.limit * 2.0;
        let mut chart = ChartBuilder::on(area)
            .caption(&self.title, ("sans-serif", 18 * UNIT))
            .margin(12 * FINE)
            .x_label_area_size(38 * FINE)
            .y_label_area_size(70 * FINE)
            .build_cartesian_2d(span.clone(), range.clone())?;
        chart
            .configure_mesh()
            .x_desc("time, s")
            .y_desc(self.unit)
            .y_label_formatter(&|y| format!("{y:.0}"))
            .x_label_formatter(&|x| format!("{x:.1}"))
            .light_line_style(WHITE)
            .bold_line_style(LIMIT.mix(0.25).stroke_width(FINE))
            .axis_style(BLACK.stroke_width(FINE))
            .set_all_tick_mark_size(5 * UNIT)
            .label_style(("sans-serif", 13 * UNIT))
            .axis_desc_style(("sans-serif", 14 * UNIT))
            .draw()?;
        for limit in [self.limit, -self.limit] {
            let ends = [(span.start, limit), (span.end, limit)];
            let series = chart.draw_series(DashedLineSeries::new(
                ends,
                6 * FINE,
                4 * FINE,
                LIMIT.stroke_width(FINE),
            ))?;
            if limit > 0.0 {
                let dash = |x, y| PathElement::new([(x, y), (x + 6 * UNIT, y)], LIMIT.stroke_width(FINE));
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
            .border_style(LIMIT.stroke_width(FINE))
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
