//! Every command as a process: its output, its exit status, and its errors for wrong arguments.

use std::io::Write;
use std::process::Stdio;

use crate::tool::{Running, cellwire, run};
use cellwire_links::Link;
use serde_json::Value;

const LINKS: [&str; 7] = [
    "kawasaki-msg",
    "val2-alter",
    "val2-viewer",
    "isra-ball",
    "fanuc-hmi-modbus",
    "laser-eb90",
    "mmacell-proto",
];

/// Runs with an input; the exit status and both outputs.
fn with_input(arguments: &str, input: &str) -> (Option<i32>, String, String) {
    let mut child = cellwire(arguments).stdin(Stdio::piped()).spawn().unwrap();
    child.stdin.take().unwrap().write_all(input.as_bytes()).unwrap();
    let output = child.wait_with_output().unwrap();
    let text = |bytes| String::from_utf8(bytes).unwrap();
    (output.status.code(), text(output.stdout), text(output.stderr))
}

#[test]
fn every_command_has_a_help_that_ends_with_success() {
    let (code, help, _) = run(cellwire("--help"));
    assert_eq!(code, Some(0));
    let list = help.split("Links:").next().unwrap();
    let names = list.lines().filter(|line| line.starts_with("  "));
    let names: Vec<&str> = names.filter_map(|line| line.split_whitespace().next()).collect();
    let all = ["demo", "simulate", "ports", "tap", "identify", "decode", "encode", "replay", "run", "alter"];
    let all = all.into_iter().chain(["fanuc", "modbus", "ls", "settings", "help"]);
    assert_eq!(names, all.collect::<Vec<_>>());
    assert!(help.lines().all(|line| line.len() <= 80), "{help}");
    for name in names.into_iter().filter(|name| *name != "help") {
        let (code, text, said) = run(cellwire(&format!("{name} --help")));
        assert_eq!((code, said.as_str()), (Some(0), ""), "{name}");
        assert!(text.contains(&format!("Usage: cellwire {name}")), "{name}: {text}");
    }
}

#[test]
fn the_short_help_of_every_command_fits_80_columns() {
    let top = "demo simulate ports tap identify decode encode replay run alter fanuc modbus ls settings capture extcap vectors completions man";
    let mut names: Vec<String> = top.split(' ').map(str::to_owned).collect();
    let mut count = 0;
    while let Some(name) = names.pop() {
        let (code, text, _) = run(cellwire(&format!("{name} -h")));
        assert_eq!(code, Some(0), "{name}");
        let long: Vec<&str> = text.lines().filter(|line| line.chars().count() > 80).collect();
        assert_eq!(long, [""; 0], "{name}");
        let inner = text.split_once("\nCommands:\n").map_or("", |(_, after)| after);
        let inner = inner.lines().take_while(|line| line.starts_with("  "));
        let inner =
            inner.filter(|line| !line.starts_with("   ")).filter_map(|line| line.split_whitespace().next());
        names.extend(inner.filter(|inner| *inner != "help").map(|inner| format!("{name} {inner}")));
        count += 1;
    }
    assert!(count > 36, "{count}");
}

#[test]
fn the_manual_has_every_command_and_keeps_columns() {
    let folder = tempfile::tempdir().unwrap();
    let (code, _, said) = run(cellwire(&format!("man {}", folder.path().display())));
    assert_eq!((code, said.as_str()), (Some(0), ""));
    for (page, has) in [
        ("cellwire.1", "Exit status:"),
        ("cellwire-run-kawasaki.1", "Exit status: 0 all done"),
        ("cellwire-settings.1", "cellwire settings modbus poll"),
    ] {
        let text = std::fs::read_to_string(folder.path().join(page)).unwrap();
        assert!(text.contains(has), "{page}: {text}");
        assert!(text.contains("\n.SH NOTES\n.nf\n") && !text.contains("EXTRA"), "{page}: {text}");
    }
}

#[test]
fn standard_input_can_be_named() {
    let bytes = "08 F8 5D 00 01";
    let named = with_input("decode isra-ball -", bytes);
    assert!(named.1.contains("\"offset\":0"), "{named:?}");
    assert_eq!(named, with_input("decode isra-ball", bytes));
}

