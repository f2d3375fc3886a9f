//! The tolerance of the ends for wrong assumptions about each other: their sessions on a virtual clock, with the
//! default settings.

use core::time::Duration;

use kawasaki_msg::{JobSource, LargePc, Line, PcConfig, PcEvent, RobotConfig, RobotEvent, Supply, timing};
use robot_session::Session as _;

use crate::controller::{Controller as _, Native};
use crate::model::{Margin, Step};

const PC: &str = "kawasaki-msg pc";
const ROBOT: &str = "kawasaki-msg robot";

/// Returns the assumptions of the ends about time.
pub fn margins() -> Vec<Margin> {
    let (robot, pc) = (RobotConfig::tcp(), PcConfig::tcp());
    // Three resends, three pauses, a clear, and the alarm.
    let assumed = 8 * robot.patience + 3 * robot.pause;
    let step = |tenths: u32| {
        let real = assumed - robot.patience / 2 + tenths * robot.patience / 10;
        Step::new(assumed, real, move || recovers(real))
    };
    vec![
        Margin::around([PC, "silence", "the robot says nothing for so long"], pc.silence, speaks),
        Margin::around(
            [PC, "reply_delay", "two messages of a packet are so far apart"],
            pc.reply_delay,
            is_read,
        ),
        Margin::around([ROBOT, "reply_timeout", "an answer takes so long"], robot.reply_timeout, is_answered),
        Margin::around([ROBOT, "patience", "no job comes for so long"], robot.patience, waits),
        Margin {
            end: ROBOT,
            setting: "patience of each step, and pause",
            real: "no job comes for so long, and then all of them",
            steps: (0..=15).map(step).collect(),
        },
        Margin::around(
            [ROBOT, "timing::LATEST_DATAGRAM", "the start of an earlier run is so late"],
            timing::LATEST_DATAGRAM,
            is_ignored,
        ),
    ]
}

/// No jobs.
struct Nothing;

impl JobSource for Nothing {
    type Work = Line;

    fn job(&mut self, _: u32) -> Supply<Line> {
        Supply::Later
    }
}

fn pc() -> LargePc<Nothing> {
    let mut pc = LargePc::with_ranges(PcConfig::tcp(), Default::default()).expect("the default can work");
    pc.handle_connected(Duration::ZERO);
    pc
}

fn speaks(silent: Duration) -> Option<&'static str> {
    let mut pc = pc();
    pc.handle_timeout(silent);
    pc.poll_event().filter(|event| *event == PcEvent::Disconnect).map(|_| "a connection that works is kept")
}

fn is_read(apart: Duration) -> Option<&'static str> {
    let mut pc = pc();
    pc.handle_input(Duration::ZERO, b"<Huuhaa$0##>");
    pc.handle_timeout(apart);
    pc.poll_transmit(apart, &mut [0; 4096]).map(|_| "a packet is read before it is answered")
}

/// Returns a robot that was asked to begin an order, and has sent its request for jobs; and the time of the request.
fn asking() -> (Native, Duration) {
    let mut robot = Native::begin(RobotConfig::tcp(), 4, 0);
    robot.handle_timeout(Duration::ZERO);
    robot.handle_connected(Duration::ZERO);
    let begun = send(&mut robot, Duration::ZERO);
    robot.handle_input(begun, b"<TilausAlkaa$3#1$1#>");
    let asked = send(&mut robot, begun);
    while robot.poll_event().is_some() {}
    (robot, asked)
}

/// Returns the time at which the next packet is sent.
fn send(robot: &mut Native, from: Duration) -> Duration {
    let mut now = from;
    loop {
        robot.handle_timeout(now);
        if robot.poll_transmit(now, &mut [0; 4096]).is_some() {
            return now;
        }
        now = robot.poll_timeout().expect("a packet is due").max(now);
    }
}

fn is_answered(after: Duration) -> Option<&'static str> {
    let (mut robot, asked) = asking();
    robot.handle_timeout(asked + after);
    core::iter::from_fn(|| robot.poll_event())
        .any(|event| event == RobotEvent::NoReply)
        .then_some("no packet is given up that will be answered")
}

fn waits(without: Duration) -> Option<&'static str> {
    reports(without, |event| matches!(event, RobotEvent::Recovery { .. }))
        .then_some("the recovery does not begin while the PC will send jobs")
}

fn recovers(without: Duration) -> Option<&'static str> {
    reports(without, |event| matches!(event, RobotEvent::Alarm { .. }))
        .then_some("there is no alarm while the PC will send jobs")
}

/// Returns whether a robot reports this event if its PC answers at once, and has no job for this long.
fn reports(without: Duration, event: fn(&RobotEvent) -> bool) -> bool {
    let (mut robot, asked) = asking();
    let mut now = asked;
    while now <= asked + without {
        robot.handle_input(now, b"<Huuhaa$0##>");
        robot.handle_timeout(now.min(asked + without));
        if core::iter::from_fn(|| robot.poll_event()).any(|it| event(&it)) {
            return true;
        }
        robot.poll_transmit(now, &mut [0; 4096]);
        now += Duration::from_micros(100);
    }
    false
}

/// Returns the property that breaks for a robot that was just started, over datagrams, and whose program reads them at once.
fn is_ignored(late: Duration) -> Option<&'static str> {
    let mut robot = Native::begin(RobotConfig::udp(), 4, 0);
    robot.handle_timeout(Duration::ZERO);
    robot.handle_connected(Duration::ZERO);
    let mut now = Duration::ZERO;
    // Another start has come before it, and opened the time in which starts that waited are not looked at.
    for at in [late - late / 10, late] {
        while now < at {
            robot.handle_timeout(now);
            robot.poll_transmit(now, &mut [0; 1472]);
            now += Duration::from_millis(1);
        }
        robot.handle_input(at, b"<TilausAlkaa$3#1$1#>");
    }
    core::iter::from_fn(|| robot.poll_event())
        .any(|event| matches!(event, RobotEvent::OrderStarted { .. }))
        .then_some("no order of an earlier run begins")
}
