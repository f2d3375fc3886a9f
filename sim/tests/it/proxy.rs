//! A network between a client and a server.

use core::sync::atomic::Ordering;
use std::io::{Read as _, Write as _};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::thread;

use cellwire_sim::FaultyProxy;

#[test]
fn the_proxy_forwards_every_byte_in_order() {
    let server = TcpListener::bind("127.0.0.1:0").unwrap();
    let proxy = FaultyProxy::start(server.local_addr().unwrap(), 1, 0.0).unwrap();
    let sent: Vec<u8> = (0..=255).cycle().take(100_000).collect();
    let mut client = TcpStream::connect(proxy.address()).unwrap();
    let copy = sent.clone();
    let writer = thread::spawn(move || {
        copy.chunks(1000).for_each(|chunk| client.write_all(chunk).unwrap());
        client.shutdown(Shutdown::Write).unwrap();
    });
    let mut received = Vec::new();
    server.accept().unwrap().0.read_to_end(&mut received).unwrap();
    writer.join().unwrap();
    assert_eq!(received, sent);
    assert!(proxy.faults().splits.load(Ordering::Relaxed) > 0);
}
