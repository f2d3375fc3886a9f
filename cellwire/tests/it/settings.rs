//! Settings, by `--set` and `--settings`: complete, listed, and refused with what to do.

use std::fmt::Write as _;
use std::fs;
use std::io::{Read, Write};
use std::net::TcpListener;
use std::process::{Command, Output, Stdio};
use std::thread;

use cellwire::devices::device_by_name;
use cellwire_links::settings::{Form, list_as};
use cellwire_links::{LINKS, Link};

/// Returns the exit status of the tool for this input, its output and its remarks.
pub(crate) fn cellwire(args: &[&str], input: &str) -> (Option<i32>, String, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_cellwire"));
    command.args(args).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    // A command that refuses its settings reads no input.
    let _ = child.stdin.take().unwrap().write_all(input.as_bytes());
    let Output { status, stdout, stderr } = child.wait_with_output().unwrap();
    (status.code(), String::from_utf8(stdout).unwrap(), String::from_utf8(stderr).unwrap())
}

#[test]
fn the_simulated_controller_can_be_set_as_its_server() {
    let fanuc = (device_by_name("fanuc").unwrap().settings)();
    for field in list_as(Form::Nanoseconds, fanuc_hmi_modbus::ServerConfig::tcp()) {
        assert!(fanuc.iter().any(|setting| setting.name == field.name), "{}", field.name);
    }
}

#[test]
fn settings_inside_others_are_listed() {
    let has = |settings: Vec<cellwire_links::settings::Setting>, names: &[&str]| {
        for name in names {
            assert!(settings.iter().any(|setting| setting.name == *name), "{name}");
        }
    };
    let device = |name: &str| (device_by_name(name).unwrap().settings)();
    has(device("puma"), &["leading_dle", "baud", "gap", "scale.per_mm", "layout.order", "home.x", "restart"]);
    has(device("laser"), &["tail", "tags", "words", "queue", "execution", "silence"]);
    has(
        device("kawasaki-robot"),
        &["charset", "udp", "limits.packet", "max_number", "bounds.max.x", "recovery.pauses", "acks", "job"],
    );
    has(device("kawasaki-pc"), &["messages.job.fields", "silence"]);
    let demo = |link: &str| cellwire::demo::settings(link);
    has(demo("kawasaki"), &["charset", "robot.patience", "robot.recovery.pauses", "pc.silence", "port"]);
    has(demo("laser"), &["baud", "resends", "tail", "robot.queue", "robot.silence"]);
    has(demo("viewer"), &["baud", "stale_after", "host.interval", "host.max_age"]);
    has(demo("fanuc"), &["poll", "word_order", "client.settle", "server.unit", "server.broadcast"]);
    has(demo("ball"), &["baud", "period", "max_age", "sensor"]);
    has(demo("mma"), &["parts", "task.grip_dwell", "task.robot_home", "central.tolerance"]);
    has(device("mma-robot"), &["accepts.itr", "writes.clos", "refusal", "speed", "drop_every"]);
}

#[test]
fn the_default_that_is_listed_is_the_default() {
    // An explicit default has no effect.
    for link in LINKS {
        for setting in (link.settings)() {
            let given = format!("{}={}", setting.name, setting.default_text());
            assert_ne!(setting.default, "", "{given}");
            let (code, _, said) = cellwire(&["encode", link.name, "--set", &given], "");
            assert_eq!((code, said.as_str()), (Some(0), ""), "{} {given}", link.name);
        }
    }
}

