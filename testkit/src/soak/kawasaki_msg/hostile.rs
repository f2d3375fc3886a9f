//! Ends that are not ours: a random walk over the protocol's messages.

use core::fmt::Write as _;

use crate::link::End;
use crate::rng::Rng;

/// Jobs of a hostile PC begin at this place, where no picture of ours is.
pub(super) const FAR: i32 = 9_000_000;

/// One end is replaced until all is healed.
#[derive(Debug)]
pub(super) struct Hostile {
    pub(super) end: End,
    rng: Rng,
    max_number: u16,
    orders: [u16; 4],
    /// The next job that the motion task may take.
    pub(super) next: u16,
}

impl Hostile {
    /// Over datagrams its orders have numbers of their own: a late one may name them when ours have begun.
    pub(super) fn new(end: End, seed: u64, max_number: u16, datagrams: bool) -> Self {
        let orders = if datagrams && end == End::B { [0, 601, 602, 603] } else { [0, 1, 2, 3] };
        Self { end, rng: Rng::new(seed ^ 0x686F_7374), max_number, orders, next: 1 }
    }

    /// Whether something is sent now, and what: some messages, a few of them corrupt.
    pub(super) fn send(&mut self) -> Option<Vec<u8>> {
        let rng = &mut self.rng;
        if !rng.chance(0.5) {
            return None;
        }
        let mut packet = String::new();
        for _ in 0..1 + rng.below(4) {
            let order = self.orders[rng.below(4)];
            // Often the next one, so that orders get on.
            let number =
                if rng.chance(0.7) { self.next } else { rng.below(self.max_number.into()) as u16 + 2 };
            let other = 1 + rng.below(self.max_number.into());
            let (name, data) = match (self.end, rng.below(8)) {
                (End::B, 0) => ("TilausAlkaa", format!("{order}$1")),
                (End::B, 1) => ("TilausLoppuu", format!("{order}")),
                (End::B, 2) => ("TilausKeskeytyy", format!("{order}")),
                (End::B, 3) => ("Tila", format!("{order}$2$$$")),
                (End::B, _) => ("Tyo", format!("{order}${number}$1${FAR}$0$1$1")),
                (End::A, 0) => ("TilausKuittaus", format!("{order}")),
                (End::A, 1) => ("LoppuKuittaus", format!("{order}$0${other}")),
                (End::A, 2) => ("Tila", format!("{order}$2${other}$$1")),
                (End::A, 3) => ("Tila", format!("{order}$2${other}${other}$")),
                (End::A, 4) => ("TyoKuittaus", format!("{order}${other}")),
                (End::A, 5) => ("TyoTauko", format!("{order}${other}")),
                (End::A, _) => ("TyoPyynto", format!("{order}${other}")),
            };
            let length = data.len() + usize::from(rng.chance(0.05));
            let _ = write!(packet, "<{name}${length}#{data}#>");
        }
        if rng.chance(0.05) {
            packet.truncate(rng.below(packet.len()));
        }
        Some(packet.into_bytes())
    }
}
