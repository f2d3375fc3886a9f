//! val2-alter in the tool: its codec, the simulated robot and its arm.

mod arm;
mod codec;
mod demo;
mod layout;
mod plot;
mod pose;
pub mod puma;

pub use arm::ArmConfig;
pub use codec::codec;
pub use demo::demo;
pub use layout::{Layout, Order};
pub use pose::Pose;
