//! The dangers of the operator's cell, each against the real program over real pseudo-terminals, measured in the cycles of a
//! controller that shares no code with it. The exact bounds are those of the latch, by its own clock
//! (`motion/src/latch/tests.rs`); here a busy machine may add a cycle or two.

use std::time::Duration;

use crate::real_time::in_real_time;
use crate::rig::controller::Cycle;
use crate::rig::{FAST, Rig, Stopped, greatest_step, x};

/// From full speed to rest within the limits: 90 units by 8 a cycle.
const RAMP: usize = 12;
const LIMIT: u16 = 8;
/// Keys and signals come by threads without a priority: half a second on the busiest machine.
const SOON: usize = 18;

fn assert_stopped(stopped: Stopped, first: usize) {
    assert!(stopped.first <= first, "{stopped:?}: the first smaller value within {first} cycles");
    assert!(stopped.zero <= first + RAMP + 2, "{stopped:?}: at rest within {} cycles", first + RAMP + 2);
    assert!(stopped.step <= LIMIT, "{stopped:?}: no step above {LIMIT}");
}

/// Asserts that the arm has not moved since `since` in this many cycles, and that a hand that lets go and rests moves it
/// again.
fn assert_still_until_rest(rig: &Rig, since: usize, cycles: usize) -> Option<Stopped> {
    let still = rig.stays_still(since, cycles)?;
    assert_eq!((still.first, still.zero), (0, 0), "{:?}", &rig.controller.log()[since..]);
    rig.push_until(8);
    Some(still)
}

/// Repeats an attempt if a busy computer had stopped the arm before.
fn tried(attempt: impl Fn() -> Option<Stopped>) -> Stopped {
    (0..10).find_map(|_| attempt()).expect("the machine is too busy for an arm that moves")
}

fn old_data() -> Option<Stopped> {
    let rig = Rig::moving(23, &[], FAST);
    rig.ball.stick();
    let stopped = rig.stopped(rig.controller.now());
    rig.terminal.wait_for("the input sends no new");
    stopped
}

#[test]
fn a_ball_that_repeats_old_data_with_a_push_stops_the_arm() {
    in_real_time(|| {
        // 150 ms from the poll of the last new values but one, and the program looks each 20 ms.
        assert_stopped(tried(old_data), 7);
    });
}

fn ball_gone() -> Option<Stopped> {
    let rig = Rig::moving(23, &[], FAST);
    rig.ball.pull();
    rig.stopped(rig.controller.now())
}

#[test]
fn a_ball_that_is_gone_stops_the_arm() {
    in_real_time(|| {
        // 150 ms.
        assert_stopped(tried(ball_gone), 5);
    });
}

fn ball_back_pushed() -> Option<Stopped> {
    let rig = Rig::moving(23, &[], FAST);
    rig.ball.pull();
    rig.terminal.wait_for("INPUT LOST");
    rig.controller.pass(RAMP);
    let since = rig.controller.now();
    rig.ball.plug();
    assert_still_until_rest(&rig, since, 40)
}

#[test]
fn a_ball_that_comes_back_pushed_moves_nothing() {
    in_real_time(|| {
        assert_stopped(tried(ball_back_pushed), 0);
    });
}

/// Comes to rest, ends ALTER with silence, writes its trace and gives the terminal back.
fn assert_ends(mut rig: Rig, cause: usize, code: Option<i32>, has_terminal: bool) -> Option<Stopped> {
    let stopped = rig.stopped(cause);
    let (status, _) = rig.wait_for_exit();
    let ended = rig.controller.wait("the end of ALTER", cause, |cycle| *cycle == Cycle::Ended);
    assert_eq!(status.code(), code, "{}", rig.terminal.text());
    // "Exit within 2 s", by the controller's clock.
    assert!(ended - cause <= 71, "ALTER ended {} cycles later", ended - cause);
    assert!(rig.traces().len() >= 2, "{:?}", rig.traces());
    let lines =
        ["interrupted: the arm is at rest, and ALTER has ended", "warning: ended before the robot reported"];
    let says = lines.iter().any(|line| rig.stderr().contains(line));
    assert!(says || code != Some(130), "{}", rig.stderr());
    if has_terminal {
        rig.terminal.assert_restored();
    }
    stopped
}

