//! Tests that check any decoder and any session against the contracts of [`Decoder`](crate::Decoder) and
//! [`Session`](crate::Session).
//!
//! [`decoder`](fn@decoder) takes valid frames of a link; [`session`](fn@session) takes a [`Subject`]: the constructor of a
//! session, the inputs of its peer, and the calls of its user. Each function panics at the first broken rule, with the steps
//! that led there.
//!
//! ```
//! # use std::time::Duration;
//! # use robot_session::{Session, contract::{self, Subject}};
//! # #[derive(Debug)] enum Event { Received(u8) }
//! # struct Link(bool, Option<u8>);
//! # impl Session for Link {
//! #     type Event = Event;
//! #     type Statistics = ();
//! #     const MAX_INPUT: usize = 1;
//! #     const MAX_TRANSMIT: usize = 1;
//! #     fn handle_connected(&mut self, _: Duration) { *self = Link(true, None) }
//! #     fn handle_disconnected(&mut self, _: Duration) { *self = Link(false, None) }
//! #     fn handle_input(&mut self, _: Duration, bytes: &[u8]) { if self.0 { self.1 = bytes.first().copied() } }
//! #     fn wants_input(&self) -> bool { self.1.is_none() }
//! #     fn handle_timeout(&mut self, _: Duration) {}
//! #     fn poll_event(&mut self) -> Option<Event> { self.1.take().map(Event::Received) }
//! #     fn poll_transmit(&mut self, _: Duration, _: &mut [u8]) -> Option<usize> { None }
//! #     fn poll_timeout(&self) -> Option<Duration> { None }
//! #     fn statistics(&self) {}
//! # }
//! struct OfMyLink;
//!
//! impl Subject for OfMyLink {
//!     type Session = Link;
//!     type Input = u8; // any type that implements `arbitrary::Arbitrary`
//!     type Call = ();
//!
//!     fn session(&self, _configuration: usize, _is_endless: bool) -> Link {
//!         Link(false, None)
//!     }
//!
//!     fn input(&self, _: &Link, _configuration: usize, byte: &u8) -> Vec<u8> {
//!         vec![*byte]
//!     }
//! }
//!
//! contract::session(&OfMyLink, 100);
//! ```

#![allow(
    clippy::cast_possible_truncation,
    clippy::indexing_slicing,
    clippy::panic,
    clippy::unwrap_used,
    reason = "a test fails by a panic, and what it takes is its own"
)]

mod chunking;
mod decoder;
mod driven;
mod rng;
mod script;
mod session;
mod subject;

pub use chunking::{after_a_cut, chunkings};
pub use decoder::{Item, decode, decoder, decoder_where};
pub use rng::Rng;
pub use script::Script;
pub use session::{scripted, session};
pub use subject::{Observed, Subject};
