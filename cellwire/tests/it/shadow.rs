//! Shadow ends in the tool: lines of a tap, its screen, and the output of `decode --shadow` for a capture.

use std::fs::File;
use std::io::{Read, Write};
use std::net::TcpListener;
use std::path::Path;
use std::process::{Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use crate::tool::{DEADLINE, Running, cellwire, run};
use cellwire_io::serial;

/// Starts a tap of a link before a server, with its capture.
fn tap(link: &str, server: &str, capture: &Path) -> Running {
    let capture = capture.display();
    Running::start(cellwire(&format!(
        "tap {link} --listen 127.0.0.1:0 --connect {server} --capture {capture}"
    )))
}

/// Returns the exit status of `decode --shadow` for a capture, and the lines about both ends.
fn said(link: &str, capture: &Path) -> (Option<i32>, Vec<String>) {
    let (status, lines, _) =
        run(cellwire(&format!("decode {link} --format pcap --shadow {}", capture.display())));
    (status, lines.lines().filter(|line| line.contains("\"shadow\"")).map(str::to_owned).collect())
}

#[test]
fn a_broken_rule_is_said_at_once_and_of_the_capture() {
    let (server, folder) = (TcpListener::bind("127.0.0.1:0").unwrap(), tempfile::tempdir().unwrap());
    let capture = folder.path().join("it.pcapng");
    let mut tap = tap("laser-eb90", &server.local_addr().unwrap().to_string(), &capture);
    let mut client = tap.connect();
    let (mut server, _) = server.accept().unwrap();
    // 0101h is asked for, and 0102h is answered; then it is answered again.
    client.write_all(b"\xEB\x90\x82\xF0\xF1\x01\x01\x01\x90\x82\xF4").unwrap();
    tap.line("\"from\":\"host\"");
    let answer = b"\xEB\x90\x82\xF0\xF1\x01\x02\x01\x90\x82\xF5";
    server.write_all(answer).unwrap();
    let line = tap.line("\"shadow\"");
    let wanted = "\"from\":\"controller\",\"shadow\":\"rule\",\"clause\":\"LE-25\",\"text\":\"the word 0102h answers 0101h\"";
    assert!(line.contains(wanted), "{line}");
    server.write_all(answer).unwrap();
    let line = tap.line("\"shadow\"");
    assert!(line.contains("\"clause\":\"LE-5\""), "{line}");
    // The capture has both, too, at the time at which they were sent.
    let begin = Instant::now();
    let (status, lines) = loop {
        let (status, lines) = said("laser-eb90", &capture);
        if lines.len() == 2 || begin.elapsed() > DEADLINE {
            break (status, lines);
        }
        thread::sleep(Duration::from_millis(20));
    };
    assert_eq!(status, Some(1), "{lines:?}");
    assert!(lines[0].contains(wanted) && lines[1].contains("\"clause\":\"LE-5\""), "{lines:?}");
    assert!(lines[0].starts_with("{\"time\":\"20"), "{lines:?}");
}

#[test]
fn a_robot_and_a_pc_that_keep_the_rules_are_not_complained_about() {
    let folder = tempfile::tempdir().unwrap();
    let capture = folder.path().join("it.pcapng");
    let pc = Running::start(cellwire("simulate kawasaki-pc --listen 127.0.0.1:0"));
    let mut tap = tap("kawasaki-msg", &pc.address(), &capture);
    let _robot = Running::start(cellwire(&format!("simulate kawasaki-robot --connect {}", tap.address())));
    let mut jobs = 0;
    while jobs < 300 {
        let line = tap.line("\"from\"");
        jobs += u32::from(line.contains("\"name\":\"Tyo\""));
        assert!(!line.contains("\"shadow\":\"rule\""), "{line}");
    }
    let (status, lines) = said("kawasaki-msg", &capture);
    assert_eq!(status, Some(0), "{lines:?}");
}

#[test]
fn a_server_of_modbus_and_its_client_are_not_complained_about() {
    let folder = tempfile::tempdir().unwrap();
    let capture = folder.path().join("it.pcapng");
    let server = Running::start(cellwire("simulate fanuc --listen 127.0.0.1:0"));
    let mut tap = tap("fanuc-hmi-modbus", &server.address(), &capture);
    // Every kind of request, the last one beyond what there is.
    let requests: String = (0..50)
        .map(|n| {
            format!(
                "{{\"unit\":1,\"function\":3,\"address\":0,\"quantity\":37}}\n\
                 {{\"unit\":1,\"function\":2,\"address\":{n},\"quantity\":15}}\n\
                 {{\"unit\":1,\"function\":6,\"address\":3000,\"value\":{n}}}\n"
            )
        })
        .collect();
    let file = folder.path().join("requests");
    std::fs::write(&file, requests + "{\"unit\":1,\"function\":4,\"address\":60000,\"quantity\":9}\n")
        .unwrap();
    let (status, replies, error) =
        run(cellwire(&format!("modbus send {} --confirm {}", tap.address(), file.display())));
    assert_eq!(status, Some(6), "{error}");
    assert_eq!(replies.lines().count(), 151, "{error}");
    let mut exceptions = 0;
    while exceptions == 0 {
        let line = tap.line("\"from\"");
        exceptions += u32::from(line.contains("\"exception\""));
        assert!(!line.contains("\"shadow\""), "{line}");
    }
    let (status, lines) = said("fanuc-hmi-modbus", &capture);
    assert_eq!((status, lines.len()), (Some(0), 0), "{lines:?}");
}

#[test]
fn a_central_controller_and_both_its_devices_are_not_complained_about() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let [high, low] = [8, 0].map(|shift| std::process::id() >> shift & 0xFF);
    // By its port a tap knows the platform.
    let addresses = [("robot", "127.0.0.1:0".to_owned()), ("platform", format!("127.{high}.{low}.1:2002"))];
    let mut taps = addresses.map(|(name, address)| {
        let device = format!("simulate mma-{name} --listen {address} --set speed=100");
        let device = Running::start(cellwire(&device));
        let capture = path(name);
        (tap("mmacell-proto", &device.address(), &capture), capture, device, name)
    });
    let part = |n| {
        let at = [20, -20].map(|y| format!("[{n}.0, {y}.0, 30.0, 0.0]"));
        format!("[[part]]\nplatform = [0.01, 0.0]\npick = {}\nplace = {}\n", at[0], at[1])
    };
    let task = "vacuum = \"5ms\"\n[task]\nrobot_home = [0.0, 0.0, 100.0, 0.0]\n";
    std::fs::write(path("task.toml"), task.to_owned() + &(0..5).map(part).collect::<String>()).unwrap();
    let (robot, platform) = (taps[0].0.address(), taps[1].0.address());
    let (status, lines, error) = run(cellwire(&format!(
        "run mma {} --robot {robot} --platform {platform}",
        path("task.toml").display()
    )));
    assert_eq!(status, Some(0), "{error}");
    assert!(lines.lines().last().unwrap().contains("\"done\":5"), "{lines}");
    for (tap, capture, _, name) in &mut taps {
        let mut replies = 0;
        loop {
            let line = tap.line("\"from\"");
            assert!(!line.contains("\"shadow\"") && !line.contains("\"error\":{"), "{name}: {line}");
            replies += u32::from(line.contains(&format!("\"from\":\"{name}\"")));
            if line.contains("\"event\":\"closed\"") {
                break;
            }
        }
        assert!(replies > 10, "{name}: {replies}");
        let (status, lines) = said("mmacell-proto", capture);
        assert_eq!((status, lines.len()), (Some(0), 0), "{name}: {lines:?}");
    }
}

