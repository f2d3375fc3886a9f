//! Modbus in TLS: certificates of the tool, its simulator, its clients.

use crate::operated::Tool;
use crate::settings::cellwire;

/// The options of a client with this certificate.
fn shown(folder: &str, name: &str) -> [String; 6] {
    let file = |file: &str| format!("{folder}/{file}");
    [
        "--tls".into(),
        file("authority.pem"),
        "--tls-cert".into(),
        file(&format!("{name}.pem")),
        "--tls-key".into(),
        file(&format!("{name}.key")),
    ]
}

#[test]
fn clients_and_the_simulator_speak_tls_with_certificates_of_the_tool() {
    let folder = tempfile::tempdir().unwrap();
    let path = |file: &str| folder.path().join("tls").join(file).to_str().unwrap().to_owned();
    let root = folder.path().join("tls").to_str().unwrap().to_owned();
    let (code, made, said) = cellwire(&["certificates", &root, "--role", "operator"], "");
    assert_eq!(code, Some(0), "{said}");
    assert!(
        made.contains("\"role\":\"operator\"") && made.contains("\"names\":[\"localhost\",\"127.0.0.1\"]"),
        "{made}"
    );
    let (code, _, said) = cellwire(&["certificates", &root], "");
    assert!(code == Some(2) && said.contains("is not empty: name another folder"), "{said}");
    let (code, _, said) = cellwire(&["certificates", &path("../x"), "--role", "../y"], "");
    assert!(code == Some(2) && said.contains("it names a file"), "{said}");

    let (authority, certificate, key) = (path("authority.pem"), path("server.pem"), path("server.key"));
    let server = ["--tls-cert", &certificate, "--tls-key", &key, "--tls-clients", &authority];
    let simulator = Tool::start(&[&["simulate", "fanuc", "--listen", "127.0.0.1:0"][..], &server].concat());
    let address = simulator.line()["listen"].as_str().unwrap().replace("127.0.0.1", "localhost");
    let send = |options: &[String]| {
        let options: Vec<&str> = options.iter().map(String::as_str).collect();
        let request = "{\"function\":3,\"address\":0,\"quantity\":2}\n";
        cellwire(&[&["modbus", "send", &address][..], &options].concat(), request)
    };
    let (code, reply, said) = send(&shown(&root, "operator"));
    assert!(code == Some(0) && reply.contains("\"registers\":["), "{reply}{said}");
    let (code, _, said) = send(&shown(&root, "operator")[..2]);
    assert!(code == Some(3) && said.contains("the peer requires a certificate"), "{said}");
    let (code, _, said) =
        send(&[&shown(&root, "client")[..], &["--tls-name".into(), "robot.local".into()]].concat());
    assert!(code == Some(2) && said.contains("is for other names: localhost, 127.0.0.1"), "{said}");
    let (code, _, said) = send(&[]);
    assert!(code == Some(3) && said.contains("speaks TLS begins so: --tls"), "{said}");
    // Both ends of a telemetry log.
    let csv = path("log.csv");
    let log = ["fanuc", "log", &address, "--csv", &csv, "--for", "500ms"];
    let (code, _, said) =
        cellwire(&[&log[..], &shown(&root, "client").each_ref().map(String::as_str)].concat(), "");
    assert_eq!(code, Some(0), "{said}");

    for device in ["laser", "kawasaki-pc"] {
        let (code, _, said) =
            cellwire(&[&["simulate", device, "--listen", "127.0.0.1:0"][..], &server].concat(), "");
        assert!(code == Some(2) && said.contains("a TCP server with --listen: fanuc, mma-robot"), "{said}");
    }
    let robot = Tool::start(&[&["simulate", "mma-robot", "--listen", "127.0.0.1:0"][..], &server].concat());
    assert_eq!(robot.line()["ready"], "mma-robot");

    let device = ["simulate", "fanuc", "--listen", "127.0.0.1:0", "--set", "roles=operator:read@0-36"];
    let (code, _, said) = cellwire(&[&device[..], &server[..4]].concat(), "");
    assert!(code == Some(2) && said.contains("give --tls-clients too"), "{said}");
    let simulator = Tool::start(&[&device[..], &server].concat());
    let address = simulator.line()["listen"].as_str().unwrap().replace("127.0.0.1", "localhost");
    let send = |name: &str, request: &str| {
        let options = shown(&root, name);
        let options = options.each_ref().map(String::as_str);
        cellwire(&[&["modbus", "send", &address][..], &options].concat(), &format!("{request}\n")).1
    };
    let reply = send("operator", r#"{"function":3,"address":35,"quantity":2}"#);
    assert!(reply.contains("\"registers\":["), "{reply}");
    for (name, request) in [
        ("operator", r#"{"function":3,"address":35,"quantity":3}"#),
        ("operator", r#"{"function":6,"address":0,"value":1}"#),
        ("client", r#"{"function":3,"address":0,"quantity":1}"#),
    ] {
        let reply = send(name, request);
        assert!(reply.contains("\"exception\":1"), "{name} {request}: {reply}");
    }
}
