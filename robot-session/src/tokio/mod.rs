//! For tokio: a session in a task of its own that reconnects automatically, with a [`Handle`] for its users; below that, the
//! loop of [`drive`](crate::drive) over any `AsyncRead + AsyncWrite`, and a decoder under `tokio_util`'s framed transports.

#[cfg(feature = "tokio-codec")]
mod codec;
mod connection;
mod connector;
mod driver;
mod handle;
mod latest;
mod listener;
mod polled;
mod served;
mod service;
mod shared;
mod task;
mod timer;
#[cfg(feature = "tokio-tls")]
pub mod tls;

/// A channel of a changing value, with waits for its changes.
pub use ::tokio::sync::watch;
/// Runs work that blocks its thread, such as writing a file, beside the task.
pub use ::tokio::task::{JoinHandle, spawn_blocking};
#[cfg(feature = "tokio-codec")]
pub use codec::Codec;
#[cfg(feature = "tokio-serial")]
pub use connector::Serial;
pub use connector::{Connector, Datagrams, Dial, Listen, Tcp, Udp, UdpListen};
pub use driver::{Driver, Waker};
pub use handle::{Closed, Handle, Outcome, Reply};
pub use latest::{Latest, LatestSender, latest};
pub use listener::serve;
pub use service::{Reports, Service};
pub use shared::Link;
pub use task::{GIVE_UP_AFTER, Reconnect, Task, spawn, spawn_woken_by};
#[cfg(feature = "tokio-serial")]
pub use tokio_serial;