#[test]
fn help_names_the_command_that_prints_all_settings() {
    let help = |args: &[&str]| cellwire(args, "").1;
    let of_simulate = help(&["simulate", "--help"]);
    assert!(of_simulate.contains("`cellwire settings COMMAND NAME`"), "{of_simulate}");
    let of_encode = help(&["encode", "--help"]).split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(of_encode.contains("alter: robot or host;"), "{of_encode}");
    for (command, lines) in [
        ("simulate laser", &["#baud = 9600", "#queue = 64", "#tail = \"printed\""][..]),
        ("decode val2-alter", &["#leading_dle = 2"]),
        ("encode mma", &["#itr = false"]),
        ("demo kawasaki", &["#speed = 16000"]),
        ("demo fanuc", &["[client]", "#timeout = \"1s\""]),
        ("modbus poll", &["#any_unit = false", "#framing = \"tcp\"", "#unit = \"auto\""]),
        ("modbus", &["#any_unit = false"]),
        ("fanuc read", &["#any_unit = false", "#word_order = \"low_first\"", "#address = \"auto\""]),
        ("alter", &["[viewer]", "#max_age = \"200ms\""]),
        ("run kawasaki", &["[messages.status]", "#name = \"Tila\""]),
    ] {
        let text = help(&[&["settings"], &command.split(' ').collect::<Vec<_>>()[..]].concat());
        for line in lines {
            assert!(text.lines().any(|found| found == *line), "{command}: {line}\n{text}");
        }
    }
    for (command, why) in [
        ("simulate", "needs a device: kawasaki-robot, "),
        ("decode", "needs the name of a link"),
        ("run puma", "kawasaki, laser or mma"),
        ("ports", "has no settings; those that have: "),
        ("decode ball", "`cellwire decode ball` has no settings"),
    ] {
        let (code, _, said) =
            cellwire(&[&["settings"], &command.split(' ').collect::<Vec<_>>()[..]].concat(), "");
        assert!(code == Some(2) && said.contains(why), "{command}: {said}");
    }
}

/// With every `#` of a default removed.
#[test]
fn what_the_command_prints_is_accepted() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("all.toml");
    let path = file.to_str().unwrap();
    let devices = cellwire::devices::DEVICES.iter().map(|device| format!("simulate {}", device.name));
    let links =
        LINKS.iter().flat_map(|link| ["decode", "demo"].map(|command| format!("{command} {}", link.short)));
    for command in devices.chain(links) {
        let (code, text, _) =
            cellwire(&[&["settings"], &command.split(' ').collect::<Vec<_>>()[..]].concat(), "");
        if code != Some(0) {
            continue; // it has none
        }
        let is_default = |line: &&str| !line.starts_with("# ") && !line.ends_with('=');
        let lines: Vec<&str> =
            text.lines().filter(is_default).map(|line| line.trim_start_matches('#')).collect();
        fs::write(&file, lines.join("\n")).unwrap();
        let more = match command.split(' ').next() {
            Some("simulate") => &["--listen", "nowhere"][..],
            Some("demo") => &["--out", "/dev/null"],
            _ => &[],
        };
        let args = [&command.split(' ').collect::<Vec<_>>()[..], more, &["--settings", path]].concat();
        let (_, _, said) = cellwire(&args, "");
        let is_refused =
            ["has no setting", "all.toml", "not one of", ", give "].iter().find(|it| said.contains(**it));
        assert!(is_refused.is_none(), "{command}: {said}\n{}", lines.join("\n"));
    }
}

#[test]
fn a_file_of_settings_is_read_and_set_counts_before_it() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("plant.toml");
    let path = file.to_str().unwrap();
    let message = r#"{"items":[{"f32":[100.0,-50.5]}]}"#;
    let encode = |args: &[&str]| cellwire(&[&["encode", "laser-eb90"], args].concat(), message);
    let plain = encode(&[]);
    assert_eq!(plain.0, Some(0), "{plain:?}");
    fs::write(&file, "# the cell in site 3\ntail = \"etx\"\nchecksum = \"u16_be\"\n[tags]\nf32 = 1\ni16 = 2\nu8 = 3\nchar = 4\n").unwrap();
    let from_file = encode(&["--settings", path]);
    assert!(from_file.1.contains("90 83"), "{from_file:?}");
    assert_ne!(from_file.1, plain.1);
    let set = encode(&["--settings", path, "--set", "tail=printed"]);
    assert!(!set.1.contains("90 83"), "{set:?}");
    let all = ["tail=etx", "checksum=u16_be", r#"tags={"f32":1,"i16":2,"u8":3,"char":4}"#];
    let by_set: Vec<&str> = all.iter().flat_map(|set| ["--set", set]).collect();
    assert_eq!(encode(&by_set), from_file);
}

