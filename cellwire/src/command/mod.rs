//! The commands: arguments, help, and output.

pub mod alter;
pub mod capture;
pub mod certificates;
mod codec;
mod compare;
pub mod decode;
pub mod demo;
pub mod encode;
pub mod extcap;
pub mod fanuc;
pub mod identify;
pub mod ls;
pub mod modbus;
pub mod ports;
mod recorded;
pub mod replay;
pub mod run;
pub mod settings;
pub mod simulate;
mod source;
pub mod tap;
pub mod vectors;
