//! A stop by a signal, with every kind of standard input: the run waits for the outcome, and the last line has the machine's
//! remaining activity.

use core::time::Duration;
use std::fs::{self, File};
use std::io::{Read as _, Write as _};
use std::net::TcpListener;
use std::process::{Command, Stdio};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::Instant;

use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value;

use crate::operated::Tool;
use crate::rig::pty::Pty;
use crate::{kawasaki_run, laser_run, mma_run};

/// The standard input of a program.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Input {
    /// A pipe that stays open.
    Pipe,
    /// `/dev/null`, as for a service.
    Null,
    /// `/dev/null`, in a session of its own, as a daemon.
    Session,
    /// A terminal, of which the program's session is.
    Terminal,
    /// A terminal of another session.
    Foreign,
}

/// How a stop is asked for.
#[derive(Debug, Clone, Copy)]
enum Stop {
    Signal(&'static str),
    /// The terminal is closed.
    Close,
}

const STOPS: [(Input, Stop); 11] = [
    (Input::Pipe, Stop::Signal("-INT")),
    (Input::Pipe, Stop::Signal("-TERM")),
    (Input::Null, Stop::Signal("-INT")),
    (Input::Null, Stop::Signal("-TERM")),
    (Input::Null, Stop::Signal("-HUP")),
    (Input::Session, Stop::Signal("-TERM")),
    (Input::Session, Stop::Signal("-INT")),
    (Input::Terminal, Stop::Signal("-INT")),
    (Input::Terminal, Stop::Signal("-TERM")),
    (Input::Terminal, Stop::Close),
    (Input::Foreign, Stop::Close),
];

/// The tool as an argument of `env`: it does not ignore SIGHUP, even if the tests are run by `nohup`.
const HEARS_HANGUP: [&str; 2] = ["--default-signal=HUP", env!("CARGO_BIN_EXE_cellwire")];

/// A run, and the terminal that it has.
pub(crate) struct Run(pub(crate) Tool, Option<Pty>);

impl Run {
    pub(crate) fn start(args: &[String], input: Input) -> Self {
        let mut command = match input {
            Input::Pipe | Input::Null => Command::new("env"),
            Input::Session | Input::Foreign | Input::Terminal => {
                let mut command = Command::new("setsid");
                command.args((input == Input::Terminal).then_some("--ctty")).arg("env");
                command
            }
        };
        command.args(HEARS_HANGUP).args(args);
        let mut terminal = None;
        match input {
            Input::Pipe => command.stdin(Stdio::piped()),
            Input::Null | Input::Session => command.stdin(Stdio::null()),
            Input::Terminal | Input::Foreign => {
                let (user, path) = Pty::new();
                terminal = Some(user);
                command.stdin(File::options().read(true).write(true).open(path).unwrap())
            }
        };
        // The command has the terminal open, too.
        let tool = Tool::spawn(command);
        Self(tool, terminal)
    }

    fn stop(&mut self, stop: Stop) {
        match stop {
            Stop::Signal(signal) => self.0.signal(signal),
            Stop::Close => self.1 = None,
        }
    }

