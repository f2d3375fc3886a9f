//! A PC lets a robot draw a zigzag: `cargo run --features std --example drawing -- pc tcp`, and `-- robot tcp` in another
//! terminal.

pub(crate) mod ends;

use kawasaki_msg::{JobKind, Line, Point};

fn main() -> Result<(), Box<dyn core::error::Error>> {
    ends::main(&zigzag())
}

/// 2000 lines over the board, each from the end of the previous line.
pub(crate) fn zigzag() -> Vec<Line> {
    let at = |n: i32| Point::new(10 * n, 500 * (n % 7));
    (0..2000).map(|n| Line { kind: JobKind::Draw, start: at(n), end: at(n + 1) }).collect()
}