#[test]
fn wrong_arguments_are_an_error_of_two_that_says_what_to_do() {
    for (arguments, says) in [
        ("", "Usage: cellwire <COMMAND>"),
        ("nonsense", "unrecognized subcommand 'nonsense'"),
        ("decode", "<LINK>"),
        ("decode nonsense", "[possible values: kawasaki, alter"),
        ("decode isra-ball --from nobody", "use --from "),
        ("decode isra-ball /no/such/file", "/no/such/file"),
        ("encode laser-eb90 --from nobody", "use --from "),
        ("vectors", "check"),
        ("simulate nonsense --listen 0", "[possible values: kawasaki-robot, kawasaki-pc"),
        ("simulate ball", "--listen"),
        ("simulate isra-ball", "--listen"),
        ("simulate ball --listen 0 --pty x", "cannot be used with"),
        ("simulate ball --connect 127.0.0.1:9", "use --pty or --listen"),
        ("simulate fanuc --connect 127.0.0.1:9", "use --listen, or --pty"),
        (
            "simulate kawasaki-robot --listen 0 --set udp=true",
            "over UDP the robot sends first: use --connect",
        ),
        ("simulate mma-robot --pty x", "use --listen"),
        ("simulate kawasaki-robot --connect 127.0.0.1", "give HOST:PORT"),
        ("run kawasaki Cargo.toml --connect 127.0.0.1", "give HOST:PORT"),
        ("simulate puma --listen 0 --set baud=10000", "take a higher baud rate"),
        ("simulate ball --listen 0 --idle-timeout NaN", "such as 250ms"),
        ("simulate ball --listen 0 --idle-timeout -1", "-1"),
        ("simulate ball --listen 0 --trace 0", "1..=10000000"),
        ("simulate ball --listen 0 --trace-dir /no/such/folder", "there is no such folder"),
        ("simulate ball --listen 0 --set baud=0", "50"),
        ("demo nonsense", "[possible values: kawasaki, alter"),
        ("demo --for NaN", "such as 250ms"),
        ("demo --for 1e300s", "such as 250ms"),
        ("demo --for -1", "-1"),
        ("demo --for 0", "give between 100ms and"),
        ("demo --seed -1", "-1"),
        ("demo ball --out /dev/null", "cannot make --out /dev/null"),
        ("demo --must-fail lost", "--must-fail needs one LINK"),
        ("demo isra-ball --must-fail limit", "has no --must-fail limit: it has lost, late"),
        ("demo isra-ball --must-fail everything", "[possible values: lost, repeated, limit, late]"),
        ("demo isra-ball --drawing x.svg", "--drawing is for kawasaki alone"),
        ("demo isra-ball --verbose --json", "cannot be used with"),
        ("demo val2-alter --set baud=1e99", "baud"),
        ("modbus send", "<SERVER>"),
        ("modbus nonsense", "nonsense"),
        ("modbus read 127.0.0.1:1", "a similar subcommand exists: 'send'"),
        ("laser run x.nc", "a similar subcommand exists: 'run laser'"),
        ("ls chek A.LS", "a similar subcommand exists: 'check'"),
        ("help simulate fanuc", "`cellwire help simulate` explains fanuc"),
        (
            "run laser --connect h:1 x.nc",
            "tip: --serial takes HOST:PORT too\n\nUsage: cellwire run laser [OPTIONS] <FILE> --serial <PORT>",
        ),
        ("modbus send h:1 --timeout 5s", "tip: it is a setting: --set timeout=VALUE"),
        ("run laser --answer-timeout 1s", "tip: it is a setting: --set answer_timeout=VALUE"),
        ("fanuc log", "<"),
        ("fanuc evaluate", "<"),
        ("ls check", "<"),
        ("ls check /dev/null --format xml", "[possible values: text, short, json, sarif]"),
        ("ls make /no/such/file.csv --mode dynamic", "/no/such/file.csv"),
        ("ls make x.csv --mode distance --mm 1e300", "--mm: give a number above 0, and 1000000 at most"),
        ("ls make x.csv --mode time --step inf", "--step: give a number above 0, and 1000000 at most"),
        ("ls make x.csv --mode dynamic --arm NaN,1,1,1,1", "--arm: give numbers between -100000 and 100000"),
        (
            "ls make x.csv --mode dynamic --tool 1e300,0,0,0,0,0",
            "--tool: give numbers between -100000 and 100000",
        ),
        ("alter", "--robot"),
        ("alter --robot /no/such/port --ball /no/such/port", "needs a terminal"),
    ] {
        let (code, out, said) = run(cellwire(arguments));
        assert_eq!((code, out.as_str()), (Some(2), ""), "`{arguments}`: {said}");
        assert!(said.contains(says), "`{arguments}` does not say {says}: {said}");
    }
}

