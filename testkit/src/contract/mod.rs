//! Decoders and ends of the table in the form that [`robot_session::contract`] tests.

mod change;
#[cfg(feature = "contract")]
mod held;
#[cfg(feature = "contract")]
mod objects;
#[cfg(feature = "contract")]
mod open;
#[cfg(feature = "contract")]
mod tabled;

pub use change::Change;
#[cfg(feature = "contract")]
pub use held::{Call, Held, Piece, Story};
#[cfg(feature = "contract")]
pub use objects::Objects;
