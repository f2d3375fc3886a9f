//! A network between a client and a server.

use core::sync::atomic::Ordering;
use core::time::Duration;
use std::io::{Read as _, Write as _};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::thread;
use std::time::Instant;

use cellwire_sim::FaultyProxy;

const LIMIT: Duration = Duration::from_secs(20);

#[test]
fn the_proxy_forwards_every_byte_in_order() {
    let server = TcpListener::bind("127.0.0.1:0").unwrap();
    let proxy = FaultyProxy::start(server.local_addr().unwrap(), 1, 0.0).unwrap();
    let sent: Vec<u8> = (0..=255).cycle().take(2_000_000).collect();
    let mut client = TcpStream::connect(proxy.address()).unwrap();
    let copy = sent.clone();
    let writer = thread::spawn(move || {
        copy.chunks(10_000).for_each(|chunk| client.write_all(chunk).unwrap());
        client.shutdown(Shutdown::Write).unwrap();
    });
    let mut received = Vec::new();
    server.accept().unwrap().0.read_to_end(&mut received).unwrap();
    writer.join().unwrap();
    assert_eq!(received, sent);
    // Of 122 reads at least.
    assert!((1..80).contains(&proxy.faults().splits.load(Ordering::Relaxed)), "{:?}", proxy.faults());
    assert!(proxy.faults().delays.load(Ordering::Relaxed) > 0);
}

#[test]
fn the_proxy_breaks_a_connection_in_the_middle_of_a_read() {
    let server = TcpListener::bind("127.0.0.1:0").unwrap();
    let proxy = FaultyProxy::start(server.local_addr().unwrap(), 1, 1.0).unwrap();
    let mut client = TcpStream::connect(proxy.address()).unwrap();
    client.set_read_timeout(Some(LIMIT)).unwrap();
    client.write_all(b"ABCD").unwrap();
    let mut received = Vec::new();
    let (mut served, _) = server.accept().unwrap();
    served.set_read_timeout(Some(LIMIT)).unwrap();
    served.read_to_end(&mut received).unwrap();
    assert!(received.len() < 4 && b"ABCD".starts_with(&received), "{received:?}");
    assert_eq!(client.read(&mut [0]).unwrap(), 0);
    assert_eq!(proxy.faults().disconnects.load(Ordering::Relaxed), 1);
}

#[test]
fn a_proxy_that_is_dropped_accepts_nobody() {
    let server = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    let proxy = FaultyProxy::start(server, 1, 0.0).unwrap();
    let address = proxy.address();
    drop(proxy);
    let begun = Instant::now();
    while TcpStream::connect(address).is_ok() {
        assert!(begun.elapsed() < LIMIT);
        thread::yield_now();
    }
}
