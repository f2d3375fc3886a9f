#![doc = include_str!("../README.md")]
#![no_std]
#![forbid(unsafe_code)]

mod controller;
mod decoder;
mod error;
mod frame;
mod framing;
mod host;
mod limit;
mod message;
mod scale;
pub mod timing;

pub use controller::{
    Controller, ControllerConfig, ControllerEvent, ControllerState, ControllerStatistics, Unselected,
};
pub use decoder::{Decoder, Received};
pub use error::{ConfigError, DecodeError, EncodeError, SessionError};
pub use frame::Frame;
pub use framing::{DLE, ETX, Framing, LeadingDle, LeadingDleError, STX};
pub use host::{
    ExceptionOutcome, Host, HostConfig, HostEvent, HostState, HostStatistics, LostReason, Policy,
    UnknownReason,
};
pub use limit::{Limiter, Limits};
pub use message::*;
pub use robot_session;
pub use scale::Scale;

/// The machines of both ends: pure, without bytes. For those who look into a session, and for the model that proves the pair.
pub mod machine {
    #[doc(hidden)]
    pub use crate::controller::ControllerRule;
    pub use crate::controller::{
        Alter, ControllerActions, ControllerInput, ControllerMachine, ControllerPhase, Handling, Outgoing,
        Progress, StartOutcome, Taken, Turn,
    };
    #[doc(hidden)]
    pub use crate::host::HostRule;
    pub use crate::host::{
        Active, Answer, Course, Draft, Due, HostActions, HostInput, HostMachine, HostPhase, Pending, Request,
        Stage, Target, Wanted,
    };
}
