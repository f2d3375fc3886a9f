//! The keys of the operator's terminal: a key moves as long as it is repeated.

use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::Duration;

use super::device::{Input, InputEvent};
use crate::alter::sample::{FULL, Jog, Sample};
use cellwire_io::clock::Clock;

/// The time for which a key moves: terminals repeat it thirty times a second, and do not report its release.
const HOLD: Duration = Duration::from_millis(120);
/// The interval at which values without a newer key are renewed.
const PERIOD: Duration = Duration::from_millis(28);
/// Half of the full deflection: a key has no middle.
const DEFLECTION: i16 = FULL / 2;

pub(super) struct Keyboard {
    clock: Clock,
    keys: Receiver<Jog>,
    /// The key that was pressed last, and how long it moves.
    pressed: Option<(Jog, Duration)>,
    next: Duration,
}

impl Keyboard {
    pub(super) fn new(clock: Clock, keys: Receiver<Jog>) -> Self {
        Self { clock, keys, pressed: None, next: Duration::ZERO }
    }

    fn axes(&self) -> [i16; 6] {
        let mut axes = [0; 6];
        if let Some((jog, _)) = self.pressed
            && let Some(axis) = axes.get_mut(usize::from(jog.axis))
        {
            *axis = if jog.is_negative { -DEFLECTION } else { DEFLECTION };
        }
        axes
    }
}

impl Input for Keyboard {
    fn poll(&mut self, wait: Duration, events: &mut Vec<InputEvent>) {
        let now = self.clock.now();
        match self.keys.recv_timeout(wait.min(self.next.saturating_sub(now))) {
            Ok(jog) => self.pressed = Some((jog, self.clock.now() + HOLD)),
            Err(RecvTimeoutError::Timeout) => {}
            // The keys are no longer read.
            Err(RecvTimeoutError::Disconnected) => {
                std::thread::sleep(wait);
                return events.push(InputEvent::Lost);
            }
        }
        let now = self.clock.now();
        self.pressed = self.pressed.filter(|(_, until)| now < *until);
        if now >= self.next {
            self.next = now + PERIOD;
            let fresh_until = now + HOLD;
            events.push(InputEvent::Sample(Sample { axes: self.axes(), buttons: 0, fresh_until }));
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::channel;

    use super::*;

    #[test]
    fn a_key_moves_while_it_is_repeated_and_rests_after_it() {
        let (sender, keys) = channel();
        let mut keyboard = Keyboard::new(Clock::start(), keys);
        let next = |keyboard: &mut Keyboard| {
            let mut events = Vec::new();
            while events.is_empty() {
                keyboard.poll(Duration::from_millis(5), &mut events);
            }
            events[0]
        };
        let moves = |event| matches!(event, InputEvent::Sample(Sample { axes: [0, -500, 0, 0, 0, 0], .. }));
        let rests = |event| matches!(event, InputEvent::Sample(Sample { axes: [0, 0, 0, 0, 0, 0], .. }));
        assert!(rests(next(&mut keyboard)));
        sender.send(Jog { axis: 1, is_negative: true }).unwrap();
        assert!((0..100).any(|_| moves(next(&mut keyboard))));
        assert!((0..100).any(|_| rests(next(&mut keyboard))), "it is not repeated");
        drop(sender);
        assert_eq!(next(&mut keyboard), InputEvent::Lost);
    }
}
