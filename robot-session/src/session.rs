//! One end of a link.

use core::time::Duration;

/// One end of a link, without a clock, a socket or a port.
///
/// After any `handle_…` or request of the caller: call [`poll_event`](Self::poll_event) and
/// [`poll_transmit`](Self::poll_transmit) until both return `None` ([`Steps`](crate::Steps) do it), then sleep until bytes
/// arrive or [`poll_timeout`](Self::poll_timeout) is reached. Other orders of calls lose nothing; calling too often or too
/// late affects only the protocol's own deadlines.
///
/// - **Time.** `now` is a [`Duration`] since an epoch that the caller chooses. It may jump or stop. All arithmetic
///   saturates, and `Duration::MAX` is legal everywhere: as a setting or a deadline it means never.
/// - **Connections.** A session begins without a connection. [`handle_connected`](Self::handle_connected) and
///   [`handle_disconnected`](Self::handle_disconnected) may come any number of times, on serial lines too: opening a port is
///   a connection. No state of a connection carries over to the next, except state that the machine preserves on purpose.
/// - **Input.** While [`wants_input`](Self::wants_input) is false, bytes stay in the transport, whose flow control stops the
///   sender. When it is true, [`handle_input`](Self::handle_input) takes up to [`MAX_INPUT`](Self::MAX_INPUT) bytes at once.
/// - **Wakes.** Nothing busy-waits. Other inputs of a session, such as the queue that a robot fills,
///   are read in [`handle_timeout`](Self::handle_timeout). The code that changes such an input wakes the caller,
///   which then calls it. The drivers have a `waker`: a turn ends when it is used, and the next one calls `handle_timeout`
///   at once.
/// - **Events.** An *outcome* (of a job, an order, a request, a connection) is never dropped. A *notice* (corrupt bytes,
///   unsolicited messages) can be: when the queue is full, the oldest is dropped and counted, see
///   [`EventQueue`](crate::end::EventQueue).
/// - **Statistics.** Counters, including one of inputs that the machine did not expect.
pub trait Session {
    /// An event of the session: small and owned, so that a handler may call the session.
    type Event: core::fmt::Debug;

    /// The counters of the session, since it was made.
    type Statistics: Copy + Default + core::fmt::Debug + PartialEq;

    /// The name of the session's link, for records of `tracing`.
    const LINK: &'static str = "";

    /// The name of the session's end of the link, for records of `tracing`.
    const END: &'static str = "";

    /// The maximum number of bytes for one [`handle_input`](Self::handle_input): the length of a driver's buffer.
    const MAX_INPUT: usize;

    /// The maximum number of bytes that one [`poll_transmit`](Self::poll_transmit) writes.
    const MAX_TRANSMIT: usize;

    /// Called when a connection was made, or the port was opened.
    fn handle_connected(&mut self, now: Duration);

    /// Called when the connection is lost or closed.
    fn handle_disconnected(&mut self, now: Duration);

    /// Takes all bytes that have arrived, up to [`MAX_INPUT`](Self::MAX_INPUT) while [`wants_input`](Self::wants_input) is
    /// true. A session that stops reading can lose some of a longer input, and reports that. On a datagram transport the
    /// bytes are one datagram.
    fn handle_input(&mut self, now: Duration, bytes: &[u8]);

    /// Called when time has passed, or another input of the session has changed.
    fn handle_timeout(&mut self, now: Duration);

    /// Called when the last byte that [`poll_transmit`](Self::poll_transmit) wrote has left the port. Optional: only for
    /// drivers that can determine this time exactly.
    fn handle_transmitted(&mut self, _now: Duration) {}

    /// Returns whether bytes are to be read from the transport now. False while the session waits for its caller, or until it
    /// has sent a message, before it reads on.
    fn wants_input(&self) -> bool {
        true
    }

    /// Removes and returns the oldest event.
    fn poll_event(&mut self) -> Option<Self::Event>;

    /// Writes the bytes to be sent; returns their number. A buffer that is too short is not filled and has no effect on the
    /// session: [`MAX_TRANSMIT`](Self::MAX_TRANSMIT) bytes are always enough.
    fn poll_transmit(&mut self, now: Duration, out: &mut [u8]) -> Option<usize>;

    /// Returns the latest time to call [`handle_timeout`](Self::handle_timeout) and [`poll_transmit`](Self::poll_transmit);
    /// `None` if nothing happens without bytes, a call or a wake.
    fn poll_timeout(&self) -> Option<Duration>;

    /// Returns the time after which a request that was sent has failed, and must not reach the peer any more. Bytes that the
    /// peer has not acknowledged by then are discarded, and the connection ends: the drivers set this limit on TCP
    /// connections. `None`: a late delivery does no harm.
    fn discards_after(&self) -> Option<Duration> {
        None
    }

    /// Returns the counters.
    fn statistics(&self) -> Self::Statistics;
}
