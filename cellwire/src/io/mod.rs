//! Captures, drawings, journals, the times of a serial line, and the hosts of simulated devices.

pub mod capture;
pub mod drawing;
pub mod journal;
pub mod line;
pub mod priority;
pub mod samples;
pub mod sheet;
pub mod table;
pub mod tap;
pub mod terminal;
