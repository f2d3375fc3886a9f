//! `cellwire bridge`: what is wrong in a hall's file is found before anything is connected. What happens with a broker is
//! `.ci/bridge`.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

use std::path::Path;
use std::process::Command;

const HALL: &str = r#"[broker]
address = "broker:8883"
group = "hall"
node = "bridge"

[store]
file = "hall.redb"

[cell.robot]
link = "fanuc-hmi-modbus"
address = "10.0.0.1:502"
settings = { poll = "100ms" }
"#;

fn check(folder: &Path, text: &str) -> (Option<i32>, String) {
    let file = folder.join("hall.toml");
    std::fs::write(&file, text).unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_cellwire"));
    let output = command.args(["bridge", "--check"]).arg(&file).output().unwrap();
    let out = String::from_utf8(output.stdout).unwrap() + &String::from_utf8(output.stderr).unwrap();
    (
        output.status.code(),
        out.replace(file.to_str().unwrap(), "hall.toml").replace(folder.to_str().unwrap(), "FOLDER"),
    )
}

#[test]
fn a_hall_is_checked_without_a_connection() {
    let folder = tempfile::tempdir().unwrap();
    let line = "{\"hall\":\"hall.toml\",\"broker\":\"broker:8883\",\"cells\":[\"robot\"]}\n";
    assert_eq!(check(folder.path(), HALL), (Some(0), line.into()));
    assert!(!folder.path().join("hall.redb").exists());
}

#[test]
fn what_is_wrong_has_its_line() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("empty.pem"), "nothing").unwrap();
    for (from, to, error) in [
        ("broker:8883", "broker", "line 2: broker.address: give HOST:PORT, such as broker.example:8883"),
        ("\"hall\"", "\"a/b\"", "line 3: broker.group: a topic's level has no '/'"),
        ("node = \"bridge\"", "node = \"bridge\"\nqos = 2", "line 5: broker.qos: give 0 or 1"),
        (
            "node = \"bridge\"",
            "node = \"bridge\"\ntls = { ca = \"empty.pem\" }",
            "line 5: FOLDER/empty.pem has no BEGIN CERTIFICATE in PEM form",
        ),
        ("\"fanuc-hmi-modbus\"", "\"fanuc\"", "line 9: cell robot: no link is called fanuc"),
        (
            "poll = \"100ms\"",
            "poll = 100",
            "line 12: cell robot: poll=100: not a time with its unit, such as 250ms or 1.5s, give 10ms to 1h",
        ),
        (
            "address = \"10.0.0.1:502\"\n",
            "",
            "line 9: cell robot: give address (HOST:PORT, or the path of a serial port), or listen where the device connects to \
             the PC",
        ),
    ] {
        assert_eq!(
            check(folder.path(), &HALL.replace(from, to)),
            (Some(2), format!("error: hall.toml, {error}\n"))
        );
    }
    let (status, error) = check(folder.path(), &HALL.replace("link = \"fanuc-hmi-modbus\"", "links = 1"));
    assert_eq!(status, Some(2));
    assert!(error.contains("at line 10, column 1") && error.contains("unknown field `links`"), "{error}");
}

#[test]
fn the_hall_of_the_page_is_right() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("ca.pem"), "-----BEGIN CERTIFICATE-----").unwrap();
    std::fs::write(folder.path().join("bridge.password"), "correct horse\n").unwrap();
    let page = include_str!("../../docs/bridge.md");
    let hall = page.split("```toml\n").nth(1).unwrap().split("```").next().unwrap();
    let cells = r#"["arm","assembly","ball","cutter","handling","painter","screen"]"#;
    let line = format!("{{\"hall\":\"hall.toml\",\"broker\":\"broker.example:8883\",\"cells\":{cells}}}\n");
    assert_eq!(check(folder.path(), hall), (Some(0), line));
}
