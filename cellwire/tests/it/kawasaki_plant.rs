//! Two plants: the same messages under two files of settings, and files that cannot be.

use std::fs;
use std::io::{BufRead, BufReader, Write};
use std::path::PathBuf;
use std::process::{Child, Command, Output, Stdio};

use serde_json::Value;

fn plant(name: &str) -> String {
    format!("{}/../kawasaki-msg/plants/{name}.toml", env!("CARGO_MANIFEST_DIR"))
}

/// Returns whether the tool succeeds with this input, its output and its remarks.
fn cellwire(args: &[&str], input: &str) -> (bool, String, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_cellwire"));
    command.args(args).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    // A command that refuses its settings reads no input.
    let _ = child.stdin.take().unwrap().write_all(input.as_bytes());
    let Output { status, stdout, stderr } = child.wait_with_output().unwrap();
    (status.success(), String::from_utf8(stdout).unwrap(), String::from_utf8(stderr).unwrap())
}

fn encode(plant: &str, objects: &str) -> String {
    let (ok, hex, remarks) =
        cellwire(&["encode", "kawasaki-msg", "--settings", plant, "--set", "roles=true"], objects);
    assert!(ok, "{remarks}");
    hex
}

fn text(hex: &str) -> String {
    let bytes = hex.split_whitespace().map(|byte| u8::from_str_radix(byte, 16).unwrap());
    bytes.map(char::from).collect()
}

/// Returns the message objects in a packet.
fn decode(plant: &str, hex: &str) -> Vec<Value> {
    let args = ["decode", "kawasaki-msg", "--settings", plant, "--set", "roles=true", "--format", "hex"];
    let (ok, lines, remarks) = cellwire(&args, hex);
    assert!(ok, "{remarks}{lines}");
    lines.lines().map(|line| serde_json::from_str::<Value>(line).unwrap()["message"].take()).collect()
}

/// A packet of a PC's: a start, a job, the end.
const PACKET: &str = r#"{"role":"order_start","values":{"order":50,"number":1}}
{"role":"job","values":{"order":50,"number":1},"work":["1","-3000","550","-2993","537"]}
{"role":"order_end","values":{"order":50}}
{"role":"filler"}
"#;

