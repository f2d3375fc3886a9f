#![doc = include_str!("../README.md")]
#![no_std]
#![cfg_attr(docsrs, feature(doc_cfg))]
#![forbid(unsafe_code)]

mod channel;
mod config;
mod engine;
mod event;
mod output;
#[cfg(feature = "spec")]
mod spec;
mod step;

pub use config::TaskConfig;
pub use engine::Task;
pub use event::{Event, Failure, Fault};
pub use mmacell_proto;
pub use output::{Device, Output};
pub use step::{Step, Trigger};
