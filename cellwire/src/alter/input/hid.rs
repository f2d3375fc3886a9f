//! A 3Dconnexion device by its HID reports, without a daemon and without the maker's driver, on every platform.
//!
//! Report 1 has X, Y, Z and, of some devices, RX, RY, RZ after them; report 2 has the rotation of the others; report 3 the
//! buttons, a bit each. The values are little-endian words of 16 bits, at most ±350. Such a device sends while it is pushed, each
//! 8 or 16 ms, and then a few times that it rests. Its X points to the right, Y to the user, Z down; here Y points away and Z up.

use std::time::Duration;

use super::device::{Input, InputEvent};
use super::mouse::{MAX_AGE, PERIOD, looks_again, thousandths};
use crate::alter::context::Context;
use crate::alter::messages::Notification;
use crate::alter::sample::Sample;

#[cfg(feature = "hid")]
pub(super) type Hid = Mouse<hidapi::HidDevice>;

#[cfg(not(feature = "hid"))]
pub(super) type Hid = Mouse<elsewhere::None>;

/// A source of reports.
pub(super) trait Reports: Sized + Send {
    /// Opens the device whose name or path contains `wanted`; also returns its name.
    ///
    /// # Errors
    /// If there is none or more than one, or it may not be opened.
    fn open(wanted: &str) -> anyhow::Result<(Self, String)>;

    /// Reads a report; returns its length, 0 if none came in time.
    ///
    /// # Errors
    /// If the device is gone.
    fn read(&mut self, wait: Duration, report: &mut [u8]) -> anyhow::Result<usize>;
}

/// A 3Dconnexion device.
pub(super) struct Mouse<R> {
    wanted: String,
    context: Context,
    device: Option<R>,
    state: State,
    next: Duration,
}

/// The latest values of the reports.
#[derive(Debug, Default)]
struct State {
    axes: [i16; 6],
    buttons: u32,
    /// When X, Y, Z and when RX, RY, RZ were reported.
    times: [Duration; 2],
    /// The rotation has a report of its own. Windows pads every report to the length of the longest: the bytes after Z are then
    /// not a rotation.
    is_apart: bool,
}

impl State {
    /// Reads a report; returns whether it was about axes or buttons.
    fn take(&mut self, report: &[u8], now: Duration) -> bool {
        let Some((id, data)) = report.split_first() else { return false };
        match (*id, data.first_chunk::<6>()) {
            (1, Some(translation)) => {
                self.half(0, translation, now);
                if let (false, Some(rotation)) = (self.is_apart, data.get(6..).and_then(<[u8]>::first_chunk))
                {
                    self.half(1, rotation, now);
                }
            }
            (2, Some(rotation)) => {
                self.is_apart = true;
                self.half(1, rotation, now);
            }
            (3, _) => {
                let bytes = (0u32..).step_by(8).zip(data.iter().take(4));
                self.buttons = bytes.map(|(shift, byte)| u32::from(*byte) << shift).sum();
            }
            _ => return false,
        }
        true
    }

    fn half(&mut self, half: usize, bytes: &[u8; 6], now: Duration) {
        let [x, y, z] =
            [0, 1, 2].map(|word| bytes.as_chunks().0.get(word).map_or(0, |bytes| i16::from_le_bytes(*bytes)));
        let values = [i32::from(x), -i32::from(y), -i32::from(z)].map(thousandths);
        if let (Some(axes), Some(time)) =
            (self.axes.as_chunks_mut::<3>().0.get_mut(half), self.times.get_mut(half))
        {
            (*axes, *time) = (values, now);
        }
    }

    /// Returns the latest values. They are as old as the older pushed half: one report may continue alone when the other is lost.
    fn sample(&self, now: Duration) -> Sample {
        let halves = self.axes.as_chunks::<3>().0.iter().zip(self.times);
        let measured = halves.filter(|(axes, _)| **axes != [0; 3]).map(|(_, time)| time).min().unwrap_or(now);
        Sample { axes: self.axes, buttons: self.buttons, fresh_until: measured + MAX_AGE }
    }
}

impl<R: Reports> Mouse<R> {
    /// # Errors
    /// If there is no such device.
    pub(super) fn open(wanted: &str, context: Context) -> anyhow::Result<Self> {
        let (device, name) = R::open(wanted)?;
        context.notify(Notification::PortOpen("3D mouse", name));
        let (state, next) = (State::default(), Duration::ZERO);
        Ok(Self { wanted: wanted.into(), context, device: Some(device), state, next })
    }

    fn reopen(&mut self, wait: Duration) {
        if !looks_again(&self.context, &mut self.next, wait) {
            return;
        }
        if let Ok((device, name)) = R::open(&self.wanted) {
            self.device = Some(device);
            self.context.notify(Notification::PortOpen("3D mouse", name));
        }
    }
}