#[test]
fn what_is_decoded_is_encoded_to_the_same_bytes() {
    for link in LINKS {
        let file = format!("{}/../reference/vectors/{link}.json", env!("CARGO_MANIFEST_DIR"));
        let vectors: Value = serde_json::from_str(&std::fs::read_to_string(file).unwrap()).unwrap();
        // The first that is written with the defaults.
        let is_plain = |vector: &&Value| vector["result"] == "valid" && vector.get("options").is_none();
        let vector = vectors["vectors"].as_array().unwrap().iter().find(is_plain).unwrap();
        let hex = vector["hex"].as_str().unwrap();
        let from = vector["from"].as_str().map_or(String::new(), |from| format!("--from {from}"));
        let (code, object, said) = with_input(&format!("decode {link} {from}"), hex);
        assert_eq!(code, Some(0), "{link}: {said}");
        let decoded: Value = serde_json::from_str(object.trim()).unwrap_or_else(|e| panic!("{object}: {e}"));
        assert_eq!(decoded["message"], vector["message"], "{link}");
        let (code, bytes, said) = with_input(&format!("encode {link} {from}"), &object);
        assert_eq!(code, Some(0), "{link}: {said}");
        let plain = |text: &str| text.split_whitespace().collect::<String>().to_lowercase();
        assert_eq!(plain(&bytes), plain(hex), "{link}");
    }
}

#[test]
fn corrupt_bytes_and_messages_are_an_error_of_one() {
    let (code, out, _) = with_input("decode isra-ball", "08 F8 5D 00 01");
    assert_eq!(code, Some(1));
    assert!(out.contains("\"error\""), "{out}");
    let (code, out, said) = with_input("encode isra-ball", "{\"status\":\"nonsense\"}\n");
    assert!(matches!(code, Some(1 | 2)), "{out} {said}");
    assert!(format!("{out}{said}").contains("nonsense"), "{out} {said}");
}

#[test]
fn the_vectors_agree() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../reference/vectors");
    let (code, out, said) = run(cellwire(&format!("vectors check {folder}")));
    assert_eq!(code, Some(0), "{said}");
    assert!(LINKS.iter().chain(&["fanuc-ls"]).all(|link| out.contains(link)), "{out}");
    // Elsewhere, those of the program.
    let mut elsewhere = cellwire("vectors check");
    let folder = tempfile::tempdir().unwrap();
    elsewhere.current_dir(folder.path());
    let built_in = run(elsewhere);
    let lines = |text: &str| text.lines().map(str::to_owned).collect::<std::collections::BTreeSet<_>>();
    assert_eq!((built_in.0, lines(&built_in.1)), (Some(0), lines(&out)), "{}", built_in.2);
}

#[test]
fn every_device_starts_says_so_and_ends_when_it_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let pty = folder.path().join("line");
    let (listen, pty) = ("--listen 127.0.0.1:0", format!("--pty {}", pty.display()));
    let connect = "--connect 127.0.0.1:9";
    let devices = [
        ("fanuc", vec![listen, &pty]),
        ("kawasaki-pc", vec![listen]),
        ("kawasaki-robot", vec![connect]),
        ("puma", vec![listen, &pty]),
        ("viewer", vec![listen, &pty]),
        ("ball", vec![listen, &pty]),
        ("laser", vec![listen, &pty]),
        ("mma-robot", vec![listen]),
        ("mma-platform", vec![listen]),
    ];
    let (_, help, _) = run(cellwire("simulate --help"));
    for (device, endpoints) in devices {
        assert!(help.contains(&format!("- {device}:")), "{device} is not in the help: {help}");
        for endpoint in endpoints {
            let mut running = Running::start(cellwire(&format!("simulate {device} {endpoint}")));
            assert_eq!(running.ready["ready"], device);
            if endpoint == listen {
                drop(running.connect());
            }
            assert_eq!(running.signal("-TERM"), Some(130), "{device} {endpoint}");
        }
    }
    assert_eq!(folder.path().read_dir().unwrap().count(), 0, "links are removed");
}