    /// Returns the last line of the run; checks that it was stopped.
    fn stopped(self) -> Value {
        let ended = self.0.event("ended");
        let (code, said) = self.0.end();
        assert_eq!((&ended["why"], code), (&"stopped".into(), Some(1)), "{ended}: {said}");
        ended
    }
}

fn number(line: &Value, name: &str) -> u64 {
    line[name].as_u64().unwrap_or_else(|| panic!("no {name} in {line}"))
}

#[test]
fn a_laser_program_stops_after_its_frame_whatever_standard_input_is() {
    let cell = laser_run::Cell::new(&["baud=9600"]);
    let program = cell.program(400);
    let args = cell.arguments(&program, &["--set", "baud=9600", "--again"]);
    for (input, stop) in STOPS {
        let mut run = Run::start(&args, input);
        run.0.event("done");
        thread::sleep(Duration::from_millis(60)); // of the 226 ms of the next frame
        run.stop(stop);
        let ended = run.stopped();
        let (done, unknown) = (number(&ended, "done"), number(&ended, "unknown"));
        assert!(unknown == 0 && (7..400).contains(&done), "{input:?}, {stop:?}: {ended}");
        assert_eq!(cell.queued(done), done, "{input:?}, {stop:?}");
        let machine = format!("the controller may still execute up to {done} queued instructions");
        assert_eq!(ended["machine"], machine);
    }
}

/// Stops an order in each of these ways; `more` is of the client and of the robot.
fn stop_orders(carrier: &'static str, stops: &[(Input, Stop)], more: &[&str]) {
    let mut cell = kawasaki_run::Cell::new(carrier, 300);
    let (mut robot, mut before) = (None, 0);
    for (input, stop) in stops {
        let mut run = Run::start(&cell.arguments(more), *input);
        run.0 = cell.ready(run.0);
        robot.get_or_insert_with(|| {
            let more = more.iter().copied().filter(|word| word.starts_with("messages."));
            cell.robot(&["job_time=10ms", "queue=50"].into_iter().chain(more).collect::<Vec<_>>())
        });
        run.0.event("done");
        run.stop(*stop);
        assert_eq!(run.0.event("order_over")["complete"], false, "{input:?}, {stop:?}");
        let ended = run.stopped();
        assert_eq!(number(&ended, "unknown"), 0, "{input:?}, {stop:?}: {ended}");
        assert_eq!(ended["machine"], "the robot has no jobs of this file queued");
        // The robot does not execute the jobs that it had queued.
        thread::sleep(Duration::from_millis(100));
        let executed = cell.executed().len();
        assert_eq!(executed as u64, number(&ended, "done"), "{input:?}, {stop:?}");
        assert!(executed > before && executed < 300, "{executed}");
        before = executed;
    }
    kawasaki_run::finish(cell.run(more), 300);
    cell.assert_executed_once();
}

#[test]
fn an_order_is_interrupted_whatever_standard_input_is() {
    stop_orders(kawasaki_run::TCP, &STOPS, &[]);
}

/// Over UDP, and in a plant without a message to interrupt an order, the robot then executes its queued jobs.
#[test]
fn an_order_ends_over_udp_and_where_it_cannot_be_interrupted() {
    stop_orders(kawasaki_run::UDP, &STOPS[..3], &[]);
    stop_orders(
        kawasaki_run::TCP,
        &STOPS[1..3],
        &["--set", "messages.order_interrupt.sent=false", "--set", "takeover=end"],
    );
}

#[test]
fn a_part_that_was_begun_is_placed_and_another_one_is_not_begun() {
    let cell = mma_run::Cell::new(10);
    for (input, stop) in STOPS {
        let mut run = Run::start(&cell.arguments(3, &["--again"]), input);
        mma_run::step(&run.0, "go_pick");
        run.stop(stop);
        let ended = run.stopped();
        let [done, unknown] = ["done", "unknown"].map(|name| number(&ended, name));
        assert_eq!((done, unknown), (1, 0), "{input:?}, {stop:?}: {ended}");
        assert_eq!(ended["machine"], "at rest");
    }
    // The robot has not gone to a part: it stops on its way.
    let cell = mma_run::Cell::new(1);
    let run = Run::start(&cell.arguments(3, &[]), Input::Null);
    mma_run::step(&run.0, "await_home");
    run.0.signal("-TERM");
    let ended = run.stopped();
    assert_eq!([number(&ended, "done"), number(&ended, "unknown"), number(&ended, "not_sent")], [0, 0, 3]);
    assert_eq!(ended["machine"], "at rest");
}

/// Checks the exit status 130; returns the error output.
fn ended_at_once(run: Run) -> String {
    let (code, said) = run.0.end();
    assert_eq!(code, Some(130), "{said}");
    said
}

#[test]
fn a_second_signal_ends_at_once_and_says_what_that_leaves() {
    for input in [Input::Null, Input::Pipe, Input::Terminal] {
        // The robot takes nothing, and answers nothing that the host reads.
        let cell = laser_run::Cell::new(&["tail=etx", "silence=never"]);
        let program = cell.program(30);
        let table = cell.path("part.outcomes.csv");
        let more = ["--set", "answer_timeout=10min", "--outcomes", table.to_str().unwrap()];
        let run = Run::start(&cell.arguments(&program, &more), input);
        let journal = || fs::read_to_string(cell.path("part.csv.journal")).unwrap_or_default();
        while !journal().contains("unknown") {
            thread::sleep(Duration::from_millis(10));
        }
        run.0.signal("-TERM");
        run.0.event("stopping");
        thread::sleep(Duration::from_millis(50)); // later than what belongs to the first
        run.0.signal("-INT");
        let said = ended_at_once(run);
        let rest = "0 of 30 done, 7 unknown; the controller may still execute up to 7 queued instructions; the same command continues from ";
        assert!(said.contains(&format!("a second signal ended the program: {rest}")), "{input:?}: {said}");
        assert!(said.contains("; with --dry-run it writes the outcomes"), "{said}");
    }
    let mut cell = kawasaki_run::Cell::new(kawasaki_run::TCP, 300);
    let mut run = Run::start(&cell.arguments(&[]), Input::Null);
    run.0 = cell.ready(run.0);
    let _robot = cell.robot(&["job_time=10min", "queue=50"]);
    run.0.event("order_started");
    thread::sleep(Duration::from_secs(1)); // others are queued
    run.0.signal("-TERM");
    run.0.event("stopping");
    thread::sleep(Duration::from_millis(50));
    run.0.signal("-TERM");
    let said = ended_at_once(run);
    let queued = said.split("0 of 300 done, ").nth(1).and_then(|rest| rest.split(' ').next()).expect(&said);
    assert!(queued.parse::<usize>().unwrap() > 5, "{said}");
    assert!(said.contains(&format!("; the robot may still execute up to {queued} queued jobs; ")), "{said}");
    let cell = mma_run::Cell::new(1);
    let run = Run::start(&cell.arguments(3, &[]), Input::Null);
    mma_run::step(&run.0, "await_home");
    run.0.signal("-INT");
    thread::sleep(Duration::from_millis(50));
    // It may have ended by the first: the devices answer within milliseconds.
    let _ = run.0.end();
}

/// After 30 s the run ends without waiting for the machine; only the devices of MM&A receive a command to stop.
#[test]
fn a_stop_has_a_limit() {
    let ended = |run: Run| {
        let begin = Instant::now();
        run.0.signal("-TERM");
        let ended = run.stopped();
        let took = begin.elapsed();
        assert!(took >= Duration::from_secs(29) && took < Duration::from_secs(40), "{took:?}: {ended}");
        ended
    };
    thread::scope(|scope| {
        scope.spawn(|| {
            // The robot takes nothing, and answers nothing that the host reads.
            let cell = laser_run::Cell::new(&["tail=etx", "silence=never"]);
            let program = cell.program(30);
            let run = Run::start(&cell.arguments(&program, &["--set", "answer_timeout=10min"]), Input::Null);
            thread::sleep(Duration::from_secs(1));
            let ended = ended(run);
            let counts = ["done", "unknown", "not_sent"].map(|name| number(&ended, name));
            assert_eq!(
                (counts, &ended["machine"]),
                ([0, 7, 23], &"the controller may still execute up to 7 queued instructions".into())
            );
        });
        scope.spawn(|| {
            let mut cell = kawasaki_run::Cell::new(kawasaki_run::TCP, 300);
            let mut run = Run::start(&cell.arguments(&[]), Input::Null);
            run.0 = cell.ready(run.0);
            let _robot = cell.robot(&["job_time=10min", "queue=50"]);
            run.0.event("order_started");
            thread::sleep(Duration::from_secs(1));
            let ended = ended(run);
            let machine = format!("the robot may still execute up to {} queued jobs", ended["unknown"]);
            assert!(number(&ended, "unknown") > 5 && ended["machine"] == machine, "{ended}");
        });
        scope.spawn(|| {
            let cell = mma_run::Cell::new(200);
            let run = Run::start(&cell.arguments(3, &["--set", "task.place_dwell=10min"]), Input::Null);
            mma_run::step(&run.0, "place_dwell");
            let ended = ended(run);
            assert_eq!((&ended["machine"], &ended["unknown"]), (&"at rest".into(), &1.into()));
        });
    });
}

/// The demo's devices end with it.
#[test]
fn a_demo_that_is_interrupted_says_how_far_it_was() {
    for (input, signal) in [(Input::Null, "-TERM"), (Input::Terminal, "-INT"), (Input::Session, "-HUP")] {
        let run = Run::start(&["demo", "laser-eb90", "--for", "60s"].map(str::to_owned), input);
        thread::sleep(Duration::from_secs(2));
        run.0.signal(signal);
        let said = ended_at_once(run);
        let line = said.lines().find(|line| line.contains("laser: interrupted at ")).expect(&said);
        assert!(line.ends_with("; its devices were simulated, and have ended"), "{line}");
    }
}

/// Answers a request to write after a second; with what it was asked.
fn slow_server() -> (String, Arc<Mutex<Vec<[u8; 12]>>>) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let requests = Arc::new(Mutex::new(Vec::new()));
    let kept = Arc::clone(&requests);
    thread::spawn(move || {
        for stream in listener.incoming() {
            let (mut stream, mut request) = (stream.unwrap(), [0; 12]);
            while stream.read_exact(&mut request).is_ok() {
                kept.lock().unwrap().push(request);
                thread::sleep(Duration::from_secs(1));
                if stream.write_all(&request).is_err() {
                    break;
                }
            }
        }
    });
    (address, requests)
}

