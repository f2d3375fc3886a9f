//! `cellwire identify --serial`: a serial line with unknown rate and format, through a pseudo-terminal.
//!
//! A pseudo-terminal has no bits. The other end here has: it writes what a receiver with the rate of the port's settings
//! would make of its bits, broken characters marked as a driver marks them.

use std::fs::File;
use std::io::Write;
use std::process::Stdio;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use crate::tool::{cellwire, run};
use cellwire_links::Link;
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{InputModes, OptionalActions, tcgetattr, tcsetattr};
use serde_json::{Map, Value, json};
use testkit::uart::{Format, marked};

/// A device that sends messages on a line of its own rate and format, again and again.
struct Device {
    name: String,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Device {
    fn start(format: Format, messages: Vec<Vec<u8>>) -> Self {
        let device = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC).unwrap();
        grantpt(&device).unwrap();
        unlockpt(&device).unwrap();
        let name = ptsname(&device, vec![]).unwrap().into_string().unwrap();
        // Kept open, so that the settings stay and the device sees no end.
        let kept = File::options().read(true).open(&name).unwrap();
        let mut port = tcgetattr(&device).unwrap();
        port.make_raw();
        tcsetattr(&device, OptionalActions::Now, &port).unwrap();
        // Unread bytes are lost, as on a line.
        rustix::io::ioctl_fionbio(&device, true).unwrap();
        let stop = Arc::new(AtomicBool::new(false));
        let (mut device, stopped) = (File::from(device), stop.clone());
        let thread = thread::spawn(move || {
            let _kept = kept;
            for message in messages.iter().cycle().take_while(|_| !stopped.load(Ordering::Relaxed)) {
                thread::sleep(Duration::from_secs_f64(format.seconds(message.len())));
                let mut port = tcgetattr(&device).unwrap();
                // A pseudo-terminal has eight bits and no parity with any settings.
                let receiver = Format { baud: port.input_speed(), data_bits: 8, odd: None, stop_bits: 1 };
                let received = receiver.receive(&format.bits(message), format.baud);
                // The marks are made here: the pseudo-terminal would mark them once more.
                port.input_modes -= InputModes::PARMRK;
                tcsetattr(&device, OptionalActions::Now, &port).unwrap();
                let _ = device.write(&marked(&received));
                thread::sleep(Duration::from_millis(5));
            }
        });
        Self { name, stop, thread: Some(thread) }
    }
}

impl Drop for Device {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        self.thread.take().unwrap().join().unwrap();
    }
}

/// Returns the messages of the viewer's host.
fn poses() -> Vec<Vec<u8>> {
    let codec = (Link::by_name("val2-viewer").unwrap().codec)("host", &Map::new()).unwrap();
    let pose = |count: i32| (0..12).map(|at| at * 1000 + count * 7 * (at - 5)).collect::<Vec<_>>();
    (0..100).map(|count| codec.encode(json!({"count": count, "pose": pose(count)})).unwrap()).collect()
}

/// Returns the lines of a run: the settings, and the finding.
fn lines(device: &Device, arguments: &str) -> (Value, Value) {
    let (code, out, said) = run(cellwire(&format!("identify --json --serial {} {arguments}", device.name)));
    assert_eq!((code, said.as_str()), (Some(0), ""), "{out}");
    let lines: Vec<Value> = out.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    (lines[0].clone(), lines[1].clone())
}

#[test]
fn the_rate_of_a_line_is_found_and_then_its_link() {
    for (baud, data_bits, odd, mode) in
        [(19_200, 8, None, "8N1"), (4800, 7, Some(false), "7E1"), (57_600, 7, Some(true), "7O1")]
    {
        let device = Device::start(Format { baud, data_bits, odd, stop_bits: 1 }, poses());
        let (settings, said) = lines(&device, "--for 8s");
        assert_eq!(settings["likely"], 1, "{settings}");
        assert_eq!(
            (&settings["lines"][0]["baud"], &settings["lines"][0]["mode"]),
            (&json!(baud), &json!(mode)),
            "{settings}"
        );
        assert_eq!(said["findings"][0]["link"], "viewer", "{said}");
        assert!(said["findings"][0]["messages"].as_u64().unwrap() > 10, "{said}");
    }
}

#[test]
fn an_interrupt_ends_with_what_is_known() {
    let device = Device::start(Format { baud: 9600, data_bits: 8, odd: None, stop_bits: 2 }, poses());
    let mut command = cellwire(&format!("identify --serial {} --for 10m", device.name));
    let child = command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    thread::sleep(Duration::from_secs(8));
    let pid = rustix::process::Pid::from_child(&child);
    rustix::process::kill_process(pid, rustix::process::Signal::INT).unwrap();
    let output = child.wait_with_output().unwrap();
    let out = String::from_utf8(output.stdout).unwrap();
    assert!(out.contains("The line has 9600 baud, 8N1."), "{out}");
    assert!(out.contains("It is viewer"), "{out}");
}

#[test]
fn the_rate_of_a_line_is_a_comment_in_a_module() {
    let device = Device::start(Format { baud: 9600, data_bits: 8, odd: None, stop_bits: 1 }, poses());
    let (code, out, said) = run(cellwire(&format!("identify --serial {} --for 8s --rust", device.name)));
    assert_eq!((code, said.as_str()), (Some(0), ""), "{out}");
    assert!(out.contains("//!   The line has 9600 baud, 8N1.\n"), "{out}");
    assert!(out.contains("//! viewer: the options that explain a capture.\n"), "{out}");
    assert!(out.lines().all(|line| line.is_empty() || line.starts_with("//")), "{out}");
}

#[test]
fn a_silent_port_and_a_file_are_no_line() {
    let device = Device::start(Format { baud: 9600, data_bits: 8, odd: None, stop_bits: 1 }, vec![vec![]]);
    let (code, _, said) = run(cellwire(&format!("identify --serial {} --for 1s", device.name)));
    assert_eq!(code, Some(2), "{said}");
    assert!(said.contains("nothing was received on /dev/pts/"), "{said}");
    let (code, _, said) = run(cellwire("identify --serial ./Cargo.toml"));
    assert!(code == Some(2) && said.contains("./Cargo.toml is not a serial port"), "{said}");
    let (code, _, said) = run(cellwire("identify --serial /dev/ttyUSB0 a.hex"));
    assert!(code == Some(2) && said.contains("cannot be used with"), "{said}");
}