#[test]
fn a_file_that_is_wrong_says_where() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("plant.toml");
    let path = file.to_str().unwrap();
    let said = |text: &str| {
        fs::write(&file, text).unwrap();
        let (code, _, said) = cellwire(&["decode", "laser-eb90", "--settings", path], "");
        assert_eq!(code, Some(2), "{said}");
        said
    };
    let error = said("tail = \"etx\"\nflag = = 1\n");
    assert!(error.contains("plant.toml is not valid TOML") && error.contains("line 2, column 8"), "{error}");
    let error = said("tial = \"etx\"\n");
    assert!(error.contains("plant.toml, line 1: laser has no setting `tial`; did you mean `tail`? `cellwire settings decode laser` lists all"), "{error}");
    let error = said("tail = \"end\"\n");
    assert!(error.contains("tail=end: not one of the choices, give printed, etx, either"), "{error}");
    let error = said("[tags]\nf32 = 1\ni16 = 1\nu8 = 3\nchar = 4\n");
    assert!(error.contains("two value types have the same tag"), "{error}");
    let error = said("[tail]\nbyte = 1\n");
    assert!(error.contains("tail={\"byte\":1}: not one of the choices"), "{error}");
    let (code, _, error) = cellwire(&["decode", "laser-eb90", "--settings", "/no/such.toml"], "");
    assert_eq!(code, Some(2));
    assert!(error.contains("cannot read /no/such.toml"), "{error}");
}

#[test]
fn a_device_refuses_what_is_out_of_range_before_it_starts() {
    let simulate = |device: &str, set: &str| {
        let (code, _, said) = cellwire(&["simulate", device, "--listen", "127.0.0.1:0", "--set", set], "");
        assert_eq!(code, Some(2), "{said}");
        said
    };
    let both = simulate("kawasaki", "queue=1");
    assert!(both.contains("kawasaki has two ends: say kawasaki-robot or kawasaki-pc"), "{both}");
    let error = simulate("laser", "queue=0");
    assert!(error.contains("queue=0: out of range, give 1 to 9999 instructions"), "{error}");
    let error = simulate("puma", "attempts=300");
    assert!(error.contains("attempts=300: out of range, give 1 to 255"), "{error}");
    let error = simulate("mma-robot", "speed=1e9");
    assert!(error.contains("speed=1000000000.0: not a whole number, give 1 to 10000 times"), "{error}");
    let error = simulate("kawasaki-pc", "silence=10");
    let expected =
        "silence=10: not a time with its unit, such as 250ms or 1.5s, give a time above 0, or never";
    assert!(error.contains(expected), "{error}");
    let error = simulate("viewer", "stale_after=1ms");
    assert!(error.contains("stale_after=1ms: out of range, give a time above 200ms, or never"), "{error}");
    let error = simulate("mma-robot", "refusal=0");
    assert!(error.contains("the error number of a refusal is 0, or does not fit its field"), "{error}");
    let error = simulate("fanuc", "unit=every");
    assert!(error.contains("unit=every: not a whole number, give 0 to 255, or auto"), "{error}");
}

/// Returns the file of `identify --write` with all options at a value that is not the default.
fn found(link: &Link) -> String {
    let mut text = String::new();
    for (name, value) in link.open.beside {
        writeln!(text, "{name} = \"{value}\"").unwrap();
    }
    for name in link.open.place_names {
        writeln!(text, "{name} = 7").unwrap();
    }
    for setting in (link.settings)().iter().filter(|it| link.open.settings.contains(&it.name.as_str())) {
        let other = setting.choices.iter().find(|value| **value != setting.default);
        match other {
            Some(value) => writeln!(text, "{} = {value}", setting.name).unwrap(),
            None => writeln!(text, "{} = {{ f32 = 1, i16 = 2, u8 = 3, char = 4 }}", setting.name).unwrap(),
        }
    }
    text
}

