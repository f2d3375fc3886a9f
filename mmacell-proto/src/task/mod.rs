//! The pick-and-place task of §6: a vacuum gripper takes parts where camera 1 sees them and puts them where camera 2 sees
//! their place, with a vacuum switch that tells whether a part hangs on the gripper.
//!
//! [`Step`] is the table, 21 steps of the source and what surrounds them; [`Task`] runs it.

mod channel;
mod engine;
mod event;
mod step;

pub use engine::{Config, Task};
pub use event::{Device, Event, Failure, Output};
pub use step::{Step, Trigger};
