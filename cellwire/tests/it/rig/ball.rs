//! A ball that shares no code with the crates, and the hand on it.

use std::collections::VecDeque;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::{Duration, Instant};

use cellwire::io::priority::{self, ThreadRole};

use super::pty::Pty;

#[derive(Debug, Clone, Copy, Default)]
struct Hand {
    x: i8,
    keys: u8,
    /// The values are those of before.
    old: bool,
    /// The ball's cable is pulled.
    gone: bool,
    faults: Faults,
}

/// The faults of a ball, or its line.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Faults {
    /// The length of the period of the faults, in packets.
    pub(crate) of: u32,
    /// How many in a row say "old data".
    pub(crate) old: u32,
    /// The same: their check is wrong.
    pub(crate) corrupt: u32,
    /// The same: nothing comes.
    pub(crate) lost: u32,
    /// Every packet is so late, its values measured when it was asked for.
    pub(crate) late: Duration,
}

pub(crate) struct Ball {
    hand: Arc<Mutex<Hand>>,
    path: PathBuf,
}

impl Ball {
    /// Creates a ball at a link to a pseudo-terminal.
    pub(crate) fn new(path: &Path) -> Self {
        let ball = Self { hand: Arc::default(), path: path.into() };
        ball.plug();
        ball
    }

    /// Pushes along X; 0 rests.
    pub(crate) fn push(&self, x: i8) {
        self.hand.lock().unwrap().x = x;
    }

    /// Holds the keys of this mask; 0 lets them go.
    pub(crate) fn hold(&self, keys: u8) {
        self.hand.lock().unwrap().keys = keys;
    }

    /// Marks every packet as "old data" from now on.
    pub(crate) fn stick(&self) {
        self.hand.lock().unwrap().old = true;
    }

    /// Sets the faults from now on.
    pub(crate) fn faults(&self, faults: Faults) {
        self.hand.lock().unwrap().faults = faults;
    }

    /// Removes the port.
    pub(crate) fn pull(&self) {
        // First the link: the number of the pseudo-terminal may soon be that of another.
        std::fs::remove_file(&self.path).unwrap();
        self.hand.lock().unwrap().gone = true;
    }

    /// Provides the port, perhaps again.
    pub(crate) fn plug(&self) {
        let (port, client) = Pty::new();
        let mut port = port.raw();
        let _ = std::fs::remove_file(&self.path);
        std::os::unix::fs::symlink(client, &self.path).unwrap();
        self.hand.lock().unwrap().gone = false;
        let hand = Arc::clone(&self.hand);
        thread::spawn(move || {
            priority::raise(ThreadRole::Hardware);
            let (mut byte, mut asked) = ([0], 0);
            // Each with the time at which it is whole.
            let mut packets: VecDeque<(Instant, [u8; 12])> = VecDeque::new();
            while Arc::strong_count(&hand) > 1 {
                if hand.lock().unwrap().gone {
                    return;
                }
                let next = packets.front().map(|(whole, _)| whole.saturating_duration_since(Instant::now()));
                let wait = next.map_or(LINE, |next| next.min(LINE));
                match port.read(wait, &mut byte) {
                    Ok(1) if byte == [0x05] => {
                        let hand = *hand.lock().unwrap();
                        let whole = Instant::now() + LINE + hand.faults.late;
                        packets.extend(answer(hand, asked).map(|packet| (whole, packet)));
                        asked += 1;
                    }
                    Ok(_) => {}
                    Err(_) => thread::sleep(Duration::from_millis(2)),
                }
                while packets.front().is_some_and(|(whole, _)| *whole <= Instant::now()) {
                    packets.pop_front().into_iter().for_each(|(_, packet)| port.write(&packet));
                }
            }
        });
    }
}

/// Thirteen bytes at 9600 baud.
const LINE: Duration = Duration::from_micros(13_600);

/// Returns the packet that answers a poll, after this many others.
fn answer(hand: Hand, asked: u32) -> Option<[u8; 12]> {
    let Faults { old, corrupt, lost, of, .. } = hand.faults;
    let place = asked.checked_rem(of).unwrap_or(of);
    let mut packet = packet(Hand { old: hand.old || place < old, ..hand });
    packet[11] ^= u8::from(place < corrupt);
    (place >= lost).then_some(packet)
}

fn packet(hand: Hand) -> [u8; 12] {
    let id = if hand.old { 0x80 } else { 0 };
    let mut packet = [8, 0xF8, 0x5D, id, hand.x.to_le_bytes()[0], 0, 0, 0, 0, 0, hand.keys, 0];
    let sum = packet[3..11].iter().fold(8u8, |sum, byte| sum.wrapping_add(*byte));
    packet[11] = sum.wrapping_neg();
    packet
}
