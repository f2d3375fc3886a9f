//! A terminal that shows pictures: a thread of its own writes them, because a terminal may block (a selection, a hung link,
//! Ctrl-S). The terminal is restored however the program ends.

use std::io::{self, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, channel, sync_channel};
use std::thread;
use std::time::Duration;

use anyhow::{Context, Result};
use ratatui::crossterm::cursor::Show;
use ratatui::crossterm::execute;
use ratatui::crossterm::terminal::{
    EnterAlternateScreen, LeaveAlternateScreen, disable_raw_mode, enable_raw_mode,
};
use ratatui::prelude::CrosstermBackend;

use cellwire_io::output;

/// A terminal that does not take the end of the alternate screen in this time is not awaited.
const RESTORE_TIMEOUT: Duration = Duration::from_millis(500);

/// The terminal while it shows pictures.
#[allow(missing_debug_implementations, reason = "it holds a terminal")]
pub struct Screen {
    terminal: ratatui::Terminal<CrosstermBackend<Picture>>,
    is_free: Arc<AtomicBool>,
    has_failed: Arc<AtomicBool>,
}

impl Screen {
    /// Enters the alternate screen. Leave it with [`leave`], on a panic too.
    pub fn enter() -> Result<Self> {
        let earlier = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |panic| {
            leave();
            earlier(panic);
        }));
        enable_raw_mode().context("the screen needs a terminal")?;
        // A line that is written later would stay inside the picture.
        output::settle();
        execute!(io::stdout(), EnterAlternateScreen)?;
        let (is_free, has_failed) = (Arc::new(AtomicBool::new(true)), Arc::new(AtomicBool::new(false)));
        // One picture at a time.
        let (pictures, to_write) = sync_channel(1);
        let (free, failed) = (Arc::clone(&is_free), Arc::clone(&has_failed));
        thread::spawn(move || write(&to_write, &mut io::stdout(), &free, &failed));
        let picture = Picture { bytes: Vec::new(), pictures, is_free: Arc::clone(&is_free) };
        let terminal = ratatui::Terminal::new(CrosstermBackend::new(picture))?;
        Ok(Self { terminal, is_free, has_failed })
    }

    /// Draws a picture if the terminal has taken the previous one; returns false otherwise.
    pub fn draw(&mut self, picture: impl FnOnce(&mut ratatui::Frame<'_>)) -> Result<bool> {
        if !self.is_free.load(Ordering::Acquire) {
            return Ok(false);
        }
        self.terminal.draw(picture)?;
        Ok(true)
    }

    /// Returns whether the terminal is gone.
    pub fn is_gone(&self) -> bool {
        self.has_failed.load(Ordering::Relaxed)
    }
}

/// Gives the terminal back as it was.
pub fn leave() {
    let _ = disable_raw_mode();
    let (done, wait) = channel();
    // A terminal with stopped output would block this thread forever.
    thread::spawn(move || {
        let _ = execute!(io::stdout(), LeaveAlternateScreen, Show);
        let _ = done.send(());
    });
    let _ = wait.recv_timeout(RESTORE_TIMEOUT);
}

/// Collects the output of a picture until it is complete.
struct Picture {
    bytes: Vec<u8>,
    pictures: SyncSender<Vec<u8>>,
    is_free: Arc<AtomicBool>,
}

impl Write for Picture {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.bytes.extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        if self.bytes.is_empty() {
            return Ok(());
        }
        self.is_free.store(false, Ordering::Release);
        // There is room: nothing is drawn while one waits. Pieces of one picture may be flushed apart.
        if let Err(error) = self.pictures.try_send(core::mem::take(&mut self.bytes)) {
            let (std::sync::mpsc::TrySendError::Full(mut bytes)
            | std::sync::mpsc::TrySendError::Disconnected(mut bytes)) = error;
            bytes.append(&mut self.bytes);
            self.bytes = bytes;
        }
        Ok(())
    }
}

