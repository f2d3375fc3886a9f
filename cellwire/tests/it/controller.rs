//! The AS program for the controller draws the picture over TCP: against `simulate kawasaki-pc`, and with every packet of
//! jobs cut off.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::indexing_slicing,
    clippy::cast_possible_truncation,
    clippy::cast_precision_loss
)]

use core::time::Duration;
use std::collections::BTreeMap;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::process::{Child, Command, Stdio};
use std::sync::{Arc, Mutex, mpsc};
use std::thread;
use std::time::Instant;

use as_interpreter::{Machine, Motion, Program, Step, TcpHost, controller};
use serde_json::Value;

/// A job as it is sent: kind, x and y of both ends, in hundredths of a millimetre.
type Job = [i32; 5];
/// The jobs that the PC has sent, by number.
type Sent = Arc<Mutex<BTreeMap<u16, Job>>>;

const LIMIT: Duration = Duration::from_secs(60);

/// `cellwire simulate kawasaki-pc`, killed when dropped.
struct Pc {
    process: Child,
    address: String,
    /// How many jobs its order had when it was over.
    over: mpsc::Receiver<u64>,
}

impl Pc {
    fn start() -> Self {
        let mut command = Command::new(env!("CARGO_BIN_EXE_cellwire"));
        let command = command.args(["simulate", "kawasaki-pc", "--listen", "127.0.0.1:0"]);
        let mut process = command.stdout(Stdio::piped()).spawn().unwrap();
        let mut lines = BufReader::new(process.stdout.take().unwrap()).lines();
        let ready: Value = serde_json::from_str(&lines.next().unwrap().unwrap()).unwrap();
        let (sender, over) = mpsc::channel();
        thread::spawn(move || {
            for line in lines.map_while(Result::ok) {
                let line: Value = serde_json::from_str(&line).unwrap();
                if line["event"] == "order_over" {
                    assert_eq!(line["complete"], true, "{line}");
                    let _ = sender.send(line["executed"].as_u64().unwrap());
                }
                assert!(line["event"] != "outcome_unknown", "{line}");
            }
        });
        Self { process, address: ready["listen"].as_str().unwrap().into(), over }
    }
}

