//! A client's requests in the machine's state.

use core::time::Duration;

use super::config::{ClientConfig, Rule};

/// A request and the slot of its bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct RequestState {
    /// The slot of the request, from 0, below `N`.
    pub slot: u8,
    /// The stage of the request.
    pub stage: Stage,
}

/// The stage of a request.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Stage {
    /// The request waits to be sent to one unit.
    Queued {
        /// Whether the reply can equal the request.
        mirrored: bool,
    },
    /// The request waits to be sent to all units.
    QueuedBroadcast,
    /// A read was sent before the request; its reply shows that a device answers on the line.
    Probing {
        /// The time at which that read times out.
        deadline: Duration,
        /// Whether corrupt bytes have come since the read was sent.
        doubtful: bool,
    },
    /// The request was sent, and waits for its reply.
    InFlight {
        /// The transaction of the request; 0 if frames have no transaction.
        transaction: u16,
        /// The time at which the request times out.
        deadline: Duration,
        /// Whether corrupt bytes have come since the request was sent, and frames have no transaction.
        doubtful: bool,
        /// Whether a frame that equals the request has come on a line that is not proven: the line may have returned it.
        returned: bool,
    },
    /// The request has its outcome, which the caller has not polled yet.
    Ended,
    /// As `Ended`, and the reply may still come.
    TimedOut {
        /// The transaction of the request.
        transaction: u16,
    },
    /// The caller has polled the outcome, and the reply may still come. The slot may be used again.
    Expired {
        /// The transaction of the request.
        transaction: u16,
    },
}

impl RequestState {
    /// Returns the time at which the request, or the read before it, times out.
    pub(super) const fn deadline(&self) -> Option<Duration> {
        match self.stage {
            Stage::Probing { deadline, .. } | Stage::InFlight { deadline, .. } => Some(deadline),
            Stage::Queued { .. }
            | Stage::QueuedBroadcast
            | Stage::Ended
            | Stage::TimedOut { .. }
            | Stage::Expired { .. } => None,
        }
    }

    /// Returns whether the request waits to be sent.
    pub(super) const fn is_queued(&self) -> bool {
        matches!(self.stage, Stage::Queued { .. } | Stage::QueuedBroadcast)
    }

    /// Returns whether the request, or the read before it, is in flight.
    pub(super) const fn is_in_flight(&self) -> bool {
        matches!(self.stage, Stage::Probing { .. } | Stage::InFlight { .. })
    }

    /// Returns whether the request, or the read before it, is in flight, and a frame with this transaction belongs to it.
    pub(super) fn waits(&self, transaction: u16, config: &ClientConfig) -> bool {
        match self.stage {
            Stage::Probing { .. } => true,
            Stage::InFlight { transaction: found, .. } => {
                found == transaction || !config.keeps(Rule::MatchTransaction)
            }
            _ => false,
        }
    }
}

/// Returns the first transaction from `next` on that no request has whose reply may still come.
pub(super) fn free_transaction(requests: &[Option<RequestState>], next: u16, config: &ClientConfig) -> u16 {
    let in_use = |transaction: u16| {
        requests.iter().map_while(Option::as_ref).any(|held| match held.stage {
            Stage::InFlight { transaction: found, .. }
            | Stage::TimedOut { transaction: found }
            | Stage::Expired { transaction: found } => found == transaction,
            Stage::Queued { .. } | Stage::QueuedBroadcast | Stage::Probing { .. } | Stage::Ended => false,
        })
    };
    let mut transaction = next;
    for _ in requests {
        if !config.keeps(Rule::FreshTransaction) || !in_use(transaction) {
            break;
        }
        transaction = config.after(transaction);
    }
    transaction
}
