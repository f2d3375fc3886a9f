//! A Kawasaki robot: it connects to its PC, queues that PC's jobs, and executes one job after the other.

use core::fmt;
use core::time::Duration;
use std::sync::Arc;

use kawasaki_msg::{Job, LargeRobot, RobotConfig, RobotEvent, Work};
use robot_session::Session as _;
use robot_work_queue::{Reader, boxed};

use crate::device::{Device, DeviceRecord, Error};
use crate::settings::Settings;

/// The execution time of a job.
pub type TimeOf<W> = Arc<dyn Fn(&W) -> Duration + Send + Sync>;

/// A Kawasaki robot's settings, for jobs of the type `W`.
#[derive(Clone)]
pub struct KawasakiRobot<W: Work> {
    /// The configuration of the session.
    pub config: RobotConfig,
    /// The ranges of a job's fields.
    pub ranges: W::Ranges,
    /// The capacity of the queue in jobs: less than the configuration's `max_number`.
    pub queue: usize,
    /// The execution time of a job.
    pub job_time: Duration,
    /// The execution time of each job; `None` if all take `job_time`.
    pub time_of: Option<TimeOf<W>>,
}

impl<W: Work> fmt::Debug for KawasakiRobot<W> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { config, ranges, queue, job_time, time_of: _ } = self;
        let mut shown = f.debug_struct("KawasakiRobot");
        shown.field("config", config).field("ranges", ranges).field("queue", queue);
        shown.field("job_time", job_time).finish_non_exhaustive()
    }
}

impl<W: Work> Default for KawasakiRobot<W> {
    /// Returns the settings over TCP, with a queue of 256 jobs of 1 s each.
    fn default() -> Self {
        let (config, ranges) = (RobotConfig::tcp(), W::Ranges::default());
        Self { config, ranges, queue: 256, job_time: Duration::from_secs(1), time_of: None }
    }
}

impl<W: Work + fmt::Debug + Send + 'static> Settings for KawasakiRobot<W> {
    type Device = Kawasaki<W>;

    fn device(&self) -> Result<Kawasaki<W>, Error> {
        Kawasaki::new(self.clone())
    }
}

/// A Kawasaki robot.
#[derive(Debug)]
pub struct Kawasaki<W: Work> {
    settings: KawasakiRobot<W>,
    session: LargeRobot<'static, W>,
    queue: Reader<'static, Job<W>>,
    /// The job in execution: its number, the job, and the time of its end.
    executing: Option<(u16, Job<W>, Duration)>,
}

impl<W: Work + fmt::Debug + Send + 'static> Kawasaki<W> {
    /// Creates a robot without an order.
    ///
    /// # Errors
    /// Settings that cannot work.
    pub fn new(settings: KawasakiRobot<W>) -> Result<Self, Error> {
        let KawasakiRobot { config, ranges, queue, .. } = &settings;
        let (writer, queue) = boxed(*queue, config.max_number).map_err(Error::settings)?;
        let session = LargeRobot::with_ranges(*config, writer, ranges.clone()).map_err(Error::settings)?;
        Ok(Self { settings, session, queue, executing: None })
    }

    /// Returns the number of jobs that it holds, including the one being executed.
    pub fn held(&self) -> usize {
        self.queue.len()
    }

    fn time_of(&self, work: &W) -> Duration {
        self.settings.time_of.as_ref().map_or(self.settings.job_time, |time_of| time_of(work))
    }
}

impl<W: Work + fmt::Debug + Send + 'static> Device for Kawasaki<W> {
    type Session = LargeRobot<'static, W>;
    type Event = RobotEvent;
    type Work = Job<W>;
    const IS_CLIENT: bool = true;

    fn session(&self) -> &Self::Session {
        &self.session
    }

    fn session_mut(&mut self) -> &mut Self::Session {
        &mut self.session
    }

    fn take(&mut self, _: Duration, event: RobotEvent, notes: &mut DeviceRecord<RobotEvent, Job<W>>) {
        match event {
            RobotEvent::Connect => notes.connect(),
            RobotEvent::Disconnect => notes.close("the PC is silent"),
            _ => {}
        }
        notes.event(event);
    }

    fn advance(&mut self, now: Duration, notes: &mut DeviceRecord<RobotEvent, Job<W>>) {
        let mut begins = now;
        loop {
            if let Some((number, job, end)) = self.executing.take_if(|(_, _, end)| *end <= now) {
                notes.executed(end, job);
                begins = end;
                // An order that was dropped meanwhile needs no report.
                let _ = self.session.job_done(now, job.number);
                // Reported before it is complete, the job is never requested again. A reset has discarded it already.
                if let Some(taken) = self.queue.take_where(|waiting, _| waiting == number) {
                    taken.complete();
                }
                self.session.handle_timeout(now);
            }
            if self.executing.is_some() {
                return;
            }
            let Some((number, job)) = self.queue.iter().next() else {
                // It sees that the queue was emptied.
                let _ = self.queue.take_where(|_, _| false);
                return;
            };
            self.executing = Some((number, *job, begins.saturating_add(self.time_of(&job.work))));
        }
    }

    fn due(&self) -> Option<Duration> {
        self.executing.as_ref().map(|(_, _, end)| *end)
    }

    /// Restarts the robot: it has no order.
    fn restart(&mut self, _: Duration) {
        // The same settings have worked before.
        if let Ok(robot) = Self::new(self.settings.clone()) {
            *self = robot;
        }
    }

    /// Drops the order, as an operator does; the job that is being executed is done.
    fn forget(&mut self, _: Duration) {
        // Without an order there is nothing to drop.
        let _ = self.session.reset_order();
    }
}
