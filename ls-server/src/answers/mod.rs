//! The answers to requests, a file each: functions of a folder and the request's parameters.

pub(crate) mod actions;
pub(crate) mod calls;
pub(crate) mod completion;
pub(crate) mod diagnostics;
pub(crate) mod folding;
pub(crate) mod format;
pub(crate) mod hover;
pub(crate) mod inlay;
pub(crate) mod places;
pub(crate) mod rename;
pub(crate) mod symbols;
pub(crate) mod target;
pub(crate) mod tokens;

pub use diagnostics::code;
