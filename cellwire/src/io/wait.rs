//! A wait for bytes that ends on time. A socket's own time limit is rounded up, to 4 ms and more on many systems.

use std::io;
use std::time::Duration;

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fd::AsFd;

/// Whether within `wait` there is something to read, an end or an error. A signal may end the wait early.
///
/// # Errors
/// The system's.
pub(super) fn readable(socket: impl AsFd, wait: Option<Duration>) -> io::Result<bool> {
    // What no system can express is as good as no limit.
    let wait = wait.and_then(|wait| Timespec::try_from(wait).ok());
    match poll(&mut [PollFd::new(&socket, PollFlags::IN)], wait.as_ref()) {
        Ok(ready) => Ok(ready > 0),
        Err(rustix::io::Errno::INTR) => Ok(false),
        Err(error) => Err(error.into()),
    }
}

#[cfg(test)]
mod tests {
    use std::io::Write as _;

    use robot_session::now;

    use super::*;
    use crate::io::tcp;

    #[test]
    fn bytes_and_an_end_are_there_to_be_read_and_silence_is_not() {
        let listener = tcp::listen("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap().to_string();
        let stream = tcp::connect(&address, tcp::CONNECT_TIMEOUT).unwrap();
        let mut peer = listener.accept().unwrap().0;
        let wait = Duration::from_micros(2300);
        let start = now();
        assert!(!readable(&stream, Some(wait)).unwrap());
        assert!(now() - start >= wait);
        assert!(!readable(&stream, Some(Duration::ZERO)).unwrap());
        peer.write_all(b"x").unwrap();
        assert!(readable(&stream, Some(Duration::MAX)).unwrap());
        let another = tcp::connect(&address, tcp::CONNECT_TIMEOUT).unwrap();
        drop(listener.accept().unwrap());
        assert!(readable(&another, None).unwrap());
    }
}
