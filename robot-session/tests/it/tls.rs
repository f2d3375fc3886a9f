//! TLS: a call over it, and the error of each connection that cannot be secure.

#![allow(clippy::disallowed_methods, clippy::disallowed_types, reason = "the tests have sockets")]

use core::time::Duration;
use std::io;
use std::net::Shutdown;
use std::path::PathBuf;
use std::sync::Arc;

use rcgen::{BasicConstraints, CertificateParams, CertifiedIssuer, DnType, IsCa, KeyPair, date_time_ymd};
use robot_session::tls::rustls::pki_types::CertificateDer;
use robot_session::tls::rustls::pki_types::pem::PemObject as _;
use robot_session::tls::{FileError, Identity, Layer, Secure, client, server};
use robot_session::tokio::tls::{Tls, serve};
use robot_session::tokio::{Connector, Listen, Tcp};
use robot_session::{ReceiveOutcome, SendOutcome, Transport as _, Wait, now};
use socket2::SockRef;
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::mpsc;
use tokio::time::timeout;

use crate::common::Asker;

const LONG: Duration = Duration::from_secs(20);
const MS: Duration = Duration::from_millis(1);
const SHORT: Duration = Duration::from_millis(20);

struct Authority {
    folder: tempfile::TempDir,
    issuer: CertifiedIssuer<'static, KeyPair>,
}

impl Authority {
    fn new(name: &str) -> Self {
        let mut params = CertificateParams::new([]).unwrap();
        params.distinguished_name.push(DnType::CommonName, name);
        params.is_ca = IsCa::Ca(BasicConstraints::Unconstrained);
        let issuer = CertifiedIssuer::self_signed(params, KeyPair::generate().unwrap()).unwrap();
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("authority.pem"), issuer.pem()).unwrap();
        Self { folder, issuer }
    }

    fn path(&self, file: &str) -> PathBuf {
        self.folder.path().join(file)
    }

    fn pem(&self) -> PathBuf {
        self.path("authority.pem")
    }

    /// Returns the files of a certificate for this name that expires in this year, and of its key.
    fn sign(&self, name: &str, until: i32) -> [PathBuf; 2] {
        let mut params = CertificateParams::new([name.to_owned()]).unwrap();
        params.not_after = date_time_ymd(until, 1, 1);
        let key = KeyPair::generate().unwrap();
        let files = [self.path(&format!("{name}-{until}.pem")), self.path(&format!("{name}-{until}.key"))];
        std::fs::write(&files[0], params.signed_by(&key, &self.issuer).unwrap().pem()).unwrap();
        std::fs::write(&files[1], key.serialize_pem()).unwrap();
        files
    }
}

fn identity([certificate, key]: &[PathBuf; 2]) -> Identity<'_> {
    Identity { certificate, key }
}

/// Returns the messages of a client and of a server about their connection.
async fn meet(
    own: &[PathBuf; 2],
    clients: Option<PathBuf>,
    (authority, client_own): (PathBuf, Option<&[PathBuf; 2]>),
    name: &str,
) -> [Result<(), String>; 2] {
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let (said, mut says) = mpsc::unbounded_channel();
    let session = move |_, met: Result<&_, io::Error>| {
        said.send(met.map(drop).map_err(|error| error.to_string())).unwrap();
        Some(Asker::new(&["ready?"]))
    };
    let config = server(identity(own), clients.as_deref()).unwrap();
    let serving = tokio::spawn(serve(listener, 4, config, session, |_, _, _| {}));
    let config = client(&authority, client_own.map(identity)).unwrap();
    let mut connector = Tls::dial(Tcp::new(address), config, name).unwrap();
    let mut line = [0; 7];
    let met = async {
        let mut stream = connector.connect().await?;
        stream.read_exact(&mut line).await.map(drop) // a server refuses a certificate of TLS 1.3 after the handshake
    };
    let met = timeout(LONG, met).await.unwrap().map_err(|error| error.to_string());
    let answer = timeout(LONG, says.recv()).await.unwrap().unwrap();
    serving.abort();
    [met, answer]
}

