//! `cellwire identify --draft`: a plant with unknown names, from a tap to a client that works with it.

use core::fmt::Write as _;
use std::fs;
use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::path::Path;
use std::process::Command;

use crate::operated::Tool;

const JOBS: usize = 40;

/// Returns the plants of the repository, with names of their own.
fn renamed(name: &str) -> String {
    let path = format!("{}/../kawasaki-msg/plants/{name}.toml", env!("CARGO_MANIFEST_DIR"));
    let mut text = String::new();
    let mut role = "";
    let plant = fs::read_to_string(path).unwrap();
    for line in plant.lines() {
        role = line.strip_prefix("[messages.").map_or(role, |rest| rest.trim_end_matches(']'));
        if line.starts_with("name = ") && !role.is_empty() {
            writeln!(
                text,
                "name = \"Q{}\"",
                role.bytes().rev().filter(|it| *it != b'_').map(char::from).collect::<String>()
            )
            .unwrap();
        } else {
            writeln!(text, "{line}").unwrap();
        }
    }
    text
}

/// Returns the part of a plant's file from a table to the next one.
fn table<'a>(text: &'a str, name: &str) -> &'a str {
    let begin = text.find(&format!("[{name}]")).unwrap_or_else(|| panic!("no {name}: {text}"));
    let end = text[begin + 1..].find("\n[").map_or(text.len(), |end| begin + 1 + end + 1);
    &text[begin..end]
}

/// Returns the draft, with each line that has a question mark replaced by the plant's.
fn corrected(draft: &str, plant: &str) -> String {
    let mut text = String::new();
    let mut columns = ["kind", "x1", "y1", "x2", "y2"].into_iter();
    for part in draft.split_inclusive("\n\n") {
        let name =
            part.split_once('[').and_then(|(_, rest)| rest.split_once(']')).map_or("", |(name, _)| name);
        let lines = part.split_inclusive('\n').map(|line| match line.split_once(" = ") {
            Some(("name" | "header" | "fields", rest))
                if rest.contains("# ?") && name.starts_with("messages.") =>
            {
                let key = &line[..line.find('=').unwrap()];
                let told = table(plant, name).lines().find(|told| told.starts_with(key));
                told.map_or_else(String::new, |told| format!("{told}\n"))
            }
            _ => line.to_owned(),
        });
        let part = lines.collect::<String>();
        if name.starts_with("messages.") && part.contains("# ? not in") {
            text += table(plant, name);
        } else if name == "[job" {
            let column = columns.next().unwrap();
            let named = part.lines().find(|line| line.starts_with("name = ")).unwrap();
            text += &part.replace(named, &format!("name = \"{column}\""));
        } else {
            text += &part;
        }
    }
    let limit = plant.lines().find(|line| line.starts_with("max_number")).unwrap();
    text.replace("# max_number = 9999", limit)
}

/// Starts the tap of a link before a server; returns it with its address.
fn tap(link: &str, server: &str, capture: &str) -> (Tool, String) {
    let tap =
        Tool::start(&["tap", link, "--listen", "127.0.0.1:0", "--connect", server, "--capture", capture]);
    let address = tap.line()["listen"].as_str().unwrap().to_owned();
    (tap, address)
}

/// Ends the tap, so that the capture is complete.
fn end(tap: Tool) {
    let pid = rustix::process::Pid::from_child(&tap.process);
    rustix::process::kill_process(pid, rustix::process::Signal::INT).unwrap();
    tap.end();
}

/// Runs `orders` orders of a client with a robot, and writes a capture of the traffic.
fn work(folder: &Path, name: &str, orders: usize, client: &str, robot: &str) {
    let path = |name: &str| folder.join(name).to_str().unwrap().to_owned();
    let mut jobs = String::from("kind,x1,y1,x2,y2\n");
    (0..JOBS).for_each(|at| {
        writeln!(jobs, "{},{},{},{at},-{at}", 1 + at % 2, at * 31 % 700, at * 17 % 90).unwrap()
    });
    let capture = path(&format!("{name}.pcapng"));
    let (mut listens, mut working) = ("127.0.0.1:0".to_owned(), None);
    for order in 0..orders {
        let table = path(&format!("{name}-{order}.csv"));
        fs::write(&table, &jobs).unwrap();
        let number = format!("order={}", 700 + order);
        let run = ["run", "kawasaki", &table, "--settings", client, "--listen", &listens, "--set", &number];
        let run = Tool::start(&run);
        run.line()["listen"].as_str().unwrap().clone_into(&mut listens);
        working.get_or_insert_with(|| {
            let (tap, taps) = tap("kawasaki-msg", &listens, &capture);
            let set = ["--set", "job_time=20ms", "--set", "queue=8"];
            let robot = ["simulate", "kawasaki-robot", "--settings", robot, "--connect", &taps];
            (Tool::start(&[&robot[..], &set].concat()), tap)
        });
        let ended = run.event("ended");
        assert_eq!((&ended["why"], &ended["done"]), (&"complete".into(), &JOBS.into()), "{ended}");
        assert_eq!(run.end().0, Some(0));
    }
    let (robot, tap) = working.unwrap();
    drop(robot);
    end(tap);
}