#[test]
fn every_command_of_a_link_takes_what_identify_writes() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    fs::write(path("jobs.csv"), "kind,x1,y1,x2,y2\n1,0,0,1,1\n").unwrap();
    fs::write(path("part.csv"), "word,x,y,z,a,b,length\n257,0,0,0,0,0,0\n").unwrap();
    let part = "[[part]]\nplatform = [0, 0]\npick = [0, 0, 0, 0]\nplace = [1, 1, 1, 0]\n";
    fs::write(path("task.toml"), part).unwrap();
    let (jobs, paths, task, csv) = (path("jobs.csv"), path("part.csv"), path("task.toml"), path("run.csv"));
    for (link, commands) in [
        (
            "kawasaki-msg",
            vec!["simulate kawasaki-robot --listen nowhere", "simulate kawasaki-pc --listen nowhere"],
        ),
        ("val2-alter", vec!["simulate puma --listen nowhere", "alter --robot /nowhere --keyboard"]),
        (
            "fanuc-hmi-modbus",
            vec![
                "simulate fanuc --listen nowhere",
                "modbus send 127.0.0.1:1",
                "modbus scan 127.0.0.1:1",
                "modbus poll 127.0.0.1:1 coils:0 --for 1ms",
                "fanuc read 127.0.0.1:1 real --address 0",
                "fanuc write 127.0.0.1:1 real 1.5 --address 0",
                &format!("fanuc log 127.0.0.1:1 --for 1ms --csv {csv}"),
            ],
        ),
        ("laser-eb90", vec!["simulate laser --listen nowhere", &format!("run laser {paths} --dry-run")]),
        (
            "mmacell-proto",
            vec![
                "simulate mma-robot --listen nowhere",
                "simulate mma-platform --listen nowhere",
                &format!("run mma {task} --dry-run"),
            ],
        ),
    ] {
        let mut commands: Vec<String> = commands.iter().map(|it| (*it).to_owned()).collect();
        if link == "kawasaki-msg" {
            commands.push(format!("run kawasaki {jobs} --dry-run"));
        }
        commands.extend(["decode", "encode"].map(|command| format!("{command} {link}")));
        commands.extend([
            format!("tap {link} --listen nowhere --connect nowhere"),
            format!("demo {link} --for 500ms"),
        ]);
        let file = path("found.toml");
        fs::write(&file, found(Link::by_name(link).unwrap())).unwrap();
        for command in commands {
            let args: Vec<&str> = command.split(' ').chain(["--settings", &file]).collect();
            let (_, _, said) = cellwire(&args, "");
            let is_refused = ["has no setting", "unexpected argument", "found.toml", "not one of"]
                .iter()
                .any(|it| said.contains(it));
            assert!(!is_refused, "{command}: {said}");
        }
    }
    // Of another link it is refused.
    let file = path("found.toml");
    fs::write(&file, found(Link::by_name("laser-eb90").unwrap())).unwrap();
    let (code, _, said) = cellwire(&["decode", "kawasaki-msg", "--settings", &file], "");
    assert_eq!(code, Some(2), "{said}");
    assert!(said.contains("kawasaki has no setting"), "{said}");
}

