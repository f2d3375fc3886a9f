//! Plots that are not on whole pixels.

/// The units of a plot per pixel: the drawing library rounds every position to a whole unit.
pub(crate) const FINE: u32 = 10;
/// The same, for places.
pub(crate) const UNIT: i32 = 10;

/// Returns a plot in its size: the plot was drawn with [`FINE`] units per pixel.
pub(crate) fn shown(plot: &str) -> String {
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
