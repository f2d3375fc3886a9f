//! The PC's end: it answers.

mod config;
mod event;
mod machine;
mod packet;
mod reports;
mod session;
mod source;
mod state;

#[doc(hidden)]
pub use config::PcRule;
pub use config::{PcConfig, Takeover};
pub use event::PcEvent;
pub use machine::Answer;
pub use session::{LargePc, Pc};
pub use source::{JobSource, Supply};
pub use state::{
    Action, CommandOutcome, Commands, Contents, Count, Input, JobSent, Known, Link, Machine, Order, Outcome,
    Rejection, Reply, Report, Stage, Start,
};
