//! The session in Rust.

use core::ops::{Deref, DerefMut};
use core::time::Duration;

use kawasaki_msg::robot::machine::{Action, DuePacket, Input, Machine};
use kawasaki_msg::robot_session::Unexpected;
use kawasaki_msg::robot_session::end::{CoreOf, End, QueueSpace};
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

impl End for Native {
    type Machine = Machine;
    type Decoder = <LargeRobot<'static, Line> as End>::Decoder;
    type Events = <LargeRobot<'static, Line> as End>::Events;
    type Statistics = RobotStatistics;
    type Payload = ();

    const LINK: &'static str = <LargeRobot<'static, Line> as End>::LINK;
    const END: &'static str = <LargeRobot<'static, Line> as End>::END;
    const MAX_INPUT: usize = <LargeRobot<'static, Line> as End>::MAX_INPUT;
    const MAX_TRANSMIT: usize = <LargeRobot<'static, Line> as End>::MAX_TRANSMIT;
    const QUEUE_SPACE: QueueSpace = <LargeRobot<'static, Line> as End>::QUEUE_SPACE;

    fn core(&self) -> &CoreOf<Self> {
        self.robot.core()
    }

    fn core_mut(&mut self) -> &mut CoreOf<Self> {
        self.robot.core_mut()
    }

    fn begin_input(&mut self, now: Duration) -> bool {
        self.robot.begin_input(now)
    }

    fn end_input(&mut self, now: Duration) {
        self.robot.end_input(now);
    }

    /// An idle motion task checks its queue, which sweeps cleared jobs.
    fn look(&mut self, now: Duration) {
        _ = self.reader.take();
        self.robot.look(now);
    }

    fn next_input(&mut self) -> Option<(Input, Option<()>)> {
        self.robot.next_input()
    }

    fn act(&mut self, now: Duration, action: Action, payload: Option<()>) {
        self.robot.act(now, action, payload);
    }

    fn write(&mut self, now: Duration, due: DuePacket, out: &mut [u8]) -> Option<(usize, Input)> {
        self.robot.write(now, due, out)
    }

    fn unexpected(unexpected: Unexpected) -> RobotEvent {
        <LargeRobot<'static, Line> as End>::unexpected(unexpected)
    }

    fn next_event(&mut self) -> Option<RobotEvent> {
        self.robot.next_event()
    }
}
