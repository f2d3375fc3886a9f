//! The site file and its store, as `--check` sees them.

use std::net::TcpListener;
use std::os::unix::fs::PermissionsExt as _;
use std::path::Path;
use std::process::Command;

use crate::{ball, bridge, figure, until};

const SITE: &str = r#"[broker]
address = "broker:8883"
group = "site"
node = "bridge"

[store]
file = "site.redb"

[cell.robot]
link = "fanuc-hmi-modbus"
address = "10.0.0.1:502"
settings = { poll = "100ms" }
"#;

fn check(folder: &Path, text: &str) -> (Option<i32>, String) {
    let file = folder.join("site.toml");
    std::fs::write(&file, text).unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_cellwire-bridge"));
    let output = command.args(["--check", "--config"]).arg(&file).output().unwrap();
    let out = String::from_utf8(output.stdout).unwrap() + &String::from_utf8(output.stderr).unwrap();
    (
        output.status.code(),
        out.replace(file.to_str().unwrap(), "site.toml").replace(folder.to_str().unwrap(), "FOLDER"),
    )
}

#[test]
fn shared_cells_need_one_broker_and_a_device_that_another_bridge_reaches() {
    let folder = tempfile::tempdir().unwrap();
    let site = SITE
        .replace("[cell.robot]", "[share]\nbridges = [\"bridge\", \"other\"]\n\n[cell.robot]\nshared = true");
    assert_eq!(check(folder.path(), &site).0, Some(0));
    for (from, to, error) in [
        ("[share]\nbridges = [\"bridge\", \"other\"]", "", "cell.robot.shared: there is no table [share]"),
        ("shared = true", "", "share: no cell is shared: set shared = true for shared cells"),
        (
            "\"bridge\", \"other\"",
            "\"a\", \"b\"",
            "share.bridges: list the nodes of all bridges that share cells",
        ),
        (
            "[\"bridge\", \"other\"]",
            "[\"bridge\"]",
            "share.bridges: list the nodes of all bridges that share cells",
        ),
        ("\"other\"", "\"a+\"", "share.bridges: a topic level must not have '+'"),
        (
            "\"broker:8883\"",
            "[\"a:1\", \"b:1\"]",
            "broker.address: bridges that share cells must use one broker",
        ),
        (
            "\"10.0.0.1:502\"",
            "\"/dev/ttyS0\"",
            "cell.robot.shared: a shared device needs HOST:PORT, not a serial port or listen",
        ),
    ] {
        assert!(site.contains(from));
        let (status, said) = check(folder.path(), &site.replace(from, to));
        assert!(status == Some(2) && said.contains(&format!(": {error}")), "{said}");
    }
}

fn secret(path: &Path, mode: u32) {
    std::fs::write(path, "correct horse\n").unwrap();
    std::fs::set_permissions(path, std::fs::Permissions::from_mode(mode)).unwrap();
}

#[test]
fn a_site_is_checked_without_a_connection() {
    let folder = tempfile::tempdir().unwrap();
    let line = "{\"site\":\"site.toml\",\"broker\":\"broker:8883\",\"cells\":[\"robot\"]}\n";
    assert_eq!(check(folder.path(), SITE), (Some(0), line.into()));
    assert!(!folder.path().join("site.redb").exists());
}

