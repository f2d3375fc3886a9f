//! A client's requests, as its machine knows them.

use core::time::Duration;

use super::config::{ClientConfig, Rule};

/// A request and the place that holds its bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Held {
    /// The place, below `N`.
    pub place: u8,
    /// How far it is.
    pub stage: Stage,
}

/// How far a request is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Stage {
    /// It waits to be sent to one unit.
    Queued {
        /// Its reply can equal it.
        mirrored: bool,
    },
    /// It waits to be sent to all units.
    QueuedBroadcast,
    /// Before it a read was sent, whose reply shows that a device answers on the line.
    Probing {
        /// When that times out.
        deadline: Duration,
        /// Something corrupt has come since it was sent.
        doubtful: bool,
    },
    /// It was sent, and waits for its reply.
    InFlight {
        /// Its transaction; 0 where frames have none.
        transaction: u16,
        /// When it times out.
        deadline: Duration,
        /// Something corrupt has come since it was sent, and frames have no transaction.
        doubtful: bool,
        /// A frame that equals it has come on a line that is not proven: the line may have returned it.
        returned: bool,
    },
    /// It has its outcome, which the caller has not taken yet.
    Ended,
    /// The same, and its reply may still come.
    TimedOut {
        /// Its transaction.
        transaction: u16,
    },
    /// The caller has taken the outcome, and the reply may still come. The place may be used again.
    Expired {
        /// Its transaction.
        transaction: u16,
    },
}

impl Held {
    /// When it times out.
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

    /// Whether it waits to be sent.
    pub(super) const fn is_queued(&self) -> bool {
        matches!(self.stage, Stage::Queued { .. } | Stage::QueuedBroadcast)
    }

    /// Whether it is in flight, or the read before it.
    pub(super) const fn is_in_flight(&self) -> bool {
        matches!(self.stage, Stage::Probing { .. } | Stage::InFlight { .. })
    }

    /// Whether it, or the read before it, is in flight, and a frame with this transaction belongs to it.
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

/// The first transaction from `next` on that no request has whose reply may still come.
pub(super) fn free_transaction(requests: &[Option<Held>], next: u16, config: &ClientConfig) -> u16 {
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