#[test]
fn a_request_in_flight_gets_its_reply_and_the_next_is_not_sent() {
    for input in [Input::Pipe, Input::Session] {
        let (server, requests) = slow_server();
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("writes.jsonl");
        let write = |value| format!("{{\"unit\":1,\"function\":6,\"address\":4,\"value\":{value}}}\n");
        fs::write(&file, [write(7), write(8)].concat()).unwrap();
        let args =
            ["modbus", "send", "--set", "timeout=4000ms", &server, file.to_str().unwrap()].map(str::to_owned);
        let run = Run::start(&args, input);
        while requests.lock().unwrap().is_empty() {
            thread::sleep(Duration::from_millis(10));
        }
        run.0.signal("-TERM");
        assert_eq!(run.0.line()["value"], 7);
        let said = ended_at_once(run);
        assert!(said.contains("interrupted: line 2 and the following were not sent"), "{input:?}: {said}");
        assert_eq!(requests.lock().unwrap().len(), 1);
    }
    // Without a request in flight it ends at once; a reply that does not come is awaited for five seconds.
    let (server, requests) = slow_server();
    let mut run =
        Run::start(&["modbus", "send", "--set", "timeout=60000ms", &server].map(str::to_owned), Input::Pipe);
    thread::sleep(Duration::from_millis(500));
    let input = run.0.stdin.take(); // it does not end by itself
    run.0.signal("-INT");
    assert_eq!(ended_at_once(run), "interrupted\n");
    drop(input);
    let silent = TcpListener::bind("127.0.0.1:0").unwrap();
    let at = silent.local_addr().unwrap().to_string();
    run = Run::start(&["modbus", "send", "--set", "timeout=60000ms", &at].map(str::to_owned), Input::Pipe);
    run.0.say("{\"unit\":1,\"function\":6,\"address\":4,\"value\":9}");
    let mut request = [0; 12];
    let (mut stream, _) = silent.accept().unwrap();
    stream.read_exact(&mut request).unwrap();
    let begin = Instant::now();
    run.0.signal("-INT");
    assert_eq!(ended_at_once(run), "interrupted: the server may execute the request of line 1\n");
    assert!(begin.elapsed() >= Duration::from_secs(5), "{:?}", begin.elapsed());
    assert!(requests.lock().unwrap().is_empty());
}

