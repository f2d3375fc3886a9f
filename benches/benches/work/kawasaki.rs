//! The jobs of an order.

use kawasaki_msg::{JobKind, Line, Point};

/// Lines on a board of 800 mm by 600 mm in front of the robot, each from one point to the next.
pub(crate) fn line(number: u16) -> Line {
    let n = i32::from(number);
    let at = |n: i32| Point::new(40_000 + n * 7919 % 80_000, n * 6007 % 60_000 - 30_000);
    let kind = if n % 5 == 0 { JobKind::Move } else { JobKind::Draw };
    Line { kind, start: at(n), end: at(n + 1) }
}
