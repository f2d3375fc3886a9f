//! `cellwire ls` and `cellwire fanuc` as processes: their output, their files and their exit status.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::{Arc, Mutex};
use std::thread;

use cellwire::devices::fanuc_hmi_modbus::simulate::connection;
use cellwire_io::clock::Clock;
use cellwire_sim::fanuc::{Controller, circle};
use cellwire_sim::host::{Listener, Server};
use fanuc_hmi_modbus::{ServerConfig, WordOrder};
use serde_json::Value;

/// A folder of its own, removed when the test ends.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("cellwire-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&path).unwrap();
        Self(path)
    }

    fn write(&self, name: &str, text: &[u8]) {
        std::fs::write(self.0.join(name), text).unwrap();
    }

    fn read(&self, name: &str) -> String {
        std::fs::read_to_string(self.0.join(name)).unwrap()
    }

    fn run(&self, arguments: &str) -> Output {
        let arguments = arguments.split_whitespace();
        Command::new(env!("CARGO_BIN_EXE_cellwire")).args(arguments).current_dir(&self.0).output().unwrap()
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        drop(std::fs::remove_dir_all(&self.0));
    }
}

fn out(output: &Output) -> &str {
    std::str::from_utf8(&output.stdout).unwrap()
}

fn err(output: &Output) -> &str {
    std::str::from_utf8(&output.stderr).unwrap()
}

fn reference(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../reference/ls").join(name)
}

/// Returns a trajectory of 2 s along X and about Z of a robot, every 8 ms.
fn trajectory() -> String {
    let row = |k: u32| {
        let t = f64::from(k) * 0.008;
        let s = (1.0 - (t * core::f64::consts::PI / 2.0).cos()) / 2.0;
        format!("{t:.3},{:.4},{:.4},-10,5,-80,{:.4}\n", 15.0 * s, 10.0 * s, 30.0 * s)
    };
    String::from("time,J1,J2,J3,J4,J5,J6\n") + &(0..=250).map(row).collect::<String>()
}

#[test]
fn check_reports_an_error_with_its_line_and_column() {
    let folder = Folder::new("check");
    folder.write("BAD.LS", b"/PROG  BAD\r\n/MN\r\n   1:J P[1] 100% CNT101    ;\r\n/END\r\n");
    let output = folder.run("ls check BAD.LS");
    assert_eq!(output.status.code(), Some(1));
    assert_eq!(
        out(&output),
        "BAD.LS: BAD, 1 instruction (no motions), 0 positions\n\
         BAD.LS:3:21: error: expected CNT with 0 to 100, or with a register\n \
         3 |    1:J P[1] 100% CNT101    ;\n   |                     ^\n  help: correct it: a controller would not take it\n"
    );
    let output = folder.run("ls check --format json BAD.LS");
    let object: Value = serde_json::from_str(out(&output)).unwrap();
    assert_eq!((&object["ok"], &object["error"]["kind"]), (&Value::from(false), &Value::from("continuous")));
    // A missing file does not hide the errors of the next one.
    let output = folder.run("ls check NONE.LS BAD.LS");
    assert_eq!(output.status.code(), Some(2));
    assert!(out(&output).contains("\nBAD.LS:3:21: "), "{}", out(&output));
    assert!(err(&output).ends_with("error: 1 of 2 files cannot be read\n"), "{}", err(&output));
}