/// `timeout` signals its child, and then the process group, of which the child is.
#[test]
fn a_signal_that_comes_twice_at_once_and_a_hangup_after_it_are_one_stop() {
    let cell = laser_run::Cell::new(&["baud=9600"]);
    let program = cell.program(100);
    let args = cell.arguments(&program, &["--set", "baud=9600", "--again"]);
    for more in [[Signal::TERM, Signal::TERM], [Signal::INT, Signal::TERM], [Signal::TERM, Signal::HUP]] {
        let run = Run::start(&args, Input::Null);
        run.0.event("done");
        let pid = Pid::from_child(&run.0.process);
        for signal in more {
            kill_process(pid, signal).unwrap();
        }
        thread::sleep(Duration::from_millis(40));
        kill_process(pid, Signal::HUP).unwrap();
        let ended = run.stopped();
        assert_eq!(number(&ended, "unknown"), 0, "{more:?}");
    }
}

#[test]
fn after_nohup_a_closed_terminal_stops_nothing() {
    let cell = laser_run::Cell::new(&[]);
    let program = cell.program(60);
    let mut command = Command::new("nohup");
    command.arg(env!("CARGO_BIN_EXE_cellwire")).args(cell.arguments(&program, &[])).stdin(Stdio::null());
    let run = Tool::spawn(command);
    run.event("done");
    run.signal("-HUP");
    assert_eq!(run.event("ended")["done"], 60);
    assert_eq!(run.end().0, Some(0));
}