fn signal(name: &str) -> Option<Stopped> {
    let rig = Rig::moving(23, &[], FAST);
    let cause = rig.controller.now();
    rig.signal(name);
    assert_ends(rig, cause, Some(130), true)
}

#[test]
fn signals_come_to_rest_first() {
    in_real_time(|| {
        for name in ["-TERM", "-INT", "-HUP"] {
            assert_stopped(tried(|| signal(name)), SOON);
        }
    });
}

/// Sends a second signal; returns whether the program ended before the arm had come to rest.
fn second_signal() -> bool {
    let mut rig = Rig::moving(23, &[], FAST);
    rig.signal("-TERM");
    // Two that come together are one to the system.
    std::thread::sleep(Duration::from_millis(50));
    rig.signal("-TERM");
    let (status, _) = rig.wait_for_exit();
    assert_eq!(status.code(), Some(130));
    assert!(rig.stderr().contains("ended at once: the arm gets no values any more"), "{}", rig.stderr());
    rig.terminal.assert_restored();
    rig.controller.wait("the end of ALTER", 0, |cycle| *cycle == Cycle::Ended);
    rig.controller.log().iter().rev().find_map(x).is_some_and(|last| last > 0)
}

#[test]
fn a_second_signal_ends_at_once() {
    in_real_time(|| {
        // A busy machine may deliver it when the arm is at rest.
        assert!((0..10).any(|_| second_signal()), "the arm came to rest first, each time");
    });
}

fn terminal_closed() -> Option<Stopped> {
    let rig = Rig::moving(23, &[], FAST);
    let cause = rig.controller.now();
    rig.terminal.close();
    assert_ends(rig, cause, Some(130), false)
}

#[test]
fn a_terminal_that_is_closed_ends_it_properly() {
    in_real_time(|| {
        assert_stopped(tried(terminal_closed), SOON);
    });
}

/// The keys before, the key that stops, and whether the program ends by it.
const STOPS: [(&[u8], &[u8], bool); 6] = [
    (b"o", b"\x1b", false),
    (b"o3", b"\x1b", false),
    (b"o", b" ", false),
    (b"o3\t", b" ", false),
    (b"o3", b"\x03", true),
    (b"", b"q", true),
];

fn stop_key(view: &[u8], key: &[u8], ends: bool) -> Option<Stopped> {
    let rig = Rig::moving(23, &[], FAST);
    if !view.is_empty() {
        rig.terminal.press(view);
        rig.terminal.wait_for("(M)ain");
    }
    let cause = rig.controller.now();
    rig.terminal.press(key);
    if ends {
        return assert_ends(rig, cause, Some(0), true);
    }
    let stopped = rig.stopped(cause);
    rig.terminal.wait_for(" STOPPED ");
    rig.controller.wait("the end of ALTER", cause, |cycle| *cycle == Cycle::Ended);
    stopped
}

#[test]
fn the_stop_key_works_in_every_view() {
    in_real_time(|| {
        for (view, key, ends) in STOPS {
            assert_stopped(tried(|| stop_key(view, key, ends)), SOON);
        }
    });
}

fn terminal_blocked() -> Option<Stopped> {
    let rig = Rig::moving(23, &[], FAST);
    rig.terminal.block();
    // Pictures for a second: the first of them blocks.
    rig.controller.pass(36);
    let cause = rig.controller.now();
    rig.terminal.press(b" ");
    rig.stopped(cause)
}

#[test]
fn a_terminal_whose_output_blocks_delays_no_key() {
    in_real_time(|| {
        assert_stopped(tried(terminal_blocked), SOON);
    });
}

fn start_pushed() -> Option<Stopped> {
    let rig = Rig::new(23, &[]);
    rig.ball.push(127);
    rig.controller.start(23);
    let since = rig.controller.wait("the start", 0, |cycle| *cycle == Cycle::Start(0));
    assert_still_until_rest(&rig, since, 40)
}

