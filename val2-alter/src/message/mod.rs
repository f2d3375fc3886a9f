//! Typed messages inside the envelope: [`RobotMessage`] one way, [`HostMessage`] the other.

mod codes;
mod host;
#[cfg(feature = "serde")]
mod json;
mod mode;
mod robot;
mod side;
mod transform;

pub use codes::{ErrorCode, Exception, SegmentStatus, StartCode};
pub(crate) use host::ALL;
pub use host::{AXES, HostMessage, Reply};
pub use mode::{Accumulation, CoordinateFrame, Mode, Polarity};
pub use robot::{End, List, Motion, MotionPhase, RobotMessage, Start};
pub use side::{Framed, Message};
pub use transform::Transform;
