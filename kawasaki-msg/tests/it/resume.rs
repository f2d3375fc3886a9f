//! A PC that was killed in the middle of an order, and another process that continues it.

use core::time::Duration;

use kawasaki_msg::motion::{Motion, boxed};
use kawasaki_msg::robot_session::Session as _;
use kawasaki_msg::{
    FromRobot, JobKind, Line, Pc, PcConfig, PcEvent, Phase, Point, Robot, RobotConfig, RobotEvent,
    SessionError, Status, pc,
};

const CYCLE: Duration = Duration::from_millis(100);

type PcEnd<'a> = Pc<&'a [Line]>;

fn picture(jobs: i32) -> Vec<Line> {
    let line = |x| Line { kind: JobKind::Draw, start: Point::new(x, 0), end: Point::new(x + 1, 0) };
    (0..jobs).map(line).collect()
}

/// A robot, its drawing, and its connection to one PC after the other.
struct Cell {
    now: Duration,
    robot: Robot<'static, Line>,
    motion: Motion<'static, Line>,
    drawn: Vec<i32>,
}

impl Cell {
    fn new() -> Self {
        let (jobs, motion) = boxed(8, 9999).unwrap();
        let robot = Robot::new(RobotConfig::tcp(), jobs).unwrap();
        Self { now: Duration::ZERO, robot, motion, drawn: Vec::new() }
    }

    fn connect(&mut self, pc: &mut PcEnd<'_>) {
        loop {
            self.now += CYCLE;
            self.robot.handle_timeout(self.now);
            if self.robot.poll_event() == Some(RobotEvent::Connect) {
                break;
            }
        }
        self.robot.handle_connected(self.now);
        pc.handle_connected(self.now);
    }

    fn disconnect(&mut self) {
        self.robot.handle_disconnected(self.now);
    }

    /// Runs an exchange, then this many jobs of the motion task. With `cut`, the PC's answer is lost.
    fn cycle(&mut self, pc: &mut PcEnd<'_>, jobs: usize, cut: bool) {
        self.now += CYCLE;
        self.robot.handle_timeout(self.now);
        while self.robot.poll_event().is_some() {}
        let mut buffer = [0; 4096];
        if let Some(length) = self.robot.poll_transmit(self.now, &mut buffer) {
            pc.handle_input(self.now, &buffer[..length]);
        }
        if let Some(length) = pc.poll_transmit(self.now + CYCLE / 10, &mut buffer)
            && !cut
        {
            self.robot.handle_input(self.now + CYCLE / 10, &buffer[..length]);
        }
        self.work(jobs);
    }

    fn work(&mut self, jobs: usize) {
        for _ in 0..jobs {
            let Some(job) = self.motion.take() else { return };
            self.drawn.push(job.complete().work.start.x);
        }
    }

    /// Runs until the order has an outcome.
    fn finish(&mut self, pc: &mut PcEnd<'_>) -> PcEvent {
        for _ in 0..1000 {
            self.cycle(pc, 2, false);
            while let Some(event) = pc.poll_event() {
                if matches!(event, PcEvent::OrderOver { .. } | PcEvent::OutcomeUnknown { .. }) {
                    return event;
                }
            }
        }
        panic!("no outcome");
    }
}

/// Returns the numbers of executed and sent jobs, as a PC in the middle of an order knows them.
fn begun<'a>(cell: &mut Cell, picture: &'a [Line], cut: bool) -> (u32, u32) {
    let mut pc: PcEnd<'a> = Pc::new(PcConfig::tcp()).unwrap();
    pc.start(50, picture).unwrap();
    cell.connect(&mut pc);
    while pc.executed() < 3 {
        cell.cycle(&mut pc, 1, false);
    }
    cell.cycle(&mut pc, 1, cut);
    let kept = (pc.executed(), pc.sent());
    assert!(kept.0 < kept.1 && (kept.1 as usize) < picture.len());
    cell.disconnect();
    // The robot works on without a PC.
    cell.work(3);
    kept
}