/// The end of standard input alone is not a stop, and a program without input runs to its end.
#[test]
fn without_standard_input_a_program_is_finished() {
    let cell = laser_run::Cell::new(&[]);
    let program = cell.program(60);
    for input in [Input::Null, Input::Session] {
        let run = Run::start(&cell.arguments(&program, &["--again"]), input);
        assert_eq!(run.0.event("ended")["done"], 60);
        assert_eq!(run.0.end().0, Some(0));
    }
}

/// Nobody sees what happens: `cellwire run laser … | head -1`.
#[test]
fn a_run_whose_output_is_closed_stops_with_nothing_unknown() {
    let cell = laser_run::Cell::new(&["baud=9600"]);
    let program = cell.program(100);
    let mut command = Command::new("bash");
    command.args(["-c", "\"$@\" | head -1; exit ${PIPESTATUS[0]}", "bash", env!("CARGO_BIN_EXE_cellwire")]);
    command.args(cell.arguments(&program, &["--set", "baud=9600"])).stdin(Stdio::null());
    let run = Tool::spawn(command);
    assert_eq!(run.line()["ready"], "laser");
    let (code, said) = run.end();
    assert_eq!(code, Some(4), "{said}");
    // The line is on standard error then.
    let line = said.lines().find_map(|line| serde_json::from_str::<Value>(line).ok()).expect(&said);
    assert_eq!(
        (&line["event"], &line["why"], &line["unknown"]),
        (&"ended".into(), &"stopped".into(), &0.into())
    );
    assert_eq!(cell.queued(number(&line, "done")), number(&line, "done"));
}

/// The program's three streams are all the terminal, as for an operator.
#[test]
fn a_closed_terminal_that_is_the_output_too_leaves_nothing_unknown() {
    let cell = laser_run::Cell::new(&["baud=9600"]);
    let program = cell.program(100);
    for session in [&["--ctty"][..], &[]] {
        let _ = fs::remove_file(cell.path("part.csv.journal"));
        let (user, path) = Pty::new();
        let end = || Stdio::from(File::options().read(true).write(true).open(&path).unwrap());
        let mut command = Command::new("setsid");
        command.args(session).arg("env").args(HEARS_HANGUP);
        command.args(cell.arguments(&program, &["--set", "baud=9600", "--again"]));
        let mut process = command.stdin(end()).stdout(end()).stderr(end()).spawn().unwrap();
        drop(command);
        let count = |outcome: &str| {
            let journal = fs::read_to_string(cell.path("part.csv.journal")).unwrap_or_default();
            journal.lines().filter(|line| line.contains(outcome)).count()
        };
        while count("done") < 2 {
            thread::sleep(Duration::from_millis(10));
        }
        drop(user);
        process.wait().unwrap();
        let (begun, done) = (count("unknown"), count("done"));
        assert!(begun == done && (2..14).contains(&done), "{session:?}: {begun} begun, {done} done");
    }
}

#[test]
fn a_signal_while_a_question_is_open_is_a_stop() {
    let cell = laser_run::Cell::new(&["baud=9600"]);
    let program = cell.program(100);
    let args = cell.arguments(&program, &["--set", "baud=9600"]);
    let run = Run::start(&args, Input::Pipe);
    run.0.event("done");
    thread::sleep(Duration::from_millis(60)); // of the 226 ms of the next frame
    run.0.kill();
    for (input, stop) in [(Input::Pipe, Stop::Signal("-TERM")), (Input::Terminal, Stop::Close)] {
        let mut run = Run::start(&args, input);
        run.0.event("question");
        run.stop(stop);
        let ended = run.stopped();
        assert_eq!([number(&ended, "done"), number(&ended, "unknown")], [7, 7], "{input:?}");
        let machine =
            "the controller may still execute up to 7 queued instructions, and those of earlier runs";
        assert_eq!(ended["machine"], machine);
    }
}
