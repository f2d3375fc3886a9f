//! Standard output or error of a program that never waits for its reader.

use std::io::{self, Write};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::Duration;

use anyhow::{Context, Result};

/// The number of bytes that may wait for a reader, beside those that the system buffers.
const BUFFER_LEN: usize = 1 << 20;

/// The time that a reader gets at the end of the program to take the buffered output.
const DRAIN_TIMEOUT: Duration = Duration::from_secs(1);

/// A thread that writes lines. When its buffer is full, lines are dropped and counted.
#[derive(Debug)]
pub(super) struct Outlet(Arc<Shared>);

#[derive(Debug, Default)]
struct Shared {
    state: Mutex<State>,
    changed: Condvar,
}

#[derive(Debug, Default)]
struct State {
    waiting: Vec<u8>,
    is_writing: bool,
    /// The number of lines that did not fit into the buffer, after those that wait.
    dropped: u64,
    failed: Option<WriteFailed>,
}

/// The reason why nothing can be written any more.
#[derive(Debug)]
struct WriteFailed(io::Error);

impl WriteFailed {
    fn again(&self) -> io::Error {
        self.0.raw_os_error().map_or_else(|| self.0.kind().into(), io::Error::from_raw_os_error)
    }
}

impl Outlet {
    /// Starts a thread that writes to `out`. `note` returns the line with the number of dropped lines.
    ///
    /// # Errors
    /// If the system has no room for a thread.
    pub(super) fn start(mut out: impl Write + Send + 'static, note: fn(u64) -> String) -> Result<Self> {
        let shared = Arc::new(Shared::default());
        let of_thread = Arc::clone(&shared);
        let thread = thread::Builder::new().name("output".into());
        thread.spawn(move || of_thread.run(&mut out, note)).context("cannot start a thread that prints")?;
        Ok(Self(shared))
    }

    /// Takes a line, or drops it.
    ///
    /// # Errors
    /// If an earlier line could not be written.
    pub(super) fn put(&self, line: &[u8]) -> io::Result<()> {
        let mut state = self.0.lock();
        if let Some(failed) = &state.failed {
            return Err(failed.again());
        }
        // Lines stay in sequence: after a dropped line, a shorter one is dropped too. Where nothing waits, a line of any length
        // does: nothing would tell the thread that one was dropped.
        let is_full = !state.waiting.is_empty() && state.waiting.len() + line.len() > BUFFER_LEN;
        if state.dropped > 0 || is_full {
            state.dropped += 1;
            return Ok(());
        }
        state.waiting.extend_from_slice(line);
        self.0.changed.notify_all();
        Ok(())
    }

    /// Waits until everything is written, a second at most: a slow reader gets it later.
    ///
    /// # Errors
    /// If a line could not be written.
    pub(super) fn finish(&self) -> io::Result<()> {
        let is_busy = |state: &mut State| state.is_writing || !state.waiting.is_empty();
        let waited = self.0.changed.wait_timeout_while(self.0.lock(), DRAIN_TIMEOUT, is_busy);
        let (state, _) = waited.unwrap_or_else(PoisonError::into_inner);
        state.failed.as_ref().map_or(Ok(()), |failed| Err(failed.again()))
    }
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn run(&self, out: &mut impl Write, note: fn(u64) -> String) {
        loop {
            let mut state = self.lock();
            while state.waiting.is_empty() {
                state.is_writing = false;
                self.changed.notify_all();
                state = self.changed.wait(state).unwrap_or_else(PoisonError::into_inner);
            }
            state.is_writing = true;
            let mut lines = core::mem::take(&mut state.waiting);
            if state.dropped > 0 {
                lines.extend(note(core::mem::take(&mut state.dropped)).into_bytes());
            }
            drop(state);
            if let Err(error) = out.write_all(&lines).and_then(|()| out.flush()) {
                let mut state = self.lock();
                (state.failed, state.is_writing, state.waiting) =
                    (Some(WriteFailed(error)), false, Vec::new());
                self.changed.notify_all();
                return;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::ErrorKind;
    use std::sync::mpsc::{Receiver, Sender, channel};

    /// Waits for a signal before each write.
    struct Slow(Receiver<()>, Sender<Vec<u8>>);

    impl Write for Slow {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            self.0.recv().map_err(|_| ErrorKind::BrokenPipe)?;
            let _ = self.1.send(bytes.to_vec());
            Ok(bytes.len())
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn lines_without_room_are_dropped_and_counted_in_their_place() {
        let ((go, wait), (sender, written)) = (channel(), channel());
        let outlet = Outlet::start(Slow(wait, sender), |count| format!("{count} dropped\n")).unwrap();
        outlet.put(b"first\n").unwrap();
        let wait_until_it_writes = || {
            while !outlet.0.lock().waiting.is_empty() {
                thread::yield_now();
            }
        };
        // The thread holds the first line; then there is room for this many.
        wait_until_it_writes();
        let line = [b'x'; 1024];
        for _ in 0..BUFFER_LEN / line.len() + 7 {
            outlet.put(&line).unwrap();
        }
        outlet.put(b"short\n").unwrap();
        go.send(()).unwrap();
        assert_eq!(written.recv().unwrap(), b"first\n");
        go.send(()).unwrap();
        let rest = written.recv().unwrap();
        assert_eq!(rest.len(), BUFFER_LEN + b"8 dropped\n".len());
        assert!(rest.ends_with(b"8 dropped\n"));
        outlet.put(b"last\n").unwrap();
        go.send(()).unwrap();
        assert_eq!(written.recv().unwrap(), b"last\n");
        // After a dropped line, one for which there is room is dropped too.
        outlet.put(b"held\n").unwrap();
        wait_until_it_writes();
        outlet.put(b"waiting\n").unwrap();
        outlet.put(&[b'x'; BUFFER_LEN]).unwrap();
        outlet.put(b"short\n").unwrap();
        for expected in [&b"held\n"[..], b"waiting\n2 dropped\n"] {
            go.send(()).unwrap();
            assert_eq!(written.recv().unwrap(), expected);
        }
        outlet.finish().unwrap();
        // A line that is longer than the buffer is written, and so is the next.
        for line in [&[b'x'; BUFFER_LEN + 1][..], b"next\n"] {
            outlet.put(line).unwrap();
            go.send(()).unwrap();
            assert_eq!(written.recv().unwrap(), line);
        }
        outlet.finish().unwrap();
        // The reader is gone: the line after the next is an error.
        drop(go);
        outlet.put(b"lost\n").unwrap();
        assert_eq!(outlet.finish().unwrap_err().kind(), ErrorKind::BrokenPipe);
        assert_eq!(outlet.put(b"refused\n").unwrap_err().kind(), ErrorKind::BrokenPipe);
    }
}