#[test]
fn every_device_is_in_the_test_of_devices() {
    let (_, help, _) = run(cellwire("simulate --help"));
    let named = help.lines().filter(|line| line.trim_start().starts_with("- ")).count();
    assert_eq!(named, 9, "a new device belongs into every_device_starts_…: {help}");
}

#[test]
fn every_demo_can_fail_and_says_why() {
    let failing = [
        ("kawasaki-msg --must-fail lost", "1 job was lost"),
        ("kawasaki-msg --must-fail repeated", "1 job was executed more than once"),
        ("laser-eb90 --must-fail lost", "1 job was lost"),
        ("laser-eb90 --must-fail repeated", "1 job was executed more than once"),
        ("mmacell-proto --must-fail lost", "1 job was lost"),
        ("mmacell-proto --must-fail repeated", "1 job was executed more than once"),
        ("val2-alter --must-fail lost", ", but was "),
        ("val2-alter --must-fail limit", "the limits are"),
        ("val2-viewer --must-fail repeated", "poses arrived at once: a backlog"),
        ("isra-ball --must-fail lost", "1 packet was lost between ball and host"),
        ("fanuc-hmi-modbus --must-fail lost", "1 request failed"),
        ("fanuc-hmi-modbus --must-fail limit", "the source measured"),
    ];
    in_threes(&failing, |(demo, failure)| {
        let report = failed(&format!("demo {demo} --for 2s --json"));
        let failures = report["failures"].to_string();
        assert!(failures.contains(failure), "{demo}: {failures}");
        // The figures say the same as the reason.
        if demo.ends_with("lost") {
            assert!(report["lost"].as_u64() >= Some(1), "{demo}: {report}");
        }
        adds_up(demo, &report);
    });
    let late = ["kawasaki-msg", "laser-eb90", "val2-alter", "isra-ball", "fanuc-hmi-modbus"];
    in_threes(&late, |demo| {
        let arguments = format!("demo {demo} --must-fail late --for 1s");
        let (code, out, said) = run(cellwire(&arguments));
        assert_eq!(code, Some(1), "{demo}: {said}");
        let words = out.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(out.contains("\nFAIL ") && words.contains("the budget 0 µs"), "{demo}: {out}");
        assert!(words.contains(" missed: ") && words.contains("deadline"), "{demo}: {out}");
        // The line to run it again is whole, and the last sentence reports the failure.
        assert!(out.contains(" --seed 1 --for 1s --must-fail late --verbose\n"), "{demo}: {out}");
        assert!(out.trim_end().lines().last().unwrap().starts_with("FAILED: the check of "), "{demo}: {out}");
    });
}

#[test]
fn faults_hide_no_spoilt_record() {
    let failing = [
        "kawasaki lost",
        "kawasaki repeated",
        "kawasaki late",
        "laser lost --seed 1",
        "laser lost --seed 2",
        "laser lost --seed 3 --for 1s",
        "laser repeated",
        "laser late",
        "mma lost --seed 1",
        "mma lost --seed 4",
        "mma repeated --seed 4",
        "alter lost",
        "alter limit",
        "alter late",
        "viewer repeated",
        "ball lost --seed 1",
        "ball lost --seed 2",
        "ball late",
        "fanuc lost",
        "fanuc limit",
    ];
    in_threes(&failing, |demo| {
        let (link, how) = demo.split_once(' ').unwrap();
        let time = if how.contains("--for") { "" } else { "--for 3s" };
        let report = failed(&format!("demo {link} --must-fail {how} --faults {time} --json"));
        let reasons = format!("{} {}", report["failures"], report["over_budget"]);
        assert!(!reasons.contains("nothing to spoil"), "{demo}: {reasons}");
        adds_up(demo, &report);
    });
    let (code, _, said) = run(cellwire("demo fanuc --must-fail late --faults"));
    assert_eq!(code, Some(2), "{said}");
    assert!(said.contains("has no --must-fail late with --faults: it has lost, limit"), "{said}");
}

