//! The controller's end by itself.

use crate::common::{CUT, Cut, MS, STOP, WHERE, controller, cut, echo, frame};
use laser_eb90::robot_session::end::{End as _, Machine as _};
use laser_eb90::robot_session::{Session as _, Unexpected};
use laser_eb90::{Class, Controller, ControllerConfig, ControllerEvent, Frame, Refusal, SessionError};

/// §2: "对于立即执行指令,先执行该指令,然后才返回应答": executed first, then answered, however long it takes.
#[test]
fn an_immediate_instruction_is_executed_before_it_is_answered() {
    let (mut controller, _reader) = controller(ControllerConfig::default(), 7);
    let mut out = [0; Frame::MAX_LEN];
    controller.handle_input(MS, &echo(STOP));
    assert_eq!(
        controller.answer(MS, |_| Ok(())),
        Err(SessionError::NotExecuting),
        "its event has not been taken"
    );
    assert_eq!(
        controller.poll_event(),
        Some(ControllerEvent::Execute { class: Class::Immediate, word: STOP })
    );
    let instruction = controller.instruction().unwrap();
    assert_eq!((instruction.word, instruction.parameters.is_empty()), (STOP, true));
    assert_eq!(controller.poll_transmit(MS * 5000, &mut out), None);
    controller.answer(MS * 5001, |_| Ok(())).unwrap();
    assert_eq!(controller.poll_timeout(), Some(MS * 5008), "the end of a cycle");
    let n = controller.poll_transmit(MS * 5008, &mut out).unwrap();
    assert_eq!(out[..n], echo(STOP));
    assert_eq!(controller.instruction(), None);
    assert_eq!(controller.answer(MS * 5009, |_| Ok(())), Err(SessionError::NotExecuting));
    assert_eq!(controller.refuse(MS * 5009, Refusal::BadParameters), Err(SessionError::NotExecuting));
}

/// Two answers to one frame would make the host send it again, and the robot execute it twice. Nothing is executed after
/// corrupt bytes before the line was silent: it may be out of the middle of another frame.
#[test]
fn a_stretch_of_bytes_is_answered_once() {
    let good = frame(&[1, 2], |_| ());
    let mut bad = good.clone();
    bad[9] ^= 0x40;
    let junk = [0x55; 40];
    let queued = |stream: &[&[u8]]| send_to_controller(&stream.concat());
    assert_eq!(queued(&[&good]), (Some(echo(CUT)), 2));
    assert_eq!(queued(&[&junk, &good]), (Some(echo(0xE002)), 0));
    assert_eq!(queued(&[&bad, &good]), (Some(echo(0xE001)), 0));
    assert_eq!(queued(&[&junk[..Frame::MIN_LEN - 1], &good]), (Some(echo(CUT)), 2), "a few bytes of noise");
    assert_eq!(queued(&[&good, &bad]), (Some(echo(CUT)), 2));
    assert_eq!(queued(&[&good, &junk]), (Some(echo(CUT)), 2));
    assert_eq!(queued(&[&bad]), (Some(echo(0xE001)), 0));
    assert_eq!(queued(&[&bad, &bad]), (Some(echo(0xE001)), 0));
    assert_eq!(queued(&[&junk]), (Some(echo(0xE002)), 0));
    assert_eq!(queued(&[&good[..good.len() - 1]]), (Some(echo(0xE002)), 0));
    assert_eq!(queued(&[&junk[..Frame::MIN_LEN - 1]]), (None, 0), "too short for a frame");
    assert_eq!(queued(&[&[0xEB, 0x90, 0x82, 0x00]]), (None, 0), "a false head in noise");
}

#[test]
fn what_the_controller_refuses() {
    let refused = |frame: Vec<u8>| {
        let (answer, queued) = send_to_controller(&frame);
        assert_eq!(queued, 0, "nothing of a refused frame is queued");
        answer.unwrap()
    };
    assert_eq!(refused(echo(0x7777)), echo(0xE003));
    assert_eq!(refused(frame(&[1, 2, 3, 4, 5, 6, 7, 8], |_| ())), echo(0xE004));
    assert_eq!(refused(frame(&[1], |p| drop(p.word(STOP)))), echo(0xE004));
    assert_eq!(refused(frame(&[], |p| drop(p.word(STOP).and_then(|p| p.word(CUT))))), echo(0xE004));
    assert_eq!(refused(frame(&[], |p| drop(p.word(WHERE).and_then(|p| p.word(STOP))))), echo(0xE004));
    assert_eq!(refused(frame(&[1], |p| drop(p.word(0x7777)))), echo(0xE003));
    assert_eq!(refused(frame(&[1], |p| drop(p.word(CUT)))), echo(0xE005));
    assert_eq!(refused(frame(&[], |p| drop(p.u8(&[1])))), echo(0xE002));
    assert_eq!(refused(not_finite(CUT, 1)), echo(0xE005));
    assert_eq!(refused(not_finite(STOP, 0)), echo(0xE005));
}

