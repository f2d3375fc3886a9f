//! The real binary between an independent controller and an independent ball, on a terminal of its own.

pub(crate) mod ball;
pub(crate) mod controller;
pub(crate) mod pty;

use std::fs::File;
use std::path::PathBuf;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::{Duration, Instant};

use ball::Ball;
use controller::{Controller, Cycle};
use pty::Pty;

/// Moving so fast, of 90 units a cycle, an arm is stopped.
pub(crate) const FAST: i16 = 72;
const TEST_TIMEOUT: Duration = Duration::from_secs(30);

pub(crate) struct Rig {
    pub(crate) controller: Controller,
    pub(crate) ball: Ball,
    pub(crate) terminal: Terminal,
    process: Child,
    folder: tempfile::TempDir,
    mode: u8,
}

impl Rig {
    /// Starts `cellwire alter`, its robot and its ball; the operator has pressed A.
    pub(crate) fn new(mode: u8, args: &[&str]) -> Self {
        Self::with_input(mode, &["--ball", "BALL"], args)
    }

    /// Starts the same with another input; `BALL` in its options is the ball's port.
    pub(crate) fn with_input(mode: u8, input: &[&str], args: &[&str]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let (robot, robot_path) = Pty::new();
        let controller = Controller::new(robot.raw());
        let ball_path = folder.path().join("ball");
        let ball = Ball::new(&ball_path);
        let terminal = Terminal::new();
        let end = || Stdio::from(File::options().read(true).write(true).open(&terminal.path).unwrap());
        let process = Command::new("setsid")
            .args(["--ctty", env!("CARGO_BIN_EXE_cellwire"), "alter", "--robot", &robot_path])
            .args(input.iter().map(|arg| if *arg == "BALL" { ball_path.as_os_str() } else { arg.as_ref() }))
            // A busy machine keeps the test's own robot silent for longer than four cycles: that alone ends no ALTER.
            .args(["--set", "silence_cycles=20", "--trace", "--trace-dir"])
            .arg(folder.path())
            .args(args)
            .stdin(end())
            .stdout(end())
            .stderr(File::create(folder.path().join("stderr")).unwrap())
            .spawn()
            .unwrap();
        let rig = Self { controller, ball, terminal, process, folder, mode };
        rig.terminal.wait_for("OFF");
        rig.terminal.press(b"a");
        rig.terminal.wait_for("WAITING");
        rig
    }

    /// Starts a rig in which ALTER runs and the hand, after a rest, pushes until the arm moves by `least` per cycle.
    pub(crate) fn moving(mode: u8, args: &[&str], least: i16) -> Self {
        let rig = Self::new(mode, args);
        rig.controller.start(mode);
        rig.push_until(least);
        rig
    }

    /// Lets go until the hand may move the arm. Where the machine is so busy that ALTER ends, it is started again.
    pub(crate) fn arm(&self) {
        self.ball.push(0);
        let end = Instant::now() + TEST_TIMEOUT;
        while !self.terminal.text().contains(" ARMED ") {
            assert!(Instant::now() < end, "it is not armed: {}", self.terminal.text());
            if self.controller.has_ended() {
                self.controller.start(self.mode);
                self.controller.pass(1);
            }
            if self.mode & 1 == 0 && self.terminal.text().contains(" READY ") {
                self.terminal.press(b"\r");
            }
            thread::sleep(Duration::from_millis(20));
        }
    }

    /// Arms, and pushes until the arm moves so. Where the machine is so busy that values become old, it begins again.
    pub(crate) fn push_until(&self, least: i16) {
        let end = Instant::now() + TEST_TIMEOUT;
        loop {
            self.arm();
            let since = self.controller.now();
            self.ball.push(127);
            loop {
                assert!(Instant::now() < end, "it does not move: {}", self.terminal.text());
                if self.controller.log()[since..].iter().any(|cycle| x(cycle).is_some_and(|x| x >= least)) {
                    return;
                }
                let text = self.terminal.text();
                if self.controller.has_ended() || text.contains(" DISARMED ") {
                    break;
                }
                thread::sleep(Duration::from_millis(5));
            }
        }
    }

