//! The link to the graphics workstation that draws the robot (§5, §9.4).
//!
//! The workstation asks with an ENQ byte (05h), the host answers with one pose; drawing takes about 0.2 s. In the source's
//! first version the workstation asked in every display cycle. While ALTER was off, its requests piled up in the serial
//! driver; when ALTER began again, they were all answered at once, and the workstation's buffer overflowed. So the
//! workstation has a *credit of one*: it asks once at the start, then only after an answer ([`Viewer`]); and the host
//! answers requests that have piled up only once ([`PoseFeed`]). A request that was lost is made good by pausing the
//! display for two seconds.
//!
//! 19200 baud, 8N1, XON/XOFF. The source does not say what an answer looks like. [`PosePacket`] is our own: text, in which
//! XON (11h) and XOFF (13h) cannot occur.

mod feed;
mod packet;

pub use feed::PoseFeed;
pub use packet::{PosePacket, ViewerError};

use core::time::Duration;

use crate::queue::Queue;

/// The workstation's request.
pub const ENQ: u8 = 0x05;

/// The graphics workstation's end.
///
/// Order: [`handle_input`](Viewer::handle_input) with what was read, [`poll_event`](Viewer::poll_event) until `None`, then, in
/// every display cycle, [`draw`](Viewer::draw), and write what [`poll_transmit`](Viewer::poll_transmit) gives. A damaged line
/// is reported and skipped up to the next `$`; like a good one it frees the credit, since it was the answer. Of four events
/// that nobody fetches, the oldest is dropped.
#[derive(Debug, Clone)]
pub struct Viewer {
    pause: Duration,
    last_draw: Option<Duration>,
    credit: bool,
    wants: bool,
    line: [u8; PosePacket::MAX_LEN],
    len: usize,
    events: Queue<Result<PosePacket, ViewerError>, 4>,
}

impl Viewer {
    /// The pause of the display after which it asks again: the source says about two seconds in one place, about five in
    /// another.
    pub const PAUSE: Duration = Duration::from_secs(2);

    /// A workstation that has not drawn yet; [`Viewer::PAUSE`] is the source's pause.
    pub fn new(pause: Duration) -> Self {
        Self {
            pause,
            last_draw: None,
            credit: true,
            wants: false,
            line: [0; PosePacket::MAX_LEN],
            len: 0,
            events: Queue::new(),
        }
    }

    /// Takes bytes from the host.
    pub fn handle_input(&mut self, bytes: &[u8]) {
        for byte in bytes {
            match byte {
                b'$' if self.len > 0 => self.finish_line(),
                b'$' => {}
                _ if self.len == 0 => continue,
                _ => {}
            }
            if let Some(place) = self.line.get_mut(self.len) {
                *place = *byte;
                self.len += 1;
            }
            if *byte == b'\n' || self.len == PosePacket::MAX_LEN {
                self.finish_line();
            }
        }
    }

    /// A display cycle, at about 5 Hz. It asks for a pose if the credit allows it: at the first call, after an answer, and
    /// after a pause (the operator switches the display off and on again).
    pub fn draw(&mut self, now: Duration) {
        let paused = self.last_draw.is_none_or(|last| now.saturating_sub(last) >= self.pause);
        self.last_draw = Some(now);
        if paused || self.credit {
            self.credit = false;
            self.wants = true;
        }
    }

    /// Writes the request, one byte, if one is due.
    pub fn poll_transmit(&mut self, out: &mut [u8]) -> Option<usize> {
        let place = out.first_mut()?;
        core::mem::take(&mut self.wants).then(|| {
            *place = ENQ;
            1
        })
    }

    /// The next pose, or what was wrong with a line.
    pub fn poll_event(&mut self) -> Option<Result<PosePacket, ViewerError>> {
        self.events.pop()
    }

    fn finish_line(&mut self) {
        let line = self.line.get(..self.len).unwrap_or_default();
        let event = match PosePacket::decode(line) {
            Ok(Some((packet, _))) => Ok(packet),
            Ok(None) => Err(ViewerError::Format { offset: line.len() }),
            Err(error) => Err(error),
        };
        self.len = 0;
        self.credit = true;
        self.events.push(event);
    }
}

impl Default for Viewer {
    fn default() -> Self {
        Self::new(Self::PAUSE)
    }
}