/// A refused setting is named with its file and line by every command, and a misspelt one with the similar names.
#[test]
fn a_misspelt_setting_is_located_by_every_command() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    for name in ["part.csv", "task.toml", "jobs.csv"] {
        fs::write(path(name), "").unwrap();
    }
    fs::write(path("part.csv"), "cut,0,0,0,0,0,0\n").unwrap();
    for (wrong, similar, commands) in [
        (
            "baut",
            "baud",
            vec![
                format!("run laser {} --dry-run", path("part.csv")),
                "simulate laser --listen 0".into(),
                "simulate ball --listen 0".into(),
                "simulate puma --listen 0".into(),
                "demo laser --for 1s".into(),
            ],
        ),
        (
            "udq",
            "udp",
            vec![format!("run kawasaki {} --dry-run", path("jobs.csv")), "decode kawasaki".into()],
        ),
        ("parst", "parts", vec!["demo mma --for 1s".into()]),
        (
            "timeuot",
            "timeout",
            vec!["modbus send 127.0.0.1:1".into(), "fanuc read 127.0.0.1:1 real --address 0".into()],
        ),
        (
            "word_oder",
            "word_order",
            vec!["decode fanuc".into(), "encode fanuc".into(), "simulate fanuc --listen 0".into()],
        ),
    ] {
        for command in commands {
            let file = path("misspelt.toml");
            fs::write(&file, format!("# a comment\n{wrong} = 1\n")).unwrap();
            let args: Vec<&str> = command.split(' ').chain(["--settings", &file]).collect();
            let (code, _, said) = cellwire(&args, "");
            assert_eq!(code, Some(2), "{command}: {said}");
            assert!(said.contains("misspelt.toml, line 2: "), "{command}: {said}");
            assert!(
                said.contains(&format!("has no setting `{wrong}`; did you mean `{similar}`")),
                "{command}: {said}"
            );
            assert!(said.contains("` lists all\n"), "{command}: {said}");
        }
    }
    // Of a plant's file each command takes its settings.
    fs::write(path("plant.toml"), "takeover = \"end\"\n").unwrap();
    let (code, _, said) = cellwire(&["decode", "kawasaki", "--settings", &path("plant.toml")], "");
    assert_eq!(
        (code, said.as_str()),
        (Some(0), "warning: the setting takeover has no effect on this command\n")
    );
}

/// Starts a server that replies to every request as unit 9: one register with the value 42.
fn unit_9() -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    thread::spawn(move || {
        for mut stream in listener.incoming().map_while(Result::ok) {
            let mut request = [0; 12];
            while stream.read_exact(&mut request).is_ok() {
                let [high, low, ..] = request;
                stream.write_all(&[high, low, 0, 0, 0, 5, 9, 3, 2, 0, 42]).unwrap();
            }
        }
    });
    address
}

#[test]
fn the_clients_of_modbus_are_set_too() {
    let address = unit_9();
    let ask = |args: &[&str]| {
        let request = r#"{"unit":1,"function":3,"address":0,"quantity":1}"#;
        cellwire(&[&["modbus", "send", &address], args].concat(), request)
    };
    let (code, out, _) = ask(&["--set", "timeout=300ms"]);
    assert_eq!(code, Some(1), "{out}");
    assert!(out.contains("failed"), "{out}");
    let (code, out, said) = ask(&["--set", "any_unit=true"]);
    assert_eq!(code, Some(0), "{said}");
    assert!(out.contains("[42]"), "{out}");
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("gateway.toml");
    fs::write(&file, "any_unit = true\n").unwrap();
    assert_eq!(ask(&["--settings", file.to_str().unwrap()]).0, Some(0));
    fs::write(&file, "# a gateway\nany_unit = 9\n").unwrap();
    let (code, _, said) = ask(&["--settings", file.to_str().unwrap()]);
    assert_eq!(code, Some(2), "{said}");
    assert!(said.contains("gateway.toml, line 2: any_unit=9: neither true nor false"), "{said}");
    let (code, _, said) = ask(&["--set", "silence=2ms"]);
    assert_eq!(code, Some(2), "{said}");
    let expected = "modbus has no setting `silence` on this kind of connection: it has timeout, any_unit, broadcast, turnaround, \
                    settle, pause, echo, framing, unit, connect_pause\n";
    assert!(said.contains(expected), "{said}");
    let (code, _, said) = ask(&["--set", "nonsense=2"]);
    assert_eq!(code, Some(2), "{said}");
    assert!(said.contains("modbus has no setting `nonsense`: it has timeout, any_unit"), "{said}");
    assert!(said.contains("unit, connect_pause; `cellwire settings modbus send` lists all\n"), "{said}");

    let read = ["fanuc", "read", &address, "int16", "--address", "0"];
    assert_eq!(cellwire(&[&read[..], &["--set", "timeout=300ms"]].concat(), "").0, Some(1));
    let (code, out, said) = cellwire(&[&read[..], &["--set", "any_unit=true"]].concat(), "");
    assert_eq!(code, Some(0), "{said}");
    assert!(out.contains("42"), "{out}");
    let csv = folder.path().join("run.csv");
    let log = ["fanuc", "log", &address, "--csv", csv.to_str().unwrap(), "--set", "in_flight=2"];
    let (code, _, said) = cellwire(&log, "");
    assert_eq!(code, Some(2), "{said}");
    assert!(said.contains("fanuc log has no setting `in_flight`"), "{said}");
    assert!(!csv.exists());
}

