//! The PC's end: it answers.

mod config;
mod event;
pub mod machine;
mod reports;
mod session;
mod source;
mod state;

#[doc(hidden)]
pub use config::Rule;
pub use config::{PcConfig, Takeover};
pub use event::PcEvent;
pub use session::{LargePc, Pc};
pub use source::{JobSource, Supply};
pub use state::CommandOutcome;