#[test]
fn check_reports_warnings_and_succeeds() {
    let folder = Folder::new("warn");
    std::fs::copy(reference("figure-4.ls"), folder.0.join("FANUCTEST2_TDMAX05TDMIN005.LS")).unwrap();
    // A comment in Latin-1, as a controller set to German writes it.
    folder.write("GRUEN.LS", b"/PROG  GRUEN\r\n/MN\r\n   1:  !gr\xFCn ;\r\n/POS\r\n/END\r\n");
    let output = folder.run("ls check FANUCTEST2_TDMAX05TDMIN005.LS GRUEN.LS");
    assert_eq!(output.status.code(), Some(0), "{}", out(&output));
    let lines: Vec<&str> = out(&output).lines().collect();
    assert_eq!(
        lines,
        [
            "FANUCTEST2_TDMAX05TDMIN005.LS: FanucTest2_tdMax05tdMin005 \"FanucTest2_tdMax05tdMin005\", \
             5 instructions (1 J, 2 S), 5 positions",
            "FANUCTEST2_TDMAX05TDMIN005.LS:3:1: warning: COMMENT has 26 characters, the controller keeps 16",
            "  help: shorten it: the rest is lost on the controller",
            "FANUCTEST2_TDMAX05TDMIN005.LS:32:1: warning: P[4] is not used",
            "  help: delete the position, or check which motion should go there",
            "FANUCTEST2_TDMAX05TDMIN005.LS:38:1: warning: P[5] is not used",
            "  help: delete the position, or check which motion should go there",
            "GRUEN.LS: GRUEN, 1 instruction (no motions), 0 positions",
            "  note: not UTF-8; read as Latin-1",
        ]
    );
    assert_eq!(folder.run("ls check --name-limit 4 GRUEN.LS").status.code(), Some(1));
    // A warning about a comment does not hide an error.
    let text = "/PROG  A\r\n/ATTR\r\nCOMMENT = \"seventeen letters\";\r\n/MN\r\n   1:J P[1] 0% FINE ;\r\n/POS\r\n/END\r\n";
    folder.write("B.LS", text.as_bytes());
    let output = folder.run("ls check --format json B.LS");
    assert_eq!(output.status.code(), Some(1), "{}", out(&output));
    let object: Value = serde_json::from_str(out(&output)).unwrap();
    assert_eq!((&object["error"]["kind"], &object["same_name"]), (&"speed_range".into(), &false.into()));
}

#[test]
fn a_folder_is_summarized_and_fails_when_a_file_has_errors() {
    let folder = Folder::new("summary");
    std::fs::create_dir_all(folder.0.join("backup/old")).unwrap();
    folder.write("backup/A.LS", b"/PROG  A\n/MN\n   1:J P[1] 5% FINE ;\n   2:J P[1] 5% FINE ;\n/POS\nP[1]{GP1:UF:0,UT:1,J1=0 deg};\nP[2]{GP1:UF:0,UT:1,J1=0 deg};\n/END\n");
    folder.write("backup/notes.txt", b"no program");
    let output = folder.run("ls list backup");
    assert_eq!(
        (output.status.code(), out(&output)),
        (
            Some(0),
            "backup: 1 file, 1 program: 2 lines, 2 motions, 2 positions\n  warning unused position: 1 in 1 file\n"
        )
    );
    folder.write("backup/old/B.ls", b"/PROG  B\n/MN\n   1:J P[1] FINE ;\n");
    let output = folder.run("ls list backup");
    assert_eq!(output.status.code(), Some(1));
    assert_eq!(
        out(&output).lines().skip(1).collect::<Vec<_>>(),
        [
            "  error   end: 1 in 1 file",
            "  warning unused position: 1 in 1 file",
            "1 file has errors: `cellwire ls check backup` shows where"
        ]
    );
    let output = folder.run("ls check backup");
    assert_eq!(output.status.code(), Some(1));
    assert!(out(&output).contains("backup/old/B.ls:4:1: error: expected `/END`\n"), "{}", out(&output));
    assert_eq!(folder.run("ls list backup/notes.txt").status.code(), Some(1));
}

