//! The errors for a broker's certificate that cannot be accepted: openssl is the broker, as far as TLS goes.

use std::io::{BufRead as _, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};

use crate::{ball, bridge_command, edit};

fn openssl(folder: &Path, arguments: &str) {
    let output = Command::new("openssl").args(arguments.split(' ')).current_dir(folder).output().unwrap();
    assert!(output.status.success(), "{arguments}: {output:?}");
}

struct Server(Child);

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Shows a certificate on a port of its own.
fn serve(folder: &Path, name: &str) -> (Server, String) {
    let (certificate, key) = (format!("{name}.pem"), format!("{name}.key"));
    let mut command = Command::new("openssl");
    command.args(["s_server", "-accept", "127.0.0.1:0", "-cert", &certificate, "-key", &key]);
    command.current_dir(folder).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::null());
    let mut server = Server(command.spawn().unwrap());
    let lines = BufReader::new(server.0.stdout.take().unwrap()).lines().map_while(Result::ok);
    let place =
        lines.into_iter().find_map(|line| Some(line.strip_prefix("ACCEPT ")?.trim().to_owned())).unwrap();
    (server, place.replace("127.0.0.1", "localhost"))
}

#[test]
fn a_certificate_that_cannot_be_accepted_has_its_advice() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    let new = "req -newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes -subj /CN=localhost";
    openssl(
        path,
        &format!("{new} -x509 -addext subjectAltName=DNS:localhost -keyout self.key -out self.pem"),
    );
    openssl(path, &format!("{new} -x509 -keyout ca.key -out ca.pem").replace("localhost", "authority"));
    openssl(path, &format!("{new} -keyout v1.key -out v1.csr"));
    openssl(path, "x509 -req -in v1.csr -CA ca.pem -CAkey ca.key -CAcreateserial -out v1.pem");
    std::fs::write(path.join("names"), "subjectAltName=DNS:localhost\n").unwrap();
    openssl(path, &format!("{new} -keyout good.key -out good.csr"));
    openssl(
        path,
        "x509 -req -in good.csr -CA ca.pem -CAkey ca.key -CAcreateserial -extfile names -out good.pem",
    );
    let ball = ball();
    for (name, authority, advice) in [
        (
            "self",
            "self.pem",
            "the broker's certificate is that of an authority, such as a self-signed one: make a certificate",
        ),
        ("v1", "ca.pem", "the broker's certificate has version 1 without names: make one of version 3"),
        ("good", "self.pem", "the broker's certificate is self-signed, or not signed by tls.ca"),
    ] {
        let (_server, place) = serve(path, name);
        let command = bridge_command(path, &place, &ball);
        edit(path, "node = \"n\"", &format!("node = \"n\"\ntls = {{ ca = \"{authority}\" }}"));
        let mut bridge = crate::tool::Running::start(command);
        let line = bridge.line("\"broker\"");
        assert!(line.contains(advice), "{name}: {line}");
        // Once for the reason, and not for each attempt.
        std::thread::sleep(std::time::Duration::from_secs(2));
        assert_eq!(bridge.signal("-TERM"), Some(0));
        assert!(!bridge.rest().iter().any(|line| line.contains(advice)));
    }
}
