//! The simulated third device: camera trigger and valves in a controller of their own (§4.9, §4.10).

use std::time::Duration;

use anyhow::Result;
use mmacell_proto::robot_session::Session as _;
use mmacell_proto::{BLOW, Device, DeviceConfig, DeviceEvent, ErrorCode, NoPose, Order, VACUUM};
use robot_session::{Step, Steps};

/// The result of some bytes.
#[derive(Debug, Default)]
pub(super) struct PeripheryOutput {
    pub(super) replies: Vec<u8>,
    /// Valves that were set: which, and whether open.
    pub(super) valves: Vec<(i32, bool)>,
    pub(super) closed: bool,
}

/// Executes commands for cameras and valves, and refuses all others.
#[derive(Debug)]
pub(super) struct Periphery {
    device: Device<NoPose>,
}

impl Periphery {
    pub(super) fn new(device: DeviceConfig) -> Result<Self> {
        Ok(Self { device: Device::new(device)? })
    }

    pub(super) fn connect(&mut self, now: Duration) {
        self.device.handle_connected(now);
    }

    pub(super) fn receive(&mut self, now: Duration, bytes: &[u8]) -> PeripheryOutput {
        let (mut answer, mut buffer) = (PeripheryOutput::default(), [0; 64]);
        self.device.handle_input(now, bytes);
        let (device, mut steps) = (&mut self.device, Steps::NEW);
        loop {
            match steps.next(device, now, &mut buffer) {
                Step::Event(DeviceEvent::Asked { order }) => decide(device, order, &mut answer.valves),
                Step::Event(DeviceEvent::Closed { .. }) => answer.closed = true,
                Step::Event(_) => {}
                Step::Write(bytes) => answer.replies.extend_from_slice(bytes),
                Step::Wait { .. } => return answer,
            }
        }
    }
}

fn decide(device: &mut Device<NoPose>, order: Order<NoPose>, valves: &mut Vec<(i32, bool)>) {
    // Neither can fail: the order is pending, and the number has a form.
    let _ = match order {
        Order::Grip { gripper: gripper @ (VACUUM | BLOW), open } => {
            valves.push((gripper, open));
            device.accept(order)
        }
        Order::Acquire { camera: 1 | 2 } | Order::Close => device.accept(order),
        _ => device.refuse(order, ErrorCode::Generic),
    };
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_knows_cameras_and_valves_and_refuses_the_rest() {
        let mut periphery = Periphery::new(DeviceConfig::DEFAULT).unwrap();
        periphery.connect(Duration::ZERO);
        let answer = periphery
            .receive(Duration::ZERO, b"ACQ+00002\r\nHND+00000OPEN\r\nHND+00007OPEN\r\nSTA\r\nRST\r\nCLO\r\n");
        assert_eq!(
            String::from_utf8(answer.replies).unwrap(),
            "OK\r\nOK\r\nER+00001\r\nER+00001\r\nER+00001\r\nOK\r\n"
        );
        assert_eq!(answer.valves, [(VACUUM, true)]);
        assert!(answer.closed);
    }
}
