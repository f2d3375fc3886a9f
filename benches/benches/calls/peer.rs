//! A peer in a program of its own, and the runtime of most programs: one thread.

use std::future::Future;
use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::thread::sleep;
use std::time::Duration;

use benches::Peer;
use robot_session::tokio::{Connector, Tcp};
use tokio::runtime::Builder;

/// The number of calls that are counted.
pub(super) const ROUNDS: u64 = 300;
/// The time that a peer takes for a reply, so that every call waits for it.
pub(super) const DELAY: Duration = Duration::from_millis(1);

/// Runs `calls` with a peer of this link, in a task: the main future of a runtime is woken through its port, which costs more.
pub(super) fn with_peer<F: Future<Output = ()> + Send + 'static>(
    link: &str,
    number: usize,
    calls: impl FnOnce(Tcp) -> F,
) {
    let peer = Peer::of(link, number);
    let runtime = Builder::new_current_thread().enable_all().build().expect("a runtime");
    let calls = runtime.spawn(calls(Tcp::new(peer.address.to_string())));
    runtime.block_on(calls).expect("the calls end");
}

/// Serves as a peer that sends the same bytes this long after each message.
pub(super) fn reply(mut stream: TcpStream, delay: Duration, bytes: &[u8]) {
    let mut message = [0; 1024];
    while stream.read(&mut message).is_ok_and(|length| length > 0) {
        sleep(delay);
        if stream.write_all(bytes).is_err() {
            return;
        }
    }
}

/// Returns a connection with the options of the handle's.
pub(super) async fn connected(mut tcp: Tcp) -> tokio::net::TcpStream {
    tcp.connect().await.expect("a peer")
}
