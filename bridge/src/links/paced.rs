//! Settings of a link whose device reports faster than any subscriber reads.

use std::time::Duration;

use super::client::Silence;
use cellwire_links::settings::{Configure, FieldVisitor};

/// The settings of a cell: the shortest time between reports, the silence, and those of the session.
#[derive(Debug, Clone)]
pub(super) struct Paced<C> {
    pub report: Duration,
    pub silence: Duration,
    pub session: C,
}

impl<C: Configure> Configure for Paced<C> {
    fn configure(&mut self, fields: &mut impl FieldVisitor) {
        let Self { report, silence, session } = self;
        let range = Duration::ZERO..=Duration::from_secs(3600);
        fields.time("report", range, "the shortest time between reports", report);
        Silence::configure(fields, silence);
        session.configure(fields);
    }
}
