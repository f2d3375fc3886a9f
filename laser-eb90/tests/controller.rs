//! The controller's end by itself.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

mod common;

use common::{CUT, MS, STOP, controller, cut, echo, frame};
use laser_eb90::{Class, ControllerConfig, ControllerEvent, Frame, Refusal, SessionError};

/// §2: "对于立即执行指令,先执行该指令,然后才返回应答": executed first, then answered, however long it takes.
#[test]
fn an_immediate_instruction_is_executed_before_it_is_answered() {
    let (mut controller, _reader) = controller(ControllerConfig::default(), 7);
    let mut out = [0; Frame::MAX_LEN];
    controller.handle_input(MS, &echo(STOP));
    let Some(ControllerEvent::Execute { class: Class::Immediate, instruction }) = controller.poll_event()
    else {
        panic!("nothing to execute")
    };
    assert_eq!((instruction.word, instruction.parameters.is_empty()), (STOP, true));
    assert_eq!(controller.poll_transmit(MS * 5000, &mut out), None);
    controller.answer(MS * 5001, |_| Ok(())).unwrap();
    assert_eq!(controller.poll_timeout(), Some(MS * 5008), "the end of a cycle");
    let n = controller.poll_transmit(MS * 5008, &mut out).unwrap();
    assert_eq!(out[..n], echo(STOP));
    assert_eq!(controller.answer(MS * 5009, |_| Ok(())), Err(SessionError::NotExecuting));
    assert_eq!(controller.refuse(MS * 5009, Refusal::BadParameters), Err(SessionError::NotExecuting));
}

/// Two answers to one frame would make the host send it again, and the robot execute it twice.
#[test]
fn a_stretch_of_bytes_is_answered_once() {
    let good = frame(&[1, 2], |_| ());
    let mut bad = good.clone();
    bad[9] ^= 0x40;
    let junk = [0x55; 40];
    let queued = |stream: &[&[u8]]| send_to_controller(&stream.concat());
    assert_eq!(queued(&[&good]), (Some(echo(CUT)), 2));
    assert_eq!(queued(&[&junk, &good]), (Some(echo(CUT)), 2));
    assert_eq!(queued(&[&bad, &good]), (Some(echo(CUT)), 2));
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
    assert_eq!(refused(frame(&[1], |p| drop(p.word(0x7777)))), echo(0xE003));
    assert_eq!(refused(frame(&[1], |p| drop(p.word(CUT)))), echo(0xE005));
    assert_eq!(refused(frame(&[], |p| drop(p.u8(&[1])))), echo(0xE002));
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
fn the_controller_does_not_speak_while_it_hears() {
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