impl Drop for Pc {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// Carries bytes between a robot and the PC, and remembers the jobs. With `cuts`, a packet that holds jobs or the order's
/// end arrives in part, and the connection ends.
fn line_to(pc: &str, cuts: bool, sent: Sent) -> u16 {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let (port, pc) = (listener.local_addr().unwrap().port(), pc.to_owned());
    thread::spawn(move || {
        let mut random = 1_u32;
        for mut robot in listener.incoming().map_while(Result::ok) {
            let mut pc = TcpStream::connect(&pc).unwrap();
            let (mut from_robot, mut to_pc) = (robot.try_clone().unwrap(), pc.try_clone().unwrap());
            let up = thread::spawn(move || {
                let _ = std::io::copy(&mut from_robot, &mut to_pc);
                let _ = to_pc.shutdown(Shutdown::Both);
            });
            let (mut packet, mut rest) = ([0; 4096], String::new());
            while let Ok(length @ 1..) = pc.read(&mut packet) {
                let text = String::from_utf8(packet[..length].to_vec()).unwrap();
                rest += &text;
                remember(&rest, &sent);
                rest.drain(..rest.rfind('>').map_or(0, |end| end + 1));
                let is_cut = cuts && (text.contains("<Tyo$") || text.contains("<TilausLoppuu$"));
                random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                // Anywhere, or after the first message: a PC from which nothing comes at all is an alarm.
                let least = if random & 0x100 == 0 { text.find('>').map_or(0, |end| end + 1) } else { 0 };
                let kept =
                    if is_cut { least + random as usize / 0x1000 % (length + 1 - least) } else { length };
                if robot.write_all(&packet[..kept]).is_err() || is_cut {
                    break;
                }
            }
            let _ = (robot.shutdown(Shutdown::Both), pc.shutdown(Shutdown::Both));
            let _ = up.join();
        }
    });
    port
}

/// Stores the whole jobs of a text; panics if one of them has changed.
fn remember(text: &str, sent: &Sent) {
    for job in text.split("<Tyo$").skip(1) {
        let Some((_, data)) = job.split_once('>').and_then(|(job, _)| job.split_once('#')) else { continue };
        let values: Vec<i32> =
            data.trim_end_matches('#').split('$').map(|value| value.parse().unwrap()).collect();
        let job: Job = values[2..].try_into().unwrap();
        let before = sent.lock().unwrap().insert(values[1] as u16, job);
        assert!(before.is_none_or(|before| before == job), "job {} has changed", values[1]);
    }
}

/// Returns the line of the last two commands to the arm.
fn line(path: &[Motion]) -> Job {
    let [.., start, end] = path else { panic!("no line: {path:?}") };
    let hundredths = |mm: f32| (mm * 100.0).round() as i32;
    let place = |motion: &Motion| [motion.to[0], motion.to[1]].map(hundredths);
    let ([x1, y1], [x2, y2]) = (place(start), place(end));
    [if end.to[2] < 10.0 { 1 } else { 2 }, x1, y1, x2, y2]
}

/// The results of a run.
struct Run {
    connections: u64,
    packets: u64,
    /// The statements of the communication task, and those of the longest exchange.
    statements: u64,
    longest: u64,
    motion: u64,
    jobs: u64,
}

fn draw(cuts: bool) -> Run {
    let (pc, sent) = (Pc::start(), Sent::default());
    let port = line_to(&pc.address, cuts, sent.clone());
    let settings = [
        ("cw.ip[1]", 127.0),
        ("cw.ip[2]", 0.0),
        ("cw.ip[3]", 0.0),
        ("cw.ip[4]", 1.0),
        ("cw.port", f64::from(port)),
        ("cw.size", 500.0),
        ("cw.low", 400.0),
        ("cw.t.exchange", 0.002),
        ("cw.t.connect", 0.01),
    ];
    let source = controller::source(&settings).unwrap();
    let mut machine = Machine::new(Program::parse(&source).unwrap());
    machine.set_pose("cw.board", [0.0; 6]);
    let tasks = ["cw.comm.pc", "cw.motion"].map(|program| machine.start(program).unwrap());
    let (mut host, begin) = (TcpHost::new(), Instant::now());
    let (mut before, mut longest) = ((0, 0), 0);
    let executed = loop {
        let steps = tasks.map(|task| machine.step(task, &mut host).unwrap_or_else(|fault| panic!("{fault}")));
        if host.packets != before.0 {
            let statements = machine.statements(tasks[0]);
            longest = longest.max(statements - before.1);
            before = (host.packets, statements);
        }
        if steps == [Step::Waits; 2] {
            if let Ok(executed) = pc.over.try_recv() {
                break executed;
            }
            assert!(begin.elapsed() < LIMIT, "{:?}", &host.printed[host.printed.len().saturating_sub(20)..]);
            thread::sleep(Duration::from_micros(200));
        }
    };
    let (sent, drawn) = (sent.lock().unwrap(), &host.drawn);
    assert!(sent.keys().copied().eq(1..=sent.len() as u16));
    assert_eq!((executed, drawn.len()), (sent.len() as u64, sent.len()), "lost or repeated");
    for ((number, job), path) in sent.iter().zip(drawn) {
        assert_eq!(line(path), *job, "job {number}");
    }
    assert_eq!(machine.truncations(), 0);
    Run {
        connections: host.connections,
        packets: host.packets,
        statements: machine.statements(tasks[0]),
        longest,
        motion: machine.statements(tasks[1]),
        jobs: executed,
    }
}

fn show(name: &str, run: &Run) {
    println!(
        "{name}: {} jobs, {} packets, {} connections; communication {} statements, {:.0} a job, {:.0} an exchange, at most {}; \
         motion {:.0} a job",
        run.jobs,
        run.packets,
        run.connections,
        run.statements,
        run.statements as f64 / run.jobs as f64,
        run.statements as f64 / run.packets as f64,
        run.longest,
        run.motion as f64 / run.jobs as f64,
    );
}

#[test]
fn the_picture_is_drawn_line_by_line() {
    let run = draw(false);
    show("whole", &run);
    assert!(run.jobs > 5892 && run.connections == 1, "the built-in picture");
    // The time that the program's page states.
    assert!(run.statements / run.jobs < 220 && run.longest < 23_000, "{} {}", run.statements, run.longest);
}

#[test]
fn so_it_is_when_every_packet_of_jobs_is_cut_off() {
    let run = draw(true);
    show("cut", &run);
    assert!(run.jobs > 5892 && run.connections > 60, "{}", run.connections);
}
