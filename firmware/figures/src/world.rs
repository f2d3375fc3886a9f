//! The world around the board: one step at a time, each at its time.

use core::cell::Cell;
use core::time::Duration;

use critical_section::Mutex;
use heapless::Vec;
use static_cell::StaticCell;

use crate::chip::{self, MAX_TRANSMISSION_LEN};
use crate::peer::{self, Peer};
use crate::{core_of, measure, uart};

static WORLD: StaticCell<World> = StaticCell::new();
static PLACE: Mutex<Cell<Option<&'static mut World>>> = Mutex::new(Cell::new(None));

struct World {
    peer: &'static mut dyn Peer,
    /// The time of a byte on the line.
    byte: Duration,
    /// The bytes from the peer: their number, how many have arrived, and when the next one arrives.
    to_board: [u8; MAX_TRANSMISSION_LEN],
    length: usize,
    come: usize,
    comes_at: Duration,
    /// The bytes from the board, and the time at which all have arrived.
    to_peer: Vec<u8, MAX_TRANSMISSION_LEN>,
    is_there_at: Duration,
}

/// The next step of the world.
#[derive(PartialEq, Eq, PartialOrd, Ord)]
enum Turn {
    Board,
    Alarm,
    Answer,
    Peer,
}

/// Starts a line at this rate: a byte is eleven bits, as with two stop bits.
pub(crate) fn start(baud: u32) {
    let world = WORLD.init_with(|| World {
        peer: peer::start(),
        byte: Duration::from_nanos(11_000_000_000 / u64::from(baud)),
        to_board: [0; MAX_TRANSMISSION_LEN],
        length: 0,
        come: 0,
        comes_at: Duration::ZERO,
        to_peer: Vec::new(),
        is_there_at: Duration::ZERO,
    });
    critical_section::with(|cs| PLACE.borrow(cs).set(Some(world)));
}

/// Runs the next event. Interrupts come in between.
pub(crate) fn step() {
    let world = critical_section::with(|cs| PLACE.borrow(cs).take()).expect("nothing in it makes a step");
    world.step();
    critical_section::with(|cs| PLACE.borrow(cs).set(Some(world)));
    measure::report();
}

impl World {
    fn step(&mut self) {
        let now = chip::now();
        let sent = chip::take_sent(&mut self.to_peer);
        if sent > 0 {
            self.is_there_at = self.is_there_at.max(now) + self.byte * sent as u32;
        }
        let is_silent = self.is_silent();
        let next = [
            (!is_silent).then_some((self.comes_at, Turn::Board)),
            chip::alarm().map(|at| (at, Turn::Alarm)),
            (!self.to_peer.is_empty()).then_some((self.is_there_at, Turn::Answer)),
            self.peer.deadline().filter(|_| is_silent).map(|at| (at, Turn::Peer)),
        ];
        let (at, turn) = next.into_iter().flatten().min().expect("something comes next");
        chip::set_now(now.max(at));
        match turn {
            Turn::Board => self.byte_comes(),
            Turn::Alarm => {
                chip::clear_alarm();
                core_of::trigger_session();
            }
            Turn::Answer | Turn::Peer => self.peer_acts(),
        }
    }

    fn is_silent(&self) -> bool {
        self.come == self.length
    }

    fn byte_comes(&mut self) {
        if !chip::is_full() {
            chip::put(self.to_board[self.come]);
            self.come += 1;
            if self.is_silent() {
                measure::request_ends();
            }
        }
        self.comes_at = chip::now() + self.byte;
        measure::interrupt(uart::interrupt);
    }

    fn peer_acts(&mut self) {
        let (now, is_silent) = (chip::now(), self.is_silent());
        let has_come = self.is_there_at <= now;
        let bytes = if has_come { self.to_peer.as_slice() } else { &[] };
        let length = self.peer.turn(now, bytes, &mut self.to_board, is_silent);
        if has_come {
            self.to_peer.clear();
        }
        if length > 0 {
            (self.come, self.length) = (0, length);
            self.comes_at = now + self.byte;
        }
    }
}