/// A setting has its effect, or a remark names it.
#[test]
fn a_setting_without_an_effect_is_named() {
    const NONE: &str = "has no effect on this command\n";
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let file = path("cell.toml");
    fs::write(&file, "view = \"telemetry\"\nword_order = \"high_first\"\nunit = 9\naddress = 0\n").unwrap();
    let address = unit_9();
    let none = |names: &[&str]| -> String {
        names.iter().map(|it| format!("warning: the setting {it} {NONE}")).collect()
    };
    let poll = ["modbus", "poll", &address, "holding:0", "--for", "10ms"];
    let said = |args: &[&str], more: &[&str]| cellwire(&[args, more].concat(), "").2;
    assert_eq!(said(&poll, &["--settings", &file]), none(&["word_order", "address"]));
    assert_eq!(said(&poll, &["--set", "address=1", "--unit", "9"]), none(&["address"]));
    assert_eq!(said(&["fanuc", "read", &address, "int16"], &["--settings", &file]), "");
    assert_eq!(
        said(&["fanuc", "read", &address, "int16"], &["--settings", &file, "--set", "view=telemetry"]),
        none(&["view"])
    );
    for (option, begin) in [("--multiply", "error: "), ("--size", "")] {
        let said = said(&["fanuc", "read", &address, "real", "--address", "0"], &[option, "10"]);
        assert!(said.starts_with(&format!("{begin}{option} has no effect on this type: ")), "{said}");
    }
    let simulated =
        said(&["simulate", "fanuc", "--listen", "nowhere", "--set", "baud=9600"], &["--settings", &file]);
    assert!(
        simulated.starts_with(&(none(&["address"]) + "the setting baud has no effect here\n")),
        "{simulated}"
    );
    // A log uses the order of words.
    let simulator = crate::fanuc_cell::Simulator::start("127.0.0.1:0", &[]);
    let csv = path("run.csv");
    let log =
        ["fanuc", "log", &simulator.address, "--csv", &csv, "--for", "300ms", "--json", "--settings", &file];
    let warning = "warning: the life counter indicates word order \"low_first\"";
    assert!(said(&log, &[]).contains(warning), "high_first is used");
    assert!(!said(&log, &["--word-order", "auto"]).contains(warning));
}

/// The frames are those of Modbus TCP unless `framing` is set: so are the defaults.
#[test]
fn the_printed_defaults_of_modbus_clients_are_those_of_the_printed_framing() {
    for command in ["fanuc log", "fanuc read", "modbus poll", "modbus send"] {
        let arguments: Vec<&str> = ["settings"].into_iter().chain(command.split(' ')).collect();
        let (_, text, _) = cellwire(&arguments, "");
        let lines: Vec<&str> = text.lines().collect();
        for line in [r#"#framing = "tcp""#, "#broadcast = false", r#"#settle = "1s""#] {
            assert!(lines.contains(&line), "{command}: {line}\n{text}");
        }
    }
}
