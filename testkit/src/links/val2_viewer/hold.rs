//! The effects of XOFF and XON on an end.

/// The ticks for which an XOFF holds an end.
pub(super) const MAX_HOLD: u8 = 2;

pub(super) const HELD: &str = "nothing is sent between XOFF and XON, unless a report says that no XON came";
pub(super) const RESUMED: &str = "XON and a new connection end a hold";

/// Ticks since the last XOFF; `None` if XON came since, a connection was made, or it was reported that no XON came.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Hold(pub(super) Option<u8>);

impl Hold {
    /// Returns the property that a transmission now violates.
    pub(super) fn sent(self) -> Option<&'static str> {
        self.0.map(|_| HELD)
    }

    /// Records a report that no XON came; returns the violated property.
    pub(super) fn ended(&mut self) -> Option<&'static str> {
        match self.0.take() {
            Some(MAX_HOLD) => None,
            Some(_) => Some(HELD),
            None => Some(RESUMED),
        }
    }

    pub(super) fn tick(&mut self) {
        if let Some(ticks) = &mut self.0 {
            *ticks = (*ticks + 1).min(MAX_HOLD);
        }
    }
}
