//! The PC, with one long drawing.

use kawasaki_msg::{JobKind, Line, Pc, PcConfig, Point, Supply};
use static_cell::StaticCell;

use super::{Caller, Peer};

type Session = Pc<fn(u32) -> Supply<Line>>;
static PEER: StaticCell<Caller<Session>> = StaticCell::new();

fn line(index: u32) -> Supply<Line> {
    let at = (index % 9_000) as i32 - 3_000;
    Supply::Job(Line { kind: JobKind::Draw, start: Point::new(at, -at), end: Point::new(at + 1, 10) })
}

pub(crate) fn start() -> &'static mut dyn Peer {
    let Ok(pc) = Session::new(PcConfig::tcp()) else { panic!("it works") };
    PEER.init(Caller::new(pc, |pc, _| {
        // Refused while there is one.
        let _ = pc.start(50, line);
        None
    }))
}
