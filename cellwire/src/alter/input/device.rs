//! The common parts of all inputs.

use std::time::Duration;

use crate::alter::sample::Sample;

/// An event of an input.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::alter) enum InputEvent {
    /// New values.
    Sample(Sample),
    /// The last values are too old.
    Old,
    /// The device is gone.
    Lost,
}

/// An input of six axes and some buttons, whose values have an age.
pub(in crate::alter) trait Input: Send {
    /// Waits for the next events, no longer than `wait`. A device that is gone is searched for again, without a longer wait.
    fn poll(&mut self, wait: Duration, events: &mut Vec<InputEvent>);

    /// Called when the host ends.
    fn end(&mut self) {}
}