#[test]
fn a_start_while_the_ball_is_pushed_moves_nothing() {
    in_real_time(|| {
        assert_stopped(tried(start_pushed), 0);
    });
}

/// Interrupts a pushed arm. The cause is the first cycle that the robot interrupts: its subroutine has stopped the arm.
fn interruption_pushed() -> Option<Stopped> {
    let rig = Rig::moving(23, &[], FAST);
    let before = rig.controller.now();
    rig.controller.interrupt(5);
    let since =
        rig.controller.wait("the interruption", before, |cycle| matches!(cycle, Cycle::Interrupted(_)));
    rig.terminal.wait_for("ALTER was interrupted");
    assert_still_until_rest(&rig, since, 45)
}

#[test]
fn an_interruption_while_the_ball_is_pushed_moves_nothing_afterwards() {
    in_real_time(|| {
        assert_stopped(tried(interruption_pushed), 0);
    });
}

fn restart_pushed() -> Option<Stopped> {
    let rig = Rig::moving(23, &[], FAST);
    let before = rig.controller.now();
    rig.controller.start(23);
    let since = rig.controller.wait("the start", before, |cycle| *cycle == Cycle::Start(0));
    assert_still_until_rest(&rig, since, 40)
}

#[test]
fn another_start_while_the_ball_is_pushed_moves_nothing() {
    in_real_time(|| {
        assert_stopped(tried(restart_pushed), 0);
    });
}

/// Makes the robot silent for more than twenty cycles, then lets it begin again, while the hand pushes all the time.
fn robot_back_pushed() -> Option<Stopped> {
    let rig = Rig::moving(23, &[], FAST);
    let before = rig.controller.now();
    rig.controller.pause(25);
    let since = rig.controller.wait("the start", before, |cycle| *cycle == Cycle::Start(0));
    assert_still_until_rest(&rig, since, 40)
}

#[test]
fn a_robot_that_comes_back_while_the_ball_is_pushed_moves_nothing() {
    in_real_time(|| {
        assert_stopped(tried(robot_back_pushed), 0);
    });
}

fn key_released() -> Option<Stopped> {
    let rig = Rig::new(23, &["--hold-to-run", "--set", "profile.hold_key=8"]);
    rig.ball.hold(0x80);
    rig.controller.start(23);
    rig.push_until(FAST);
    let cause = rig.controller.now();
    rig.ball.hold(0);
    let stopped = rig.stopped(cause);
    rig.terminal.wait_for("the key was let go");
    // The key alone arms nothing: the hand has to rest.
    rig.ball.hold(0x80);
    rig.stays_still(rig.controller.now() + 2, 20).is_some_and(|still| still.zero == 0).then_some(stopped)?
}

#[test]
fn hold_to_run_moves_only_while_the_key_is_held() {
    in_real_time(|| {
        let rig = Rig::new(23, &["--hold-to-run", "--set", "profile.hold_key=8"]);
        rig.controller.start(23);
        rig.arm();
        let since = rig.controller.now();
        rig.ball.push(127);
        rig.controller.pass(20);
        let log = rig.controller.log();
        assert!(log[since..].iter().all(|cycle| x(cycle).unwrap_or(0) == 0), "{:?}", &log[since..]);
        drop(rig);
        assert_stopped(tried(key_released), SOON);
    });
}

/// Each reply that the robot could not read is counted, with its reason.
#[test]
fn rejected_replies_are_counted_and_their_reasons_shown() {
    in_real_time(|| {
        let rig = Rig::moving(23, &[], FAST);
        for (code, counted) in [
            (1, "rejected 1: checksum 1  "),
            (2, "rejected 2: checksum 1, format 1  "),
            (5, "rejected 3: checksum 1, format 1, marks 1  "),
            (1, "rejected 4: checksum 2, format 1, marks 1  "),
        ] {
            rig.controller.reject(code);
            rig.terminal.wait_for(counted);
        }
        // A motion that the arm has not executed counts as rest: it continues from there within the limits.
        let log = rig.controller.log();
        assert!(log.iter().filter_map(x).all(|x| x.unsigned_abs() <= 90), "{log:?}");
    });
}