#[test]
fn check_prints_findings_in_other_forms_and_fails_by_level() {
    let folder = Folder::new("forms");
    std::fs::create_dir_all(folder.0.join("cell/empty")).unwrap();
    folder.write("cell/A.LS", b"/PROG  A\n/MN\n   1:  CALL B ;\n   2:  CALL MISSING ;\n   3:  GRIP OPEN ;\n   4:  END ;\n   5:  R[1]=1 ;\n/END\n");
    folder.write("cell/B.LS", b"/PROG  B\n/MN\n   1:  CAL A ;\n/END\n");
    let output = folder.run("ls check cell --format short");
    assert_eq!(output.status.code(), Some(1));
    assert_eq!(
        out(&output),
        "cell/A.LS:4:8: hint: no program has this name\n\
         cell/A.LS:5:8: hint: unknown instruction: it must be a macro\n\
         cell/A.LS:7:8: warning: unreachable line\n\
         cell/B.LS:3:8: error: unknown instruction or option: did you mean `CALL`?\n"
    );
    let output = folder.run("ls check cell/B.LS cell/A.LS --format sarif");
    let sarif: Value = serde_json::from_str(out(&output)).unwrap();
    let results = sarif["runs"][0]["results"].as_array().unwrap();
    let short = |result: &Value| {
        let place = &result["locations"][0]["physicalLocation"];
        let uri = place["artifactLocation"]["uri"].as_str().unwrap();
        format!(
            "{uri}:{}:{} {} {}",
            place["region"]["startLine"], place["region"]["startColumn"], result["level"], result["ruleId"]
        )
    };
    // Without a folder nothing is known of what may be called.
    assert_eq!(
        results.iter().map(short).collect::<Vec<_>>(),
        [
            "cell/B.LS:3:8 \"error\" \"misspelled\"",
            "cell/A.LS:5:8 \"note\" \"macro\"",
            "cell/A.LS:7:8 \"warning\" \"unreachable\""
        ]
    );
    let output = folder.run("ls check --format json cell/B.LS");
    let object: Value = serde_json::from_str(out(&output)).unwrap();
    assert_eq!(
        (&object["findings"][0]["level"], &object["findings"][0]["word"]),
        (&"error".into(), &"CALL".into())
    );
    // The file has another name than its program: a finding in every format.
    folder.write("cell/OTHER.LS", b"/PROG  A\n/MN\n   1:  END ;\n/END\n");
    let message = "the file is not named as the program: on the controller both must be the same";
    let short = format!("cell/OTHER.LS:1:8: warning: {message}\n");
    let output = folder.run("ls check cell/OTHER.LS --format short");
    assert_eq!((output.status.code(), out(&output)), (Some(0), short.as_str()));
    assert_eq!(folder.run("ls check cell/OTHER.LS --fail-on warning").status.code(), Some(1));
    let text = folder.run("ls check cell/OTHER.LS");
    assert!(
        out(&text).ends_with(&format!("{short}  help: rename the file, or the program\n")),
        "{}",
        out(&text)
    );
    let sarif = folder.run("ls check cell/OTHER.LS --format sarif");
    assert!(out(&sarif).contains(r#""ruleId":"file-name""#), "{}", out(&sarif));
    let object: Value =
        serde_json::from_str(out(&folder.run("ls check cell/OTHER.LS --format json"))).unwrap();
    assert_eq!(object["findings"][0]["kind"], "file_name");
    assert_eq!((&object["findings"][0]["level"], &object["same_name"]), (&"warning".into(), &false.into()));
    let output = folder.run("ls list cell");
    assert!(out(&output).contains("  warning file name: 1 in 1 file\n"), "{}", out(&output));
    std::fs::remove_file(folder.0.join("cell/OTHER.LS")).unwrap();
    // An instruction that is not known is a hint until it is named.
    folder.write("GLUE.LS", b"/PROG  GLUE\n/MN\n   1:  GLUE START[1] ;\n   2:J P[1] 5% FINE GLUE50 ;\n/POS\nP[1]{\n GP1:\n UF : 0, UT : 1,\n J1= 0 deg\n};\n/END\n");
    let output = folder.run("ls check GLUE.LS --format short");
    let hints = "GLUE.LS:3:8: hint: the instruction is not known\nGLUE.LS:4:21: hint: the motion option is not known\n";
    assert_eq!((output.status.code(), out(&output)), (Some(0), hints));
    folder.write("instructions.txt", b"glue\n\n");
    let output = folder.run("ls check GLUE.LS --format short --instructions instructions.txt");
    assert_eq!((output.status.code(), out(&output)), (Some(0), ""));
    let output = folder.run("ls check GLUE.LS --instructions none.txt");
    assert_eq!(output.status.code(), Some(2));
    assert!(err(&output).contains("cannot read none.txt"), "{}", err(&output));
    folder.write("macros.txt", b"Grip Open\n\nGrip Close\n");
    let output = folder.run("ls check cell/A.LS --format short --macros macros.txt");
    assert_eq!((output.status.code(), out(&output)), (Some(0), "cell/A.LS:7:8: warning: unreachable line\n"));
    let output = folder.run("ls check cell/A.LS --fail-on warning");
    assert_eq!(output.status.code(), Some(1));
    let output = folder.run("ls check cell/empty cell/B.LS");
    assert_eq!((output.status.code(), out(&output)), (Some(2), ""));
    assert!(
        err(&output).contains("nothing to check: there is no .ls file in or below cell/empty"),
        "{}",
        err(&output)
    );
}

#[test]
fn make_refuses_what_no_robot_or_this_one_cannot_do() {
    let folder = Folder::new("limits");
    let joint = |speed| format!("{{\"min\": -10, \"max\": 170, \"speed\": {speed}}}");
    let robot = |speeds: [u32; 6]| format!("{{\"joints\": [{}]}}", speeds.map(joint).join(","));
    folder.write("slow.json", robot([100, 100, 100, 100, 100, 20]).as_bytes());
    folder.write("none.json", b"{\"joints\": []}");
    folder.write("still.json", robot([100, 0, 100, 100, 100, 20]).as_bytes());
    folder.write("far.csv", b"0,0,0,0,0,0,0\n1,0,0,0,0,0,5\n2,171,0,0,0,0,5\n");
    folder.write("fast.csv", b"0,0,0,0,0,0,0\n0.1,0,0,0,0,0,5\n");
    folder.write("nan.csv", b"0,0,0,0,0,0,0\n1,0,0,nan,0,0,5\n");
    folder.write("back.csv", b"0,0,0,0,0,0,0\n1,0,0,0,0,0,5\n0.5,0,0,0,0,0,6\n");
    folder.write("any.csv", b"0,0,0,0,0,0,0\n0.1,0,0,0,0,0,500\n");
    for (arguments, message) in [
        (
            "far.csv --limits slow.json",
            "far.csv: J1 is 171.000° at 2.000 s: the robot's range is -10° to 170°",
        ),
        (
            "fast.csv --limits slow.json",
            "fast.csv: J6 moves at 50°/s until 0.100 s: the robot's limit is 20°/s",
        ),
        ("any.csv", "any.csv: J6 moves at 5000°/s until 0.100 s: the robot's limit is 2000°/s"),
        ("nan.csv", "nan.csv: line 2, column 7: expected a number such as `-108.435`"),
        ("back.csv", "back.csv: line 3, column 1: expected a time later than the previous one"),
        ("fast.csv --limits still.json", "still.json: J2: min must be below max, and speed above 0"),
    ] {
        let output = folder.run(&format!("ls make {arguments} --mode time --step 0.5"));
        assert_eq!(
            (output.status.code(), err(&output).trim_end()),
            (Some(2), format!("error: {message}").as_str()),
            "{arguments}"
        );
    }
    let output = folder.run("ls make fast.csv --mode time --step 0.5 --limits none.json");
    assert!(
        err(&output).starts_with("error: none.json: line 1, column 13: expected {\"joints\""),
        "{}",
        err(&output)
    );
    assert_eq!(folder.run("ls make fast.csv --mode time --step 0.5").status.code(), Some(0));
}

#[test]
fn make_writes_a_program_that_checks_in_every_mode() {
    let folder = Folder::new("make");
    folder.write("path.csv", trajectory().as_bytes());
    // The path is 123.8 mm long and turns by 45°; a last step of less than half a step is added to the previous one.
    for (mode, moves) in [
        ("distance --mm 10", 12),
        ("distance --deg 5", 9),
        ("time --step 0.25", 8),
        ("dynamic --min 0.05 --max 0.5 --by translation --speed tenth", 15),
    ] {
        let output = folder.run(&format!("ls make path.csv --mode {mode} --comment a_path --utool 3"));
        assert_eq!(output.status.code(), Some(0), "{}", err(&output));
        let first = err(&output).lines().next().unwrap().to_owned();
        assert_eq!(first, format!("PATH.LS: {moves} spline moves from 251 samples"), "{mode}");
        assert!(err(&output).contains("rounding   of the speeds: "));
        let output = folder.run("ls check PATH.LS");
        let positions = moves + 1;
        let summary = format!(
            "PATH.LS: PATH \"a_path\", {} instructions (1 J, {moves} S), {positions} positions\n",
            positions + 2
        );
        assert_eq!(out(&output), summary, "{mode}");
        assert!(folder.read("PATH.LS").contains("   1:  UTOOL_NUM=3 ;\r\n"));
    }
}

#[test]
fn make_refuses_arguments_that_contradict_each_other() {
    let folder = Folder::new("refuse");
    folder.write("path.csv", trajectory().as_bytes());
    folder.write("short.csv", b"time,J1\n0,1\n");
    for (arguments, message) in [
        ("path.csv --mode time", "error: --mode time needs --step"),
        ("path.csv --mode distance", "error: --mode distance needs --mm or --deg"),
        ("path.csv --mode time --step 1 --mm 5", "error: --mm belongs to another --mode"),
        (
            "path.csv --mode time --step 0",
            "error: steps must be above zero, and the shortest not longer than the longest",
        ),
        (
            "path.csv --mode distance --mm -5",
            "error: steps must be above zero, and the shortest not longer than the longest",
        ),
        (
            "path.csv --mode time --step 1 --tool 1,2,3,4,5,6,7",
            "error: --tool needs six numbers, with commas between them",
        ),
        (
            "path.csv --mode time --step 1 --tool 1,2,3",
            "error: --tool needs six numbers, with commas between them",
        ),
        (
            "path.csv --mode time --step 1 --comment seventeen-letters",
            "error: COMMENT has 17 characters, the controller keeps 16",
        ),
        (
            "short.csv --mode time --step 1",
            "error: short.csv: line 2, column 1: expected seven columns: time in s, J1 to J6 in degrees; found 2",
        ),
    ] {
        let output = folder.run(&format!("ls make {arguments}"));
        assert_eq!((output.status.code(), err(&output).trim_end()), (Some(2), message), "{arguments}");
    }
    assert_eq!(std::fs::read_dir(&folder.0).unwrap().count(), 2, "nothing was written");
}

#[test]
fn background_writes_the_sources_task() {
    let folder = Folder::new("background");
    let output = folder.run("ls background --out -");
    assert_eq!(out(&output), std::fs::read_to_string(reference("figure-8.canonical.ls")).unwrap());
    let summary = "standard output: R[1] to R[19] every 8 ms; R[30] to R[42] are scratch\n";
    assert!(err(&output).starts_with(summary), "{}", err(&output));
    assert_eq!(folder.run("ls background --first 20").status.code(), Some(2));
    for same in ["ls background", "ls background"] {
        assert_eq!(folder.run(same).status.code(), Some(0));
    }
    let other = folder.run("ls background --first 101");
    let refusal = "error: BG_TELEMETRY.LS exists and is another program; --out FILE replaces a file";
    assert_eq!((other.status.code(), err(&other).trim_end()), (Some(2), refusal));
    assert_eq!(folder.run("ls background --first 101 --out BG_TELEMETRY.LS").status.code(), Some(0));
}

/// Starts a controller on a free port of this machine; it runs until the test's process ends.
fn controller(order: WordOrder) -> String {
    let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let shared = Arc::new(Mutex::new(Controller::new(Box::new(circle), order)));
    thread::spawn(move || {
        let (listener, clock) = (Listener::new(listener).unwrap(), Clock::start());
        let server = Server::new(listener, || clock.now());
        let device = connection(&shared, ServerConfig::tcp()).unwrap();
        server.run(device, || true, |_, _| Ok::<_, std::io::Error>(()))
    });
    address
}

#[test]
fn log_finds_the_word_order_and_writes_the_telemetry() {
    for (order, name) in [(WordOrder::LowFirst, "low_first"), (WordOrder::HighFirst, "high_first")] {
        let folder = Folder::new(name);
        let output = folder.run(&format!("fanuc log {} --csv run.csv --for 1s --json", controller(order)));
        assert_eq!(output.status.code(), Some(0), "{}", err(&output));
        let object: Value = serde_json::from_str(out(&output)).unwrap();
        assert_eq!(object["word_order"], name);
        let table = folder.read("run.csv");
        let rows: Vec<Vec<f64>> = table
            .lines()
            .skip(1)
            .map(|row| row.split(',').skip(1).take(31).map(|v| v.parse().unwrap()).collect())
            .collect();
        assert_eq!(object["samples"], rows.len());
        assert!(rows.len() > 20, "{} rows", rows.len());
        for row in &rows {
            assert_eq!(row.len(), 31);
            // The circle of the simulated controller: 100 mm about X 500, at 100 mm/s.
            let radius = (row[4] - 500.0).hypot(row[5]);
            assert!((radius - 100.0).abs() < 0.01, "{row:?}");
            let speed = row[21].hypot(row[22]);
            assert!((speed - 100.0).abs() < 0.5, "{row:?}");
        }
    }
}

#[test]
fn log_warns_of_a_word_order_that_the_life_counter_contradicts() {
    let folder = Folder::new("contradicted");
    let address = controller(WordOrder::LowFirst);
    let log = |order: &str| {
        folder.run(&format!("fanuc log {address} --csv run.csv --for 300ms --word-order {order}"))
    };
    let warning = "warning: the life counter indicates word order \"low_first\": these values are wrong\n";
    let wrong = log("high_first");
    assert!(err(&wrong).contains(warning), "{}", err(&wrong));
    assert_eq!(wrong.status.code(), Some(5), "what is read in the wrong order cannot be");
    assert!(!err(&log("low_first")).contains("warning"));
}

#[test]
fn log_reports_a_refused_connection() {
    let folder = Folder::new("nothing");
    let free = std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    let output = folder.run(&format!("fanuc log {free} --csv run.csv --for 300ms"));
    assert_eq!(output.status.code(), Some(3));
    assert!(err(&output).contains(&format!("error: cannot connect to {free}")), "{}", err(&output));
}

#[test]
fn a_log_is_compared_with_its_trajectory() {
    let folder = Folder::new("evaluate");
    let demo = folder.run("demo fanuc-hmi-modbus --for 5s --out . --json");
    let report: Value = serde_json::from_str(out(&demo)).unwrap();
    let output = folder.run("fanuc evaluate fanuc/trajectory.csv fanuc/recording.csv --out plots --json");
    assert_eq!(output.status.code(), Some(0), "{}", err(&output));
    let object: Value = serde_json::from_str(out(&output)).unwrap();
    assert_eq!(object["compared"], report["figures"]["compared"]);
    for file in ["position.svg", "position-errors.svg", "orientation.svg", "orientation-errors.svg"] {
        let drawn = folder.read(&format!("plots/{file}"));
        assert!(drawn.starts_with("<svg") && drawn.contains("time since the motion began, s"), "{file}");
        assert!(folder.0.join("fanuc").join(file).exists());
    }
    assert_eq!(folder.run("ls check fanuc/DEMO_SPLINE.LS fanuc/BG_TELEMETRY.LS").status.code(), Some(0));
    // Rows that are not samples do not count.
    let recording = folder.read("fanuc/recording.csv");
    let marked = recording.replacen(
        '\n',
        &format!("\n,7,,100{}nan POS_X\n{}disconnected\n", ",NaN".repeat(27) + ",", ",".repeat(31)),
        1,
    );
    folder.write("marked.csv", marked.as_bytes());
    let marked = folder.run("fanuc evaluate fanuc/trajectory.csv marked.csv --json");
    let other: Value = serde_json::from_str(out(&marked)).unwrap();
    assert_eq!(other, object);
    assert!(object["bounds"]["delay"]["low"].as_f64().unwrap() < 0.0, "{object}");
    // A delay beyond the search is not found, and the report states that instead of meaningless errors.
    let late: String = recording
        .lines()
        .enumerate()
        .map(|(index, row)| match row.split_once(',') {
            Some((time, rest)) if index > 0 => format!("{},{rest}\n", time.parse::<f64>().unwrap() + 30.0),
            _ => format!("{row}\n"),
        })
        .collect();
    folder.write("late.csv", late.as_bytes());
    let output = folder.run("fanuc evaluate fanuc/trajectory.csv late.csv");
    assert_eq!(output.status.code(), Some(1));
    assert!(err(&output).starts_with("error: no delay found: the best fit within ±10 s"), "{}", err(&output));
    assert!(!out(&output).contains("error of the position"), "{}", out(&output));
    assert_eq!(
        folder.run("fanuc evaluate fanuc/trajectory.csv late.csv --within 40s").status.code(),
        Some(0)
    );
    let swapped = folder.run("fanuc evaluate fanuc/trajectory.csv fanuc/trajectory.csv");
    assert!(err(&swapped).contains("the first line has no column time_s"), "{}", err(&swapped));
}
