//! What the connection to the broker reports to the hub.

use crate::payload::Payload;

/// What something that has happened means for the hub.
#[derive(Debug)]
pub enum Event {
    /// Nothing.
    None,
    /// The broker has accepted the connection.
    Opened,
    /// The broker has accepted the subscriptions.
    Connected,
    /// The connection is over, and why.
    Lost(String),
    /// The records of the cell of this place are held: the broker refuses its topic, and why.
    Held {
        /// The cell.
        place: usize,
        /// Why.
        why: String,
    },
    /// They are published now.
    Released(usize),
    /// All births follow once more.
    Rebirth,
    /// Metrics of a cell are to be written.
    Write {
        /// The cell.
        device: String,
        /// The metrics.
        payload: Payload,
        /// Why it is no command that may be obeyed, if it is none.
        unfit: Option<String>,
    },
    /// What a bridge says of shared cells, also this one.
    Share {
        /// The topic after `cellwire/GROUP/`.
        from: String,
        /// Whether the broker has stored it.
        is_retained: bool,
        /// What it says.
        payload: Vec<u8>,
    },
    /// Nothing that is understood, and why.
    Strange(String),
}
