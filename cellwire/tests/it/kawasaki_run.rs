//! `cellwire kawasaki` against `cellwire simulate kawasaki-robot`: both the real binary, over TCP and UDP.

use core::fmt::Write as _;
use core::time::Duration;
use std::fs;
use std::net::UdpSocket;
use std::path::PathBuf;

use crate::operated::Tool;

pub(crate) const TCP: &str = "udp=false";
pub(crate) const UDP: &str = "udp=true";

fn plant(name: &str) -> String {
    format!("{}/../kawasaki-msg/plants/{name}.toml", env!("CARGO_MANIFEST_DIR"))
}

/// A table of pallet moves, and what a robot has executed of it.
pub(crate) struct Cell {
    folder: tempfile::TempDir,
    carrier: &'static str,
    /// Where the PC listens, once it has.
    address: String,
    rows: Vec<String>,
}

impl Cell {
    pub(crate) fn new(carrier: &'static str, jobs: usize) -> Self {
        let row = |n: usize| {
            let tool = if n.is_multiple_of(2) { "open" } else { "closed" };
            format!("{}.500,-1.{n:03},{}.000,0.001,90.000,0.000,{tool},{}", n % 360, n % 100, 1 + n % 100)
        };
        let rows: Vec<String> = (0..jobs).map(row).collect();
        let folder = tempfile::tempdir().unwrap();
        let mut table = String::from("j1,j2,j3,j4,j5,j6,tool,speed\n");
        rows.iter().for_each(|row| writeln!(table, "{row}").unwrap());
        fs::write(folder.path().join("pallet.csv"), table).unwrap();
        Self { folder, carrier, address: "127.0.0.1:0".into(), rows }
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn text(&self, name: &str) -> String {
        self.path(name).to_str().unwrap().to_owned()
    }

    /// Starts the listening client, and waits until it is ready.
    pub(crate) fn run(&mut self, more: &[&str]) -> Tool {
        let args = self.arguments(more);
        self.ready(Tool::start(&args.iter().map(String::as_str).collect::<Vec<_>>()))
    }

    /// Returns the arguments of a listening client.
    pub(crate) fn arguments(&self, more: &[&str]) -> Vec<String> {
        let (file, plant) = (self.text("pallet.csv"), plant("pallet"));
        let mut args = vec!["run", "kawasaki", &file, "--settings", &plant, "--set", self.carrier];
        args.extend(["--listen", &self.address]);
        args.extend(more);
        args.into_iter().map(str::to_owned).collect()
    }

    /// Waits until a client listens.
    pub(crate) fn ready(&mut self, tool: Tool) -> Tool {
        let ready = tool.line();
        assert_eq!(ready["ready"], "kawasaki");
        self.address = ready["listen"].as_str().unwrap().to_owned();
        tool
    }

    /// Starts a robot that connects to the client, and records the executed jobs.
    pub(crate) fn robot(&self, more: &[&str]) -> Tool {
        let (record, plant) = (format!("record={}", self.text("record.csv")), plant("pallet"));
        let mut args = vec!["simulate", "kawasaki-robot", "--settings", &plant, "--set", self.carrier];
        args.extend(["--connect", &self.address, "--set", &record, "--set", "reconnect_delay=100ms"]);
        args.extend(more.iter().flat_map(|setting| ["--set", setting]));
        let tool = Tool::start(&args);
        assert_eq!(tool.line()["ready"], "kawasaki-robot");
        tool
    }

    /// Returns the jobs that the robots have executed: the fields of each job.
    pub(crate) fn executed(&self) -> Vec<String> {
        let text = fs::read_to_string(self.path("record.csv")).unwrap_or_default();
        text.lines().skip(1).map(|row| row.splitn(3, ',').nth(2).unwrap().to_owned()).collect()
    }

    /// Asserts that each job was executed once, in sequence.
    pub(crate) fn assert_executed_once(&self) {
        let executed = self.executed();
        let first = executed.iter().zip(&self.rows).position(|(found, given)| found != given);
        assert_eq!((executed.len(), first), (self.rows.len(), None), "lost or repeated");
    }
}

pub(crate) fn finish(run: Tool, done: usize) {
    let ended = run.event("ended");
    assert_eq!((&ended["why"], &ended["done"]), (&"complete".into(), &done.into()), "{ended}");
    assert_eq!(run.end().0, Some(0));
}

#[test]
fn a_table_is_executed_once() {
    for carrier in [TCP, UDP] {
        let mut cell = Cell::new(carrier, 700);
        let out = cell.text("outcomes.csv");
        let run = cell.run(&["--outcomes", &out]);
        let _robot = cell.robot(&["job_time=0", "queue=40"]);
        let first = run.event("done");
        assert_eq!((&first["first"], &first["lines"][0]), (&1.into(), &2.into()));
        finish(run, 700);
        cell.assert_executed_once();
        let table = fs::read_to_string(&out).unwrap();
        assert_eq!((table.lines().count(), table.lines().nth(700)), (701, Some("700,701,done")));

        // Again: not without being told to.
        let (code, said) = cell.run_refused(&[]);
        assert_eq!(code, Some(2));
        assert!(said.contains("is finished according to") && said.contains("--again"), "{said}");
        // A table that was changed is another one.
        let table = fs::read_to_string(cell.path("pallet.csv")).unwrap();
        fs::write(cell.path("pallet.csv"), table.replacen(",open,", ",closed,", 1)).unwrap();
        let (code, said) = cell.run_refused(&[]);
        assert_eq!(code, Some(2));
        assert!(said.contains("it belongs to another file of jobs"), "{said}");
        fs::write(cell.path("pallet.csv"), "j1,j2,j3\n1,2,3\n").unwrap();
        cell.rows.push("1.000,2.000,3.000,0.000,0.000,0.000,open,50".into());
        finish(cell.run(&["--again"]), 1);
        cell.assert_executed_once();
    }
}

impl Cell {
    /// Runs a client that cannot begin.
    fn run_refused(&self, more: &[&str]) -> (Option<i32>, String) {
        let (file, plant) = (self.text("pallet.csv"), plant("pallet"));
        let mut args = vec!["run", "kawasaki", &file, "--settings", &plant, "--listen", "127.0.0.1:0"];
        args.extend(more);
        Tool::start(&args).end()
    }
}

#[test]
fn a_run_that_is_killed_goes_on_and_nothing_is_lost_or_repeated() {
    for carrier in [TCP, UDP] {
        let mut cell = Cell::new(carrier, 900);
        let mut run = cell.run(&[]);
        let _robot = cell.robot(&["job_time=2ms", "queue=100"]);
        for _ in 0..3 {
            for _ in 0..4 {
                run.event("done");
            }
            run.kill(); // as kill -9
            let before = cell.executed().len();
            run = cell.run(&[]);
            let on = run.event("resumed");
            assert!(on["done"].as_u64().unwrap() <= before as u64 + 1, "{on} {before}");
            assert!(run.event("order_resumed")["sent"].as_u64() > Some(0));
        }
        finish(run, 900);
        cell.assert_executed_once();
    }
}

#[test]
fn a_robot_that_vanishes_is_an_error_and_its_jobs_a_question() {
    for carrier in [TCP, UDP] {
        let mut cell = Cell::new(carrier, 300);
        let brief = ["--robot-timeout", "1s", "--set", "silence=1s"];
        let run = cell.run(&brief);
        let robot = cell.robot(&["job_time=5ms", "queue=50"]);
        for _ in 0..3 {
            run.event("done");
        }
        drop(robot);
        let (code, said) = run.end();
        assert_eq!(code, Some(3), "{said}");
        assert!(said.contains("the robot has been disconnected for 1s"), "{said}");
        let executed = cell.executed().len();

        // Another one has forgotten the order. Nobody answers: nothing is sent.
        let mut run = cell.run(&[]);
        let robot = cell.robot(&["job_time=1ms", "queue=50"]);
        drop(run.stdin.take());
        let unknown = run.event("unanswered");
        let ended = run.event("ended");
        assert_eq!((&ended["why"], &ended["unknown"]), (&"stopped".into(), &unknown["count"]));
        assert_eq!(run.end().0, Some(1));
        assert_eq!(cell.executed().len(), executed);
        drop(robot);
        // The operator sees how far it came.
        let mut run = cell.run(&[]);
        // An answer before its question does not count.
        run.say("done");
        run.say("1");
        let _robot = cell.robot(&["job_time=1ms", "queue=50"]);
        assert_eq!(run.event("no_question")["typed"], "done");
        assert_eq!(run.event("no_question")["typed"], "1");
        let question = run.event("question");
        let (first, count) = (question["first"].as_u64().unwrap(), question["count"].as_u64().unwrap());
        assert_eq!((&question["first"], &question["count"]), (&unknown["first"], &unknown["count"]));
        assert!((first..=first + count).contains(&(executed as u64 + 1)), "{question} {executed}");
        run.say("what?");
        assert!(run.event("hint")["hint"].as_str().unwrap().contains("the number of the last that is done"));
        run.say(&executed.to_string());
        let answer: serde_json::Value = match executed as u64 + 1 - first {
            0 => "repeat".into(),
            done if done == count => "done".into(),
            _ => executed.into(),
        };
        assert_eq!(run.event("answered")["answer"], answer);
        finish(run, 300);
        cell.assert_executed_once();
    }
}

#[test]
fn a_robot_that_is_restarted_leaves_a_question_and_the_run_goes_on() {
    let mut cell = Cell::new(TCP, 200);
    let mut run = cell.run(&[]);
    let robot = cell.robot(&["job_time=5ms", "queue=20"]);
    for _ in 0..3 {
        run.event("done");
    }
    drop(robot);
    let executed = cell.executed().len();
    let _robot = cell.robot(&["job_time=1ms", "queue=20"]);
    run.event("unknown");
    let question = run.event("question");
    assert_eq!(run.lines.recv_timeout(Duration::from_millis(700)).ok(), None, "nothing happens unasked");
    assert_eq!(cell.executed().len(), executed);
    run.say("pause");
    assert_eq!(run.event("hint")["hint"], "answer done, repeat or stop");
    run.say("repeat");
    assert_eq!(run.event("answered")["answer"], "repeat");
    finish(run, 200);
    // The jobs of the question that had been executed are executed again, as the operator answered.
    let again = executed as u64 + 1 - question["first"].as_u64().unwrap();
    assert_eq!(cell.executed().len() as u64, 200 + again);
}

#[test]
fn it_pauses_stops_and_goes_on_with_nothing_lost_or_repeated() {
    let mut cell = Cell::new(TCP, 150);
    let mut run = cell.run(&[]);
    let _robot = cell.robot(&["job_time=10ms", "queue=50"]);
    run.event("done");
    run.say("pause");
    run.event("paused");
    let over = run.event("order_over");
    assert_eq!(over["complete"], false);
    let executed = cell.executed().len();
    assert!(executed < 150, "what it had queued is not executed");
    assert_eq!(run.lines.recv_timeout(Duration::from_millis(700)).ok(), None);
    assert_eq!((cell.executed().len(), &over["executed"]), (executed, &executed.into()));
    run.say("continue");
    run.event("continued");
    let next = run.event("done");
    assert_eq!(next["first"].as_u64().unwrap(), executed as u64 + 1);
    run.say("stop");
    run.event("stopping");
    let ended = run.event("ended");
    assert_eq!((&ended["why"], &ended["unknown"]), (&"stopped".into(), &0.into()));
    assert_eq!(run.end().0, Some(1));
    assert_eq!(cell.executed().len() as u64, ended["done"].as_u64().unwrap());
    finish(cell.run(&[]), 150);
    cell.assert_executed_once();
}

#[test]
fn two_runs_at_once_are_refused() {
    let mut cell = Cell::new(TCP, 5);
    let first = cell.run(&[]);
    let (code, said) = cell.run_refused(&[]);
    assert_eq!(code, Some(2));
    assert!(said.contains("another process is running this file of jobs"), "{said}");
    let _robot = cell.robot(&["job_time=0"]);
    finish(first, 5);
}

#[test]
fn without_a_robot_it_does_not_begin() {
    let mut cell = Cell::new(TCP, 5);
    let (code, said) = cell.run(&["--robot-timeout", "300ms"]).end();
    assert_eq!(code, Some(2));
    assert!(said.contains("no robot connected within 300ms: see --robot-timeout"), "{said}");
}

/// Datagrams of other senders: bytes that are not a message, and the messages of another robot.
#[test]
fn foreign_datagrams_hurt_nobody() {
    let mut cell = Cell::new(UDP, 400);
    let run = cell.run(&[]);
    let other = UdpSocket::bind("127.0.0.1:0").unwrap();
    other.set_read_timeout(Some(Duration::from_millis(200))).unwrap();
    let send = |text: &str| assert!(other.send_to(text.as_bytes(), &cell.address).is_ok());
    for text in ["", "hello", "<Tila$6#0$0$$$", "<Tyo#>", "<Nobody$0##>"] {
        send(text);
    }
    let _robot = cell.robot(&["job_time=2ms", "queue=50"]);
    let order = run.event("order_started")["order"].to_string();
    run.event("done");
    // As if the robot had executed more and left the order.
    let message = |name: &str, data: String| format!("<{name}${}#{data}#>", data.len());
    for number in 1..=400 {
        send(&message("TyoKuittaus", format!("{order}${number}")));
        send(&message("LoppuKuittaus", format!("{order}$0${number}")));
        send(&message("Tila", format!("0$0${number}${number}${order}")));
        send("<<<\u{0}");
    }
    assert!(other.recv(&mut [0; 4096]).is_err(), "it is answered");
    finish(run, 400);
    cell.assert_executed_once();
}

#[test]
fn a_robot_may_listen() {
    let cell = Cell::new(TCP, 60);
    let (file, plant) = (cell.text("pallet.csv"), plant("pallet"));
    let record = format!("record={}", cell.text("record.csv"));
    let robot = Tool::start(&[
        "simulate",
        "kawasaki-robot",
        "--settings",
        &plant,
        "--listen",
        "127.0.0.1:0",
        "--set",
        &record,
        "--set",
        "job_time=0",
        "--set",
        "reconnect_delay=50ms",
    ]);
    let address = robot.line()["listen"].as_str().unwrap().to_owned();
    let run = Tool::start(&["run", "kawasaki", &file, "--settings", &plant, "--connect", &address]);
    finish(run, 60);
    cell.assert_executed_once();
    let (code, said) =
        Tool::start(&["run", "kawasaki", &file, "--connect", &address, "--set", UDP, "--again"]).end();
    assert_eq!(code, Some(2));
    assert!(said.contains("j1"), "{said}");
}

/// A square with a diagonal.
const SQUARE: &str = r#"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 100 100"><path fill="none" stroke="black" d="M 10 10 H 90 V 90 H 10 Z L 90 90"/></svg>"#;

#[test]
fn a_drawing_is_drawn_in_any_plant_whose_jobs_are_lines() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    fs::write(path("square.svg"), SQUARE).unwrap();
    // Millimetres with three decimals, in another order, and a field more.
    let mut text = fs::read_to_string(plant("other")).unwrap();
    for name in ["x2", "y2", "x1", "y1"] {
        text +=
            &format!("[[job]]\nname = \"{name}\"\nkind = \"decimal\"\nplaces = 3\nrange = [0.0, 500.0]\n");
    }
    text += "[[job]]\nname = \"pen\"\nkind = \"text\"\ndefault = \"rot\"\n[[job]]\nname = \"kind\"\nkind = \"whole\"\nrange = [1, 2]\n";
    fs::write(path("metric.toml"), text).unwrap();
    for (plant, carrier, row) in [
        (plant("default"), TCP, "2,1,9120,2970,32880,2970"),
        (path("metric.toml"), UDP, "2,328.800,29.700,91.200,29.700,rot,1"),
    ] {
        let (plan, drawn, record) = (path("plan.svg"), path("drawn.svg"), path("record.csv"));
        let common = ["--settings", &plant, "--set", carrier];
        let file = path("square.svg");
        let draw = ["run", "kawasaki", &file, "--picture", &plan, "--again"];
        let dry = Tool::start(&[&draw[..], &["--dry-run"], &common].concat());
        let plan_of = dry.line();
        let (least, most) = (&plan_of["mm"]["least"], &plan_of["mm"]["most"]);
        assert_eq!(
            (&plan_of["jobs"], &plan_of["board"]),
            (&serde_json::json!(6), &serde_json::json!([420.0, 297.0]))
        );
        assert_eq!((least, most), (&serde_json::json!([91.2, 29.7]), &serde_json::json!([328.8, 267.3])));
        assert_eq!(dry.end().0, Some(0));
        let run = Tool::start(&[&draw[..], &common, &["--listen", "127.0.0.1:0"]].concat());
        let address = run.line()["listen"].as_str().unwrap().to_owned();
        let sets = [format!("out={drawn}"), format!("record={record}"), "speed=1000000".into()];
        let sets: Vec<&str> = sets.iter().flat_map(|set| ["--set", set]).collect();
        let robot = Tool::start(
            &[&["simulate", "kawasaki-robot", "--connect", &address][..], &common, &sets].concat(),
        );
        finish(run, 6);
        assert_eq!(robot.event("drawn")["strokes"], 5);
        robot.event("order_over");
        let [plan, drawn] = [plan, drawn].map(|file| fs::read_to_string(file).unwrap());
        // The robot has drawn the plan's lines; the plan has axes as well.
        let path = drawn.split(" d=\"").nth(1).and_then(|rest| rest.split('"').next()).unwrap();
        assert!(path.len() > 20 && plan.contains(path), "{plan}\n{drawn}");
        let table = fs::read_to_string(&record).unwrap();
        assert!(table.lines().any(|line| line.split_once(',').unwrap().1.ends_with(row)), "{row}\n{table}");
        fs::remove_file(record).unwrap();
    }
    // Jobs that are not lines cannot be drawn.
    let pallet = plant("pallet");
    let file = path("square.svg");
    let (code, said) = Tool::start(&["run", "kawasaki", &file, "--settings", &pallet, "--dry-run"]).end();
    assert_eq!(code, Some(2));
    assert!(said.contains("the plant's jobs are not lines"), "{said}");
    // Nor what the robot does not reach.
    let (code, said) =
        Tool::start(&["run", "kawasaki", &file, "--set", "bounds.max.x=30000", "--dry-run"]).end();
    assert_eq!(code, Some(2));
    assert!(said.contains("line 2: field 'x2' is 32880, not from -9999999 to 30000"), "{said}");
}
