//! The session in Rust.

use core::ops::{Deref, DerefMut};
use core::time::Duration;

use kawasaki_msg::robot_session::Session;
use kawasaki_msg::{
    Bounds, Job, LargeRobot, Line, Phase, RobotConfig, RobotEvent, RobotStatistics, SessionError,
};
use robot_work_queue::Reader;

use super::Controller;

/// A [`LargeRobot`] and the motion task's end of its queue.
#[derive(Debug)]
pub struct Native {
    /// The communication task.
    pub robot: LargeRobot<'static, Line>,
    /// The motion task's end.
    pub reader: Reader<'static, Job<Line>>,
    reports: Vec<u16>,
}

impl Controller for Native {
    const WHOLE: bool = true;

    fn within(bounds: Bounds, config: RobotConfig, capacity: usize, _: u64) -> Self {
        let (writer, reader) = robot_work_queue::boxed(capacity, config.max_number).unwrap();
        Self { robot: LargeRobot::with_ranges(config, writer, bounds).unwrap(), reader, reports: Vec::new() }
    }

    fn execute(&mut self, _: Duration, overtakes: bool) -> Option<Job<Line>> {
        let last = if overtakes { self.reader.iter().last().map(|(number, _)| number) } else { None };
        let job = match last {
            Some(last) => self.reader.take_where(|number, _| number == last),
            None => self.reader.take(),
        }?;
        let done = *job;
        self.reports.push(done.number);
        job.complete();
        Some(done)
    }

    fn report(&mut self, now: Duration) {
        for number in self.reports.drain(..) {
            self.robot.job_done(now, number).unwrap();
        }
    }

    fn has_jobs(&self) -> bool {
        !self.reader.is_empty()
    }

    fn clear_queue(&mut self) -> Result<(), SessionError> {
        self.robot.clear_queue()
    }

    fn reset_order(&mut self) -> Result<(), SessionError> {
        self.robot.reset_order()
    }

    fn phase(&self) -> Phase {
        self.robot.phase()
    }

    fn queued(&self) -> u32 {
        self.robot.queued()
    }

    fn executed(&self) -> u32 {
        self.robot.executed()
    }

    fn order(&self) -> Option<u16> {
        self.robot.order()
    }
}

impl Deref for Native {
    type Target = LargeRobot<'static, Line>;

    fn deref(&self) -> &LargeRobot<'static, Line> {
        &self.robot
    }
}

impl DerefMut for Native {
    fn deref_mut(&mut self) -> &mut LargeRobot<'static, Line> {
        &mut self.robot
    }
}

impl Session for Native {
    type Event = RobotEvent;
    type Statistics = RobotStatistics;

    const MAX_INPUT: usize = 65536;
    const MAX_TRANSMIT: usize = LargeRobot::<Line>::MAX_TRANSMIT;

    fn handle_connected(&mut self, now: Duration) {
        self.robot.handle_connected(now);
    }

    fn handle_disconnected(&mut self, now: Duration) {
        self.robot.handle_disconnected(now);
    }

    fn handle_input(&mut self, now: Duration, bytes: &[u8]) {
        self.robot.handle_input(now, bytes);
    }

    fn handle_timeout(&mut self, now: Duration) {
        self.robot.handle_timeout(now);
    }

    fn poll_event(&mut self) -> Option<RobotEvent> {
        self.robot.poll_event()
    }

    fn poll_transmit(&mut self, now: Duration, out: &mut [u8]) -> Option<usize> {
        self.robot.poll_transmit(now, out)
    }

    fn poll_timeout(&self) -> Option<Duration> {
        self.robot.poll_timeout()
    }

    fn statistics(&self) -> RobotStatistics {
        self.robot.statistics()
    }
}
