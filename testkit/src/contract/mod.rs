//! What `robot-session` promises, checked for any decoder and any session.
//!
//! Each function panics at the first broken rule, with what led there.

mod decoder;
mod session;

pub use decoder::{Item, decode, decoder, decoder_where};
pub use session::{End, session};
