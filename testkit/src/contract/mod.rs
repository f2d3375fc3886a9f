//! Decoders and ends of the table as what [`robot_session::contract`] holds to the contract.

mod change;
#[cfg(feature = "links")]
mod held;
#[cfg(feature = "links")]
mod objects;
#[cfg(feature = "links")]
mod open;
#[cfg(feature = "links")]
mod tabled;

pub use change::change;
#[cfg(feature = "links")]
pub use held::{Held, Story};
#[cfg(feature = "links")]
pub use objects::Objects;
