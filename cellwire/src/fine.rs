//! Plots that are not on whole pixels.

use core::fmt::Display;
use core::ops::Range;

use anyhow::{Result, anyhow};
use plotters::coord::Shift;
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;

/// The area of a plot, or a part of it.
pub(crate) type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
/// Axes, on which curves are drawn.
pub(crate) type Chart<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<RangedCoordf64, RangedCoordf64>>;
/// The outcome of drawing.
pub(crate) type Drawn<T = ()> = Result<T, DrawingAreaErrorKind<std::io::Error>>;

/// The color of axes and grids.
pub(crate) const FRAME: RGBColor = RGBColor(130, 130, 130);

/// The units of a plot per pixel: the drawing library rounds every position to a whole unit.
pub(crate) const FINE: u32 = 10;
/// The same, for places.
pub(crate) const UNIT: i32 = 10;

/// Draws a plot of this size in pixels, and returns it as SVG; `what` names it in an error.
///
/// # Errors
/// If it cannot be drawn.
pub(crate) fn draw(
    what: impl Display,
    [width, height]: [u32; 2],
    draw: impl FnOnce(&Area<'_>) -> Drawn,
) -> Result<String> {
    let mut drawn = String::new();
    let root = SVGBackend::with_string(&mut drawn, (width * FINE, height * FINE)).into_drawing_area();
    let outcome = root.fill(&WHITE).and_then(|()| draw(&root)).and_then(|()| root.present());
    outcome.map_err(|error| anyhow!("cannot draw {what}: {error}"))?;
    drop(root);
    Ok(shown(&drawn))
}

/// Draws axes with a title, the names of X and Y, and the digits after the points of their numbers.
pub(crate) fn chart<'a, 'b>(
    area: &Area<'b>,
    title: &str,
    [x, y]: [&str; 2],
    [xs, ys]: [Range<f64>; 2],
    [x_digits, y_digits]: [usize; 2],
) -> Drawn<Chart<'a, 'b>> {
    let mut chart = ChartBuilder::on(area)
        .caption(title, ("sans-serif", 19 * UNIT))
        .margin(12 * FINE)
        .x_label_area_size(38 * FINE)
        .y_label_area_size(74 * FINE)
        .build_cartesian_2d(xs, ys)?;
    let shown =
        |value: &f64, digits: usize| format!("{:.*}", digits, if value.abs() < 1e-9 { 0.0 } else { *value });
    chart
        .configure_mesh()
        .x_desc(x)
        .y_desc(y)
        .x_label_formatter(&|value| shown(value, x_digits))
        .y_label_formatter(&|value| shown(value, y_digits))
        .light_line_style(WHITE)
        .bold_line_style(FRAME.mix(0.25).stroke_width(FINE))
        .axis_style(BLACK.stroke_width(FINE))
        .set_all_tick_mark_size(5 * UNIT)
        .label_style(("sans-serif", 14 * UNIT))
        .axis_desc_style(("sans-serif", 15 * UNIT))
        .draw()?;
    Ok(chart)
}

/// Returns a plot in its size: the plot was drawn with [`FINE`] units per pixel.
fn shown(plot: &str) -> String {
    let size = |name: &str| -> Option<u32> {
        let (_, rest) = plot.split_once(&format!(" {name}=\""))?;
        rest.split_once('"')?.0.parse().ok()
    };
    let (Some(width), Some(height)) = (size("width"), size("height")) else { return plot.to_owned() };
    let drawn = format!("width=\"{width}\" height=\"{height}\"");
    plot.replacen(&drawn, &format!("width=\"{}\" height=\"{}\"", width / FINE, height / FINE), 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plot_is_shown_in_its_size() {
        let drawn =
            r#"<svg width="12000" height="9000" viewBox="0 0 12000 9000"><a width="12000" height="9000"/>"#;
        let expected =
            r#"<svg width="1200" height="900" viewBox="0 0 12000 9000"><a width="12000" height="9000"/>"#;
        assert_eq!(shown(drawn), expected);
    }
}
