use core::task::Poll;
use core::time::Duration;

use crate::value::Pose;

/// A command to the arm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Motion {
    /// Along a straight line (`LMOVE`), otherwise by the joints (`JMOVE`).
    pub straight: bool,
    /// The goal of the motion.
    pub to: Pose,
}

/// One row of `TCP_STATUS`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Socket {
    /// The other end's port.
    pub port: u16,
    /// The number of the socket.
    pub id: i32,
    /// 0, or the number of the error after which the socket can no longer be used.
    pub error: i32,
}

/// The surroundings of the language: time, sockets and the arm. A result below 0 is the number of an error.
///
/// A call that returns [`Poll::Pending`] is repeated until it is ready. `since` is the time at which the statement
/// began.
pub trait Host {
    /// Returns the time since the controller was switched on.
    fn now(&self) -> Duration;

    /// Executes `TCP_CONNECT`: returns the socket's number.
    fn connect(&mut self, since: Duration, timeout: Duration, ip: [u8; 4], port: u16) -> Poll<i32>;

    /// Executes `TCP_SEND`.
    fn send(&mut self, since: Duration, timeout: Duration, socket: i32, strings: &[&[u8]]) -> Poll<i32>;

    /// Executes `TCP_RECV`: returns the received bytes, in strings of at most `longest` bytes.
    fn receive(
        &mut self,
        since: Duration,
        timeout: Duration,
        socket: i32,
        longest: usize,
    ) -> Poll<(i32, Vec<Vec<u8>>)>;

    /// Executes `TCP_CLOSE`.
    fn close(&mut self, socket: i32) -> i32;

    /// Executes `TCP_STATUS`.
    fn sockets(&mut self) -> Vec<Socket>;

    /// Executes `LMOVE` or `JMOVE`: pending while the arm has another command.
    fn give(&mut self, motion: Motion) -> Poll<()>;

    /// Executes `BREAK`: pending while the arm moves.
    fn arrived(&mut self) -> Poll<()>;

    /// Executes `PRINT`.
    fn print(&mut self, task: usize, line: &str);
}

/// A controller without a network whose arm is where it is sent at once, and whose clock is stopped.
#[derive(Debug, Clone, Copy, Default)]
pub struct NoHost;

impl Host for NoHost {
    fn now(&self) -> Duration {
        Duration::ZERO
    }

    fn connect(&mut self, _: Duration, _: Duration, _: [u8; 4], _: u16) -> Poll<i32> {
        Poll::Ready(-1)
    }

    fn send(&mut self, _: Duration, _: Duration, _: i32, _: &[&[u8]]) -> Poll<i32> {
        Poll::Ready(-1)
    }

    fn receive(&mut self, _: Duration, _: Duration, _: i32, _: usize) -> Poll<(i32, Vec<Vec<u8>>)> {
        Poll::Ready((-1, Vec::new()))
    }

    fn close(&mut self, _: i32) -> i32 {
        0
    }

    fn sockets(&mut self) -> Vec<Socket> {
        Vec::new()
    }

    fn give(&mut self, _: Motion) -> Poll<()> {
        Poll::Ready(())
    }

    fn arrived(&mut self) -> Poll<()> {
        Poll::Ready(())
    }

    fn print(&mut self, _: usize, _: &str) {}
}
