//! The board that is drawn on.

use kawasaki_msg::{JobKind, Line, Point};

use crate::io::drawing;

/// The board: an A3 sheet, in hundredths of a millimetre.
pub const SHEET: drawing::Point = drawing::Point { x: 42_000, y: 29_700 };

/// The lines of a picture as jobs: a point on the board is a point on the sheet.
pub fn jobs(picture: &drawing::Picture) -> Vec<Line> {
    let point = |p: drawing::Point| Point::new(p.x, p.y);
    let job = |line: &drawing::Line| Line {
        kind: if line.draws { JobKind::Draw } else { JobKind::Move },
        start: point(line.from),
        end: point(line.to),
    };
    picture.lines.iter().map(job).collect()
}

/// What was drawn, as a picture.
pub fn drawn(lines: impl IntoIterator<Item = Line>) -> Vec<drawing::Line> {
    let point = |p: Point| drawing::Point { x: p.x, y: p.y };
    let line = |line: Line| drawing::Line {
        draws: line.kind == JobKind::Draw,
        from: point(line.start),
        to: point(line.end),
    };
    lines.into_iter().map(line).collect()
}
