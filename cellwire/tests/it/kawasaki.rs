//! The Kawasaki cell over TCP, each end in its own process.

use std::io::{BufRead, BufReader};
use std::process::{Child, ChildStdout, Command, Stdio};

use serde_json::Value;

/// A running `cellwire simulate`, killed when dropped.
struct Device {
    process: Child,
    lines: std::io::Lines<BufReader<ChildStdout>>,
}

impl Device {
    fn start(arguments: &[&str]) -> Self {
        let mut command = Command::new(env!("CARGO_BIN_EXE_cellwire"));
        let mut process =
            command.arg("simulate").args(arguments).stdout(Stdio::piped()).spawn().expect("cellwire runs");
        let lines = BufReader::new(process.stdout.take().unwrap()).lines();
        Self { process, lines }
    }

    /// Reads up to the next line with this field.
    fn until(&mut self, key: &str, value: Option<&str>) -> Value {
        loop {
            let line = self.lines.next().unwrap_or_else(|| panic!("ended before {key} {value:?}")).unwrap();
            let line: Value = serde_json::from_str(&line).unwrap();
            if line.get(key).is_some_and(|found| value.is_none_or(|value| found == value)) {
                return line;
            }
        }
    }

    fn event(&mut self, name: &str) -> Value {
        self.until("event", Some(name))
    }
}

impl Drop for Device {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

#[test]
fn an_order_is_drawn_and_a_restarted_robot_is_detected() {
    let mut pc = Device::start(&["kawasaki-pc", "--listen", "127.0.0.1:0"]);
    let address = pc.until("ready", Some("kawasaki-pc"))["listen"].as_str().unwrap().to_owned();

    // Slow, so that it is killed in the middle of the picture.
    let mut slow = Device::start(&["kawasaki-robot", "--connect", &address, "--set", "speed=100"]);
    slow.event("queue_full");
    drop(slow);
    let mut fast = Device::start(&["kawasaki-robot", "--connect", &address, "--set", "speed=10000000"]);
    let unknown = pc.event("outcome_unknown");
    assert_eq!(unknown["order"], 50);
    assert!(unknown["executed"].as_u64() < unknown["sent"].as_u64(), "{unknown}");

    // The next order is executed by the new robot.
    assert_eq!(pc.event("order_started")["order"], 51);
    let over = pc.event("order_over");
    assert_eq!((&over["order"], &over["complete"]), (&51.into(), &true.into()), "{over}");
    assert_eq!(fast.event("drawn")["strokes"], 5892);
}

#[test]
fn the_error_of_a_wrong_endpoint_names_the_right_one() {
    for (device, wrong, right) in
        [("kawasaki-pc", "--connect", "--listen"), ("kawasaki-robot", "--listen", "--connect")]
    {
        let mut command = Command::new(env!("CARGO_BIN_EXE_cellwire"));
        let args = ["simulate", device, wrong, "127.0.0.1:0", "--set", "udp=true"];
        let output = command.args(args).output().unwrap();
        assert_eq!(output.status.code(), Some(2));
        let error = String::from_utf8(output.stderr).unwrap();
        assert!(error.contains(&format!("use {right}")), "{error}");
    }
}

#[test]
#[cfg(unix)]
fn an_interrupted_device_writes_its_trace_and_removes_its_link() {
    let dir = std::env::temp_dir().join(format!("cellwire-interrupt-{}", std::process::id()));
    std::fs::create_dir_all(&dir).unwrap();
    let (link, folder) = (dir.join("ball"), dir.to_str().unwrap());
    let mut pc = Device::start(&["kawasaki-pc", "--listen", "127.0.0.1:0", "--trace", "--trace-dir", folder]);
    let address = pc.until("ready", Some("kawasaki-pc"))["listen"].as_str().unwrap().to_owned();
    let _robot = Device::start(&["kawasaki-robot", "--connect", &address]);
    pc.event("order_started");
    let mut ball = Device::start(&["ball", "--pty", link.to_str().unwrap()]);
    ball.until("ready", Some("ball"));
    assert!(link.is_symlink());
    for device in [&mut pc, &mut ball] {
        let kill = Command::new("kill").arg(device.process.id().to_string()).status().unwrap();
        assert!(kill.success());
        assert_eq!(device.process.wait().unwrap().code(), Some(130));
    }
    assert!(!link.is_symlink());
    let trace = std::fs::read_to_string(dir.join("kawasaki-pc.trace")).unwrap();
    assert!(trace.starts_with("# kawasaki-pc: interrupted\n"), "{trace}");
    std::fs::remove_dir_all(dir).unwrap();
}