    /// Returns the controller's observations from `cause` on: the number of cycles to the first smaller value, and to zero; and
    /// the greatest step. `None`: a busy computer had stopped the arm before.
    pub(crate) fn stopped(&self, cause: usize) -> Option<Stopped> {
        let rests = |cycle: &Cycle| matches!(cycle, Cycle::Ended | Cycle::Start(_) | Cycle::Interrupted(_));
        let zero = self.controller.wait("rest", cause, |cycle| x(cycle).map_or(rests(cycle), |x| x == 0));
        let log = self.controller.log();
        let before = x(log[..cause].last()?)?;
        let smaller = |cycle: &Cycle| x(cycle).map_or(rests(cycle), |x| x < before);
        let first = log[cause..].iter().position(smaller)?;
        let is_fast = before >= FAST && log[cause..=zero].iter().any(|cycle| x(cycle).is_some());
        is_fast.then_some(Stopped { first, zero: zero - cause, step: greatest_step(&log), seen: log.len() })
    }

    /// Asserts that no value moves the arm in this many cycles from `cause` on; `None` if a busy computer has ended ALTER
    /// meanwhile.
    pub(crate) fn stays_still(&self, cause: usize, cycles: usize) -> Option<Stopped> {
        self.controller.pass((cause + cycles).saturating_sub(self.controller.now()));
        let log = self.controller.log();
        let moved = |cycle: &Cycle| x(cycle).is_some_and(|x| x != 0);
        let first = log[cause..].iter().position(moved).unwrap_or(0);
        let zero = log[cause..].iter().rposition(moved).map_or(0, |last| last + 1);
        let answered = log[cause..].iter().filter(|cycle| x(cycle).is_some()).count();
        (answered > cycles / 2).then_some(Stopped { first, zero, step: greatest_step(&log), seen: log.len() })
    }

    pub(crate) fn signal(&self, signal: &str) {
        let pid = self.process.id().to_string();
        assert!(Command::new("kill").args([signal, &pid]).status().unwrap().success());
    }

    /// Waits for the end of the process; how long that took.
    pub(crate) fn wait_for_exit(&mut self) -> (ExitStatus, Duration) {
        let begin = Instant::now();
        loop {
            if let Some(status) = self.process.try_wait().unwrap() {
                return (status, begin.elapsed());
            }
            assert!(begin.elapsed() < TEST_TIMEOUT, "it does not end: {}", self.terminal.text());
            thread::sleep(Duration::from_millis(5));
        }
    }

    /// Returns the program's standard error.
    pub(crate) fn stderr(&self) -> String {
        std::fs::read_to_string(self.folder.path().join("stderr")).unwrap()
    }

    /// Returns the traces that were written.
    pub(crate) fn traces(&self) -> Vec<PathBuf> {
        let entries = std::fs::read_dir(self.folder.path()).unwrap();
        entries
            .map(|entry| entry.unwrap().path())
            .filter(|path| path.extension() == Some("trace".as_ref()))
            .collect()
    }
}

impl Drop for Rig {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// How the arm came to rest, in cycles of 28 ms.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Stopped {
    pub(crate) first: usize,
    pub(crate) zero: usize,
    pub(crate) step: u16,
    /// The cycles until then.
    pub(crate) seen: usize,
}

/// Returns the value of a reply along X.
pub(crate) fn x(cycle: &Cycle) -> Option<i16> {
    match cycle {
        Cycle::Values([x, ..], _) => Some(*x),
        _ => None,
    }
}