fn next<'a>(picture: &'a [Line], (executed, sent): (u32, u32)) -> PcEnd<'a> {
    let mut pc: PcEnd<'a> = Pc::new(PcConfig::tcp()).unwrap();
    pc.resume(50, picture, executed, sent, []).unwrap();
    pc
}

#[test]
fn the_order_goes_on_and_each_job_is_executed_once() {
    for cut in [false, true] {
        // The stored state may be old: more is executed. Or the packet was never sent: less was.
        for (less, more) in [(0, 0), (3, 0), (0, 5), (2, 40)] {
            let (picture, mut cell) = (picture(300), Cell::new());
            let (executed, sent) = begun(&mut cell, &picture, cut);
            let mut pc = next(&picture, (executed - less, (sent + more).min(300)));
            cell.connect(&mut pc);
            let over = cell.finish(&mut pc);
            assert_eq!(over, PcEvent::OrderOver { order: 50, executed: 300, complete: true });
            assert_eq!(cell.drawn, (0..300).collect::<Vec<_>>());
        }
    }
}

#[test]
fn what_no_order_can_be_is_refused() {
    let picture = picture(3);
    let mut pc: PcEnd<'_> = Pc::new(PcConfig::tcp()).unwrap();
    let mut resume = |order, executed, sent| pc.resume(order, &picture[..], executed, sent, []);
    assert_eq!(resume(0, 1, 2), Err(SessionError::OrderZero));
    assert_eq!(resume(50, 3, 2), Err(SessionError::NotInFlight { executed: 3, sent: 2 }));
    assert_eq!(resume(50, 0, 4), Err(SessionError::FewerJobs { sent: 4 }), "the order would seem complete");
    let endless = |_| kawasaki_msg::Supply::Job(picture[0]);
    let mut pc: Pc<_> = Pc::new(PcConfig::tcp()).unwrap();
    let mut resume = |order, executed, sent| pc.resume(order, endless, executed, sent, []);
    assert_eq!(resume(50, 0, 9999), Err(SessionError::NotInFlight { executed: 0, sent: 9999 }));
    assert_eq!(resume(50, 1, 9999), Ok(()));
    assert_eq!(resume(51, 1, 2), Err(SessionError::OrderActive { active: 50 }));
    assert_eq!(pc.start(51, endless), Err(SessionError::OrderActive { active: 50 }));
}

/// The machine is the same as that of a PC whose connection was lost: the model has explored everything that follows.
#[test]
fn the_state_is_that_after_a_lost_connection() {
    use kawasaki_msg::robot_session::end::Machine as _;
    use pc::machine::{Input, Machine, SentAnswer};
    let config = PcConfig { max_number: 63, ..PcConfig::tcp() };
    let now = Duration::from_secs(1);
    let mut lost = Machine::default();
    let status = Status { order: 0, phase: Phase::Idle, queued: None, executed: None, ended: 0 };
    let reports = [
        FromRobot::Status(status),
        FromRobot::OrderAck { active: 50 },
        FromRobot::Request { order: 50, number: 1 },
        FromRobot::JobAck { order: 50, number: 2 },
    ];
    lost.on(now, Input::Connected, &config).unwrap();
    lost.on(now, Input::Start { order: 50 }, &config).unwrap();
    for report in reports {
        for input in [Input::Message(report), Input::ReadEnd { whole: true }] {
            lost.on(now, input, &config).unwrap();
        }
        // As many jobs as are requested, up to four.
        let answer = lost.transmit(2 * now, &config).expect("an answer is due");
        let jobs = answer.jobs.map_or(0, |(from, _)| 4 - from);
        let sent = SentAnswer { request: answer.request.is_some(), jobs, ..SentAnswer::default() };
        lost.on(2 * now, Input::Sent(sent), &config).unwrap();
        while lost.report().is_some() {
            lost.on(2 * now, Input::Reported, &config).unwrap();
        }
    }
    lost.on(2 * now, Input::Disconnected, &config).unwrap();
    let mut resumed = Machine::default();
    resumed.on(now, Input::Resume { order: 50, executed: 2, sent: 4, total: None }, &config).unwrap();
    assert_eq!(resumed, lost);
}
