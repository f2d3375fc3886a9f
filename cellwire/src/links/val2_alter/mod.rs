//! val2-alter in the tool: its codec, the simulated robot and the simulated graphics workstation.

mod codec;
mod demo;
mod plot;
pub mod puma;
pub mod workstation;

pub use codec::codec;
pub use demo::demo;