#[tokio::test]
async fn a_connection_that_cannot_be_secure_says_why() {
    let [ours, theirs, again] = ["cell", "other plant", "cell"].map(Authority::new);
    let (own, expired) = (ours.sign("localhost", 2100), ours.sign("localhost", 2020));
    let (person, stranger) = (ours.sign("operator", 2100), theirs.sign("operator", 2100));
    let lookalike = again.sign("operator", 2100);
    let expired_person = ours.sign("former", 2020);
    let all = [
        (&own, false, None, "localhost", Ok(()), Ok(())),
        (&own, true, Some(&person), "localhost", Ok(()), Ok(())),
        (
            &expired,
            false,
            None,
            "localhost",
            Err("the peer's certificate has expired"),
            Err("says that this end's certificate has expired"),
        ),
        (
            &own,
            false,
            None,
            "robot.local",
            Err("is for other names"),
            Err("the peer refuses this end's certificate"),
        ),
        (
            &stranger,
            false,
            None,
            "operator",
            Err("not signed by the given authority"),
            Err("does not know the authority"),
        ),
        (
            &lookalike,
            false,
            None,
            "operator",
            Err("not signed by the given authority"),
            Err("the peer refuses this end's certificate"),
        ),
        (
            &own,
            true,
            None,
            "localhost",
            Err("the peer requires a certificate"),
            Err("the client has no certificate"),
        ),
        (
            &own,
            true,
            Some(&stranger),
            "localhost",
            Err("does not know the authority"),
            Err("not signed by the given authority"),
        ),
        (
            &own,
            true,
            Some(&expired_person),
            "localhost",
            Err("says that this end's certificate has expired"),
            Err("the peer's certificate has expired"),
        ),
    ];
    for (own, asks, shown, name, ours_says, server_says) in all {
        let clients = asks.then(|| ours.pem());
        let met = meet(own, clients, (ours.pem(), shown), name).await;
        println!("{name}: {met:?}");
        for (met, expected) in met.iter().zip([ours_says, server_says]) {
            match (met, expected) {
                (Ok(()), Ok(())) => {}
                (Err(said), Err(expected)) if said.contains(expected) => {}
                _ => panic!("{name}, {asks}: {met:?}, not {expected:?}"),
            }
        }
    }
}

/// A peer with another protocol, and a silent one, on either side.
#[tokio::test(start_paused = true)]
async fn a_peer_without_tls_is_named() {
    let authority = Authority::new("cell");
    let own = authority.sign("localhost", 2100);
    let mut listen =
        Tls::accept(Listen::bind("127.0.0.1:0").await.unwrap(), server(identity(&own), None).unwrap());
    let address = listen.tcp().address().unwrap();
    let mut plain = TcpStream::connect(address).await.unwrap();
    plain.write_all(&[0, 1, 0, 0, 0, 6, 1, 3, 0, 0, 0, 37]).await.unwrap();
    let said = listen.connect().await.unwrap_err().to_string();
    assert!(said.contains("does not speak TLS on this port"), "{said}");
    let silent = TcpStream::connect(address).await.unwrap();
    let said = listen.connect().await.unwrap_err();
    assert_eq!(said.to_string(), "the peer has not answered the TLS handshake: it may not speak TLS");
    drop(silent);
    let server = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let address = server.local_addr().unwrap().to_string();
    let mut dial =
        Tls::dial(Tcp::new(address), client(&authority.pem(), None).unwrap(), "localhost").unwrap();
    let closing = async { drop(server.accept().await.unwrap()) };
    let (said, ()) = tokio::join!(dial.connect(), closing);
    let said = said.unwrap_err().to_string();
    assert!(said.contains("closed the connection without ending TLS") || said.contains("reset"), "{said}");
    let modbus = async {
        let mut stream = server.accept().await.unwrap().0;
        stream.write_all(&[0, 1, 0, 0, 0, 3, 1, 0x83, 1]).await.unwrap();
        stream
    };
    let (said, _stream) = tokio::join!(dial.connect(), modbus);
    let said = said.unwrap_err().to_string();
    assert!(said.contains("does not speak TLS on this port"), "{said}");
}

#[test]
fn a_file_that_cannot_be_used_is_named() {
    let authority = Authority::new("cell");
    let (own, other) = (authority.sign("localhost", 2100), authority.sign("other", 2100));
    let none = authority.path("none.pem");
    let FileError { file, why } = client(&none, None).unwrap_err();
    assert_eq!((&file, why.contains("No such file")), (&none, true), "{why}");
    let error = client(&own[1], None).unwrap_err();
    assert_eq!((&error.file, &error.why[..]), (&own[1], "it has no certificate"));
    let mixed = Identity { certificate: &own[0], key: &other[1] };
    let error = server(mixed, None).unwrap_err();
    assert!(error.file == other[1] && error.why.contains("keys may not be consistent"), "{error}");
    let swapped = Identity { certificate: &own[0], key: &own[0] };
    let error = server(swapped, None).unwrap_err();
    assert!(error.to_string().contains("no items found"), "{error}");
    assert!(Tls::dial(Tcp::new("x:1"), client(&authority.pem(), None).unwrap(), "not a name!").is_err());
}