/// A window of one cell shows nothing, and harms nothing.
#[test]
fn a_terminal_without_room_is_no_error() {
    in_real_time(|| {
        let mut rig = Rig::moving(23, &[], 8);
        for (rows, columns) in [(1, 1), (3, 200), (24, 2)] {
            rig.terminal.resize(rows, columns);
            rig.controller.pass(10);
        }
        let cause = rig.controller.now();
        rig.terminal.press(b"q");
        rig.controller.wait("rest", cause, |cycle| x(cycle) == Some(0) || *cycle == Cycle::Ended);
        let (status, _) = rig.wait_for_exit();
        assert_eq!((status.code(), rig.stderr().contains("panicked")), (Some(0), false), "{}", rig.stderr());
        rig.terminal.resize(24, 80);
        rig.terminal.assert_restored();
    });
}

#[test]
fn another_mode_is_refused_and_both_are_named() {
    in_real_time(|| {
        for mode in [21, 22] {
            let rig = Rig::new(mode, &[]);
            rig.controller.start(mode);
            rig.controller.wait("the refusal", 0, |cycle| *cycle == Cycle::Start(0xFF));
            rig.terminal.wait_for(&format!("the robot has mode {mode}, expected 23"));
        }
        let rig = Rig::new(22, &["--set", "mode=22"]);
        rig.controller.start(22);
        rig.controller.wait("the start", 0, |cycle| *cycle == Cycle::Start(0));
    });
}

/// At 19200 baud a message with transformation leaves room for a few words: those that are zero and were zero are left out.
#[test]
fn mode_23_is_answered_at_19200_baud_and_what_fits_is_said_before() {
    in_real_time(|| {
        let mut rig = Rig::new(23, &["--set", "baud=19200"]);
        // Before anything moves, in text and on the screen; there in the head, where no message takes its place.
        let advice = "19200 baud, mode 23: only 3 of 6 axes fit a reply";
        assert!(rig.stderr().contains(&format!("warning: {advice}")), "{}", rig.stderr());
        rig.terminal.wait_for("3 of 6 axes fit, held 0");
        rig.terminal.wait_for("38400 baud or");
        rig.controller.start(23);
        rig.push_until(FAST);
        let log = rig.controller.log();
        let lengths = log.iter().filter_map(|cycle| match cycle {
            Cycle::Values(_, length) => Some(*length),
            _ => None,
        });
        // 36 bytes and more take 18.75 ms of 28: the rest of the cycle is enough for 17 bytes at most.
        assert!(lengths.max().unwrap() <= 17, "{log:?}");
        assert!(greatest_step(&log) <= LIMIT, "{log:?}");
        rig.terminal.press(b"q");
        rig.wait_for_exit();
        drop(rig);
        // If all axes fit, there is no remark.
        let rig = Rig::new(19, &["--set", "baud=19200", "--set", "mode=19"]);
        assert!(!rig.terminal.text().contains("axes fit") && !rig.stderr().contains("axes fit"));
    });
}

fn slow_line() -> Option<Stopped> {
    let rig = Rig::moving(23, &["--set", "baud=19200"], FAST);
    let cause = rig.controller.now();
    rig.terminal.press(b" ");
    rig.stopped(cause)
}

