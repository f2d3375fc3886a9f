//! A line in memory with a capacity of few bytes, for all drivers: a writer waits while it is full, so a reader that
//! does not read delays the writer.

use core::future::poll_fn;
use core::pin::Pin;
use core::task::{Context, Poll, Waker};
use std::collections::VecDeque;
use std::io;
use std::sync::{Arc, Condvar, Mutex, MutexGuard};
use std::time::Duration;

use embedded_io_async::ErrorType;
use robot_session::{ReceiveOutcome, SendOutcome, Transport, Wait};
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};

/// One end of a line.
#[derive(Clone)]
pub struct Pipe {
    line: Arc<(Mutex<Line>, Condvar)>,
    /// The index of the direction that it writes; it reads the other one.
    way: usize,
}

struct Line {
    room: usize,
    ways: [VecDeque<u8>; 2],
    /// The number of bytes that still go each way before the line is cut.
    until_cut: [usize; 2],
    is_cut: bool,
    waiting: Vec<Waker>,
}

/// Creates both ends of a line that buffers this many bytes in each direction, and is cut after this many: [`usize::MAX`] is
/// never.
pub fn line(room: usize, until_cut: [usize; 2]) -> [Pipe; 2] {
    let ways = [VecDeque::new(), VecDeque::new()];
    let line = Arc::new((
        Mutex::new(Line { room, ways, until_cut, is_cut: false, waiting: Vec::new() }),
        Condvar::new(),
    ));
    [Pipe { line: Arc::clone(&line), way: 0 }, Pipe { line, way: 1 }]
}

impl Pipe {
    fn lock(&self) -> MutexGuard<'_, Line> {
        self.line.0.lock().unwrap()
    }

    /// Cuts the line.
    pub fn cut(&self) {
        self.lock().is_cut = true;
        self.changed(&mut self.lock());
    }

    fn changed(&self, line: &mut Line) {
        self.line.1.notify_all();
        line.waiting.drain(..).for_each(Waker::wake);
    }

    /// Reads some bytes; 0 at the end, `None` if there are none yet.
    fn try_read(&self, line: &mut Line, buffer: &mut [u8]) -> Option<usize> {
        let way = &mut line.ways[1 - self.way];
        let length = way.len().min(buffer.len());
        if length == 0 {
            return line.is_cut.then_some(0);
        }
        for (place, byte) in buffer.iter_mut().zip(way.drain(..length)) {
            *place = byte;
        }
        self.changed(line);
        Some(length)
    }

    fn try_write(&self, line: &mut Line, bytes: &[u8]) -> io::Result<Option<usize>> {
        if line.is_cut {
            return Err(io::ErrorKind::BrokenPipe.into());
        }
        let length = bytes.len().min(line.room - line.ways[self.way].len());
        if length == 0 {
            return Ok(None);
        }
        let length = length.min(line.until_cut[self.way]);
        line.ways[self.way].extend(&bytes[..length]);
        line.until_cut[self.way] -= length;
        line.is_cut = line.until_cut[self.way] == 0;
        self.changed(line);
        Ok(Some(length))
    }

    /// Reads for a peer that has no driver; none at the end.
    pub fn read(&self, buffer: &mut [u8]) -> usize {
        let mut line = self.lock();
        loop {
            match self.try_read(&mut line, buffer) {
                Some(length) => return length,
                None => line = self.line.1.wait(line).unwrap(),
            }
        }
    }
}

impl Transport for Pipe {
    fn receive(&mut self, buffer: &mut [u8], wait: Wait<'_>) -> io::Result<ReceiveOutcome> {
        let until = robot_session::now().saturating_add(wait.limit.unwrap_or(Duration::MAX));
        let mut line = self.lock();
        loop {
            match self.try_read(&mut line, buffer) {
                Some(0) => return Ok(ReceiveOutcome::Closed),
                Some(length) => return Ok(ReceiveOutcome::Bytes(length)),
                None => {}
            }
            let left = until.saturating_sub(robot_session::now());
            if left.is_zero() || wait.room && line.ways[self.way].len() < line.room {
                return Ok(ReceiveOutcome::Nothing);
            }
            line = self.line.1.wait_timeout(line, left).unwrap().0;
        }
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<SendOutcome> {
        Ok(match self.try_write(&mut self.lock(), bytes)? {
            Some(length) if length == bytes.len() => SendOutcome::Buffered,
            part => SendOutcome::Part(part.unwrap_or(0)),
        })
    }
}

impl AsyncRead for Pipe {
    fn poll_read(
        self: Pin<&mut Self>,
        context: &mut Context<'_>,
        out: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        let mut line = self.lock();
        match self.try_read(&mut line, out.initialize_unfilled()) {
            Some(length) => {
                out.advance(length);
                Poll::Ready(Ok(()))
            }
            None => {
                line.waiting.push(context.waker().clone());
                Poll::Pending
            }
        }
    }
}

impl AsyncWrite for Pipe {
    fn poll_write(self: Pin<&mut Self>, context: &mut Context<'_>, bytes: &[u8]) -> Poll<io::Result<usize>> {
        let mut line = self.lock();
        match self.try_write(&mut line, bytes)? {
            Some(length) => Poll::Ready(Ok(length)),
            None => {
                line.waiting.push(context.waker().clone());
                Poll::Pending
            }
        }
    }

    fn poll_flush(self: Pin<&mut Self>, _: &mut Context<'_>) -> Poll<io::Result<()>> {
        Poll::Ready(Ok(()))
    }

    fn poll_shutdown(self: Pin<&mut Self>, _: &mut Context<'_>) -> Poll<io::Result<()>> {
        Poll::Ready(Ok(()))
    }
}

impl ErrorType for Pipe {
    type Error = io::Error;
}

impl embedded_io_async::Read for Pipe {
    async fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        poll_fn(|context| {
            let mut out = ReadBuf::new(buffer);
            Pin::new(&mut *self).poll_read(context, &mut out).map_ok(|()| out.filled().len())
        })
        .await
    }
}

impl embedded_io_async::Write for Pipe {
    async fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        poll_fn(|context| Pin::new(&mut *self).poll_write(context, bytes)).await
    }

    async fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}