/// Returns a frame with a NaN, which the encoder rejects.
fn not_finite(word: u16, shorts: usize) -> Vec<u8> {
    let mut bytes = vec![0xF1, 1];
    bytes.extend(word.to_le_bytes());
    bytes.extend([0xF1, 2, 9, 0, 0, 0].repeat(shorts));
    bytes.extend([0xF0, 1]);
    bytes.extend(f32::NAN.to_le_bytes());
    let sum = bytes.iter().fold(0u8, |sum, byte| sum.wrapping_add(*byte));
    let mut out = vec![0xEB, 0x90, 0x82, 0xF0];
    out.extend(bytes);
    out.extend([0x90, 0x82, sum]);
    out
}

/// The numbers of the queue are ours alone: the longest queue that there is works.
#[test]
fn a_queue_of_9999_takes_9999() {
    let (mut controller, mut reader) = controller(ControllerConfig::default(), 9999);
    let mut out = [0; Frame::MAX_LEN];
    let mut now = MS;
    let mut send = |indices: &[u32]| {
        now += MS * 100;
        controller.handle_input(now, &frame(indices, |_| ()));
        let length = controller.poll_transmit(now + MS * 16, &mut out).unwrap();
        out[..length].to_vec()
    };
    let all: Vec<u32> = (0..9999).collect();
    for batch in all.chunks(7) {
        assert_eq!(send(batch), echo(CUT));
    }
    assert_eq!(reader.len(), 9999);
    assert_eq!(send(&[9999]), echo(0xE006));
    for index in 0..5000 {
        assert_eq!(reader.take().map(|job| job.complete()), Some(cut(index)));
    }
    assert_eq!(send(&[9999, 10_000]), echo(CUT));
    for index in 5000..10_001 {
        assert_eq!(reader.take().map(|job| job.complete()), Some(cut(index)));
    }
    assert!(reader.is_empty());
}

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

/// A single byte EBh of the rest may begin a head, but does not.
#[test]
fn a_byte_that_may_begin_a_head_does_not_end_the_rest() {
    let frame = frame(&[470, 471], |_| ());
    let place = 3 + frame[3..].iter().position(|byte| *byte == 0xEB).unwrap();
    let (mut controller, reader) = controller(ControllerConfig::default(), 21);
    let mut answers = 0;
    let pieces = [&frame[..place], &frame[place..=place], &frame[place + 1..]];
    for (piece, at) in pieces.into_iter().zip([MS, MS * 100, MS * 200]) {
        controller.handle_input(at, piece);
        controller.handle_timeout(at + MS * 50);
        answers += u32::from(controller.poll_transmit(at + MS * 70, &mut [0; Frame::MAX_LEN]).is_some());
    }
    assert_eq!(
        (answers, reader.len()),
        (1, 0),
        "a host that repeats it for each answer has it executed twice"
    );
}

/// A byte is lost, and parameters read as a frame, which is unsolicited.
#[test]
fn nothing_is_executed_out_of_the_middle_of_a_corrupt_frame() {
    let inner = echo(CUT);
    let parameters = &inner[..8];
    for (is_lost, has_no_head) in [(false, false), (true, false), (true, true)] {
        let mut outer = frame(&[], |p| drop(p.word(STOP).and_then(|p| p.u8(parameters))));
        if is_lost {
            let doubled = outer.windows(2).position(|pair| pair == [0x90, 0x90]).unwrap();
            outer.remove(doubled);
            *outer.last_mut().unwrap() = *inner.last().unwrap();
        }
        if has_no_head {
            outer[0] = 0xEA;
        }
        let (mut controller, reader) = controller(ControllerConfig::default(), 7);
        controller.handle_input(MS, &outer);
        controller.handle_timeout(MS * 51);
        let executes = core::iter::from_fn(|| controller.poll_event())
            .any(|event| matches!(event, ControllerEvent::Execute { .. }));
        assert_eq!((executes, reader.len()), (!is_lost, 0), "{outer:02X?}");
    }
}

