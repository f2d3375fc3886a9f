//! The contents of the envelope: requests and replies (MODBUS Application Protocol V1.1b3, section 6).

mod buffer;
mod data;
mod exception;
pub mod function;
mod identification;
pub mod limit;
mod pdu;
mod records;
mod reply;
mod request;
mod wire;

pub use buffer::PduBuf;
pub use data::{Bits, BitsMut, Words, WordsMut};
pub use exception::Exception;
pub(crate) use identification::HEAD;
pub use identification::{DeviceIdentification, DeviceObjects};
pub use pdu::Pdu;
#[cfg(any(feature = "arbitrary", feature = "serde"))]
pub(crate) use records::Group;
pub use records::{FileRange, FileRecord, Records};
pub use reply::Reply;
pub use request::Request;
pub(crate) use wire::run;
