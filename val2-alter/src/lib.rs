//! Codec for VAL II ALTER.
#![no_std]
#![forbid(unsafe_code)]

#[cfg(feature = "tokio")]
extern crate std;

mod decoder;
mod error;
mod frame;
mod message;
mod pose;
mod scale;
mod transform;

pub use decoder::{Decoder, Received};
pub use error::{DecodeError, EncodeError, SessionError};
pub use frame::{DLE, ETX, Frame, Framing, LeadingDle, STX};
pub use message::*;
pub use pose::Pose;
pub use scale::Scale;
pub use transform::{Layout, Order, Transform};