#[test]
fn a_draft_that_is_corrected_where_it_says_so_works() {
    for name in ["default", "other"] {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
        let plant = renamed(name);
        fs::write(path("plant.toml"), &plant).unwrap();
        work(folder.path(), "first", 3, &path("plant.toml"), &path("plant.toml"));
        let identify = ["identify", "--json", &path("first.pcapng"), "--draft", &path("draft.toml")];
        assert_eq!(Tool::start(&identify).end().0, Some(0));
        let draft = fs::read_to_string(path("draft.toml")).unwrap();
        let line = |role: &str, key: &str| {
            let table = table(&draft, &format!("messages.{role}")).lines();
            table.clone().find(|line| line.starts_with(key)).unwrap_or_default().to_owned()
        };
        // Every command accepts the draft as it is.
        for command in [
            "decode kawasaki",
            "simulate kawasaki-robot --listen nowhere",
            "simulate kawasaki-pc --listen nowhere",
        ] {
            let file = path("draft.toml");
            let args: Vec<&str> = command.split(' ').chain(["--settings", &file]).collect();
            let said = Command::new(env!("CARGO_BIN_EXE_cellwire")).args(args).output().unwrap();
            let said = String::from_utf8(said.stderr).unwrap();
            assert!(!said.contains("draft.toml"), "{command}: {said}");
        }
        // Names that the capture shows are not marked as uncertain.
        for role in ["job", "job_ack", "job_request", "order_start", "order_ack", "end_ack", "status"] {
            let named = line(role, "name");
            assert!(!named.contains('?') && !named.is_empty(), "{name} {role}: {draft}");
        }
        for role in ["job_ack", "job_request", "order_start", "order_ack"] {
            assert!(!line(role, "fields").contains('?'), "{name} {role}: {draft}");
        }
        // An order that was interrupted when all was done would look the same.
        assert!(line("order_end", "name").contains('?'), "{draft}");
        fs::write(path("corrected.toml"), corrected(&draft, &plant)).unwrap();
        work(folder.path(), "second", 1, &path("corrected.toml"), &path("plant.toml"));
    }
}

