//! A server with more clients than it can serve, and with clients that do not read. Windows accepts any number of bytes at
//! once, and has no `ulimit`.

use std::fs::File;
use std::io::{Read as _, Write as _};
use std::net::{TcpListener, TcpStream};
use std::process::Command;

use cellwire_sim::host::{Arrival, Listener, MAX_CLIENTS};

use crate::gadget::Line;
use crate::host::{Host, LIMIT, MS, much};

/// Returns the next notice, except those of sent bytes.
fn next_but_sent(host: &Host) -> String {
    core::iter::repeat_with(|| host.next()).find(|told| !told.starts_with("sent ")).unwrap()
}

#[test]
fn a_client_that_does_not_read_its_replies_is_not_read() {
    let host = Host::of(much(2000), None);
    let (mut first, a) = host.connect();
    assert_eq!(host.next(), format!("{a} connected"));
    first.write_all(b"AB").unwrap();
    let (mut second, b) = host.connect();
    assert_eq!(next_but_sent(&host), format!("{b} connected"));
    second.read_exact(&mut [0; 128_000]).unwrap();
    second.write_all(b"CD").unwrap();
    assert_eq!(next_but_sent(&host), "received CD", "the bytes that came before are not read");
    first.read_exact(&mut [0; 128_000]).unwrap();
    assert_eq!(next_but_sent(&host), "received AB");
}

#[test]
fn a_client_that_does_not_read_is_disconnected_by_one_more_message() {
    let mut line = much(2000);
    line.sends.push_back((10 * MS, "more"));
    let host = Host::of(line, None);
    let (_client, name) = host.connect();
    assert_eq!(host.next(), format!("{name} connected"));
    host.set_clock(10 * MS);
    assert_eq!(next_but_sent(&host), format!("{name} disconnected: the peer does not read"));
}

/// Runs a test in a process of its own that can open so many files; returns whether this is that process.
fn with_files(limit: usize, test: &str) -> bool {
    if std::env::var_os("CELLWIRE_SIM_FILES").is_some() {
        return true;
    }
    let mut command = Command::new("sh");
    command.arg("-c").arg(format!("ulimit -n {limit} && exec \"$0\" --exact {test}"));
    let ran = command.arg(std::env::current_exe().unwrap()).env("CELLWIRE_SIM_FILES", "").output().unwrap();
    let said = String::from_utf8_lossy(&ran.stdout);
    assert!(ran.status.success() && said.contains("1 passed"), "{said}");
    false
}

#[test]
fn the_maximum_of_clients_is_served() {
    if !with_files(2 * MAX_CLIENTS + 100, "limits::the_maximum_of_clients_is_served") {
        return;
    }
    let host = Host::of(Line::default(), None);
    let mut clients = Vec::new();
    for _ in 0..MAX_CLIENTS {
        let (client, name) = host.connect();
        assert_eq!(host.next(), format!("{name} connected"));
        clients.push(client);
    }
    let (mut client, name) = host.connect();
    assert_eq!(host.next(), format!("{name} refused: the maximum of clients is connected"));
    assert_eq!(client.read(&mut [0]).unwrap(), 0);
}

#[test]
fn a_client_without_a_free_descriptor_is_refused() {
    if !with_files(40, "limits::a_client_without_a_free_descriptor_is_refused") {
        return;
    }
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap();
    let mut listener = Listener::new(listener).unwrap();
    assert!(matches!(listener.accept(), Ok(Arrival::Nobody)));
    let mut files = Vec::new();
    for _ in 0..2 {
        let mut client = TcpStream::connect(address).unwrap();
        client.set_read_timeout(Some(LIMIT)).unwrap();
        while let Ok(file) = File::open("/dev/null") {
            files.push(file);
        }
        match listener.accept() {
            Ok(Arrival::Refused(peer, why)) => {
                assert_eq!(
                    (peer, &*why),
                    (client.local_addr().unwrap(), "too many open files, see ulimit -n")
                );
            }
            other => panic!("{other:?}"),
        }
        assert_eq!(client.read(&mut [0]).unwrap(), 0);
    }
}
