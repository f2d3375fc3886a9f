//! What `robot-session` promises, checked for any decoder and any session behind the table.
//!
//! Each function panics at the first broken rule, with what led there.

mod decoder;
#[cfg(feature = "links")]
mod session;

pub use decoder::{Item, decode, decoder, decoder_where};
#[cfg(feature = "links")]
pub use session::{Held, Story, session};
