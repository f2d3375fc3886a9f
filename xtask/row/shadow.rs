//! A host and a device, as their messages show them.

use anyhow::Result;

use crate::shadow::{LineEvent, Report, Setup, Shadow};

pub(super) fn shadow(_setup: &Setup<'_>) -> Result<Box<dyn Shadow>> {
    Ok(Box::new(RequestState::Unknown))
}

/// Whether there was a request.
#[derive(PartialEq)]
enum RequestState {
    /// There may have been one before.
    Unknown,
    Never,
    Once,
}

impl Shadow for RequestState {
    fn see(&mut self, seen: &LineEvent<'_>, report: &mut Report<'_>) {
        match *seen {
            LineEvent::Opened => *self = Self::Never,
            LineEvent::Closed | LineEvent::Missed { .. } => *self = Self::Unknown,
            LineEvent::Message { from: "host", .. } => *self = Self::Once,
            LineEvent::Message { from, .. } if *self == Self::Never => {
                report.rule(from, "XX-6", "an unsolicited reply");
            }
            LineEvent::Message { .. } | LineEvent::Bytes { .. } | LineEvent::Corrupt { .. } => {}
        }
    }

    fn pass(&mut self, _: &mut Report<'_>) {}

    fn state(&self) -> String {
        match self {
            Self::Unknown => "the state is not known yet",
            Self::Never => "unsolicited",
            Self::Once => "the host has asked",
        }
        .into()
    }
}
