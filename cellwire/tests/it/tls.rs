//! TLS of commands and simulators, with certificates of the tool.

use std::io::{BufRead as _, BufReader, Write as _};
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::thread;

use robot_session::tls::{Identity, Secure, server};
use robot_session::{ReceiveOutcome, Transport as _, Wait};
use tempfile::TempDir;

use crate::operated::{TEST_TIMEOUT, Tool};
use crate::settings::cellwire;

/// A folder of certificates of two authorities, `tls` and `other`.
struct Certificates(TempDir);

impl Certificates {
    fn make() -> Self {
        let folder = tempfile::tempdir().unwrap();
        for name in ["tls", "other"] {
            let path = folder.path().join(name);
            let (code, _, said) = cellwire(&["certificates", path.to_str().unwrap()], "");
            assert_eq!(code, Some(0), "{said}");
        }
        Self(folder)
    }

    /// Returns the options of an end with this certificate, such as `tls/client`.
    fn options(&self, name: &str) -> Vec<String> {
        let (folder, name) = name.split_once('/').unwrap();
        shown(self.0.path().join(folder).to_str().unwrap(), name).to_vec()
    }
}

/// Returns a command with these options.
fn with(args: &[&str], options: &[String]) -> Vec<String> {
    args.iter().map(ToString::to_string).chain(options.iter().cloned()).collect()
}

fn start(args: &[&str], options: &[String]) -> Tool {
    Tool::start(&with(args, options).iter().map(String::as_str).collect::<Vec<_>>())
}

fn address(tool: &Tool) -> String {
    tool.line()["listen"].as_str().unwrap().replace("127.0.0.1", "localhost")
}

/// Clients that send nothing.
fn silent(address: &str) -> Vec<TcpStream> {
    (0..10).map(|_| TcpStream::connect(address).unwrap()).collect()
}

/// Returns the options of an end with this certificate.
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
    let server = ["--tls-cert", &certificate, "--tls-key", &key, "--tls", &authority];
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
    assert!(code == Some(3) && said.contains("the peer speaks TLS on this port: give --tls"), "{said}");
    // Both ends of a telemetry log.
    let csv = path("log.csv");
    let log = ["fanuc", "log", &address, "--csv", &csv, "--for", "500ms"];
    let (code, _, said) =
        cellwire(&[&log[..], &shown(&root, "client").each_ref().map(String::as_str)].concat(), "");
    assert_eq!(code, Some(0), "{said}");

    let device = ["simulate", "fanuc", "--listen", "127.0.0.1:0", "--set", "roles=operator:read@0-36"];
    let (code, _, said) = cellwire(&[&device[..], &server[..4]].concat(), "");
    assert!(code == Some(2) && said.contains("give their authority with --tls"), "{said}");
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

#[test]
fn options_that_say_too_little_are_refused() {
    let certificates = Certificates::make();
    let (client, server) = (certificates.options("tls/client"), certificates.options("tls/server"));
    let listen = ["simulate", "kawasaki-pc", "--listen", "127.0.0.1:0"];
    let dial = ["simulate", "kawasaki-robot", "--connect", "localhost:1"];
    let named = [&server[..], &["--tls-name".into(), "robot.local".into()]].concat();
    let udp = [&client[..], &["--set".into(), "udp=true".into()]].concat();
    let task = "plate.toml --robot localhost:1 --platform localhost:1";
    let mma: Vec<&str> = ["run", "mma"].into_iter().chain(task.split(' ')).collect();
    for (args, options, expected) in [
        (&listen[..], &server[..2], "--tls of a server needs --tls-cert and --tls-key too: its certificate"),
        (&listen, &named, "--tls-name is for a connection to a server, and this end accepts clients"),
        (&dial, &client[2..], "--tls-cert of a client needs --tls too: the authority of the server"),
        (&dial, &udp, "--tls is for TCP, and the setting udp is given"),
        (
            &["simulate", "laser", "--listen", "127.0.0.1:0"],
            &server,
            "--tls is for a device on TCP, with --listen",
        ),
        (
            &["simulate", "fanuc", "--pty", "x"],
            &server,
            "--tls is for a device on TCP, with --listen or --connect",
        ),
        (&["modbus", "send", "/dev/ttyS0"], &client, "--tls is for TCP, and /dev/ttyS0 is a serial port"),
        (&mma, &client[..3], "a value is required for '--tls-cert <FILE>'"),
    ] {
        let args = with(args, options);
        let (code, _, said) = cellwire(&args.iter().map(String::as_str).collect::<Vec<_>>(), "");
        assert!(code == Some(2) && said.contains(expected), "{args:?}: {said}");
    }
}

/// Writes a picture of four lines for a Kawasaki robot.
fn picture(folder: &Path) -> String {
    let file = folder.join("square.svg");
    let path = r#"<path d="M10 10 L90 10 L90 90 L10 90 Z" fill="none" stroke="black"/>"#;
    let head = r#"<svg xmlns="http://www.w3.org/2000/svg" width="100" height="100" viewBox="0 0 100 100">"#;
    std::fs::write(&file, format!("{head}{path}</svg>")).unwrap();
    file.to_str().unwrap().to_owned()
}