const WORDS: &str = "[words]
commands = [
  { first = 4097, last = 4098, class = \"interpreted\" },
  { first = 513, last = 515, class = \"immediate\" },
  { first = 769, last = 769, class = \"query\" },
]
[words.errors]
bad_checksum = 991
bad_frame = 992
unknown_command = 993
bad_batch = 994
bad_parameters = 995
queue_full = 996
";

/// Returns a program with other words than the tool's own: the cuts, and after every third instruction the one that lets the
/// robot continue.
fn program() -> String {
    let line = |n: u16| {
        let then = if n.is_multiple_of(3) { "514\n" } else { "" };
        format!("{},{n},{},0,0,0,{n}\n{then}", 4097 + n % 2, n % 7)
    };
    String::from("word,x,y,z,a,b,length\n") + &(0..12).map(line).collect::<String>()
}

fn set(settings: &str) -> impl Iterator<Item = &str> {
    settings.split(' ').flat_map(|it| ["--set", it])
}

#[test]
fn the_words_of_a_laser_are_drafted_and_work_when_they_are_corrected_where_it_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    fs::write(path("plant.toml"), WORDS).unwrap();
    fs::write(path("part.csv"), program()).unwrap();
    let robot = ["simulate", "laser", "--listen", "127.0.0.1:0", "--settings", &path("plant.toml")];
    let robot = robot.into_iter().chain(set("baud=115200 execution=50ms queue=4 batch=3"));
    let robot = Tool::start(&robot.collect::<Vec<_>>());
    let listens = robot.line()["listen"].as_str().unwrap().to_owned();
    let work = |name: &str, words: &str| {
        let (tap, taps) = tap("laser-eb90", &listens, &path(&format!("{name}.pcapng")));
        // The numbers of queued and held instructions: no program requests them.
        let mut client = TcpStream::connect(&taps).unwrap();
        for _ in 0..3 {
            client.write_all(&[0xEB, 0x90, 0x82, 0xF0, 0xF1, 0x01, 0x01, 0x03, 0x90, 0x82, 0xF6]).unwrap();
            while tap.line()["from"] != "controller" {}
            // An answer with values; it may come in pieces.
            let mut length = 0;
            while length <= 11 {
                let piece = client.read(&mut [0; 64]).unwrap();
                assert!(piece > 0, "the tap stays connected");
                length += piece;
            }
        }
        drop(client);
        tap.event("closed");
        tap.event("closed");
        let journal = path(&format!("{name}.journal"));
        let run = [
            "run",
            "laser",
            &path("part.csv"),
            "--journal",
            &journal,
            "--serial",
            &taps,
            "--settings",
            words,
        ];
        let run = run.into_iter().chain(set("baud=115200 longest_frame=1 max_pause=0 batch=3"));
        let run = Tool::start(&run.collect::<Vec<_>>());
        let ended = run.event("ended");
        assert_eq!((&ended["why"], &ended["done"]), (&"complete".into(), &16.into()), "{ended}");
        assert_eq!(run.end().0, Some(0));
        end(tap);
    };
    work("first", &path("plant.toml"));
    let identify = ["identify", "--json", &path("first.pcapng"), "--draft", &path("draft.toml")];
    assert_eq!(Tool::start(&identify).end().0, Some(0));
    let draft = fs::read_to_string(path("draft.toml")).unwrap();
    let line = |text: &str| {
        draft.lines().find(|line| line.contains(text)).unwrap_or_else(|| panic!("{text}: {draft}"))
    };
    for (word, class) in [(4097, "interpreted"), (4098, "interpreted"), (769, "query")] {
        let line = line(&format!("first = {word}"));
        assert!(line.contains(&format!("class = \"{class}\"")) && !line.contains('?'), "{line}");
    }
    assert!(line("queue_full = 996").contains('?'));
    // It is executed at once, as instructions are queued: somebody who knows the machine says what it is.
    let asked = line("first = 514");
    assert!(asked.contains("interpreted") && asked.contains("# ? 4 times"), "{asked}");
    fs::write(path("corrected.toml"), draft.replace(asked, &asked.replace("interpreted", "immediate")))
        .unwrap();
    work("second", &path("corrected.toml"));
    // A shadow with the corrected words knows all of them.
    let unknown = |settings: &[&str]| {
        let mut decode = Command::new(env!("CARGO_BIN_EXE_cellwire"));
        decode.args(["decode", "laser-eb90", "--format", "pcap", "--shadow", &path("second.pcapng")]);
        let output = decode.args(settings).output().unwrap();
        String::from_utf8(output.stdout).unwrap().matches("is not a command word").count()
    };
    assert!(unknown(&[]) > 0);
    assert_eq!(unknown(&["--settings", &path("corrected.toml")]), 0);
}

/// A frame of three instructions, and its answer.
const FRAME: &str = "eb 90 82 f0 f1 01 01 01 f0 02 00 00 a0 41 00 00 20 41 f1 01 01 01 90 82 ";

#[test]
fn the_draft_of_a_laser_alone_suffices() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let bytes: Vec<u8> =
        FRAME.split_whitespace().skip(3).map(|byte| u8::from_str_radix(byte, 16).unwrap()).collect();
    let sum = bytes[1..bytes.len() - 2].iter().fold(0u8, |sum, byte| sum.wrapping_add(*byte));
    fs::write(path("laser.hex"), format!("{FRAME}{sum:02x}\n").repeat(3)).unwrap();
    let mut identify = Command::new(env!("CARGO_BIN_EXE_cellwire"));
    let draft = path("draft.toml");
    identify.args([
        "identify",
        "--json",
        "--link",
        "laser",
        "--from",
        "host",
        &path("laser.hex"),
        "--format",
        "hex",
    ]);
    let output = identify.args(["--draft", &draft, "--write", &path("cell.toml")]).output().unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(0), "{said}");
    let read = |name: &str| -> toml::Table { fs::read_to_string(path(name)).unwrap().parse().unwrap() };
    let (draft_of, written) = (read("draft.toml"), read("cell.toml"));
    // The draft has all that the settings have, and the words.
    for (name, value) in &written {
        assert_eq!(draft_of.get(name), Some(value), "{name}");
    }
    assert!(written.contains_key("checksum") && draft_of.contains_key("words"), "{draft_of:?}");
    let text = fs::read_to_string(&draft).unwrap();
    let marked = text.lines().filter(|line| line.contains("# ?")).count();
    assert!(marked > 1, "{text}");
    assert!(
        said.contains(&format!("{draft} has the draft of laser: check the {marked} lines with a ?\n")),
        "{said}"
    );
    assert!(
        said.contains("cell.toml has the settings of laser: ")
            && said.contains(" undecided, see the comments"),
        "{said}"
    );
    let decode = ["decode", "laser", "--settings", &draft, &path("laser.hex"), "--format", "hex"];
    assert_eq!(Tool::start(&decode).end().0, Some(0));
}
