//! Decoders and ends of the table in the form that [`robot_session::contract`] tests.

mod change;
#[cfg(feature = "contract")]
mod objects;
#[cfg(feature = "contract")]
mod open;
#[cfg(feature = "contract")]
mod tabled;
#[cfg(feature = "contract")]
mod tested_end;

pub use change::Change;
#[cfg(feature = "contract")]
pub use objects::Objects;
#[cfg(feature = "contract")]
pub use tested_end::{Call, Piece, Story, TestedEnd};
