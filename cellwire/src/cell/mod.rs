//! Scenarios: simulated devices and clients put together, with what is measured and drawn.

pub mod demo;
mod fine;
pub mod operator;
pub mod report;
pub mod run;
pub mod telemetry;
pub mod teleop;
