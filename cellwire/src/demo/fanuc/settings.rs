//! The settings of the demo.

use core::ops::RangeInclusive;
use std::time::Duration;

use fanuc_hmi_modbus::{ClientConfig, ServerConfig, WordOrder};

use cellwire_links::fanuc_hmi_modbus::{ClientSettings, word_order};
use cellwire_links::settings::{Configure, FieldVisitor};
use cellwire_sim::fanuc::PERIOD;

/// The times from one request to the next.
const POLL: RangeInclusive<Duration> = Duration::from_millis(1)..=Duration::from_secs(60);

/// The settings of the demo.
#[derive(Debug)]
pub struct Settings {
    pub(super) poll: Duration,
    pub(super) word_order: WordOrder,
    pub(super) client: ClientConfig,
    pub(super) server: ServerConfig,
}

impl Default for Settings {
    fn default() -> Self {
        let (client, server) = (ClientConfig::tcp(), ServerConfig::tcp());
        Self { poll: PERIOD, word_order: WordOrder::default(), client, server }
    }
}

impl Configure for Settings {
    fn configure(&mut self, fields: &mut impl FieldVisitor) {
        let Self { poll, word_order: order, client, server } = self;
        fields.time("poll", POLL, "the time between requests", poll);
        word_order(fields, order);
        fields.group("client", |fields| ClientSettings(client).configure(fields));
        fields.group("server", |fields| {
            fields.without(&["framing"], |fields| server.configure(fields));
        });
    }
}