impl<R: Reports> Input for Mouse<R> {
    fn poll(&mut self, wait: Duration, events: &mut Vec<InputEvent>) {
        let Some(device) = &mut self.device else { return self.reopen(wait) };
        let mut report = [0; 64];
        let read = device.read(wait, &mut report);
        let now = self.context.clock.now();
        match read {
            Ok(length) => {
                let is_new = self.state.take(report.get(..length).unwrap_or_default(), now);
                if is_new || self.state.axes == [0; 6] && now >= self.next {
                    self.next = now + PERIOD;
                    events.push(InputEvent::Sample(self.state.sample(now)));
                }
            }
            Err(error) => {
                (self.device, self.state) = (None, State::default());
                self.context.notify(Notification::PortLost("3D mouse", format!("{error:#}")));
                events.push(InputEvent::Lost);
            }
        }
    }
}

#[cfg(feature = "hid")]
mod device {
    use std::time::Duration;

    use anyhow::{Context as _, Result, bail};
    use hidapi::{DeviceInfo, HidApi, HidDevice};

    use super::Reports;

    /// Logitech, whose name the older ones have, and 3Dconnexion.
    const MAKERS: [u16; 2] = [0x046d, 0x256f];
    /// A multi-axis controller, among the generic desktop controls.
    const USAGE: (u16, u16) = (1, 8);

    impl Reports for HidDevice {
        fn open(wanted: &str) -> Result<(Self, String)> {
            let api = HidApi::new().context("cannot list the HID devices")?;
            let name = |device: &DeviceInfo| {
                format!(
                    "{} at {}",
                    device.product_string().unwrap_or("nameless").trim(),
                    device.path().to_string_lossy()
                )
            };
            let known = |device: &&DeviceInfo| {
                MAKERS.contains(&device.vendor_id()) && (device.usage_page(), device.usage()) == USAGE
            };
            let all: Vec<_> = api.device_list().filter(known).map(|device| (device, name(device))).collect();
            let names = || all.iter().map(|(_, name)| name.as_str()).collect::<Vec<_>>().join(", ");
            let mut fitting = all.iter().filter(|(_, name)| name.contains(wanted));
            match (fitting.next(), fitting.next()) {
                (Some((device, name)), None) => {
                    let open = device.open_device(&api);
                    let open = open.with_context(|| {
                        format!("cannot open {name} (check this user's read and write permission)")
                    })?;
                    Ok((open, name.clone()))
                }
                (None, _) if all.is_empty() => bail!("no 3Dconnexion device is plugged in"),
                (None, _) => bail!("no 3Dconnexion device with `{wanted}` in its name; found: {}", names()),
                (Some(_), Some(_)) => {
                    bail!("more than one 3Dconnexion device; choose one: {}", names())
                }
            }
        }

        fn read(&mut self, wait: Duration, report: &mut [u8]) -> Result<usize> {
            let wait = i32::try_from(wait.as_millis()).unwrap_or(i32::MAX);
            Ok(self.read_timeout(report, wait)?)
        }
    }
}

#[cfg(not(feature = "hid"))]
mod elsewhere {
    use std::time::Duration;

    /// There are no reports.
    pub(in super::super) enum None {}

    impl super::Reports for None {
        fn open(_: &str) -> anyhow::Result<(Self, String)> {
            anyhow::bail!("--hid is not available: this program was built without the feature `hid`")
        }

