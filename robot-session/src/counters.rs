//! The counters of a session.

use core::fmt::Debug;

/// The counters of an end: those of its link, and two of the loop of every session. [`counters!`](crate::counters!) defines
/// them.
pub trait Counters: Copy + Default + Debug + PartialEq {
    /// Inputs that the machine's state did not allow.
    fn unexpected(&mut self) -> &mut u64;

    /// Notices dropped because the event queue was full.
    fn dropped_notices(&mut self) -> &mut u64;
}

/// Defines the counters of an end: the listed ones, and the two of the loop of every session. The crate has the features
/// `defmt` and `serde`.
///
/// ```
/// robot_session::counters! {
///     /// Counters of a host.
///     pub struct HostStatistics {
///         /// Polls sent.
///         pub polls: u64,
///     }
/// }
///
/// assert_eq!(HostStatistics::default().unexpected, 0);
/// ```
#[macro_export]
macro_rules! counters {
    ($(#[$about:meta])* pub struct $counters:ident { $($(#[$doc:meta])* pub $field:ident: $type:ty,)* }) => {
        $(#[$about])*
        #[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
        #[cfg_attr(feature = "defmt", derive(defmt::Format))]
        #[cfg_attr(feature = "serde", derive(serde::Serialize))]
        #[non_exhaustive]
        pub struct $counters {
            $($(#[$doc])* pub $field: $type,)*
            /// Inputs that the state does not allow.
            pub unexpected: u64,
            /// Notices dropped because the event queue was full.
            pub dropped_notices: u64,
        }

        impl $crate::end::Counters for $counters {
            fn unexpected(&mut self) -> &mut u64 {
                &mut self.unexpected
            }

            fn dropped_notices(&mut self) -> &mut u64 {
                &mut self.dropped_notices
            }
        }
    };
}
