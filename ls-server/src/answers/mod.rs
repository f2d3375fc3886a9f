//! The answers to requests, a file each: functions of a folder and the request's parameters.

pub(crate) mod completion;
pub(crate) mod diagnostics;
pub(crate) mod hover;
pub(crate) mod symbols;

pub use diagnostics::code;