/// Returns the report of a demo that fails.
fn failed(arguments: &str) -> Value {
    let (code, out, said) = run(cellwire(arguments));
    assert_eq!(code, Some(1), "{arguments}: {out} {said}");
    let report: Value = serde_json::from_str(&out).unwrap();
    assert_eq!(report["ok"], false, "{arguments}: {report}");
    report
}

/// Asserts that each sent job has one outcome.
fn adds_up(demo: &str, report: &Value) {
    let count = |name: &str| report[name].as_u64().unwrap_or_default();
    let outcomes = ["done", "lost", "repeated", "withdrawn", "altered"].map(count).iter().sum::<u64>();
    let outcomes = outcomes + count("unknown") - count("unknown_executed");
    if !report["sent"].is_null() {
        assert_eq!(outcomes, count("sent"), "{demo}: {report}");
    }
}

/// Runs three demos at once, because demos mostly wait.
fn in_threes<T: Sync>(demos: &[T], run: impl Fn(&T) + Sync) {
    for three in demos.chunks(3) {
        std::thread::scope(|scope| three.iter().for_each(|demo| drop(scope.spawn(|| run(demo)))));
    }
}

/// Checks that do not depend on the load of the computer.
#[test]
fn a_demo_that_loses_nothing_succeeds() {
    in_threes(&["kawasaki-msg", "laser-eb90", "mmacell-proto --set parts=5"], |demo| {
        let (code, out, said) = run(cellwire(&format!("demo {demo} --for 2s")));
        assert_eq!(code, Some(0), "{demo}: {out} {said}");
        assert!(out.contains(" 0 lost, 0 repeated"), "{demo}: {out}");
        assert!(out.lines().all(|line| line.chars().count() <= 80), "{demo}: {out}");
    });
}

#[test]
fn every_demo_writes_what_it_promises() {
    let folder = tempfile::tempdir().unwrap();
    for link in LINKS {
        let (code, _, said) =
            run(cellwire(&format!("demo {link} --for 2s --out {}", folder.path().display())));
        assert!(matches!(code, Some(0 | 1)), "{link}: {said}");
        let files = if link == "fanuc-hmi-modbus" {
            ["position", "position-errors", "orientation", "orientation-errors"]
                .map(|name| folder.path().join("fanuc").join(name).with_extension("svg"))
                .to_vec()
        } else {
            vec![folder.path().join(Link::by_name(link).unwrap().short).with_extension("svg")]
        };
        for file in files {
            let text = std::fs::read_to_string(&file).unwrap_or_else(|e| panic!("{}: {e}", file.display()));
            assert!(text.contains("<svg") && text.trim_end().ends_with("</svg>"), "{}", file.display());
        }
    }
}

#[test]
fn a_request_is_answered_by_the_simulated_controller() {
    let fanuc = Running::listening("fanuc");
    let request = "{\"unit\":1,\"function\":3,\"address\":16384,\"quantity\":2}\n";
    let (code, out, said) = with_input(&format!("modbus send {}", fanuc.address()), request);
    assert_eq!(code, Some(0), "{said}");
    let reply: Value = serde_json::from_str(out.trim()).unwrap();
    assert_eq!(reply["function"], 3, "{out}");
    // Beyond the tables: an exception is an answer, with an exit status of its own.
    let request = "{\"unit\":1,\"function\":3,\"address\":65535,\"quantity\":1}\n";
    let (code, out, said) = with_input(&format!("modbus send {}", fanuc.address()), request);
    assert_eq!(code, Some(6), "{said}");
    assert!(out.contains("exception"), "{out}");
}

#[test]
fn bytes_of_another_link_and_a_file_without_a_link_lead_to_identify() {
    let file = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(file.path(), "#<Tyo,8:1,2,3,4\n").unwrap();
    let path = file.path().display();
    let (code, out, said) = run(cellwire(&format!("decode laser --format raw {path}")));
    assert_eq!(code, Some(1), "{said}");
    assert!(out.contains("\"error\""), "{out}");
    let hint = format!("nothing here is a message of laser: `cellwire identify {path}` says what it is\n");
    assert!(said.contains(&hint), "{said}");
    let (code, _, said) = run(cellwire(&format!("decode {path}")));
    assert_eq!(code, Some(2), "{said}");
    assert!(
        said.contains(&format!("LINK comes before the file; `cellwire identify {path}` finds out")),
        "{said}"
    );
}
