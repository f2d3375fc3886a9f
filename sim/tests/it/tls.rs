//! A server whose clients speak TLS.

use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::sync::Arc;

use cellwire_sim::Simulator;
use rcgen::{BasicConstraints, CertificateParams, CertifiedIssuer, IsCa, KeyPair};
use robot_session::tls::rustls::{ClientConfig, ClientConnection, StreamOwned};
use robot_session::tls::{Identity, client, server};

use crate::gadget::{Gadget, Line};
use crate::host::{Host, much};

/// Starts a host whose clients have to show a certificate; returns it with the configuration of a client, and with the
/// certificate of both.
fn host(line: Line) -> (Host, Arc<ClientConfig>, Vec<u8>) {
    let mut params = CertificateParams::new([]).unwrap();
    params.is_ca = IsCa::Ca(BasicConstraints::Unconstrained);
    let issuer = CertifiedIssuer::self_signed(params, KeyPair::generate().unwrap()).unwrap();
    let key = KeyPair::generate().unwrap();
    let params = CertificateParams::new(["localhost".to_owned()]).unwrap();
    let certificate = params.signed_by(&key, &issuer).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let files = ["authority.pem", "own.pem", "own.key"].map(|name| folder.path().join(name));
    let [authority, own, own_key] = &files;
    std::fs::write(authority, issuer.pem()).unwrap();
    std::fs::write(own, certificate.pem()).unwrap();
    std::fs::write(own_key, key.serialize_pem()).unwrap();
    let identity = Identity { certificate: own, key: own_key };
    let config = server(identity, Some(authority)).unwrap();
    let simulator = Simulator::new(Gadget { line, ..Gadget::default() });
    let host = Host::new(simulator, None, |listener| listener.with_tls(Some(config)));
    (host, client(authority, Some(identity)).unwrap(), certificate.der().to_vec())
}

/// Returns a client whose last bytes of the handshake are not sent yet.
fn connect(host: &Host, config: Arc<ClientConfig>) -> (StreamOwned<ClientConnection, TcpStream>, String) {
    let (mut stream, name) = host.connect();
    let mut tls = ClientConnection::new(config, "localhost".try_into().unwrap()).unwrap();
    while tls.is_handshaking() {
        while tls.wants_write() {
            tls.write_tls(&mut stream).unwrap();
        }
        tls.read_tls(&mut stream).unwrap();
        tls.process_new_packets().unwrap();
    }
    (StreamOwned::new(tls, stream), name)
}

#[test]
fn bytes_that_come_with_the_end_of_the_handshake_are_read() {
    let (host, config, certificate) = host(Line::default());
    let (mut client, name) = connect(&host, config);
    // The records arrive at once, and are read in parts.
    let sent = ["AB".to_owned(), "CDEFG".repeat(1000), "HIJ".repeat(1000)];
    for text in &sent {
        client.conn.writer().write_all(text.as_bytes()).unwrap();
    }
    let mut bytes = Vec::new();
    while client.conn.wants_write() {
        client.conn.write_tls(&mut bytes).unwrap();
    }
    client.sock.write_all(&bytes).unwrap();
    assert_eq!(host.next(), format!("{name} connected{}", certificate.escape_ascii()));
    assert_eq!(host.received(8002), sent.concat());
    drop(host);
    assert_eq!(client.read(&mut [0]).unwrap(), 0, "TLS is ended");
}

#[test]
fn a_client_gets_what_did_not_fit_when_it_was_sent() {
    let (host, config, _) = host(much(1000));
    let (mut client, _) = connect(&host, config);
    client.flush().unwrap();
    // Everything is given to TLS before the client reads.
    while host.next().contains("connected") {}
    for _ in 1..1000 {
        assert!(host.next().starts_with("sent "));
    }
    client.read_exact(&mut [0; 64_000]).unwrap();
}
