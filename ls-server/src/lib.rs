#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

mod answer;
mod answers;
mod document;
mod edits;
mod files;
mod folder;
mod index;
mod listing;
mod position;
mod requests;
mod server;
mod uri;
mod wire;

#[cfg(test)]
mod tests;

pub use answers::code;
pub use files::Walk;
pub use server::{Options, Simulate, serve};
pub use uri::of_path as uri;
