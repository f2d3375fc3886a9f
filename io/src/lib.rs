#![doc = include_str!("../README.md")]
#![allow(clippy::std_instead_of_core, reason = "it is for programs with std")]

pub mod backoff;
#[cfg(feature = "progress")]
pub mod bar;
pub mod bell;
pub mod clock;
pub mod drive;
pub mod endpoint;
pub mod files;
pub mod input;
pub mod interrupt;
pub mod latency;
mod limiter;
pub mod manual;
#[cfg(unix)]
pub mod marked_port;
mod outlet;
pub mod output;
pub mod plain;
pub mod port;
pub mod ports;
pub mod serial;
pub mod stream;
pub mod tcp;
pub mod tls;
pub mod trace;
pub mod udp;
#[cfg(windows)]
pub mod windows;