        fn read(&mut self, _: Duration, _: &mut [u8]) -> anyhow::Result<usize> {
            match *self {}
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;
    use std::sync::atomic::AtomicBool;
    use std::sync::mpsc::{Receiver, channel, sync_channel};
    use std::sync::{Mutex, MutexGuard};

    use super::*;
    use cellwire_io::clock::Clock;
    use cellwire_io::trace::Trace;

    const MS: Duration = Duration::from_millis(1);

    fn bytes(text: &str) -> Vec<u8> {
        text.split_whitespace().map(|byte| u8::from_str_radix(byte, 16).unwrap()).collect()
    }

    /// Axes and buttons after each report.
    fn values(reports: &[&str]) -> Vec<([i16; 6], u32)> {
        let mut state = State::default();
        let after = |report: &&str| state.take(&bytes(report), MS).then_some((state.axes, state.buttons));
        reports.iter().filter_map(after).collect()
    }

    /// Reports as other programs have recorded them: pressed down, let go, turned to the right, tilted, both keys.
    #[test]
    fn a_space_navigator_has_a_report_for_its_rotation() {
        let reports = [
            "01 00 00 00 00 34 00",
            "02 00 00 00 00 00 00",
            "01 00 00 00 00 00 00",
            "02 00 00 00 00 2d 00",
            "02 00 00 e2 ff 00 00",
            "03 01 00",
            "03 03 00",
            "03 00 00",
        ];
        let rest = [0; 6];
        let tilted = [0, 0, 0, 0, 85, 0];
        assert_eq!(
            values(&reports),
            [
                ([0, 0, -148, 0, 0, 0], 0),
                ([0, 0, -148, 0, 0, 0], 0),
                (rest, 0),
                ([0, 0, 0, 0, 0, -128], 0),
                (tilted, 0),
                (tilted, 1),
                (tilted, 3),
                (tilted, 0),
            ]
        );
    }

    #[test]
    fn a_wireless_space_mouse_has_all_in_one_report_and_tells_of_its_battery() {
        let reports = [
            "01 00 00 00 00 19 00 00 00 00 00 00 00",
            "17 64 01",
            "01 00 00 00 00 00 00 00 00 00 00 30 00",
            "01 5e 01 a2 fe ff 7f 00 80 00 00 01 00",
            "03 11 00 40 80 ff",
        ];
        assert_eq!(
            values(&reports),
            [
                ([0, 0, -71, 0, 0, 0], 0),
                ([0, 0, 0, 0, 0, -137], 0),
                ([1000, 1000, -1000, -1000, 0, -2], 0),
                ([1000, 1000, -1000, -1000, 0, -2], 0x8040_0011),
            ]
        );
    }

    /// As Windows gives them where the longest report has 12 bytes.
    #[test]
    fn what_follows_a_short_report_is_no_rotation() {
        let reports = [
            "02 46 00 00 00 00 00 00 00 00 00 00 00",
            "01 46 00 00 00 00 00 00 00 00 00 00 00",
            "03 02 00 00 00 00 00 00",
        ];
        assert_eq!(
            values(&reports),
            [([0, 0, 0, 200, 0, 0], 0), ([200, 0, 0, 200, 0, 0], 0), ([200, 0, 0, 200, 0, 0], 2)]
        );
    }

    #[test]
    fn what_is_no_whole_report_changes_nothing() {
        assert_eq!(values(&["", "01", "01 46 00 00 00 00", "02 01 02", "04 01"]), []);
        assert_eq!(values(&["01 46 00 00 00 00 00 46 00 00"]), [([200, 0, 0, 0, 0, 0], 0)]);
    }

    #[test]
    fn a_push_is_as_old_as_the_older_of_its_two_reports() {
        let mut state = State::default();
        state.take(&bytes("01 46 00 00 00 00 00"), 8 * MS);
        assert_eq!(state.sample(8 * MS).fresh_until, 108 * MS);
        state.take(&bytes("02 46 00 00 00 00 00"), 16 * MS);
        for time in [24, 40, 200] {
            state.take(&bytes("01 46 00 00 00 00 00"), time * MS);
        }
        assert_eq!(state.sample(200 * MS).fresh_until, 116 * MS);
        state.take(&bytes("02 00 00 00 00 00 00"), 201 * MS);
        assert_eq!(state.sample(210 * MS).fresh_until, 300 * MS);
        // Rest is as good as new.
        state.take(&bytes("01 00 00 00 00 00 00"), 220 * MS);
        assert_eq!(state.sample(900 * MS).fresh_until, 1000 * MS);
    }

    /// The plugged-in device: its reports, and that it is pulled out when they have ended.
    static PLUGGED: Mutex<Option<Receiver<Vec<u8>>>> = Mutex::new(None);

    fn plugged() -> MutexGuard<'static, Option<Receiver<Vec<u8>>>> {
        PLUGGED.lock().unwrap()
    }

    struct RecordedReports(Receiver<Vec<u8>>);

    impl Reports for RecordedReports {
        fn open(_: &str) -> anyhow::Result<(Self, String)> {
            let reports = plugged().take().ok_or_else(|| anyhow::anyhow!("nothing is plugged in"))?;
            Ok((Self(reports), "recorded".into()))
        }

        fn read(&mut self, wait: Duration, report: &mut [u8]) -> anyhow::Result<usize> {
            use std::sync::mpsc::RecvTimeoutError::{Disconnected, Timeout};
            match self.0.recv_timeout(wait) {
                Ok(read) => {
                    report[..read.len()].copy_from_slice(&read);
                    Ok(read.len())
                }
                Err(Timeout) => Ok(0),
                Err(Disconnected) => anyhow::bail!("it is pulled out"),
            }
        }
    }

    fn context() -> Context {
        let (notify, _) = sync_channel(100);
        Context {
            clock: Clock::start(),
            notify,
            stop: Arc::new(AtomicBool::new(false)),
            runs: Arc::new(AtomicBool::new(true)),
            trace: Trace::new("hid", 0, None),
            ended_traces: channel().0,
        }
    }

