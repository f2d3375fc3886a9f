//! Incidents of a controller that its host has not caused.

use core::time::Duration;

use val2_alter::{ErrorCode, Frame, Framing, SegmentStatus};

/// An incident. It waits until ALTER runs; an incident on the line, until ALTER runs or starts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Incident {
    /// The program runs a subroutine that takes this long.
    Interrupt(Duration),
    /// The next reply reaches the controller so that it has this error.
    Misread(ErrorCode),
    /// The next message leaves the controller with a wrong checksum.
    Corrupt,
    /// The messages report this status of the motion segment from now on.
    Status(SegmentStatus),
    /// The program ends ALTER with an end message.
    Finish,
    /// The controller is switched off and on, and its program started: no message reports the end of ALTER.
    Restart,
}

/// Returns the bytes to deliver in place of a reply, so that a controller reports this error.
pub(super) fn misread(error: ErrorCode, framing: Framing) -> Vec<u8> {
    // An exception byte and a select byte are a whole reply; with X selected a word is missing.
    let data: &[u8] = match error {
        ErrorCode::Format => &[0, 1],
        ErrorCode::Overflow => &[0; 15],
        _ => &[0, 0],
    };
    let mut bytes = [0; Frame::MAX_LEN];
    let encoded = Frame::new(data).and_then(|frame| frame.encode(framing, &mut bytes));
    let mut reply = bytes.get(..encoded.unwrap_or_default()).unwrap_or_default().to_vec();
    match error {
        ErrorCode::Checksum => spoil(&mut reply),
        ErrorCode::Incomplete => reply.truncate(reply.len() / 2),
        ErrorCode::Mark => {
            // DLE ETX, and the sum of zeros.
            if let [.., end, _sum] = reply.as_mut_slice() {
                *end = 0x04;
            }
        }
        ErrorCode::Timeout => reply.clear(),
        _ => {}
    }
    reply
}

/// Makes the checksum of a frame wrong.
pub(super) fn spoil(frame: &mut [u8]) {
    if let Some(sum) = frame.last_mut() {
        *sum ^= 0x55;
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, clippy::indexing_slicing)]
mod tests {
    use robot_session::Session as _;
    use val2_alter::{Controller, ControllerConfig, ControllerEvent, LeadingDle};

    use super::*;

    const MS: Duration = Duration::from_millis(1);
    const ERRORS: [ErrorCode; 6] = [
        ErrorCode::Checksum,
        ErrorCode::Format,
        ErrorCode::Overflow,
        ErrorCode::Incomplete,
        ErrorCode::Mark,
        ErrorCode::Timeout,
    ];

    #[test]
    fn no_checksum_stays_right() {
        for sum in 0..=u8::MAX {
            let mut frame = [0x10, sum];
            spoil(&mut frame);
            assert!(frame[0] == 0x10 && frame[1] != sum, "{sum:#04x}");
        }
    }

    #[test]
    fn a_controller_has_each_error_with_what_it_is_given() {
        let other = Framing {
            leading_dle: LeadingDle::One,
            negated_sum: true,
            stuffed_checksum: true,
            ignore_spare_select: true,
        };
        for framing in [Framing::DEFAULT, other] {
            for error in ERRORS {
                let config = ControllerConfig { framing, gap: None, ..ControllerConfig::default() };
                let mut controller = Controller::new(config).unwrap();
                let mut out = [0; Frame::MAX_LEN];
                controller.handle_connected(Duration::ZERO);
                controller.start(Duration::ZERO).unwrap();
                controller.poll_transmit(Duration::ZERO, &mut out).unwrap();
                let mut accept = [0; Frame::MAX_LEN];
                let length = Frame::new(&[0]).unwrap().encode(framing, &mut accept).unwrap();
                controller.handle_input(5 * MS, &accept[..length]);
                controller.poll_transmit(28 * MS, &mut out).unwrap();
                controller.handle_input(40 * MS, &misread(error, framing));
                controller.handle_timeout(56 * MS);
                let mut events = core::iter::from_fn(|| controller.poll_event());
                assert_eq!(events.next(), Some(ControllerEvent::Started));
                assert_eq!(events.next(), Some(ControllerEvent::BadReply(error)), "{framing:?}");
            }
        }
    }
}