/// A megabyte in each direction between two ends that read it late: all of it comes, and then the end.
#[test]
fn secure_connections_of_std_lose_nothing() {
    let authority = Authority::new("cell");
    let (own, person) = (authority.sign("localhost", 2100), authority.sign("operator", 2100));
    let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap();
    let config = server(identity(&own), Some(&authority.pem())).unwrap();
    let both_have_all = Arc::new(std::sync::Barrier::new(2));
    let far_has_all = Arc::clone(&both_have_all);
    let far = std::thread::spawn(move || {
        let mut far = Secure::accept(listener.accept().unwrap().0, config).unwrap();
        assert!(far.connection().peer_certificates().is_some());
        exchange(&mut far);
        far_has_all.wait();
    });
    let config = client(&authority.pem(), Some(identity(&person))).unwrap();
    let mut near = Secure::dial(std::net::TcpStream::connect(address).unwrap(), config, "localhost").unwrap();
    exchange(&mut near);
    both_have_all.wait();
    far.join().unwrap();
    let mut buffer = [0; 64];
    assert_eq!(near.receive(&mut buffer, Wait::limited(LONG)).unwrap(), ReceiveOutcome::Closed);
}

/// Sends a megabyte and reads one.
fn exchange(end: &mut Secure) {
    let bytes: Vec<u8> = (0..1_000_000_u32).map(|at| (at % 251) as u8).collect();
    let (mut sent, mut read, mut buffer) = (0, Vec::new(), [0; 4096]);
    while sent < bytes.len() || read.len() < bytes.len() {
        sent += match end.send(&bytes[sent..]).unwrap() {
            SendOutcome::Part(length) => length,
            SendOutcome::Buffered | SendOutcome::Transmitted => bytes.len() - sent,
        };
        if let ReceiveOutcome::Bytes(length) = end.receive(&mut buffer, Wait::limited(MS)).unwrap() {
            read.extend_from_slice(&buffer[..length]);
        }
    }
    // Bytes that TLS must still send are written during a wait.
    for _ in 0..100 {
        assert_eq!(
            end.receive(&mut buffer, Wait::limited(MS)).unwrap_or(ReceiveOutcome::Nothing),
            ReceiveOutcome::Nothing
        );
    }
    assert!(read == bytes);
}

/// Returns the ends of a connection.
async fn pair() -> [robot_session::tokio::tls::Secure; 2] {
    let authority = Authority::new("cell");
    let own = authority.sign("localhost", 2100);
    let mut listen =
        Tls::accept(Listen::bind("127.0.0.1:0").await.unwrap(), server(identity(&own), None).unwrap());
    let address = listen.tcp().address().unwrap().to_string();
    let mut dial =
        Tls::dial(Tcp::new(address), client(&authority.pem(), None).unwrap(), "localhost").unwrap();
    let (near, far) = tokio::join!(dial.connect(), listen.connect());
    [near.unwrap(), far.unwrap()]
}

#[tokio::test]
async fn a_connection_that_is_dropped_ends_tls() {
    let [mut near, far] = pair().await;
    drop(far);
    assert_eq!(near.read(&mut [0; 8]).await.unwrap(), 0);
}

#[tokio::test]
async fn a_flush_sends_all_that_was_written() {
    let [mut near, mut far] = pair().await;
    let (mut written, mut read, mut buffer) = (0, 0, vec![0; 1 << 16]);
    while let Ok(length) = timeout(MS, near.write(&buffer)).await {
        written += length.unwrap();
    }
    let reads = async {
        while read < written {
            read += far.read(&mut buffer).await.unwrap();
        }
    };
    let (flushed, reads) = tokio::join!(near.flush(), timeout(LONG, reads));
    assert!(flushed.is_ok() && reads.is_ok(), "{read} of {written}");
}

#[tokio::test]
async fn a_secure_connection_has_the_peer_and_the_options_of_its_tcp_connection() {
    let authority = Authority::new("cell");
    let server = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let address = server.local_addr().unwrap().to_string();
    let mut dial =
        Tls::dial(Tcp::new(&address), client(&authority.pem(), None).unwrap(), "localhost").unwrap();
    assert_eq!(dial.peer(), Some(address));
    dial.discard_after(LONG);
    let _tcp = dial.tcp().clone().connect().await.unwrap();
    #[cfg(target_os = "linux")]
    assert_eq!(rustix::net::sockopt::tcp_user_timeout(&_tcp), Ok(20_000));
}

