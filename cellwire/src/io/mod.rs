//! Transports, the times of a serial line, captures, files, signals.

pub mod backoff;
pub mod bell;
pub mod capture;
pub mod drawing;
pub mod drive;
pub mod files;
pub mod input;
pub mod interrupt;
pub mod journal;
pub mod latency;
mod limiter;
pub mod line;
#[cfg(unix)]
pub mod marked;
mod outlet;
pub mod output;
pub mod pauses;
pub mod plain;
pub mod port;
pub mod ports;
pub mod priority;
pub mod samples;
pub mod serial;
pub mod sheet;
pub mod stream;
pub mod tap;
pub mod tcp;
pub mod terminal;
pub mod trace;
pub mod udp;
#[cfg(windows)]
pub mod windows;
