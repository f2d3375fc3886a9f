//! Cuts, frames of them, and sessions that are connected.
#![allow(dead_code, unreachable_pub, missing_debug_implementations, reason = "a helper of several tests")]

use core::time::Duration;

use laser_eb90::robot_session::{Encode as _, Session as _};
use laser_eb90::{
    Controller, ControllerConfig, EncodeError, Host, HostConfig, Instruction, Item, Payload, Profile,
};
use robot_work_queue::Reader;

pub const MS: Duration = Duration::from_millis(1);
/// The time at which a host that was connected at 0 has left the line alone long enough, with the default
/// configuration.
pub const READY: Duration = Duration::from_millis(1475);
/// An interpreted, an immediate and a query instruction of the default words.
pub const CUT: u16 = 0x0101;
pub const STOP: u16 = 0x0201;
pub const WHERE: u16 = 0x0301;

/// A cut that knows which one it is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cut {
    pub index: u32,
    pub x: f32,
}

impl TryFrom<Instruction<'_>> for Cut {
    type Error = ();

    fn try_from(instruction: Instruction<'_>) -> Result<Self, ()> {
        let mut items = instruction.parameters;
        match (instruction.word, items.next(), items.next(), items.next()) {
            (CUT, Some(Ok(Item::I16(index))), Some(Ok(Item::F32(x))), None) => {
                let [low, high] = index.array().ok_or(())?.map(i16::cast_unsigned);
                let [x] = x.array().ok_or(())?;
                Ok(Self { index: u32::from(high) << 16 | u32::from(low), x })
            }
            _ => Err(()),
        }
    }
}

pub fn cut(index: u32) -> Cut {
    Cut { index, x: index as f32 * 0.25 }
}

pub fn write_cut(payload: &mut Payload<'_>, cut: Cut) -> Result<(), EncodeError> {
    let index = [(cut.index & 0xFFFF) as i16, (cut.index >> 16) as i16];
    payload.i16(&index)?.f32(&[cut.x]).map(drop)
}

/// Returns a host that was connected at 0.
pub fn host(config: HostConfig) -> Host {
    let mut host = Host::new(config).unwrap();
    host.handle_connected(Duration::ZERO);
    host
}

/// Returns a controller that was connected at 0.
pub fn controller(
    config: ControllerConfig,
    capacity: usize,
) -> (Controller<'static, Cut>, Reader<'static, Cut>) {
    let (writer, reader) = robot_work_queue::boxed(capacity, 10_000).unwrap();
    let mut controller = Controller::new(config, writer).unwrap();
    controller.handle_connected(Duration::ZERO);
    (controller, reader)
}

pub fn encoded(payload: &Payload<'_>) -> Vec<u8> {
    let frame = payload.frame().unwrap();
    let mut out = vec![0; frame.encoded_len()];
    frame.encode(&mut out).unwrap();
    out
}

/// Returns a frame with one word.
pub fn echo(word: u16) -> Vec<u8> {
    let mut buffer = [0; 16];
    let mut payload = Payload::new(&mut buffer, &Profile::default());
    payload.word(word).unwrap();
    encoded(&payload)
}

/// Returns a frame of cuts, and `extra` after them.
pub fn frame(indices: &[u32], extra: impl FnOnce(&mut Payload<'_>)) -> Vec<u8> {
    let mut buffer = [0; 512];
    let mut payload = Payload::new(&mut buffer, &Profile::default());
    for index in indices {
        payload.word(CUT).unwrap();
        write_cut(&mut payload, cut(*index)).unwrap();
    }
    extra(&mut payload);
    encoded(&payload)
}
