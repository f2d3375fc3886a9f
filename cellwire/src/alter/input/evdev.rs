//! A device of the Linux input system: a game pad, a joystick, a 3D mouse. Its state is read in a fixed period; so long as it can
//! be read, the system answers for it.
//!
//! The system does not report that a wireless device is out of its receiver's reach: use `--hold-to-run` with such a device.

#[cfg(target_os = "linux")]
pub(super) use linux::Evdev;

#[cfg(not(target_os = "linux"))]
pub(super) use elsewhere::Evdev;

/// An axis as the device describes it.
#[cfg(any(target_os = "linux", test))]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Range {
    least: i32,
    most: i32,
    /// The value at rest: in the middle, or at the least, as a trigger is.
    rest: i32,
}

#[cfg(any(target_os = "linux", test))]
impl Range {
    /// Returns the range of an axis that was at `value` when the device was opened.
    fn of(least: i32, most: i32, value: i32) -> Self {
        let width = i64::from(most) - i64::from(least);
        let is_trigger = i64::from(value) - i64::from(least) <= width / 10;
        let middle = i32::try_from(i64::from(least) + width / 2).unwrap_or(least);
        Self { least, most, rest: if is_trigger { least } else { middle } }
    }

    /// Returns a value in thousandths of the full deflection.
    fn thousandths(self, value: i32) -> i16 {
        let way = i64::from(value.clamp(self.least, self.most.max(self.least))) - i64::from(self.rest);
        let full = if way < 0 {
            i64::from(self.rest) - i64::from(self.least)
        } else {
            i64::from(self.most) - i64::from(self.rest)
        };
        (way * i64::from(super::FULL))
            .checked_div(full)
            .and_then(|value| i16::try_from(value).ok())
            .unwrap_or(0)
    }
}

#[cfg(target_os = "linux")]
mod linux {
    use std::io;
    use std::path::{Path, PathBuf};
    use std::thread;
    use std::time::Duration;

    use anyhow::{Context as _, Result};
    use evdev::{AbsoluteAxisCode, Device};

    use super::Range;
    use crate::alter::context::Context;
    use crate::alter::input::device::{Input, InputEvent};
    use crate::alter::messages::Notification;
    use crate::alter::sample::Sample;

    const AXES: [AbsoluteAxisCode; 6] = [
        AbsoluteAxisCode::ABS_X,
        AbsoluteAxisCode::ABS_Y,
        AbsoluteAxisCode::ABS_Z,
        AbsoluteAxisCode::ABS_RX,
        AbsoluteAxisCode::ABS_RY,
        AbsoluteAxisCode::ABS_RZ,
    ];
    const PERIOD: Duration = Duration::from_millis(20);
    const MAX_AGE: Duration = Duration::from_millis(100);
    const REOPEN: Duration = Duration::from_millis(200);
    /// The first of the buttons: those of pads, joysticks and mice have codes from here on.
    const FIRST_BUTTON: u16 = 0x100;

    pub(in super::super) struct Evdev {
        path: PathBuf,
        context: Context,
        open: Option<OpenDevice>,
        next: Duration,
    }

    struct OpenDevice {
        device: Device,
        ranges: [Option<Range>; 6],
        /// The codes of its buttons, in their order.
        buttons: Vec<u16>,
    }

    impl OpenDevice {
        fn new(path: &Path) -> io::Result<Self> {
            let device = Device::open(path)?;
            let state = device.get_abs_state()?;
            let ranges = AXES.map(|axis| {
                let known = device.supported_absolute_axes().is_some_and(|axes| axes.contains(axis));
                let info = state.get(usize::from(axis.0)).filter(|_| known)?;
                Some(Range::of(info.minimum, info.maximum, info.value))
            });
            let keys = device.supported_keys().into_iter().flat_map(|keys| keys.iter().map(|key| key.0));
            let buttons = keys.filter(|code| *code >= FIRST_BUTTON).take(32).collect();
            Ok(Self { device, ranges, buttons })
        }

        fn read(&self) -> io::Result<([i16; 6], u32)> {
            let state = self.device.get_abs_state()?;
            let mut axes = [0; 6];
            for ((value, axis), range) in axes.iter_mut().zip(AXES).zip(self.ranges) {
                if let (Some(range), Some(info)) = (range, state.get(usize::from(axis.0))) {
                    *value = range.thousandths(info.value);
                }
            }
            let down = self.device.get_key_state()?;
            let down = |code: &u16| u32::from(down.contains(evdev::KeyCode(*code)));
            let buttons = (0u32..).zip(&self.buttons).map(|(bit, code)| down(code) << bit).sum();
            Ok((axes, buttons))
        }
    }

    impl Evdev {
        pub(in super::super) fn open(path: &Path, context: Context) -> Result<Self> {
            let open = OpenDevice::new(path).with_context(|| {
                format!(
                    "cannot open the input device {} (see /dev/input/by-id; needs the group `input`)",
                    path.display()
                )
            })?;
            let name = open.device.name().unwrap_or("nameless").to_owned();
            context.notify(Notification::PortOpen("input", name));
            Ok(Self { path: path.into(), context, open: Some(open), next: Duration::ZERO })
        }
    }

    impl Input for Evdev {
        fn poll(&mut self, wait: Duration, events: &mut Vec<InputEvent>) {
            let now = self.context.clock.now();
            thread::sleep(wait.min(self.next.saturating_sub(now)));
            let now = self.context.clock.now();
            if now < self.next {
                return;
            }
            let Some(open) = &self.open else {
                self.next = now + REOPEN;
                if let Ok(open) = OpenDevice::new(&self.path) {
                    self.open = Some(open);
                    self.context.notify(Notification::PortOpen("input", self.path.display().to_string()));
                }
                return;
            };
            self.next = now + PERIOD;
            match open.read() {
                Ok((axes, buttons)) => {
                    events.push(InputEvent::Sample(Sample { axes, buttons, fresh_until: now + MAX_AGE }));
                }
                Err(error) => {
                    self.open = None;
                    self.context.notify(Notification::PortLost("input", error.to_string()));
                    events.push(InputEvent::Lost);
                }
            }
        }
    }
}

#[cfg(not(target_os = "linux"))]
mod elsewhere {
    use std::path::Path;
    use std::time::Duration;

    use crate::alter::context::Context;
    use crate::alter::input::device::{Input, InputEvent};

    pub(in super::super) enum Evdev {}

    impl Evdev {
        pub(in super::super) fn open(_: &Path, _: Context) -> anyhow::Result<Self> {
            anyhow::bail!("--evdev needs Linux")
        }
    }

    impl Input for Evdev {
        fn poll(&mut self, _: Duration, _: &mut Vec<InputEvent>) {
            match *self {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sticks_rest_in_the_middle_and_triggers_at_their_least() {
        let stick = Range::of(-32768, 32767, 120);
        assert_eq!([-32768, -16384, 0, 32767].map(|value| stick.thousandths(value)), [-1000, -499, 0, 1000]);
        let pad = Range::of(0, 255, 128);
        assert_eq!([0, 127, 128, 255].map(|value| pad.thousandths(value)), [-1000, 0, 7, 1000]);
        let trigger = Range::of(0, 1023, 3);
        assert_eq!([0, 512, 1023, 5000].map(|value| trigger.thousandths(value)), [0, 500, 1000, 1000]);
        let broken = Range::of(5, 5, 5);
        assert_eq!(broken.thousandths(9), 0);
        assert_eq!(Range::of(i32::MIN, i32::MAX, 0).thousandths(i32::MIN), -1000);
    }
}
