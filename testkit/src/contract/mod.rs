//! What `robot-session` promises, checked for any decoder and any session behind the table.
//!
//! Each function panics at the first broken rule, with what led there.

mod change;
mod decoder;
#[cfg(feature = "links")]
mod driven;
#[cfg(feature = "links")]
mod held;
#[cfg(feature = "links")]
mod objects;
#[cfg(feature = "links")]
mod open;
#[cfg(feature = "links")]
mod session;

pub use change::change;
pub use decoder::{Item, decode, decoder, decoder_where};
#[cfg(feature = "links")]
pub use objects::Objects;
#[cfg(feature = "links")]
pub use session::{Held, Story, scripted, session};
