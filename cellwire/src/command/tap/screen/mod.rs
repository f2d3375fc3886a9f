//! The screen of a tap: both ends while they talk.

mod board;
mod draw;
#[cfg(test)]
mod tests;

use std::io::{self, IsTerminal as _};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::{Duration, Instant, SystemTime};

use anyhow::{Result, ensure};
use ratatui::crossterm::event::{self, Event, KeyCode, KeyEventKind, KeyModifiers};

use self::board::Board;
use super::SILENCE;
use super::decoding::{Entry, TapDecoder};
use crate::io::tap::TapReceiver;
use crate::io::terminal::{self, Screen};
use cellwire_io::output;

/// A picture is drawn this often.
const PICTURE: Duration = Duration::from_millis(100);

/// Checks that standard output is a terminal.
///
/// # Errors
/// If it is not.
pub(super) fn check() -> Result<()> {
    ensure!(io::stdout().is_terminal(), "--screen needs a terminal");
    Ok(())
}

/// Returns the remarks from now on, for the screen.
pub(super) fn remarks() -> Receiver<String> {
    let (sender, remarks) = channel();
    output::show_remarks(Some(sender));
    remarks
}

/// Shows the observations and these remarks until the user ends it with q, or there are no more.
///
/// # Errors
/// If the terminal cannot be used.
pub(super) fn show(
    title: &str,
    mut decoding: TapDecoder<'_>,
    seen: &TapReceiver,
    remarks: &Receiver<String>,
) -> Result<()> {
    let mut board = Board::new(title, SystemTime::now());
    let outcome = Screen::enter().and_then(|mut screen| {
        let outcome = run(&mut screen, &mut board, &mut decoding, (seen, remarks));
        drop(screen);
        terminal::leave();
        outcome
    });
    output::show_remarks(None);
    remarks.try_iter().for_each(|text| board.remark(text));
    // The remarks were on the screen, which is gone.
    board.remarks.iter().for_each(|text| output::remark(text));
    outcome
}

fn run(
    screen: &mut Screen,
    board: &mut Board,
    decoding: &mut TapDecoder<'_>,
    (seen, remarks): (&TapReceiver, &Receiver<String>),
) -> Result<()> {
    let mut next = Instant::now();
    loop {
        remarks.try_iter().for_each(|text| board.remark(text));
        let wait = next.saturating_duration_since(Instant::now()).min(SILENCE);
        let mut tell = |entry: Entry| {
            board.take(&entry);
            Ok(())
        };
        let outcome = match seen.next_within(wait) {
            Ok(seen) => decoding.take(&seen, &mut tell),
            Err(RecvTimeoutError::Timeout) => decoding.silence(&mut tell),
            Err(RecvTimeoutError::Disconnected) => return Ok(()),
        };
        if let Err(error) = outcome {
            board.fail(&format!("{error:#}"));
        }
        if Instant::now() >= next {
            board.pass_time(SystemTime::now());
            board.state = decoding.state();
            screen.draw(|frame| draw::draw(frame, board))?;
            next = Instant::now() + PICTURE;
            if is_ended()? || screen.is_gone() {
                return Ok(());
            }
        }
    }
}

/// Returns whether the user has pressed q, or Ctrl-C.
fn is_ended() -> Result<bool> {
    while event::poll(Duration::ZERO)? {
        if let Event::Key(key) = event::read()?
            && key.kind == KeyEventKind::Press
        {
            let is_interrupt =
                key.code == KeyCode::Char('c') && key.modifiers.contains(KeyModifiers::CONTROL);
            if is_interrupt || key.code == KeyCode::Char('q') {
                return Ok(true);
            }
        }
    }
    Ok(false)
}
