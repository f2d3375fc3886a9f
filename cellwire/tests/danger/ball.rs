//! A ball that shares no code with the crates, and the hand on it.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::{Duration, Instant};

use cellwire::io::priority::{self, Rank};

use super::pty::Pty;

#[derive(Debug, Clone, Copy, Default)]
struct Hand {
    x: i8,
    keys: u8,
    /// The values are those of before.
    old: bool,
    /// The ball's cable is pulled.
    gone: bool,
}

pub(crate) struct Ball {
    hand: Arc<Mutex<Hand>>,
    path: PathBuf,
}

impl Ball {
    /// At a link to a pseudo-terminal.
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

    /// From now on every packet says "old data".
    pub(crate) fn stick(&self) {
        self.hand.lock().unwrap().old = true;
    }

    /// The port disappears.
    pub(crate) fn pull(&self) {
        // First the link: the number of the pseudo-terminal may soon be that of another.
        std::fs::remove_file(&self.path).unwrap();
        self.hand.lock().unwrap().gone = true;
    }

    /// The port is there, perhaps again.
    pub(crate) fn plug(&self) {
        let (port, client) = Pty::new();
        let mut port = port.raw();
        let _ = std::fs::remove_file(&self.path);
        std::os::unix::fs::symlink(client, &self.path).unwrap();
        self.hand.lock().unwrap().gone = false;
        let hand = Arc::clone(&self.hand);
        thread::spawn(move || {
            priority::raise(Rank::Hardware);
            let mut byte = [0];
            while Arc::strong_count(&hand) > 1 {
                if hand.lock().unwrap().gone {
                    return;
                }
                match port.read(Duration::from_millis(5), &mut byte) {
                    Ok(1) if byte == [0x05] => {
                        // Thirteen bytes at 9600 baud.
                        let whole = Instant::now() + Duration::from_micros(13_600);
                        thread::sleep(whole.saturating_duration_since(Instant::now()));
                        let hand = *hand.lock().unwrap();
                        port.write(&packet(hand));
                    }
                    Ok(_) => {}
                    Err(_) => thread::sleep(Duration::from_millis(2)),
                }
            }
        });
    }
}

fn packet(hand: Hand) -> [u8; 12] {
    let id = if hand.old { 0x80 } else { 0 };
    let mut packet = [8, 0xF8, 0x5D, id, hand.x.to_le_bytes()[0], 0, 0, 0, 0, 0, hand.keys, 0];
    let sum = packet[3..11].iter().fold(8u8, |sum, byte| sum.wrapping_add(*byte));
    packet[11] = sum.wrapping_neg();
    packet
}
