//! The drawing: its jobs are straight lines.

use super::work::{FieldVisitor, VisitResult, Work};
use crate::error::FieldFault;

/// One straight line. An order is one picture, and its jobs are lines (thesis, section 11).
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Line {
    /// With the pen on the board, or off it.
    pub kind: JobKind,
    /// The beginning of the line.
    pub start: Point,
    /// The end of the line.
    pub end: Point,
}

/// The layout of the source's application; the unit and the codes are this project's.
impl Work for Line {
    type Ranges = Bounds;

    fn fields<F: FieldVisitor>(&mut self, &Bounds { min, max }: &Bounds, fields: &mut F) -> VisitResult {
        fields.whole("kind", &mut self.kind, JobKind::Draw..=JobKind::Move)?;
        fields.whole("x1", &mut self.start.x, min.x..=max.x)?;
        fields.whole("y1", &mut self.start.y, min.y..=max.y)?;
        fields.whole("x2", &mut self.end.x, min.x..=max.x)?;
        fields.whole("y2", &mut self.end.y, min.y..=max.y)
    }
}

/// Whether the pen is on the board (thesis, section 11). The codes on the wire are this project's: 1 and 2, because AS reads
/// an empty string as 0.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
pub enum JobKind {
    /// Code 1: draw the line with the pen on the board.
    #[default]
    Draw = 1,
    /// Code 2: move along the line with the pen off the board.
    Move = 2,
}

/// The code on the wire.
impl From<JobKind> for i32 {
    fn from(kind: JobKind) -> i32 {
        kind as i32
    }
}

/// A job of any other kind cannot be executed.
impl TryFrom<i32> for JobKind {
    type Error = FieldFault;

    fn try_from(code: i32) -> Result<Self, FieldFault> {
        match code {
            1 => Ok(JobKind::Draw),
            2 => Ok(JobKind::Move),
            found => Err(FieldFault::Value { found }),
        }
    }
}

/// A point on the board, in hundredths of a millimetre. The unit is this project's: whole numbers need no separator on the
/// wire.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Point {
    /// The first coordinate, in hundredths of a millimetre.
    pub x: i32,
    /// The second coordinate, in hundredths of a millimetre.
    pub y: i32,
}

impl Point {
    /// Creates a point from hundredths of a millimetre.
    pub const fn new(x: i32, y: i32) -> Self {
        Self { x, y }
    }
}

/// The coordinates that a robot accepts, both ends included (thesis, section 7.3).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Bounds {
    /// The least coordinate of each axis.
    pub min: Point,
    /// The greatest coordinate of each axis.
    pub max: Point,
}

impl Bounds {
    /// Seven digits, 100 m: whole numbers that a real of an AS program (24 bits) holds exactly.
    pub const WIDEST: Self =
        Self { min: Point::new(-9_999_999, -9_999_999), max: Point::new(9_999_999, 9_999_999) };

    /// Returns whether a point is within the bounds.
    pub const fn contains(&self, point: Point) -> bool {
        self.min.x <= point.x && point.x <= self.max.x && self.min.y <= point.y && point.y <= self.max.y
    }
}

/// The source names no limit; the default is the widest.
impl Default for Bounds {
    fn default() -> Self {
        Self::WIDEST
    }
}
