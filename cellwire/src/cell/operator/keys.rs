//! The thread that reads the keys.

use std::sync::mpsc::{Receiver, channel};
use std::thread;

use ratatui::crossterm::event::{self, Event, KeyCode, KeyEvent, KeyEventKind, KeyModifiers};

use crate::cell::teleop::{Order, Orders};

/// What a key does to the arm, whatever the screen shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Stop {
    /// Come to rest.
    Stop,
    /// Come to rest, and end.
    End,
}

/// Reads the keys. The stop is done here: it waits for no screen. Everything is passed on besides. Ctrl-C a second time calls
/// `end_at_once`.
pub(super) fn read(orders: Orders, end_at_once: fn()) -> Receiver<KeyEvent> {
    let (pressed, keys) = channel();
    thread::spawn(move || {
        let mut ending = false;
        while let Ok(event) = event::read() {
            let Event::Key(key) = event else { continue };
            if key.kind == KeyEventKind::Release {
                continue;
            }
            match stop(key) {
                Some(Stop::Stop) => orders.order(Order::Stop),
                Some(Stop::End) if ending => end_at_once(),
                Some(Stop::End) => {
                    ending = true;
                    orders.order(Order::End);
                }
                None => {}
            }
            if pressed.send(key).is_err() {
                return;
            }
        }
        // No key can stop the arm any more.
        orders.order(Order::End);
    });
    keys
}

/// Space and Esc stop, Ctrl-C ends. Esc and another key that come together are one key with Alt: that stops too.
pub(super) fn stop(key: KeyEvent) -> Option<Stop> {
    match key.code {
        KeyCode::Char('c') if key.modifiers.contains(KeyModifiers::CONTROL) => Some(Stop::End),
        KeyCode::Esc | KeyCode::Char(' ') => Some(Stop::Stop),
        _ if key.modifiers.contains(KeyModifiers::ALT) => Some(Stop::Stop),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn space_esc_and_what_comes_with_esc_stop() {
        let key = |code, modifiers| stop(KeyEvent::new(code, modifiers));
        assert_eq!(key(KeyCode::Char(' '), KeyModifiers::NONE), Some(Stop::Stop));
        assert_eq!(key(KeyCode::Esc, KeyModifiers::NONE), Some(Stop::Stop));
        assert_eq!(key(KeyCode::Char('a'), KeyModifiers::ALT), Some(Stop::Stop));
        assert_eq!(key(KeyCode::Char('c'), KeyModifiers::CONTROL), Some(Stop::End));
        assert_eq!(key(KeyCode::Char('c'), KeyModifiers::NONE), None);
        assert_eq!(key(KeyCode::Char('a'), KeyModifiers::NONE), None);
    }
}
