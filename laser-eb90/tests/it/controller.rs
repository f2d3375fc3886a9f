//! The controller's counters and its names of states. Its rules are the stories of `reference/sessions/laser-eb90.json`.

use crate::common::{CUT, Cut, MS, STOP, controller, cut, echo, frame};
use laser_eb90::robot_session::Session as _;
use laser_eb90::robot_session::end::{End as _, Machine as _};
use laser_eb90::{Controller, ControllerConfig, ControllerEvent, Frame};

/// Bytes that come after a pause longer than the silence have no head: they are the rest of the answered frame, until
/// a frame begins.
#[test]
fn the_rest_of_a_frame_that_was_answered_is_not_answered() {
    let (mut controller, mut reader) = controller(ControllerConfig::default(), 21);
    let mut out = [0; Frame::MAX_LEN];
    let mut answer = |controller: &mut Controller<'static, Cut>, ms: u32| {
        controller.handle_timeout(MS * ms);
        let length = controller.poll_transmit(MS * (ms + 16), &mut out)?;
        Some(out[..length].to_vec())
    };
    let frame = frame(&[1, 2, 3], |_| ());
    let (head, rest) = frame.split_at(20);
    controller.handle_input(MS, head);
    assert_eq!(controller.poll_timeout(), Some(MS * 51));
    assert_eq!(answer(&mut controller, 51), Some(echo(0xE002)));
    assert_eq!(controller.machine().name(), "ListeningRest");
    controller.handle_input(MS * 70, &rest[..10]);
    assert_eq!(answer(&mut controller, 150), None);
    controller.handle_input(MS * 200, &rest[10..]);
    assert_eq!(answer(&mut controller, 300), None);
    assert!(reader.is_empty());
    // The same again, paused again: a frame that begins is answered.
    controller.handle_input(MS * 400, head);
    assert_eq!(answer(&mut controller, 500), Some(echo(0xE002)));
    // The rest and the whole frame at once: the frame may be out of the middle of the rest.
    controller.handle_input(MS * 550, &[rest, &frame].concat());
    assert_eq!(answer(&mut controller, 650), Some(echo(0xE002)));
    assert!(reader.is_empty());
    controller.handle_input(MS * 700, &frame);
    assert_eq!(answer(&mut controller, 704), Some(echo(CUT)));
    assert_eq!(reader.take().map(|job| job.complete()), Some(cut(1)));
    // A frame has been accepted: bytes without a head are a frame whose head is corrupt.
    controller.handle_input(MS * 900, rest);
    assert_eq!(answer(&mut controller, 1000), Some(echo(0xE002)));
}

#[test]
fn a_controller_counts_what_it_has_done() {
    let (mut controller, _reader) = controller(ControllerConfig::default(), 21);
    let mut corrupt = frame(&[3], |_| ());
    corrupt[9] ^= 0x40;
    let frames = [frame(&[1, 2], |_| ()), echo(STOP), echo(0x7777), corrupt];
    for (bytes, at) in frames.into_iter().zip([MS, MS * 100, MS * 200, MS * 300]) {
        controller.handle_input(at, &bytes);
        let executes = core::iter::from_fn(|| controller.poll_event())
            .any(|event| matches!(event, ControllerEvent::Execute { .. }));
        if executes {
            controller.answer(at, |_| Ok(())).unwrap();
        }
        controller.handle_timeout(at + MS * 50);
        assert!(controller.poll_transmit(at + MS * 70, &mut [0; Frame::MAX_LEN]).is_some());
    }
    let count = controller.statistics();
    assert_eq!((count.queued, count.executed, count.refused, count.corrupt, count.answers), (2, 1, 2, 1, 4));
}
