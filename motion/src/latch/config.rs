use core::time::Duration;

/// The configuration of the latch.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LatchConfig {
    /// The time for which the hand must rest. Default: 0.3 s.
    pub rest: Duration,
    /// Whether a key must confirm as well. Default: no.
    ///
    /// It should be set if values are offsets from the path (non-cumulative ALTER): when armed, the arm leaves its held
    /// offset, and moves to that of the hand.
    pub confirm: bool,
    /// Whether the arm moves only while the hand holds a key: to let it go disarms. Default: no.
    pub hold_to_run: bool,
    /// The longest time of the end: coming to rest, and ending ALTER. Default: 1.5 s.
    pub end_within: Duration,
    /// The longest time until the controller reports the end of ALTER when no message is answered any more. Default:
    /// 0.15 s.
    pub farewell: Duration,
    /// The rules of the latch, all of which apply.
    #[cfg(feature = "model")]
    #[doc(hidden)]
    pub rules: robot_session::end::Rules<Rule>,
}

robot_session::rules! {
    /// The rules of the latch, without which an arm would move without a hand, or stop without a reason shown.
    pub enum Rule for LatchConfig {
        /// The hand has to rest before it moves the arm.
        Rest,
        /// A push restarts the rest.
        Uninterrupted,
        /// New values arm: time alone does not, for a push may have come that is not read yet.
        ByValues,
        /// Values that are not renewed disarm.
        Expire,
        /// Expired deadlines are handled before a late caller's input.
        TimeFirst,
        /// Old values move nothing, even before a late caller passes the time.
        FreshInUse,
        /// Values that are old when they arrive do not count.
        OldOnArrival,
        /// A start message disarms.
        Start,
        /// The end of ALTER disarms.
        Over,
        /// An interruption disarms.
        Interruption,
        /// An arm that the robot brakes or has stopped disarms.
        Halt,
        /// An input without new values disarms.
        OldValues,
        /// A lost input disarms.
        InputLost,
        /// Another meaning of the values disarms.
        Profile,
        /// The key that must be held disarms when it is let go.
        HoldToRun,
        /// A key must confirm, if [`LatchConfig::confirm`] is set.
        Confirm,
        /// Only a hand that has rested is confirmed.
        ConfirmRested,
        /// After a stop, nothing arms before ALTER is over.
        StopHolds,
        /// After an end, nothing arms.
        EndHolds,
        /// A stop is passed on in every state.
        PassOnStop,
        /// A stop is the cause until ALTER runs again.
        StopIsCause,
        /// The end does not wait for ALTER without end.
        EndInTime,
        /// When no message is answered any more, the end does not wait for long.
        Farewell,
        /// Every change of the latch is reported.
        Report,
    }
}

impl Default for LatchConfig {
    fn default() -> Self {
        Self {
            rest: Duration::from_millis(300),
            confirm: false,
            hold_to_run: false,
            end_within: Duration::from_millis(1500),
            farewell: Duration::from_millis(150),
            #[cfg(feature = "model")]
            rules: robot_session::end::Rules::ALL,
        }
    }
}
