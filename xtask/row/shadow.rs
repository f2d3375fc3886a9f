//! A host and a device, as their messages show them.

use anyhow::Result;

use crate::shadow::{Report, Seen, Setup, Shadow};

pub(super) fn shadow(_setup: &Setup<'_>) -> Result<Box<dyn Shadow>> {
    Ok(Box::new(Asked::Unknown))
}

/// Whether there was a request.
#[derive(PartialEq)]
enum Asked {
    /// There may have been one before.
    Unknown,
    Never,
    Once,
}

impl Shadow for Asked {
    fn see(&mut self, seen: &Seen<'_>, report: &mut Report<'_>) {
        match *seen {
            Seen::Opened => *self = Self::Never,
            Seen::Closed | Seen::Missed { .. } => *self = Self::Unknown,
            Seen::Message { from: "host", .. } => *self = Self::Once,
            Seen::Message { from, .. } if *self == Self::Never => {
                report.rule(from, "XX-6", "an unsolicited reply");
            }
            Seen::Message { .. } | Seen::Bytes { .. } | Seen::Corrupt { .. } => {}
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
