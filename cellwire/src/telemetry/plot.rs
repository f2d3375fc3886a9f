//! The source's figures 9 to 12 from a run: position and orientation with their speeds, and the errors of all four.

use core::ops::Range;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use cellwire_io::files;
use cellwire_motion::{Deviation, State};
use plotters::prelude::*;

use super::recording::Comparison;
use crate::fine::{self, Area, Drawn, FINE, UNIT};

const RED: RGBColor = RGBColor(200, 60, 50);
const GREEN: RGBColor = RGBColor(40, 140, 70);
const BLUE: RGBColor = RGBColor(30, 90, 180);
const VIOLET: RGBColor = RGBColor(130, 70, 160);
const NORM: RGBColor = RGBColor(60, 60, 60);

/// Draws the four figures into a folder; their paths.
///
/// # Errors
/// If one cannot be written.
pub fn draw(folder: &Path, comparison: &Comparison) -> Result<Vec<PathBuf>> {
    std::fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))?;
    let both = |title, unit, parts: &[Part<State>]| Panel {
        title,
        unit,
        curves: parts
            .iter()
            .flat_map(|part| {
                [
                    curve(
                        &format!("{} recorded", part.name),
                        part.colour,
                        Stroke::Wide,
                        &comparison.recording,
                        |s| (s.time, (part.value)(s)),
                    ),
                    curve(
                        &format!("{} asked for", part.name),
                        part.colour,
                        Stroke::Dashed,
                        &comparison.reference,
                        |s| (s.time, (part.value)(s)),
                    ),
                ]
            })
            .collect(),
    };
    let errors = |title, unit, parts: &[Part<Deviation>]| Panel {
        title,
        unit,
        curves: parts
            .iter()
            .map(|part| {
                curve(part.name, part.colour, Stroke::Thin, &comparison.deviations, |d| {
                    (d.time, (part.value)(d))
                })
            })
            .collect(),
    };
    let quaternion = |name, colour, value| Part { name, colour, value };
    let figures = [
        (
            "position.svg",
            both("Position of the tool", "mm", &xyz(|s: &State| s.position)[..3]),
            both("Speed of the tool", "mm/s", &xyz(|s: &State| s.velocity)),
        ),
        (
            "position-errors.svg",
            errors("Position error, recorded minus planned", "mm", &xyz(|d: &Deviation| d.position)),
            errors("Error of the speed", "mm/s", &xyz(|d: &Deviation| d.velocity)),
        ),
        (
            "orientation.svg",
            both(
                "Orientation of the tool: quaternion with continuous sign",
                "part of the quaternion",
                &[
                    quaternion("q1", NORM, Box::new(|s: &State| s.orientation.w)),
                    quaternion("q2", RED, Box::new(|s: &State| s.orientation.x)),
                    quaternion("q3", GREEN, Box::new(|s: &State| s.orientation.y)),
                    quaternion("q4", VIOLET, Box::new(|s: &State| s.orientation.z)),
                ],
            ),
            both(
                "Angular velocity about the world's axes",
                "degrees/s",
                &xyz(|s: &State| s.angular_velocity),
            ),
        ),
        (
            "orientation-errors.svg",
            errors(
                "Error of the orientation, as a rotation vector",
                "degrees",
                &xyz(|d: &Deviation| d.rotation),
            ),
            errors("Error of the angular velocity", "degrees/s", &xyz(|d: &Deviation| d.angular_velocity)),
        ),
    ];
    let span = span(comparison)?;
    let mut paths = Vec::new();
    for (name, top, bottom) in figures {
        let path = folder.join(name);
        let picture = fine::draw(path.display(), [1200, 860], |root| {
            let (upper, lower) = root.split_vertically(430 * UNIT);
            top.draw(&upper, span.clone())?;
            bottom.draw(&lower, span.clone())
        })?;
        files::write(&path, picture.as_bytes())?;
        paths.push(path);
    }
    Ok(paths)
}

/// A part of a state that is drawn as one curve.
struct Part<T> {
    name: &'static str,
    colour: RGBColor,
    value: Box<dyn Fn(&T) -> f64>,
}

