//! Modbus TCP and RTU, both ends, and what FANUC's *HMI Device Communication* says over it.

#![no_std]
#![forbid(unsafe_code)]

pub mod block;
pub mod typed;

pub use block::TelemetryBlock;
pub use typed::WordOrder;
