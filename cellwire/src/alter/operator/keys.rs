//! The thread that reads the keys.

use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread;

use ratatui::crossterm::event::{self, Event, KeyCode, KeyEvent, KeyEventKind, KeyModifiers};

use crate::alter::input::Jog;
use crate::alter::{Order, Orders};

/// The effect of a key on the arm, on every screen.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Stop {
    /// Come to rest.
    Stop,
    /// Come to rest, and end.
    End,
}

/// Reads the keys. The stop is done here: it waits for no screen. Everything is passed on besides. Ctrl-C a second time calls
/// `end_at_once`.
pub(super) fn read(orders: Orders, jog: Option<Sender<Jog>>, end_at_once: fn()) -> Receiver<KeyEvent> {
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
            if let (Some(jog), Some(axis)) = (&jog, axis(key)) {
                let _ = jog.send(axis);
                continue;
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

/// Returns the stop of a key: Space and Esc stop, Ctrl-C ends. Esc and another key that arrive together are one key with
/// Alt, which stops too.
pub(super) fn stop(key: KeyEvent) -> Option<Stop> {
    match key.code {
        KeyCode::Char('c') if key.modifiers.contains(KeyModifiers::CONTROL) => Some(Stop::End),
        KeyCode::Esc | KeyCode::Char(' ') => Some(Stop::Stop),
        _ if key.modifiers.contains(KeyModifiers::ALT) => Some(Stop::Stop),
        _ => None,
    }
}

/// Returns the motion of a key that moves an axis, if the keyboard is the input.
fn axis(key: KeyEvent) -> Option<Jog> {
    let shift = key.modifiers.contains(KeyModifiers::SHIFT);
    let (axis, is_negative) = match key.code {
        KeyCode::Right => (0, false),
        KeyCode::Left => (0, true),
        KeyCode::Up => (1, false),
        KeyCode::Down => (1, true),
        KeyCode::PageUp => (2, false),
        KeyCode::PageDown => (2, true),
        KeyCode::Home => return Some(Jog { axis: 5, is_negative: false }),
        KeyCode::End => return Some(Jog { axis: 5, is_negative: true }),
        _ => return None,
    };
    Some(Jog { axis: if shift { axis + 3 } else { axis }, is_negative })
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

    #[test]
    fn arrows_move_and_turn() {
        let key =
            |code, modifiers| axis(KeyEvent::new(code, modifiers)).map(|jog| (jog.axis, jog.is_negative));
        assert_eq!(key(KeyCode::Left, KeyModifiers::NONE), Some((0, true)));
        assert_eq!(key(KeyCode::PageUp, KeyModifiers::SHIFT), Some((5, false)));
        assert_eq!(key(KeyCode::End, KeyModifiers::NONE), Some((5, true)));
        assert_eq!(key(KeyCode::Char('x'), KeyModifiers::NONE), None);
    }
}