/// Returns the change by an offset in the 40 cycles after its input was lost.
fn offset_held() -> Option<Stopped> {
    // At full speed, and far from where the hand is.
    let rig = Rig::moving(22, &["--set", "mode=22"], 500);
    let cause = rig.controller.now();
    rig.ball.pull();
    rig.controller.pass(60);
    let log = rig.controller.log();
    let held = log[cause..].iter().filter_map(x).max()?;
    let goes_back = |cycle: &Cycle| x(cycle).is_some_and(|x| x < held);
    assert!(!log[cause..].iter().skip_while(|cycle| x(cycle) != Some(held)).any(goes_back), "{log:?}");
    // It comes to rest when the last change is made.
    let zero = log[cause..].iter().position(|cycle| x(cycle) == Some(held))?;
    let speeds: Vec<i32> =
        log.windows(2).filter_map(|pair| Some(i32::from(x(&pair[1])?) - i32::from(x(&pair[0])?))).collect();
    let step = speeds.windows(2).map(|pair| (pair[1] - pair[0]).unsigned_abs()).max()?;
    let before = i32::from(x(&log[cause - 1])?) - i32::from(x(&log[cause - 2])?);
    let slower = |pair: &[Cycle]| {
        x(&pair[1]).zip(x(&pair[0])).is_some_and(|(b, a)| i32::from(b) - i32::from(a) < before)
    };
    let first = log[cause - 1..].windows(2).position(slower)?;
    Some(Stopped { first, zero, step: u16::try_from(step).ok()?, seen: log.len() })
}

#[test]
fn an_offset_is_held_without_the_input_and_after_it_has_come_back() {
    in_real_time(|| {
        let rig = Rig::moving(22, &["--set", "mode=22"], 1000);
        rig.ball.pull();
        rig.terminal.wait_for("INPUT LOST");
        rig.controller.pass(20);
        let since = rig.controller.now();
        let held = rig.controller.log().iter().rev().find_map(x).unwrap();
        assert!(held >= 1000, "{held}");
        rig.controller.pass(20);
        // A hand at rest does not ask to go back to the path: the operator has to confirm that.
        rig.ball.push(0);
        rig.ball.plug();
        rig.terminal.wait_for(" READY ");
        rig.controller.pass(20);
        let log = rig.controller.log();
        assert!(log[since..].iter().filter_map(x).all(|x| x == held), "{:?}", &log[since..]);
        rig.arm();
        rig.controller.wait("the path", since, |cycle| x(cycle) == Some(0));
    });
}

/// The figures of every danger: `cargo test --release -p cellwire --test it danger -- --ignored --nocapture`, 20 tries each,
/// four at a time, which loads the machine.
#[test]
#[ignore = "takes minutes"]
fn table() {
    type Attempt = fn() -> Option<Stopped>;
    let dangers: [(&str, Attempt); 17] = [
        ("old data with a push", old_data),
        ("the ball's port is gone", ball_gone),
        ("SIGTERM", || signal("-TERM")),
        ("SIGINT", || signal("-INT")),
        ("SIGHUP", || signal("-HUP")),
        ("the terminal is closed", terminal_closed),
        ("Esc in the options", || stop_key(b"o", b"\x1b", false)),
        ("space in the debug view", || stop_key(b"o3", b" ", false)),
        ("space, the terminal blocked", terminal_blocked),
        ("the held key is let go", key_released),
        ("space, 19200 baud, mode 23", slow_line),
        ("mode 22, the ball's port is gone: zero is the last change of the offset", offset_held),
        ("ALTER starts while the ball is pushed", start_pushed),
        ("ALTER starts again while the ball is pushed", restart_pushed),
        ("ALTER is back from an interruption, the ball pushed", interruption_pushed),
        ("the robot is back, the ball pushed", robot_back_pushed),
        ("the ball comes back pushed", ball_back_pushed),
    ];
    println!(
        "| danger | first smaller value, ms | zero, ms | greatest step, of {LIMIT} |\n| --- | --- | --- | --- |"
    );
    for (name, attempt) in dangers {
        let tries: Vec<Stopped> = std::thread::scope(|scope| {
            let four = [(); 4].map(|()| scope.spawn(move || [(); 5].map(|()| tried(attempt))));
            four.into_iter().flat_map(|tries| tries.join().unwrap()).collect()
        });
        let ms = |cycles: fn(&Stopped) -> usize| {
            let mut all: Vec<usize> = tries.iter().map(cycles).collect();
            all.sort_unstable();
            format!("{} ({} to {})", all[10] * 28, all[0] * 28, all[19] * 28)
        };
        let step = tries.iter().map(|stopped| stopped.step).max().unwrap();
        println!("| {name} | {} | {} | {step} |", ms(|it| it.first), ms(|it| it.zero));
    }
}