/// Returns the three parts of a vector and its norm.
fn xyz<T: 'static>(vector: fn(&T) -> [f64; 3]) -> [Part<T>; 4] {
    let part = |name, colour, index: usize| Part {
        name,
        colour,
        value: Box::new(move |item: &T| vector(item).get(index).copied().unwrap_or(0.0))
            as Box<dyn Fn(&T) -> f64>,
    };
    let norm = Box::new(move |item: &T| vector(item).iter().map(|part| part * part).sum::<f64>().sqrt());
    [
        part("X", RED, 0),
        part("Y", GREEN, 1),
        part("Z", BLUE, 2),
        Part { name: "norm", colour: NORM, value: norm },
    ]
}

#[derive(Clone, Copy)]
enum Stroke {
    /// The recording: wide and pale, so that the reference is visible upon it.
    Wide,
    Dashed,
    Thin,
}

struct Curve {
    label: String,
    colour: RGBColor,
    stroke: Stroke,
    points: Vec<(f64, f64)>,
}

fn curve<T>(
    label: &str,
    colour: RGBColor,
    stroke: Stroke,
    items: &[T],
    point: impl Fn(&T) -> (f64, f64),
) -> Curve {
    Curve { label: label.into(), colour, stroke, points: items.iter().map(point).collect() }
}

struct Panel {
    title: &'static str,
    unit: &'static str,
    curves: Vec<Curve>,
}

/// Returns the time span from shortly before the reference begins to shortly after its end.
fn span(comparison: &Comparison) -> Result<Range<f64>> {
    let (Some(first), Some(last)) = (comparison.reference.first(), comparison.reference.last()) else {
        anyhow::bail!("there is nothing to draw");
    };
    let margin = (last.time - first.time) * 0.03;
    Ok(first.time - margin..last.time + margin)
}

impl Panel {
    fn draw(&self, area: &Area<'_>, span: Range<f64>) -> Drawn {
        let values =
            self.curves.iter().flat_map(|c| &c.points).filter(|(t, _)| span.contains(t)).map(|(_, y)| *y);
        let (low, high) = values.fold((f64::MAX, f64::MIN), |(low, high), y| (low.min(y), high.max(y)));
        let margin = if high > low { (high - low) * 0.06 } else { 1.0 };
        let digits = match high - low {
            range if range > 20.0 => 0,
            range if range > 2.0 => 1,
            range if range > 0.2 => 2,
            _ => 3,
        };
        // The legend stands beside the curves, not upon them.
        let (plot, side) = area.split_horizontally(1030 * UNIT);
        let (names, ranges) =
            (["time since the motion began, s", self.unit], [span.clone(), low - margin..high + margin]);
        let mut chart = fine::chart(&plot, self.title, names, ranges, [1, digits])?;
        for (row, curve) in (0..).zip(&self.curves) {
            let points: Vec<(f64, f64)> =
                curve.points.iter().copied().filter(|(time, _)| span.contains(time)).collect();
            let y = (56 + row * 24) * UNIT;
            let ends = vec![(12 * UNIT, y), (46 * UNIT, y)];
            let text = ("sans-serif", 14 * UNIT).into_font().color(&NORM);
            side.draw(&Text::new(curve.label.clone(), (54 * UNIT, y - 8 * UNIT), text))?;
            match curve.stroke {
                Stroke::Wide => {
                    let style = curve.colour.mix(0.35).stroke_width(5 * FINE);
                    chart.draw_series(LineSeries::new(points, style))?;
                    side.draw(&PathElement::new(ends, style))?;
                }
                Stroke::Thin => {
                    let style = curve.colour.stroke_width(2 * FINE);
                    chart.draw_series(LineSeries::new(points, style))?;
                    side.draw(&PathElement::new(ends, style))?;
                }
                Stroke::Dashed => {
                    let style = curve.colour.stroke_width(2 * FINE);
                    chart.draw_series(DashedLineSeries::new(points, 7 * FINE, 5 * FINE, style))?;
                    for x in [12 * UNIT, 24 * UNIT, 36 * UNIT] {
                        side.draw(&PathElement::new(vec![(x, y), (x + 8 * UNIT, y)], style))?;
                    }
                }
            }
        }
        Ok(())
    }
}
