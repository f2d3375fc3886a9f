//! The PC of a Kawasaki robot.
#![no_std]
#![no_main]

use kawasaki_msg::{JobKind, Line, Pc, PcConfig, Point};

const LINES: [Line; 1] = [Line { kind: JobKind::Draw, start: Point::new(0, 0), end: Point::new(1, 0) }];

#[unsafe(no_mangle)]
extern "C" fn main() -> i32 {
    let Ok(mut session) = Pc::new(PcConfig::TCP) else { return 1 };
    no_std::run(&mut session, &mut [0; 4096], |session, _| {
        let _ = session.start(50, &LINES[..]);
    })
}