    #[test]
    fn a_device_that_is_pulled_out_is_lost_and_found_again_at_rest() {
        let context = context();
        assert!(Mouse::<RecordedReports>::open("", context.clone()).is_err());
        let (reports, receiver) = channel();
        *plugged() = Some(receiver);
        let mut mouse = Mouse::<RecordedReports>::open("", context).unwrap();
        let mut poll = || {
            let mut events = Vec::new();
            mouse.poll(5 * MS, &mut events);
            events
        };
        let axes = |event: Option<&InputEvent>| match event {
            Some(InputEvent::Sample(sample)) => Some(sample.axes),
            _ => None,
        };
        // It rests, though it has sent nothing yet.
        assert_eq!(axes(poll().first()), Some([0; 6]));
        reports.send(bytes("01 5e 01 00 00 00 00")).unwrap();
        assert_eq!(axes(poll().first()), Some([1000, 0, 0, 0, 0, 0]));
        // A push that is not repeated is reported once.
        assert_eq!(poll(), []);
        drop(reports);
        assert_eq!(poll(), [InputEvent::Lost]);
        assert_eq!(poll(), []);
        let (_reports, receiver) = channel();
        *plugged() = Some(receiver);
        let end = std::time::Instant::now() + Duration::from_secs(10);
        let found = std::iter::from_fn(|| (std::time::Instant::now() < end).then(&mut poll))
            .find(|events| !events.is_empty());
        assert_eq!(axes(found.unwrap().first()), Some([0; 6]));
    }

    /// The system's own HID, with a device that is a program (`Documentation/hid/uhid.rst`).
    #[cfg(all(target_os = "linux", feature = "hid"))]
    #[test]
    #[ignore = "needs /dev/uhid, and the right to use it"]
    fn a_device_of_the_system_is_found_read_and_lost() {
        use std::io::Write as _;
        const DESTROY: u32 = 1;
        const CREATE: u32 = 11;
        const INPUT: u32 = 12;
        // X, Y, Z and RX, RY, RZ in two reports of signed words, and 16 buttons.
        let descriptor = bytes(
            "05 01 09 08 a1 01 16 a2 fe 26 5e 01 75 10 95 03 a1 00 85 01 09 30 09 31 09 32 81 06 c0 a1 00 85 02 09 33 09 34 09 35 81 06 \
             c0 a1 02 85 03 05 09 19 01 29 10 15 00 25 01 75 01 95 10 81 02 c0 c0",
        );
        let mut system = std::fs::File::options().read(true).write(true).open("/dev/uhid").unwrap();
        let mut tell = |kind: u32, parts: &[&[u8]]| {
            let mut event = kind.to_ne_bytes().to_vec();
            parts.iter().for_each(|part| event.extend_from_slice(part));
            event.resize(4380, 0);
            system.write_all(&event).unwrap();
        };
        let mut name = b"SpaceMouse Compact".to_vec();
        name.resize(256, 0);
        let length = u16::try_from(descriptor.len()).unwrap();
        let (bluetooth, ids) = (5_u16, [0x256f_u32, 0xc635, 0, 0]);
        let ids: Vec<u8> = ids.iter().flat_map(|id| id.to_ne_bytes()).collect();
        tell(CREATE, &[&name, &length.to_ne_bytes(), &bluetooth.to_ne_bytes(), &ids, &descriptor]);
        let end = std::time::Instant::now() + Duration::from_secs(20);
        let mut mouse = loop {
            match Hid::open("Compact", context()) {
                Ok(mouse) => break mouse,
                Err(error) => assert!(std::time::Instant::now() < end, "{error:#}"),
            }
        };
        let mut wait_for = |wanted: Result<([i16; 6], u32), ()>| {
            let mut events = Vec::new();
            while std::time::Instant::now() < end {
                mouse.poll(5 * MS, &mut events);
                let fits = |event: &InputEvent| match event {
                    InputEvent::Sample(sample) => Ok((sample.axes, sample.buttons)) == wanted,
                    InputEvent::Lost => wanted == Err(()),
                    InputEvent::Old => false,
                };
                if events.iter().any(fits) {
                    return;
                }
            }
            panic!("{wanted:?} is not there: {events:?}");
        };
        let mut report = |text: &str| {
            let report = bytes(text);
            tell(INPUT, &[&u16::try_from(report.len()).unwrap().to_ne_bytes(), &report]);
        };
        wait_for(Ok(([0; 6], 0)));
        report("01 46 00 00 00 34 00");
        report("02 00 00 e2 ff 00 00");
        report("03 02 00");
        wait_for(Ok(([200, 0, -148, 0, 85, 0], 2)));
        tell(DESTROY, &[]);
        wait_for(Err(()));
    }
}