#[test]
fn shadows_need_both_ends() {
    let (status, _, error) = run(cellwire("decode laser-eb90 --shadow"));
    assert_eq!(status, Some(2));
    assert!(
        error.contains("--shadow needs both ends: use it with a capture, such as a file of pcap"),
        "{error}"
    );
}

/// The tap's own errors are on its screen at once, and not only when it has ended.
#[test]
fn the_screen_shows_that_a_server_is_not_there() {
    let (mut terminal, name) = serial::pair().unwrap();
    terminal.set_timeout(Duration::from_millis(100)).unwrap();
    assert!(
        Command::new("stty").args(["-F", &name, "rows", "24", "cols", "120"]).status().unwrap().success()
    );
    let free = || TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    let (listen, server) = (free(), free());
    let open = || Stdio::from(File::options().read(true).write(true).open(&name).unwrap());
    let arguments = format!("tap laser-eb90 --listen {listen} --connect {server} --no-capture --screen");
    let mut command = cellwire(&arguments);
    let mut tap = command.stdin(open()).stdout(open()).stderr(Stdio::null()).spawn().unwrap();
    let begin = Instant::now();
    let (mut text, mut is_connected) = (String::new(), false);
    while !text.contains("cannot connect") {
        assert!(begin.elapsed() < DEADLINE, "{text}");
        is_connected = is_connected || std::net::TcpStream::connect(listen).is_ok();
        let mut bytes = [0; 4096];
        if let Ok(read) = terminal.read(&mut bytes) {
            text.push_str(&String::from_utf8_lossy(&bytes[..read]));
        }
    }
    assert!(!text.contains("\u{1b}[?1049l"), "while the screen is shown");
    tap.kill().unwrap();
    tap.wait().unwrap();
}
