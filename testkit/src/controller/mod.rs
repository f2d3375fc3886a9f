//! A Kawasaki robot as the tests use it: the session in Rust with its queue, or a controller with the AS program in it.

mod interpreted;
mod native;

use core::time::Duration;

use kawasaki_msg::robot_session::Session;
use kawasaki_msg::{Bounds, Job, Line, Phase, RobotConfig, RobotEvent, SessionError};

pub use interpreted::AsRobot;
pub use native::Native;

/// A robot: its communication task is a session, its motion task is driven by the test.
pub trait Controller: Session<Event = RobotEvent> + Sized {
    /// Whether its jobs may overtake one another, and it works over datagrams.
    const WHOLE: bool;

    /// Creates a controller that was just switched on. Open choices (the task that runs first) follow from `seed`.
    fn begin(config: RobotConfig, capacity: usize, seed: u64) -> Self {
        Self::within(Bounds::WIDEST, config, capacity, seed)
    }

    /// Creates the same controller, with coordinates within `bounds`.
    fn within(bounds: Bounds, config: RobotConfig, capacity: usize, seed: u64) -> Self;

    /// Executes the motion task's next job, or the last waiting one if jobs may overtake one another.
    fn execute(&mut self, now: Duration, overtakes: bool) -> Option<Job<Line>>;

    /// Reports the executed jobs to the communication task.
    fn report(&mut self, now: Duration);

    /// Returns whether a job waits for the motion task.
    fn has_jobs(&self) -> bool;

    /// Performs the first reset.
    ///
    /// # Errors
    /// As [`Robot::clear_queue`](kawasaki_msg::Robot::clear_queue).
    fn clear_queue(&mut self) -> Result<(), SessionError>;

    /// Performs the second reset.
    ///
    /// # Errors
    /// As [`Robot::reset_order`](kawasaki_msg::Robot::reset_order).
    fn reset_order(&mut self) -> Result<(), SessionError>;

    /// Returns the phase of the order.
    fn phase(&self) -> Phase;

    /// Returns the number of jobs of the order, or of the last one, that were queued.
    fn queued(&self) -> u32;

    /// Returns the number of these jobs that are executed.
    fn executed(&self) -> u32;

    /// Returns the active order.
    fn order(&self) -> Option<u16>;
}
