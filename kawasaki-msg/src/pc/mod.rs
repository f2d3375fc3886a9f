//! The PC's end: it answers.

mod config;
mod event;
mod machine;
mod reports;
mod session;
mod source;
mod state;

#[doc(hidden)]
pub use config::Rule;
pub use config::{Config, PcConfig, Takeover};
pub use event::PcEvent;
pub use session::{LargePc, Pc};
pub use source::{JobSource, Supply};
pub use state::{
    Action, Answer, CommandOutcome, Commands, Contents, Count, Input, Known, Link, Machine, Order, Outcome,
    Rejection, Reply, Report, Rest, Sent, Stage, Start,
};