/// An execution continues when the connection is lost; its answer is dropped.
#[test]
fn an_execution_outlasts_its_connection_and_its_answer_does_not() {
    let (mut controller, reader) = controller(ControllerConfig::default(), 21);
    let mut out = [0; Frame::MAX_LEN];
    controller.handle_input(MS, &echo(STOP));
    controller.handle_disconnected(MS * 2);
    assert!(matches!(controller.poll_event(), Some(ControllerEvent::Execute { word: STOP, .. })));
    controller.handle_input(MS * 3, &echo(STOP));
    let unexpected = Unexpected { state: "DisconnectedExecuting", input: "Bytes" };
    assert_eq!(controller.poll_event(), Some(ControllerEvent::Unexpected(unexpected)));
    controller.handle_connected(MS * 10);
    controller.handle_input(MS * 20, &frame(&[1], |_| ()));
    assert_eq!(controller.poll_transmit(MS * 1000, &mut out), None, "it is busy");
    controller.answer(MS * 1000, |_| Ok(())).unwrap();
    let length = controller.poll_transmit(MS * 1008, &mut out).unwrap();
    assert_eq!((&out[..length], reader.len()), (&echo(CUT)[..], 1));
    controller.handle_input(MS * 2000, &frame(&[2], |_| ()));
    controller.handle_disconnected(MS * 2001);
    controller.handle_connected(MS * 2002);
    assert_eq!(controller.poll_transmit(MS * 3000, &mut out), None, "queued, and its answer is gone");
}

/// Bytes that are passed in without a connection cause an event, and no instruction.
#[test]
fn a_frame_without_a_connection_is_not_queued() {
    let (mut controller, mut reader) = controller(ControllerConfig::default(), 21);
    controller.handle_disconnected(MS);
    controller.handle_input(MS, &frame(&[1, 2], |_| ()));
    let unexpected = Unexpected { state: "Disconnected", input: "Bytes" };
    assert_eq!(controller.poll_event(), Some(ControllerEvent::Unexpected(unexpected)));
    assert_eq!((controller.poll_event(), reader.take().is_none()), (None, true));
    controller.handle_connected(MS);
    assert_eq!((controller.poll_timeout(), controller.poll_event()), (None, None));
}

/// The host has stopped waiting for the first answer: it would take it for the second's.
#[test]
fn a_frame_withdraws_the_answer_that_it_overtakes() {
    let (mut controller, mut reader) = controller(ControllerConfig::default(), 21);
    let mut out = [0; Frame::MAX_LEN];
    controller.handle_input(MS, &echo(STOP));
    assert!(controller.poll_event().is_some());
    controller.handle_input(MS * 100, &frame(&[5], |_| ()));
    assert!(reader.is_empty(), "the robot is busy");
    controller.answer(MS * 200, |_| Ok(())).unwrap();
    let n = controller.poll_transmit(MS * 208, &mut out).unwrap();
    assert_eq!(out[..n], echo(CUT));
    assert_eq!(controller.poll_transmit(MS * 300, &mut out), None);
    assert_eq!(reader.take().map(|job| *job), Some(cut(5)));
}

#[test]
fn the_controller_does_not_send_while_it_receives() {
    let (mut controller, _reader) = controller(ControllerConfig::default(), 21);
    let mut out = [0; Frame::MAX_LEN];
    controller.handle_input(MS, &frame(&[1], |_| ()));
    controller.handle_input(MS * 10, &frame(&[2], |_| ())[..9]);
    assert_eq!(controller.poll_transmit(MS * 16, &mut out), None);
    assert_eq!(controller.poll_timeout(), Some(MS * 60));
    let n = controller.poll_transmit(MS * 60, &mut out).unwrap();
    assert_eq!(out[..n], echo(CUT), "the rest never came");
    assert_eq!(controller.poll_transmit(MS * 200, &mut out), None);
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

fn send_to_controller(stream: &[u8]) -> (Option<Vec<u8>>, usize) {
    let (mut controller, reader) = controller(ControllerConfig::default(), 21);
    let mut out = [0; Frame::MAX_LEN];
    controller.handle_input(MS, stream);
    let mut answers = Vec::new();
    for ms in 2..300 {
        if let Some(n) = controller.poll_transmit(MS * ms, &mut out) {
            answers.push(out[..n].to_vec());
        }
    }
    assert!(answers.len() <= 1, "two answers: {answers:02X?}");
    (answers.pop(), reader.len())
}