fn write(pictures: &Receiver<Vec<u8>>, out: &mut impl Write, is_free: &AtomicBool, has_failed: &AtomicBool) {
    while let Ok(picture) = pictures.recv() {
        if out.write_all(&picture).and_then(|()| out.flush()).is_err() {
            has_failed.store(true, Ordering::Relaxed);
        }
        is_free.store(true, Ordering::Release);
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;
    use std::sync::atomic::AtomicU8;

    use super::*;

    const BLOCKED: u8 = 0;
    const OPEN: u8 = 1;
    const GONE: u8 = 2;

    /// A terminal that takes nothing while it is blocked.
    struct BlockedTerminal(Arc<AtomicU8>, Arc<Mutex<Vec<u8>>>);

    impl Write for BlockedTerminal {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            while self.0.load(Ordering::Acquire) == BLOCKED {
                thread::sleep(Duration::from_millis(1));
            }
            if self.0.load(Ordering::Acquire) == GONE {
                return Err(io::ErrorKind::BrokenPipe.into());
            }
            self.1.lock().unwrap().extend_from_slice(bytes);
            Ok(bytes.len())
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    /// The part of the next test that panics, in a process and on a terminal of its own.
    #[test]
    #[ignore = "it is run by another test, on a pseudo-terminal"]
    fn panics() {
        let mut screen = Screen::enter().unwrap();
        screen.draw(|frame| frame.render_widget("drawn", frame.area())).unwrap();
        while !screen.is_free.load(Ordering::Acquire) {
            thread::sleep(Duration::from_millis(1));
        }
        screen.draw(|_| panic!("a panic while it is drawn")).unwrap();
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn a_panic_gives_the_terminal_back() {
        use std::io::Read;
        use std::process::{Command, Stdio};
        use std::time::Instant;

        let (mut user, path) = cellwire_io::serial::pair().unwrap();
        let open = || std::fs::File::options().read(true).write(true).open(&path).unwrap();
        // The settings of the terminal stay as long as it is open.
        let _client = open();
        let stty = |args: &[&str]| {
            let output = Command::new("stty").args(["-F", &path]).args(args).output().unwrap();
            assert!(output.status.success(), "{output:?}");
            String::from_utf8(output.stdout).unwrap()
        };
        stty(&["sane", "rows", "24", "cols", "80"]);
        let settings = stty(&["-g"]);
        let mut process = Command::new("setsid")
            .arg("--ctty")
            .arg(std::env::current_exe().unwrap())
            .args(["--exact", "io::terminal::tests::panics", "--ignored", "--nocapture"])
            .stdin(Stdio::from(open()))
            .stdout(Stdio::from(open()))
            .stderr(Stdio::from(open()))
            .spawn()
            .unwrap();
        let (mut shown, end) = (Vec::new(), Instant::now() + Duration::from_secs(60));
        let mut status = None;
        loop {
            let mut buffer = [0; 4096];
            let length = user.read(&mut buffer).unwrap_or(0);
            shown.extend_from_slice(&buffer[..length]);
            if length == 0 && status.is_some() {
                break;
            }
            status = process.try_wait().unwrap();
            assert!(Instant::now() < end, "it does not end: {}", String::from_utf8_lossy(&shown));
        }
        let shown = String::from_utf8_lossy(&shown);
        let at = |text: &str| shown.find(text).unwrap_or_else(|| panic!("no {text:?} in {shown:?}"));
        // Entered, drawn, left, and only then the message, where it can be read.
        let [entered, drawn, left] = ["\x1b[?1049h", "drawn", "\x1b[?1049l"].map(at);
        assert!(entered < drawn && drawn < left && left < at("a panic while it is drawn"), "{shown:?}");
        assert_eq!(stty(&["-g"]), settings);
    }

    #[test]
    fn a_terminal_that_blocks_keeps_nobody_and_loses_no_piece_of_a_picture() {
        let (is_free, has_failed) = (Arc::new(AtomicBool::new(true)), Arc::new(AtomicBool::new(false)));
        let (gate, shown) = (Arc::new(AtomicU8::new(BLOCKED)), Arc::new(Mutex::new(Vec::new())));
        let (pictures, to_write) = sync_channel(1);
        let (free, failed) = (Arc::clone(&is_free), Arc::clone(&has_failed));
        let mut out = BlockedTerminal(Arc::clone(&gate), Arc::clone(&shown));
        let writer = thread::spawn(move || write(&to_write, &mut out, &free, &failed));
        let mut picture = Picture { bytes: Vec::new(), pictures, is_free: Arc::clone(&is_free) };
        let wait_until_free = || {
            while !is_free.load(Ordering::Acquire) {
                thread::sleep(Duration::from_millis(1));
            }
        };
        // Pieces of one picture: none of them waits.
        for piece in ["one", "two", "three", "four"] {
            picture.write_all(piece.as_bytes()).unwrap();
            picture.flush().unwrap();
        }
        assert!(!is_free.load(Ordering::Acquire), "nothing else is drawn meanwhile");
        gate.store(OPEN, Ordering::Release);
        wait_until_free();
        picture.write_all(b"five").unwrap();
        while !shown.lock().unwrap().ends_with(b"five") {
            picture.flush().unwrap();
            thread::sleep(Duration::from_millis(1));
        }
        assert_eq!(*shown.lock().unwrap(), b"onetwothreefourfive");
        gate.store(GONE, Ordering::Release);
        picture.write_all(b"six").unwrap();
        picture.flush().unwrap();
        drop(picture);
        writer.join().unwrap();
        assert!(has_failed.load(Ordering::Relaxed), "the terminal is gone");
    }
}
