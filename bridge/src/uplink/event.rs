//! The events of the connection to the broker, for the hub.

use crate::payload::Payload;

/// An event of the connection to the broker, as the hub handles it.
#[derive(Debug)]
pub enum Event {
    /// The hub has nothing to do.
    None,
    /// The broker has accepted the connection.
    Opened,
    /// The broker has accepted the subscriptions.
    Connected,
    /// The connection is over; the reason.
    Lost(String),
    /// The records of a cell are held, because the broker refuses its topic.
    Held {
        /// The index of the cell.
        place: usize,
        /// The reason of the refusal, for the log.
        why: String,
    },
    /// The records of the cell of this index are published now.
    Released(usize),
    /// All births follow once more.
    Rebirth,
    /// Metrics of a cell are to be written.
    Write {
        /// The device, which is the name of a cell.
        device: String,
        /// The metrics to write, as the message has them.
        payload: Payload,
        /// The reason to refuse the command; `None` if there is no such reason.
        unfit: Option<String>,
    },
    /// A message about shared cells, from another bridge or from this one.
    Share {
        /// The part of the topic after `cellwire/GROUP/`.
        from: String,
        /// Whether the broker has stored it.
        is_retained: bool,
        /// The content of the message.
        payload: Vec<u8>,
    },
    /// The message is not understood; the reason.
    Malformed(String),
}
