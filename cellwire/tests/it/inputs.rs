//! The inputs that people own, each moving the arm of an independent controller through the real program.

use std::io::Write;
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::Path;
use std::process::{Child, Command};
use std::sync::Arc;
use std::sync::atomic::{AtomicI32, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use crate::real_time::in_real_time;
use crate::rig::controller::Cycle;
use crate::rig::pty::Pty;
use crate::rig::{Rig, x};
use cellwire::alter::input::read_recording;

/// Arms, and pushes until the arm moves. `release` lets go: where the machine is so busy that ALTER ends, it begins again.
fn wait_for_motion(rig: &Rig, mut push: impl FnMut(), mut release: impl FnMut()) {
    let end = Instant::now() + Duration::from_secs(60);
    loop {
        release();
        rig.arm();
        let since = rig.controller.now();
        while !rig.controller.has_ended() && !rig.terminal.text().contains(" DISARMED ") {
            if rig.controller.log()[since..].iter().any(|cycle| x(cycle).is_some_and(|x| x >= 16)) {
                return;
            }
            assert!(Instant::now() < end, "it does not move: {}", rig.terminal.text());
            push();
            thread::sleep(Duration::from_millis(30));
        }
    }
}

#[test]
fn the_keyboard_moves_the_arm_while_a_key_is_repeated() {
    in_real_time(|| {
        let rig = Rig::with_input(23, &["--keyboard"], &[]);
        rig.controller.start(23);
        wait_for_motion(&rig, || rig.terminal.press(b"\x1b[C"), || {});
        let since = rig.controller.now();
        rig.controller.wait("rest", since, |cycle| x(cycle) == Some(0));
    });
}

/// Serves the protocol of spacenavd's socket, version 0, without that daemon.
fn daemon(path: &Path) -> Arc<AtomicI32> {
    let x = Arc::new(AtomicI32::new(0));
    let (pushed, listener) = (Arc::clone(&x), UnixListener::bind(path).unwrap());
    thread::spawn(move || {
        let event = |socket: &mut UnixStream, x: i32| {
            let words = [0, x, 0, 0, 0, 0, 0, 16];
            socket.write_all(&words.iter().flat_map(|word| word.to_ne_bytes()).collect::<Vec<u8>>())
        };
        loop {
            let (mut socket, _) = listener.accept().unwrap();
            let mut last = 0;
            loop {
                let x = pushed.load(Ordering::Relaxed);
                if x == i32::MIN {
                    break;
                }
                // A device at rest reports it once.
                if (x != 0 || last != 0) && event(&mut socket, x).is_err() {
                    break;
                }
                last = x;
                thread::sleep(Duration::from_millis(16));
            }
            drop(socket);
            while pushed.load(Ordering::Relaxed) == i32::MIN {
                thread::sleep(Duration::from_millis(5));
            }
        }
    });
    x
}

#[test]
fn a_3d_mouse_moves_the_arm_and_its_daemon_that_ends_stops_it() {
    in_real_time(|| {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("spnav.sock");
        let hand = daemon(&path);
        let rig = Rig::with_input(23, &["--spacenav", path.to_str().unwrap()], &[]);
        rig.controller.start(23);
        wait_for_motion(&rig, || hand.store(350, Ordering::Relaxed), || hand.store(0, Ordering::Relaxed));
        let since = rig.controller.now();
        hand.store(i32::MIN, Ordering::Relaxed);
        rig.controller.wait("rest", since, |cycle| x(cycle) == Some(0));
        rig.terminal.wait_for("INPUT LOST");
        // Back and pushed it moves nothing.
        hand.store(350, Ordering::Relaxed);
        let since = rig.controller.now();
        rig.controller.pass(30);
        assert!(rig.controller.log()[since..].iter().all(|cycle| x(cycle).unwrap_or(0) == 0));
        hand.store(0, Ordering::Relaxed);
        wait_for_motion(&rig, || hand.store(350, Ordering::Relaxed), || hand.store(0, Ordering::Relaxed));
    });
}

/// spacenavd itself, with a Magellan on a serial line.
struct Spacenavd(Child);

impl Drop for Spacenavd {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Debian's daemon makes its socket in `run`, from the folder in which it was started.
#[test]
#[ignore = "needs Debian's package spacenavd"]
fn a_magellan_moves_the_arm_through_spacenavd() {
    in_real_time(|| {
        let folder = tempfile::tempdir().unwrap();
        let [config, log] = ["spnavrc", "log"].map(|name| folder.path().join(name));
        let (mouse, path) = Pty::new();
        let mut mouse = mouse.raw();
        let pushed = Arc::new(AtomicI32::new(0));
        let hand = Arc::clone(&pushed);
        thread::spawn(move || {
            let nibbles = |value: i32| {
                let value = value + 0x8000;
                [12, 8, 4, 0].map(|shift| 0x30 | u8::try_from(value >> shift & 15).unwrap())
            };
            let mut last = 0;
            loop {
                let mut request = [0; 64];
                let length = mouse.read(Duration::from_millis(16), &mut request).unwrap_or(0);
                let request = String::from_utf8_lossy(&request[..length]).into_owned();
                if request.contains("vQ") {
                    mouse.write(b"vMAGELLAN  Version 6.50  by LOGITECH INC. 08/08/94\r");
                }
                for (command, answer) in
                    [("m3", &b"m3\r"[..]), ("c3", b"c33\r"), ("z", b"z\r"), ("b", b"b\r"), ("q", b"q00\r")]
                {
                    if request.contains(command) {
                        mouse.write(answer);
                    }
                }
                let x = hand.load(Ordering::Relaxed);
                if x != 0 || last != 0 {
                    let mut packet = vec![b'd'];
                    packet.extend(nibbles(x));
                    (0..5).for_each(|_| packet.extend(nibbles(0)));
                    packet.push(b'\r');
                    mouse.write(&packet);
                }
                last = x;
            }
        });
        std::fs::create_dir(folder.path().join("run")).unwrap();
        let socket = folder.path().join("run/spnav.sock");
        std::fs::write(&config, format!("serial = {path}\nrepeat-interval = 50\n")).unwrap();
        let process = Command::new("spacenavd")
            .current_dir(folder.path())
            .args(["-d", "-v"])
            .arg("-c")
            .arg(&config)
            .arg("-l")
            .arg(&log)
            .spawn()
            .unwrap();
        let _daemon = Spacenavd(process);
        let end = Instant::now() + Duration::from_secs(20);
        while UnixStream::connect(&socket).is_err() {
            assert!(Instant::now() < end, "{}", std::fs::read_to_string(&log).unwrap());
            thread::sleep(Duration::from_millis(50));
        }
        let rig = Rig::with_input(23, &["--spacenav", socket.to_str().unwrap()], &[]);
        rig.controller.start(23);
        wait_for_motion(&rig, || pushed.store(300, Ordering::Relaxed), || pushed.store(0, Ordering::Relaxed));
        let since = rig.controller.now();
        pushed.store(0, Ordering::Relaxed);
        rig.controller.wait("rest", since, |cycle| x(cycle) == Some(0));
    });
}

/// Returns the values without their times.
fn values(path: &Path) -> Vec<Result<([i16; 6], u32), bool>> {
    let events = read_recording(&std::fs::read_to_string(path).unwrap()).unwrap();
    events.into_iter().map(|event| event.values.map(|(axes, buttons, _)| (axes, buttons))).collect()
}

#[test]
fn a_recording_played_back_gives_the_same_values() {
    in_real_time(|| {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
        let end = |mut rig: Rig| {
            rig.terminal.press(b"q");
            rig.wait_for_exit();
        };
        let rig = Rig::new(23, &["--record", &path("hand")]);
        rig.controller.start(23);
        // The hand rests for two seconds: played back, ALTER may start later after the first values than it does here.
        rig.controller.pass(72);
        rig.push_until(48);
        rig.ball.push(0);
        let rest = rig.controller.now();
        rig.controller.wait("rest", rest, |cycle| x(cycle) == Some(0));
        end(rig);
        let recorded = values(Path::new(&path("hand")));
        assert!(recorded.iter().any(|values| matches!(values, Ok(([1000, ..], 0)))), "{recorded:?}");

        // A host that stalls for some cycles ends ALTER, or makes the hand's values old: then it is played once more.
        let played = (0..5).find_map(|attempt| {
            let again = path(&format!("again-{attempt}"));
            let rig = Rig::with_input(23, &["--play", &path("hand")], &["--record", &again]);
            rig.controller.start(23);
            let until = Instant::now() + Duration::from_secs(12);
            let moving = loop {
                let moves = |cycle: &Cycle| x(cycle).is_some_and(|x| x >= 40);
                match rig.controller.log().iter().position(moves) {
                    None if Instant::now() < until => thread::sleep(Duration::from_millis(5)),
                    moving => break moving,
                }
            };
            if let Some(moving) = moving {
                rig.controller.wait("rest", moving, |cycle| x(cycle) == Some(0));
                rig.terminal.wait_for(" DISARMED ");
            }
            end(rig);
            moving.map(|_| values(Path::new(&again)))
        });
        let again = played.expect("no motion, five times");
        assert!(
            recorded.starts_with(&again) && again.len() + 5 > recorded.len(),
            "{} of {}",
            again.len(),
            recorded.len()
        );
    });
}

#[test]
fn an_input_that_is_none_is_refused() {
    let refused = |args: &[&str]| {
        let output = Command::new("script")
            .args(["-qec"])
            .arg(format!("{} alter --robot /dev/null {}", env!("CARGO_BIN_EXE_cellwire"), args.join(" ")))
            .arg("/dev/null")
            .output()
            .unwrap();
        String::from_utf8_lossy(&output.stdout).into_owned()
    };
    assert!(refused(&[]).contains("required"), "{}", refused(&[]));
    assert!(refused(&["--keyboard", "--ball", "x"]).contains("cannot be used with"));
}