/// Returns the greatest change from a cycle to the next; after a cycle without a reply the arm begins from rest.
pub(crate) fn greatest_step(log: &[Cycle]) -> u16 {
    let steps = log.windows(2).filter_map(|pair| {
        let before = x(&pair[0]).unwrap_or(0);
        Some((i32::from(x(&pair[1])?) - i32::from(before)).unsigned_abs())
    });
    steps.max().map_or(0, |step| u16::try_from(step).unwrap())
}

/// A terminal, as its user's end sees it.
pub(crate) struct Terminal {
    pub(crate) path: String,
    user: Arc<Mutex<Option<Pty>>>,
    screen: Arc<Mutex<vt100::Parser>>,
    is_blocked: Arc<AtomicBool>,
    /// The settings before the program.
    settings: String,
}

impl Terminal {
    fn new() -> Self {
        let (user, path) = Pty::new();
        // The settings of the port stay as long as it is open.
        let client = File::options().read(true).write(true).open(&path).unwrap();
        stty(&path, &["sane", "rows", "24", "cols", "80"]);
        let settings = stty(&path, &["-g"]);
        let mut reader = user.again();
        let terminal = Self {
            path,
            user: Arc::new(Mutex::new(Some(user))),
            screen: Arc::new(Mutex::new(vt100::Parser::new(24, 80, 0))),
            is_blocked: Arc::default(),
            settings,
        };
        let (screen, is_blocked, open) =
            (Arc::clone(&terminal.screen), Arc::clone(&terminal.is_blocked), Arc::clone(&terminal.user));
        thread::spawn(move || {
            let _client = client;
            let mut buffer = [0; 4096];
            while open.lock().unwrap().is_some() {
                if is_blocked.load(Ordering::Relaxed) {
                    thread::sleep(Duration::from_millis(5));
                    continue;
                }
                if let Ok(n) = reader.read(Duration::from_millis(20), &mut buffer) {
                    screen.lock().unwrap().process(&buffer[..n]);
                }
            }
        });
        terminal
    }

    pub(crate) fn press(&self, keys: &[u8]) {
        self.user.lock().unwrap().as_mut().unwrap().write(keys);
    }

    /// Stops the terminal's output, as Ctrl-S or a selection does.
    pub(crate) fn block(&self) {
        self.is_blocked.store(true, Ordering::Relaxed);
        let client = File::options().read(true).write(true).open(&self.path).unwrap();
        rustix::termios::tcflow(&client, rustix::termios::Action::OOff).unwrap();
    }

    /// Gives the window this many rows and columns.
    pub(crate) fn resize(&self, rows: u16, columns: u16) {
        stty(&self.path, &["rows", &rows.to_string(), "cols", &columns.to_string()]);
    }

    /// Closes the window.
    pub(crate) fn close(&self) {
        *self.user.lock().unwrap() = None;
    }

    pub(crate) fn text(&self) -> String {
        self.screen.lock().unwrap().screen().contents()
    }

    /// Waits until a text is shown.
    pub(crate) fn wait_for(&self, text: &str) {
        let end = Instant::now() + TEST_TIMEOUT;
        while !self.text().contains(text) {
            assert!(Instant::now() < end, "{text:?} was not shown: {}", self.text());
            thread::sleep(Duration::from_millis(10));
        }
    }

    /// Asserts that it is as it was before the program: its settings, and the screen.
    pub(crate) fn assert_restored(&self) {
        assert_eq!(stty(&self.path, &["-g"]), self.settings);
        // The terminal may not have read the last bytes yet.
        let end = Instant::now() + TEST_TIMEOUT;
        while self.screen.lock().unwrap().screen().alternate_screen() {
            assert!(Instant::now() < end, "the alternate screen was not left");
            thread::sleep(Duration::from_millis(5));
        }
    }
}

fn stty(path: &str, args: &[&str]) -> String {
    let output = Command::new("stty").args(["-F", path]).args(args).output().unwrap();
    assert!(output.status.success(), "{output:?}");
    String::from_utf8(output.stdout).unwrap()
}