#[test]
fn what_is_wrong_has_its_line() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("empty.pem"), "nothing").unwrap();
    let bad = "-----BEGIN CERTIFICATE-----\nno base64!\n-----END CERTIFICATE-----\n";
    std::fs::write(folder.path().join("bad.pem"), bad).unwrap();
    for (from, to, error) in [
        ("broker:8883", "broker", "line 2: broker.address: give HOST:PORT, such as broker.example:8883"),
        ("\"site\"", "\"a/b\"", "line 3: broker.group: a topic level must not have '/'"),
        (
            "\"broker:8883\"",
            "[\"a:1\", \"b\"]",
            "line 2: broker.address: give HOST:PORT, such as broker.example:8883",
        ),
        (
            "node = \"bridge\"",
            "node = \"bridge\"\njson = \"a/#\"",
            "line 5: broker.json: a topic level must not have '#'",
        ),
        (
            "node = \"bridge\"",
            "node = \"bridge\"\njson = \"spBv1.0/x\"",
            "line 5: broker.json: this topic prefix is reserved",
        ),
        (
            "file = \"site.redb\"",
            "file = \"site.redb\"\nbytes = \"15KiB\"",
            "line 8: store.bytes: give 16KiB or more",
        ),
        (
            "settings = { poll = \"100ms\" }",
            "dead_band = { \"Telemetry/Y\" = 1 }",
            "line 12: cell robot: dead_band: Telemetry/Y is neither a metric of this link nor a folder of metrics",
        ),
        ("node = \"bridge\"", "node = \"bridge\"\nqos = 2", "line 5: broker.qos: give 0 or 1"),
        (
            "node = \"bridge\"",
            "node = \"bridge\"\ntls = { ca = \"empty.pem\" }",
            "line 5: FOLDER/empty.pem: no BEGIN CERTIFICATE in PEM format",
        ),
        (
            "node = \"bridge\"",
            "node = \"bridge\"\ntls = { ca = \"bad.pem\" }",
            "line 5: FOLDER/bad.pem: a certificate is not in PEM format: base64 decode error: InvalidCharacter(33)",
        ),
        (
            "10.0.0.1:502",
            "/dev/ttyS0",
            "line 9: cell robot: /dev/ttyS0 looks like a serial port, but this link uses TCP: give HOST:PORT",
        ),
        (
            "\"fanuc-hmi-modbus\"\naddress = \"10.0.0.1:502\"\nsettings = { poll = \"100ms\" }",
            "\"kawasaki-msg\"\naddress = \"10.0.0.1:502\"\nsettings = { udp = true }",
            "line 9: cell robot: over UDP the robot sends first: give listen instead of address",
        ),
        (
            "\"fanuc-hmi-modbus\"",
            "\"fanuk\"",
            "line 9: cell robot: no link is called fanuk; the links are kawasaki, alter, viewer, ball, fanuc, laser, mma; did you mean `fanuc`?",
        ),
        (
            "poll = \"100ms\"",
            "poll = 100",
            "line 12: cell robot: poll=100: not a time with its unit, such as 250ms or 1.5s, give 10ms to 1h",
        ),
        (
            "settings = { poll = \"100ms\" }",
            "connect_pause = \"2min\"",
            "line 9: cell robot: connect_pause is longer than a minute",
        ),
        (
            "\"fanuc-hmi-modbus\"\naddress = \"10.0.0.1:502\"\nsettings = { poll = \"100ms\" }",
            "\"kawasaki-msg\"\nlisten = \"127.0.0.1:0\"\nconnect_pause = \"1s\"",
            "line 9: cell robot: connect_pause has no effect on a device that connects to the PC",
        ),
        (
            "address = \"10.0.0.1:502\"\n",
            "",
            "line 9: cell robot: give address (HOST:PORT or a serial port), or listen if the device connects to the PC",
        ),
    ] {
        assert_eq!(
            check(folder.path(), &SITE.replace(from, to)),
            (Some(2), format!("error: site.toml, {error}\n"))
        );
    }
    let (status, error) = check(folder.path(), &SITE.replace("link = \"fanuc-hmi-modbus\"", "links = 1"));
    assert_eq!(status, Some(2));
    assert!(error.contains("at line 10, column 1") && error.contains("unknown field `links`"), "{error}");
}

#[test]
fn what_is_unsafe_has_to_be_allowed() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("secret");
    let site = |more: &str| SITE.replace("node = \"bridge\"", &format!("node = \"bridge\"\n{more}"));
    let login = "user = \"u\"\npassword_file = \"secret\"";
    let ok = |text: &str| check(folder.path(), text).0 == Some(0);
    let refused = |text: &str, error: &str| {
        assert_eq!(check(folder.path(), text), (Some(2), format!("error: site.toml, {error}\n")));
    };
    secret(&file, 0o600);
    let clear = "line 6: the password would be sent to broker:8883 in clear text: set tls, or allow = [\"password_without_tls\"]";
    refused(&site(login), clear);
    assert!(ok(&site(&format!("{login}\nallow = [\"password_without_tls\"]"))));
    assert!(
        ["localhost", "127.0.0.1", "[::1]"]
            .iter()
            .all(|host| ok(&site(login).replace("broker:8883", &format!("{host}:1883"))))
    );
    secret(&file, 0o644);
    let here = site(login).replace("broker:8883", "localhost:1883");
    let readable =
        "line 6: FOLDER/secret is world-readable: chmod 600 it, or set allow = [\"readable_secrets\"]";
    refused(&here, readable);
    assert!(ok(&here.replace(login, &format!("{login}\nallow = [\"readable_secrets\"]"))));
    refused(
        &site("tls = { ca = \"secret\", certificate = \"secret\", key = \"secret\" }"),
        &readable.replace('6', "5").replacen("chmod 500", "chmod 600", 1),
    );
    let (status, error) = check(folder.path(), &site("allow = [\"anything\"]"));
    assert!(status == Some(2) && error.contains("unknown variant `anything`"), "{error}");
    let (status, error) = check(folder.path(), &site("mqtt = \"4\""));
    assert!(status == Some(2) && error.contains("unknown variant `4`, expected `5` or `3.1.1`"), "{error}");
}