#[test]
fn a_kawasaki_pc_and_its_robot_speak_tls_whichever_listens() {
    let certificates = Certificates::make();
    let (client, server) = (certificates.options("tls/client"), certificates.options("tls/server"));
    let file = picture(certificates.0.path());
    let pc = start(&["run", "kawasaki", &file, "--listen", "127.0.0.1:0"], &server);
    let place = address(&pc);
    let dial = ["simulate", "kawasaki-robot", "--connect", &place];
    // Robots without TLS, of another authority, and without a certificate.
    for (options, expected) in [
        (vec![], "the peer speaks TLS on this port: give --tls"),
        (certificates.options("other/client"), "not signed by the given authority"),
        (client[..2].to_vec(), "TLS: the peer requires a certificate: give one with its key"),
    ] {
        let robot = start(&dial, &options);
        let why = robot.event("disconnected")["why"].clone();
        assert!(why.as_str().unwrap().contains(expected), "{why}");
    }
    // Silent clients neither delay the robot nor take its place.
    let mut waiting = silent(&place);
    let robot = start(&dial, &client);
    robot.event("connected");
    waiting.extend(silent(&place));
    assert_eq!(pc.event("ended")["why"], "complete");
    let (code, said) = pc.end();
    let refused = [
        "does not speak TLS on this port",
        "refuses this end's certificate",
        "the client has no certificate",
    ];
    assert!(code == Some(0) && refused.iter().all(|why| said.contains(why)), "{said}");

    let robot = start(&["simulate", "kawasaki-robot", "--listen", "127.0.0.1:0"], &server);
    let place = address(&robot);
    let pc = start(&["run", "kawasaki", &file, "--again", "--connect", &place], &client);
    assert_eq!(pc.event("ended")["why"], "complete");
    let plain = start(&["simulate", "kawasaki-robot", "--listen", "127.0.0.1:0"], &[]);
    let pc = start(&["simulate", "kawasaki-pc", "--connect", &address(&plain)], &client);
    let why = pc.event("disconnected")["why"].clone();
    assert!(why.as_str().unwrap().contains("does not speak TLS on this port"), "{why}");
}

/// Cameras and valves that answer the lines of a controller.
fn periphery(listener: &TcpListener, certificates: &Path) {
    let own =
        Identity { certificate: &certificates.join("server.pem"), key: &certificates.join("server.key") };
    let config = server(own, Some(&certificates.join("authority.pem"))).unwrap();
    let mut stream = Secure::accept(listener.accept().unwrap().0, config).unwrap();
    let (mut buffer, mut pending) = ([0; 256], Vec::new());
    while let ReceiveOutcome::Bytes(length) =
        stream.receive(&mut buffer, Wait::limited(TEST_TIMEOUT)).unwrap()
    {
        pending.extend_from_slice(&buffer[..length]);
        while let Some(end) = pending.iter().position(|byte| *byte == b'\n') {
            let line: Vec<u8> = pending.drain(..=end).collect();
            let answer = match line.trim_ascii_end() {
                b"acquire 1" => "part [0.05,-0.02] [-120.0,40.0,10.0,0.0]\n",
                b"acquire 2" => "slot [120.0,40.0,12.0,1.57]\n",
                b"vacuum on" => "ok\nswitch high\n",
                b"vacuum off" => "ok\nswitch low\n",
                _ => "ok\n",
            };
            stream.send(answer.as_bytes()).unwrap();
        }
    }
}

#[test]
fn a_cell_of_mma_speaks_tls_with_both_devices_and_the_periphery() {
    let certificates = Certificates::make();
    let (client, own) = (certificates.options("tls/client"), certificates.options("tls/server"));
    let root = certificates.0.path();
    let task = root.join("plate.toml");
    let part =
        "platform = [0.05, -0.02]\npick = [-120.0, 40.0, 10.0, 0.0]\nplace = [120.0, 40.0, 12.0, 1.57]\n";
    std::fs::write(&task, format!("[task]\nrobot_home = [0.0, 0.0, 100.0, 0.0]\n[[part]]\n{part}")).unwrap();
    let task = task.to_str().unwrap();
    let simulate = |device| start(&["simulate", device, "--listen", "127.0.0.1:0"], &own);
    let (robot, platform) = (simulate("mma-robot"), simulate("mma-platform"));
    let places = [address(&robot), address(&platform)];
    let [a, b] = &places;
    let run = ["run", "mma", task, "--robot", a, "--platform", b, "--again"];
    for (options, expected) in [
        (vec![], "the peer speaks TLS on this port: give --tls"),
        (
            certificates.options("other/client"),
            "TLS: the peer's certificate is self-signed, or not signed by",
        ),
        (client[..2].to_vec(), "TLS: the peer requires a certificate: give one with its key"),
        (
            [&client[..], &["--tls-name".into(), "x.y".into()]].concat(),
            "is for other names: localhost, 127.0.0.1",
        ),
    ] {
        let (_, said) = start(&run, &options).end();
        assert!(said.contains(expected), "{expected}: {said}");
    }
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let place = listener.local_addr().unwrap().to_string().replace("127.0.0.1", "localhost");
    let folder = root.join("tls");
    let cameras = thread::spawn(move || periphery(&listener, &folder));
    let controller = start(&[&run[..], &["--periphery", &place]].concat(), &client);
    robot.event("connected");
    // A client that is silent, or does not speak TLS, does not take the place of the controller.
    let waiting = silent(a);
    (&waiting[0]).write_all(b"SVON\r\n").unwrap();
    let mut alert = Vec::new();
    BufReader::new(&waiting[0]).read_until(b'\r', &mut alert).unwrap();
    assert!(alert.starts_with(&[0x15, 3]), "{alert:?}");
    let ended = controller.event("ended");
    assert_eq!((&ended["why"], &ended["done"]), (&"complete".into(), &1.into()), "{ended}");
    cameras.join().unwrap();
    assert!(robot.event("disconnected")["why"].as_str().unwrap().contains("by CLO"));
}