#[test]
fn a_client_of_std_without_a_certificate_is_told() {
    let authority = Authority::new("cell");
    let own = authority.sign("localhost", 2100);
    let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap();
    let config = server(identity(&own), Some(&authority.pem())).unwrap();
    let far = std::thread::spawn(move || {
        Secure::accept(listener.accept().unwrap().0, config).unwrap_err().to_string()
    });
    let config = client(&authority.pem(), None).unwrap();
    let stream = std::net::TcpStream::connect(address).unwrap();
    let said = Secure::dial(stream, config, "localhost")
        .and_then(|mut near| near.receive(&mut [0; 64], Wait::limited(LONG)))
        .unwrap_err();
    assert_eq!(said.to_string(), "TLS: the peer requires a certificate: give one with its key");
    assert_eq!(far.join().unwrap(), "TLS: the client has no certificate, and has to have one");
}

/// Returns the ends of a client and of a server in a loop of many connections, which waits for no handshake.
fn ends_of_a_loop() -> [Secure; 2] {
    let authority = Authority::new("cell");
    let (own, person) = (authority.sign("localhost", 2100), authority.sign("operator", 2100));
    let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let near = std::net::TcpStream::connect(listener.local_addr().unwrap()).unwrap();
    SockRef::from(&near).set_recv_buffer_size(10_000).unwrap(); // less than TLS holds for a peer that does not read
    let config = client(&authority.pem(), Some(identity(&person))).unwrap();
    let near = std::thread::spawn(|| Secure::dial(near, config, "localhost").unwrap());
    let mut far = listener.accept().unwrap().0;
    far.set_nonblocking(true).unwrap();
    SockRef::from(&far).set_send_buffer_size(10_000).unwrap();
    let mut layer = Layer::accept(server(identity(&own), Some(&authority.pem())).unwrap()).unwrap();
    while !layer.shake_hands(&mut far).unwrap() {
        assert!(Wait::limited(LONG).readable(&far).unwrap());
    }
    let shown = CertificateDer::from_pem_file(&person[0]).unwrap();
    assert_eq!(layer.peer_certificate(), Some(&*shown));
    [near.join().unwrap(), Secure::new(far, layer)]
}

#[test]
fn bytes_for_a_peer_that_reads_late_are_sent_as_soon_as_there_is_room() {
    let [mut near, mut far] = ends_of_a_loop();
    // The server's tickets have come, and no byte for the session.
    assert_eq!(near.receive(&mut [0], Wait::limited(LONG)).unwrap(), ReceiveOutcome::Nothing);
    far.discard_after(LONG).unwrap();
    #[cfg(target_os = "linux")]
    assert_eq!(SockRef::from(far.stream()).tcp_user_timeout().unwrap(), Some(LONG));
    let bytes = [7; 100_000];
    assert_eq!(far.send(&bytes[..9]).unwrap(), SendOutcome::Buffered);
    let (mut sent, mut refused) = (9, 0);
    // For a while the system of the peer still takes bytes from this one.
    while refused < 5 {
        let begin = now();
        match far.send(&bytes).unwrap() {
            SendOutcome::Part(0) => {
                far.wait_for_room(Wait::limited(SHORT)).unwrap();
                refused = if now() - begin < SHORT { 0 } else { refused + 1 };
            }
            SendOutcome::Part(length) => (sent, refused) = (sent + length, 0),
            SendOutcome::Buffered | SendOutcome::Transmitted => (sent, refused) = (sent + bytes.len(), 0),
        }
    }
    assert!(far.connection().wants_write());
    let reader = std::thread::spawn(move || {
        let mut buffer = [0; 4096];
        std::thread::sleep(SHORT); // the server waits for room
        while sent > 0 {
            match near.receive(&mut buffer, Wait::limited(LONG)).unwrap() {
                ReceiveOutcome::Bytes(length) => sent -= length,
                ReceiveOutcome::Nothing => {}
                ReceiveOutcome::Closed => panic!("{sent} bytes are lost"),
            }
        }
        assert_eq!(near.send(b"!").unwrap(), SendOutcome::Buffered);
        near
    });
    let begin = now();
    while far.receive(&mut [0], Wait::limited(LONG)).unwrap() != ReceiveOutcome::Bytes(1) {}
    assert!(now() - begin < LONG / 2, "the rest was not sent");
    far.wait_for_room(Wait::default()).unwrap();
    reader.join().unwrap();
}

#[test]
fn the_end_of_a_connection_that_does_not_end_tls_is_an_error() {
    let [mut near, mut far] = ends_of_a_loop();
    let end_of = |end: &mut Secure| end.receive(&mut [0], Wait::limited(LONG)).unwrap_err().to_string();
    near.stream().shutdown(Shutdown::Write).unwrap();
    let ended = "the client has closed the connection without ending TLS";
    assert_eq!([end_of(&mut far), end_of(&mut far)], [ended; 2], "however often it is asked");
    far.stream().shutdown(Shutdown::Write).unwrap();
    let ended = "the peer has closed the connection without ending TLS: it may not speak TLS, or refuse our certificate";
    assert_eq!(end_of(&mut near), ended);
}