#[test]
fn a_check_says_what_a_start_would_do_with_the_store() {
    let folder = tempfile::tempdir().unwrap();
    let ball = ball();
    let nobody = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().to_string();
    let mut bridge = bridge(folder.path(), &nobody, &ball);
    until("records", || figure(&bridge, "store_records") > 3);
    let store = folder.path().join("s.redb");
    assert_eq!(std::fs::metadata(&store).unwrap().permissions().mode() & 0o777, 0o600);
    let text = std::fs::read_to_string(folder.path().join("site.toml")).unwrap();
    let line = |text: &str| check(folder.path(), text).1.lines().nth(1).unwrap().to_owned();
    let busy = line(&text);
    assert!(busy.contains("in use by a running bridge"), "{busy}");
    assert_eq!(bridge.signal("-TERM"), Some(0));
    let same = line(&text);
    assert!(same.starts_with("{\"store\":\"FOLDER/s.redb\",\"records\":"), "{same}");
    assert!(same.ends_with(",\"dropped_orphans\":{}}"), "{same}");
    let count: u64 =
        same["{\"store\":\"FOLDER/s.redb\",\"records\":".len()..].split(',').next().unwrap().parse().unwrap();
    let renamed = line(&text.replace("[cell.ball]", "[cell.sphere]"));
    assert!(renamed.ends_with(&format!(",\"dropped_orphans\":{{\"ball\":{count}}}}}")), "{renamed}");
    let records = folder.path().join("s.redb.records");
    assert_eq!(std::fs::metadata(&records).unwrap().permissions().mode() & 0o777, 0o600);
    let good = std::fs::read(&records).unwrap();
    std::fs::write(&records, &good[..good.len() / 2]).unwrap();
    let (status, error) = check(folder.path(), &text);
    assert!(status == Some(2) && error.contains("s.redb.records has "), "{error}");
    std::fs::write(&records, &good).unwrap();
    let length = std::fs::metadata(&store).unwrap().len();
    std::fs::File::options().write(true).open(&store).unwrap().set_len(length / 2).unwrap();
    let (status, error) = check(folder.path(), &text);
    assert!(status == Some(2) && error.contains("is damaged"), "{error}");
}

#[test]
fn the_sites_of_the_page_are_right() {
    let folder = tempfile::tempdir().unwrap();
    let ca = "-----BEGIN CERTIFICATE-----\nAAAA\n-----END CERTIFICATE-----\n";
    std::fs::write(folder.path().join("ca.pem"), ca).unwrap();
    secret(&folder.path().join("bridge.password"), 0o600);
    let page = include_str!("../../../docs/bridge.md");
    let mut sites = page.split("```toml\n").skip(1).map(|block| block.split("```").next().unwrap());
    for (broker, cells) in [
        ("127.0.0.1:1883", r#"["cutter","robot"]"#),
        ("broker.example:8883", r#"["arm","assembly","ball","cutter","handling","painter","screen"]"#),
    ] {
        let line = format!("{{\"site\":\"site.toml\",\"broker\":\"{broker}\",\"cells\":{cells}}}\n");
        assert_eq!(check(folder.path(), sites.next().unwrap()), (Some(0), line));
    }
}

#[test]
fn a_shell_and_man_have_its_options() {
    let folder = tempfile::tempdir().unwrap();
    let bridge = |option: &str, value: &Path| {
        let output =
            Command::new(env!("CARGO_BIN_EXE_cellwire-bridge")).arg(option).arg(value).output().unwrap();
        assert!(output.status.success(), "{output:?}");
        String::from_utf8(output.stdout).unwrap()
    };
    let completions = bridge("--completions", Path::new("bash"));
    assert!(
        completions.contains("default cellwire-bridge\n") && completions.contains("--config"),
        "{completions}"
    );
    assert_eq!(bridge("--man", folder.path()), "");
    let page = std::fs::read_to_string(folder.path().join("cellwire-bridge.1")).unwrap();
    assert!(page.contains("Settings of a cell of kawasaki"), "{page}");
}