#[test]
fn one_packet_under_two_plants() {
    let [default, other] = [plant("default"), plant("other")];
    let ours = encode(&default, PACKET);
    let start = "<TilausAlkaa$4#50$1#>";
    let job = "<Tyo$26#50$1$1$-3000$550$-2993$537#>";
    assert_eq!(text(&ours), format!("{start}{job}<TilausLoppuu$2#50#><Huuhaa$0##>"));
    let packet = PACKET.replace(r#"{"order":50,"number":1}}"#, r#"{"order":50}}"#);
    let theirs = encode(&other, &packet);
    let job = "<Auftrag$7$30#1$50$1$-3000$550$-2993$537$EOJ#>";
    assert_eq!(text(&theirs), format!("<Anfang$7$2#50#>{job}<Schluss$7$2#50#><Nichts$7$0##>"));
    let mut read = decode(&default, &ours);
    assert_eq!(read[1]["work"].as_array().unwrap().len(), 5);
    // The start message of that plant does not contain the first job's number.
    read[0]["values"].as_object_mut().unwrap().remove("number");
    assert_eq!(decode(&other, &theirs), read);
}

/// The file in the repository is what the tool does without one.
#[test]
fn the_default_file_is_the_default() {
    let (ok, without, _) = cellwire(&["encode", "kawasaki-msg", "--set", "roles=true"], PACKET);
    assert_eq!((ok, without), (true, encode(&plant("default"), PACKET)));
}

#[test]
fn what_is_not_of_the_plant_is_an_error_object() {
    let hex = |text: &str| text.bytes().map(|byte| format!("{byte:02X} ")).collect::<String>();
    for (wire, kind) in [
        ("<Tyo$26#50$1$1$-3000$550$-2993$537#>", "unknown_name"),
        ("<Auftrag$8$10#1$50$1$EOJ#>", "header"),
        ("<Auftrag$7$11#1$50$1$EOX1#>", "not_the_constant"),
        ("<Anfang$7$5#65536#>", "out_of_range"),
    ] {
        let other = plant("other");
        let args = ["decode", "kawasaki-msg", "--settings", &other, "--set", "roles=true", "--format", "hex"];
        let (_, lines, _) = cellwire(&args, &hex(wire));
        let line: Value = serde_json::from_str(lines.lines().next().unwrap()).unwrap();
        assert_eq!(line["error"]["kind"], kind, "{line}");
    }
}

/// A file of settings that is gone with the test.
struct File(PathBuf);

impl File {
    fn new(name: &str, text: &str) -> Self {
        let path = std::env::temp_dir().join(format!("cellwire-plant-{name}-{}.toml", std::process::id()));
        fs::write(&path, text).unwrap();
        Self(path)
    }
}

impl Drop for File {
    fn drop(&mut self) {
        let _ = fs::remove_file(&self.0);
    }
}

/// Refused before anything is read, with the line, the setting and what it can be.
#[test]
fn a_plant_that_contradicts_itself_is_refused_with_its_line() {
    for (name, text, line, why) in [
        (
            "field",
            "charset = \"ascii\"\n\n[messages.job]\nfields = [\"order\", \"speed\"]\n",
            4,
            "`speed` is not a field",
        ),
        ("lacks", "[messages.end_ack]\nname = \"E\"\nfields = [\"ended\"]\n", 1, "lacks the field Executed"),
        ("twice", "[messages.filler]\nname = \"Tyo\"\n", 1, "is empty, duplicate or unencodable"),
        ("needed", "[messages.status]\nsent = false\n", 1, "must have the role Status once"),
        (
            "double",
            "\n[messages.pause]\nfields = [\"order\", \"order\"]\n",
            2,
            "has a duplicate or invalid field",
        ),
        ("work", "\n\n[messages.pause]\nfields = [\"work\"]\n", 3, "has a duplicate or invalid field"),
        ("choice", "charset = \"utf8\"\n", 1, "give ascii, latin1"),
    ] {
        let file = File::new(name, text);
        let path = file.0.to_str().unwrap();
        let (ok, out, remarks) = cellwire(&["encode", "kawasaki-msg", "--settings", path], PACKET);
        assert!(!ok && out.is_empty(), "{name}: {out}");
        assert!(
            remarks.contains(&format!("{path}, line {line}: ")) && remarks.contains(why),
            "{name}: {remarks}"
        );
    }
    let file = File::new("unknown", "[messages.jobb]\nname = \"X\"\n");
    let (ok, _, remarks) =
        cellwire(&["encode", "kawasaki-msg", "--settings", file.0.to_str().unwrap()], PACKET);
    assert!(!ok && remarks.contains("no setting `messages.jobb"), "{remarks}");
}

/// A job or a value that the plant cannot send: nothing is written of it, and the others are.
#[test]
fn an_object_that_does_not_fit_costs_only_itself() {
    let objects = r#"{"role":"order_end","values":{"order":70000}}
{"role":"order_end","values":{"order":1,"phase":2}}
{"role":"job","values":{"order":1,"number":1},"work":["a$b"]}
{"role":"pausa"}
{"role":"order_end","values":{"order":2}}
"#;
    let (ok, hex, remarks) = cellwire(&["encode", "kawasaki-msg", "--set", "roles=true"], objects);
    assert_eq!((ok, text(&hex).as_str()), (false, "<TilausLoppuu$2#2#>".replace("$2#2", "$1#2").as_str()));
    let lines: Vec<&str> = remarks.lines().collect();
    assert!(lines[0].contains("line 1: field 0 is 70000, not from 0 to 65535"), "{remarks}");
    assert!(lines[1].contains("line 2: a value is not a field of the message `TilausLoppuu`"), "{remarks}");
    assert!(lines[2].contains("line 3: '$' is not allowed in a name or field"), "{remarks}");
    assert!(lines[3].contains("line 4: the plant has no message of the role `pausa`"), "{remarks}");
}

struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

impl Running {
    fn start(device: &str, arguments: &[&str]) -> (Self, impl Iterator<Item = Value> + use<>) {
        let mut command = Command::new(env!("CARGO_BIN_EXE_cellwire"));
        command.args(["simulate", device, "--settings", &plant("other")]).args(arguments);
        let mut process = command.stdout(Stdio::piped()).spawn().unwrap();
        let lines = BufReader::new(process.stdout.take().unwrap()).lines();
        (Self(process), lines.map(|line| serde_json::from_str(&line.unwrap()).unwrap()))
    }
}

/// Both simulated ends, in the other plant.
#[test]
fn an_order_is_drawn_in_the_other_plant() {
    let (_pc, mut lines) = Running::start("kawasaki-pc", &["--listen", "127.0.0.1:0"]);
    let address = lines.next().unwrap()["listen"].as_str().unwrap().to_owned();
    let (_robot, _lines) =
        Running::start("kawasaki-robot", &["--connect", &address, "--set", "speed=10000000"]);
    let over = lines.find(|line| line["event"] == "order_over").unwrap();
    assert_eq!((&over["order"], &over["complete"]), (&50.into(), &true.into()), "{over}");
}

/// A job as a draft of a capture describes it.
const DRAFTED: &str = "[[job]]
name = \"field_1\"
kind = \"whole\"
range = [3, 5]

[[job]]
name = \"field_2\"
kind = \"decimal\"
places = 1
range = [-10.0, 10.0]

[[job]]
name = \"field_3\"
kind = \"text\"
length = [1, 4]

[messages.order_interrupt]
sent = false
";

#[test]
fn a_simulated_pc_sends_example_jobs_in_a_plant_whose_jobs_are_not_lines() {
    use crate::operated::Tool;
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (plant, record) = (path("draft.toml"), path("record.csv"));
    fs::write(&plant, DRAFTED).unwrap();
    let pc = ["simulate", "kawasaki-pc", "--listen", "127.0.0.1:0", "--settings", &plant];
    let pc = Tool::start(&pc);
    let address = pc.line()["listen"].as_str().unwrap().to_owned();
    let record_to = format!("record={record}");
    let robot = ["simulate", "kawasaki-robot", "--connect", &address, "--settings", &plant];
    let robot = Tool::start(&[&robot[..], &["--set", "job_time=1ms", "--set", &record_to]].concat());
    robot.event("order_over");
    drop(robot);
    let rows = fs::read_to_string(&record).unwrap();
    let first =
        "order,number,field_1,field_2,field_3\n50,1,3,0.0,A\n50,2,4,0.1,A\n50,3,5,0.2,A\n50,4,3,0.3,A\n";
    assert!(rows.starts_with(first) && rows.lines().count() == 11, "{rows}");
    drop(pc);
    // A drawing needs lines, and another missing message its name.
    let (ok, _, said) = cellwire(&[&pc_with(&plant)[..], &["--set", "drawing=a.svg"]].concat(), "");
    assert!(!ok && said.contains("the plant's jobs are not lines"), "{said}");
    let (ok, _, said) = cellwire(&[&pc_with(&plant)[..], &["--set", "takeover=interrupt"]].concat(), "");
    assert!(!ok && said.contains("with takeover=end or never it does not"), "{said}");
    fs::write(&plant, format!("{DRAFTED}\n[messages.order_start]\nsent = false\n")).unwrap();
    let (ok, _, said) = cellwire(&pc_with(&plant), "");
    assert!(
        !ok && said.contains("the table must have the role OrderStart once; set messages.order_start.name"),
        "{said}"
    );
    let remark = "the plant's jobs are not lines: [[job]] has no numbers kind, x1, y1, x2, y2: an order is 10 jobs with example values of \
                  its fields\n";
    assert!(said.contains(remark), "{said}");
}

fn pc_with(plant: &str) -> [&str; 6] {
    ["simulate", "kawasaki-pc", "--listen", "nowhere", "--settings", plant]
}

/// A run that lacks the plant's table of messages understands nothing of its robot.
#[test]
fn a_run_without_the_table_of_its_robot_says_so_and_ends() {
    let folder = tempfile::tempdir().unwrap();
    let jobs = folder.path().join("line.svg");
    fs::write(&jobs, r#"<svg xmlns="http://www.w3.org/2000/svg" width="9" height="9"><path d="M1 1H8" stroke="black"/></svg>"#).unwrap();
    let arguments =
        ["run", "kawasaki", jobs.to_str().unwrap(), "--listen", "127.0.0.1:0", "--robot-timeout", "1s"];
    let mut run = Command::new(env!("CARGO_BIN_EXE_cellwire"));
    let mut run = run
        .args(arguments)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut lines = BufReader::new(run.stdout.take().unwrap()).lines().map(Result::unwrap);
    let ready: Value = serde_json::from_str(&lines.next().unwrap()).unwrap();
    let robot = [
        "simulate",
        "kawasaki-robot",
        "--settings",
        &plant("other"),
        "--connect",
        ready["listen"].as_str().unwrap(),
    ];
    let mut robot = Command::new(env!("CARGO_BIN_EXE_cellwire"))
        .args(robot)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    let hint = lines.find(|line| line.contains("\"hint\"")).unwrap();
    assert!(hint.contains("no message of the robot is in the table of messages"), "{hint}");
    let output = run.wait_with_output().unwrap();
    robot.kill().unwrap();
    robot.wait().unwrap();
    assert_eq!(output.status.code(), Some(2), "{}", String::from_utf8_lossy(&output.stderr));
}
