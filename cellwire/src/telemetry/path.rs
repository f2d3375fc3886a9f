//! The path of a program that was simulated: a table, and a picture from above, from the side, and over time.

use anyhow::Result;
use plotters::prelude::*;

use crate::fine::{self, Area, Drawn, FINE, UNIT};
use cellwire_motion::Pose;

/// The joints and the tool's pose of the robot at a time.
#[derive(Debug, Clone, Copy)]
pub struct Sample {
    /// The time since the start, in s.
    pub time: f64,
    /// The angles of J1 to J6, in degrees.
    pub joints: [f64; 6],
    /// The tool's pose in the world frame.
    pub pose: Pose,
}

/// Returns the length of the tool's path, in mm.
pub fn length(samples: &[Sample]) -> f64 {
    // The sum of nothing would be -0.0.
    samples.windows(2).map(distance).fold(0.0, |sum, distance| sum + distance)
}

fn distance(pair: &[Sample]) -> f64 {
    match pair {
        [a, b] => a.pose.distance(&b.pose),
        _ => 0.0,
    }
}

/// Returns a table: time, joints, X Y Z W P R.
pub fn table(samples: &[Sample]) -> String {
    let mut table = String::from("time_s,J1,J2,J3,J4,J5,J6,x_mm,y_mm,z_mm,w_deg,p_deg,r_deg\n");
    for sample in samples {
        table += &format!("{:.3}", sample.time);
        for value in sample.joints.iter().chain(&sample.pose.to_xyzwpr()) {
            table += &format!(",{value:.4}");
        }
        table.push('\n');
    }
    table
}

const LINE: RGBColor = RGBColor(30, 90, 180);
const START: RGBColor = RGBColor(40, 140, 70);
const END: RGBColor = RGBColor(200, 60, 50);

/// Draws a picture of the path.
///
/// # Errors
/// If it cannot be drawn.
pub fn draw(title: &str, samples: &[Sample]) -> Result<String> {
    fine::draw("the path", [1200, 900], |root| figure(root, title, samples))
}

fn figure(root: &Area<'_>, title: &str, samples: &[Sample]) -> Drawn {
    let (upper, lower) = root.split_vertically(560 * UNIT);
    let (left, right) = upper.split_horizontally(600 * UNIT);
    let places = |x: usize, y: usize| -> Vec<(f64, f64)> {
        let part = |sample: &Sample, axis: usize| sample.pose.position.get(axis).copied().unwrap_or(0.0);
        samples.iter().map(|sample| (part(sample, x), part(sample, y))).collect()
    };
    view(&left, &format!("{title} from above"), ["X, mm", "Y, mm"], &places(0, 1))?;
    view(&right, "from the side (starts green, ends red)", ["X, mm", "Z, mm"], &places(0, 2))?;
    let speed = |pair: &[Sample]| match pair {
        [a, b] if b.time > a.time => (b.time, distance(pair) / (b.time - a.time)),
        _ => (0.0, 0.0),
    };
    let speeds: Vec<(f64, f64)> = samples.windows(2).map(speed).collect();
    let last = samples.last().map_or(1.0, |sample| sample.time).max(0.1);
    let fastest = speeds.iter().map(|(_, speed)| *speed).fold(1.0, f64::max);
    let ranges = [0.0..last, 0.0..fastest * 1.06];
    let mut chart = fine::chart(&lower, "Speed of the tool", ["time, s", "mm/s"], ranges, [1, 0])?;
    chart.draw_series(LineSeries::new(speeds, LINE.stroke_width(2 * FINE))).map(drop)
}

/// Draws the path on a plane, both axes in the same scale; its start is green, its end red.
fn view(area: &Area<'_>, title: &str, names: [&str; 2], path: &[(f64, f64)]) -> Drawn {
    let range = |values: &mut dyn Iterator<Item = f64>| {
        values.fold((f64::MAX, f64::MIN), |(low, high), value| (low.min(value), high.max(value)))
    };
    let (left, right) = range(&mut path.iter().map(|(x, _)| *x));
    let (low, high) = range(&mut path.iter().map(|(_, y)| *y));
    // The plot is about as wide as high.
    let half = ((right - left).max(high - low) * 0.55).max(1.0);
    let (middle_x, middle_y) = (f64::midpoint(left, right), f64::midpoint(low, high));
    let ranges = [middle_x, middle_y].map(|middle| middle - half..middle + half);
    let mut chart = fine::chart(area, title, names, ranges, [0, 0])?;
    chart.draw_series(LineSeries::new(path.iter().copied(), LINE.stroke_width(2 * FINE)))?;
    for (place, colour) in [(path.first(), START), (path.last(), END)] {
        chart.draw_series(place.map(|place| Circle::new(*place, 6 * UNIT, colour.filled())))?;
    }
    Ok(())
}
