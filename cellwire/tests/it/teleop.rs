//! The teleoperation cell over pseudo-terminals: properties that do not depend on the load of the computer.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, channel};
use std::thread;
use std::time::Duration;

use crate::real_time::in_real_time;
use cellwire::alter::input::InputConfig;
use cellwire::alter::{LIMITS, Notification, PortConfig, Profile, Teleop, TeleopConfig, Traces, host_config};
use cellwire::demo::DemoOptions;
use cellwire::demo::teleop::cell::{self, CellConfig};
use cellwire::devices::isra_ball::ball;
use cellwire::devices::val2_alter::puma::{self, PumaConfig};
use cellwire::io::line::{Line, Lines};
use cellwire_io::clock::Clock;
use cellwire_io::serial;
use cellwire_io::trace::TraceArgs;
use cellwire_motion::latch::LatchConfig;
use cellwire_sim::puma::{Pose, PumaEvent};
use cellwire_sim::{Settings as _, TeachBall};
use val2_alter::{ErrorCode, HostConfig, Motion};

const TEST_TIMEOUT: Duration = Duration::from_secs(20);

fn next(events: &Receiver<puma::Notification>) -> puma::Notification {
    events.recv_timeout(TEST_TIMEOUT).expect("the robot reports something")
}

/// Returns the position of the arm at the beginning of ALTER.
fn wait_for_start(events: &Receiver<puma::Notification>) -> Pose {
    loop {
        if let puma::Notification::Robot(PumaEvent::Started(pose)) = next(events) {
            return pose;
        }
    }
}

/// Returns the position of the arm, and the reason of its stop, after the host has gone. A busy computer may have missed a
/// window before.
fn wait_for_end(events: &Receiver<puma::Notification>) -> (ErrorCode, Pose) {
    let (mut is_connected, mut end) = (true, None);
    loop {
        match next(events) {
            puma::Notification::Connected(connected) => is_connected = connected,
            puma::Notification::Robot(PumaEvent::Started(_)) => end = None,
            puma::Notification::Robot(PumaEvent::Ended(error, pose)) => end = Some((error, pose)),
            _ => {}
        }
        if let (false, Some(end)) = (is_connected, end) {
            return end;
        }
    }
}

/// Waits until the robot itself reports that it has moved.
fn wait_for_motion(host: &Teleop) {
    let mut begin = None;
    loop {
        let (_, notification) = host.wait(TEST_TIMEOUT).expect("the host reports something");
        let Notification::Motion(Motion { transform: Some(transform), .. }) = notification else { continue };
        if *begin.get_or_insert(transform) != transform {
            return;
        }
    }
}

/// §3.3.3: "da die Robotersteuerung bei Ausbleiben von Antwortpaketen den ALTER-Betrieb beendet".
#[test]
fn a_host_that_dies_in_mid_motion_leaves_the_arm_standing_and_the_next_one_takes_over() {
    in_real_time(|| {
        let clock = Clock::start();
        let off = TraceArgs::off();
        let stop = Arc::new(AtomicBool::new(false));
        let (robot_port, robot) = serial::pair().unwrap();
        let (ball_port, ball) = serial::pair().unwrap();
        let (notify, events) = channel();
        let mut config = PumaConfig::default();
        config.puma.restart = Duration::from_millis(200);
        let mut line =
            Line::over_port(robot_port, Path::new(&robot), clock, 38_400, off.start("robot")).unwrap();
        let stopped = Arc::clone(&stop);
        let robot_thread = thread::spawn(move || {
            let goes_on = || !stopped.load(Ordering::Relaxed);
            puma::run(&mut line, config.simulator()?, true, goes_on, |_, event| {
                let _ = notify.send(event);
                Ok(())
            })
        });
        let mut line = Line::over_port(ball_port, Path::new(&ball), clock, 9600, off.start("ball")).unwrap();
        let stopped = Arc::clone(&stop);
        let ball_thread = thread::spawn(move || {
            let goes_on = || !stopped.load(Ordering::Relaxed);
            ball::run(&mut line, TeachBall::default().simulator()?, goes_on, |_| Ok(()))
        });

        let host = || {
            let config = TeleopConfig {
                robot: PortConfig { path: robot.clone(), baud: 38_400 },
                input: InputConfig::Ball(PortConfig { path: ball.clone(), baud: 9600 }),
                record: None,
                viewer: None,
                viewer_host: val2_viewer::HostConfig::default(),
                alter: HostConfig { limits: LIMITS, subroutine: true, ..host_config() },
                polls: isra_ball::HostConfig::default(),
                profile: Profile::for_limits(LIMITS, 150),
                latch: LatchConfig::default(),
            };
            let traces = Traces { robot: off.start("r"), ball: off.start("b"), viewer: off.start("v") };
            Teleop::start(config, clock, &traces).unwrap()
        };
        let first = host();
        let begin = wait_for_start(&events);
        wait_for_motion(&first);
        drop(first); // without a word: no ramp, no end
        let (error, stands) = wait_for_end(&events);
        assert_eq!(error, ErrorCode::Timeout);
        assert_ne!(stands, begin, "the arm had moved");
        let second = host();
        assert_eq!(wait_for_start(&events), stands, "the arm was at rest meanwhile");
        drop(second);
        stop.store(true, Ordering::Relaxed);
        let record = robot_thread.join().unwrap().unwrap();
        assert_eq!((record.starts >= 2, record.drift), (true, 0.0));
        ball_thread.join().unwrap().unwrap();
    });
}

/// §9.2: "so daß in keinem Fall höhere Beschleunigungen auftreten", however the lines and the host misbehave.
#[test]
fn the_robot_never_gets_more_than_the_limits_whatever_goes_wrong() {
    whatever_goes_wrong(Lines::PseudoTerminals);
}

/// The lines of a platform without pseudo-terminals.
#[test]
fn nor_over_tcp() {
    whatever_goes_wrong(Lines::Tcp);
}

fn whatever_goes_wrong(lines: Lines) {
    in_real_time(|| {
        let options = DemoOptions {
            seconds: Some(Duration::from_millis(4500)),
            faults: true,
            seed: 5,
            lines,
            ..DemoOptions::quiet()
        };
        let record = cell::run(&CellConfig::default(), &options).unwrap();
        assert!(record.puma.starts > 0 && record.host.stalls > 0, "{record:?}");
        let sent = record.puma.judge.extremes;
        assert!(sent.keeps(&LIMITS), "{sent:?}");
        assert_eq!((record.puma.drift, record.drawn.most_at_once <= 1), (0.0, true));
    });
}
