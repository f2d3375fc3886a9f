//! `cellwire ls run` and `cellwire simulate fanuc --set program=FILE`: programs that run, seen in their paths and over Modbus.

use std::process::Output;
use std::thread;
use std::time::{Duration, Instant};

use crate::fanuc_cell::{Folder, Simulator, err, object, out};
use serde_json::{Value, json};

/// Returns a program of instructions, one per line, and of positions given as X, Y, Z and R, the tool pointing down.
fn program(name: &str, instructions: &str, positions: &[[f64; 4]]) -> String {
    let mut text = format!("/PROG  {name}\n/MN\n");
    for (number, line) in (1..).zip(instructions.lines().map(str::trim).filter(|line| !line.is_empty())) {
        text += &format!("{number:4}:{line} ;\n");
    }
    text += "/POS\n";
    for (number, [x, y, z, r]) in (1..).zip(positions) {
        text += &format!(
            "P[{number}]{{\n   GP1:\n\tUF : 0, UT : 0,\t\tCONFIG : 'N U T, 0, 0, 0',\n\tX = {x} mm,\tY = {y} mm,\tZ = {z} mm,\n\
             \tW = 180.0 deg,\tP = 0.0 deg,\tR = {r} deg\n}};\n"
        );
    }
    text + "/END\n"
}

fn events(output: &Output) -> Vec<Value> {
    out(output).lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

/// Returns the texts of the messages, in sequence.
fn messages(output: &Output) -> Vec<String> {
    let events = events(output);
    let messages = events.iter().filter(|event| event["event"] == "message");
    messages.map(|event| event["text"].as_str().unwrap().to_owned()).collect()
}

/// Returns time, X, Y and Z of the path.
fn path(folder: &Folder) -> Vec<[f64; 4]> {
    let row = |row: &str| {
        let values: Vec<f64> = row.split(',').map(|value| value.parse().unwrap()).collect();
        [values[0], values[7], values[8], values[9]]
    };
    folder.read("made/path.csv").lines().skip(1).map(row).collect()
}

const SQUARE: [[f64; 4]; 4] = [
    [400.0, -50.0, 150.0, 0.0],
    [500.0, -50.0, 150.0, 0.0],
    [500.0, 50.0, 150.0, 0.0],
    [400.0, 50.0, 150.0, 30.0],
];

#[test]
fn a_robot_follows_its_program_around_corners_and_stops_where_it_says_fine() {
    let folder = Folder::new("square");
    let instructions = "J P[1] 50% FINE
        L P[2] 100mm/sec CNT100
        L P[3] 100mm/sec CNT50
        L P[4] 100mm/sec FINE
        WAIT .50(sec)
        L P[1] 600cm/min CNT0
        CALL ARC(25)";
    folder.write("SQUARE.LS", &program("SQUARE", instructions, &SQUARE));
    let arc = "PR[1]=LPOS
        PR[2]=PR[1]
        PR[2,1]=PR[2,1]+AR[1]
        PR[2,2]=PR[2,2]+AR[1]
        PR[3]=PR[1]
        PR[3,1]=PR[3,1]+2*AR[1]
        C PR[2]\n    :  PR[3] 50mm/sec FINE";
    let arc = program("ARC", &arc.replace("\n    :", "~"), &[]).replace('~', "\n    :");
    folder.write("arc.ls", &arc);
    let output = folder.run("ls run SQUARE.LS --out made");
    assert_eq!(output.status.code(), Some(0), "{}{}", out(&output), err(&output));
    assert_eq!(events(&output).last().unwrap()["event"], "program_ended");
    let path = path(&folder);
    let nearest = |[x, y, z, _]: [f64; 4]| {
        let far = path.iter().map(|[_, a, b, c]| (a - x).hypot(b - y).hypot(c - z));
        far.fold(f64::MAX, f64::min)
    };
    // 100 mm/s and two averages of 0.2 s together: CNT100 leaves the corner by 20·13/72/√2 mm, half of the overlap by an
    // eighth of that.
    let [first, full, half, fine] = SQUARE.map(nearest);
    assert!(first < 0.01 && fine < 0.01, "{first} {fine}");
    assert!((full - 2.55).abs() < 0.1 && (half - 0.33).abs() < 0.05, "{full} {half}");
    let speed = |pair: &[[f64; 4]]| {
        let ([t, x, y, z], [u, a, b, c]) = (pair[0], pair[1]);
        (u, (a - x).hypot(b - y).hypot(c - z) / (u - t))
    };
    let speeds: Vec<(f64, f64)> = path.windows(2).map(speed).collect();
    let rests = speeds.iter().filter(|(_, speed)| *speed < 0.01).count();
    assert!((55..75).contains(&rests), "half a second and the ends: {rests} periods of 8 ms");
    let begin =
        path.iter().find(|[_, x, y, z]| (x - 400.0).hypot(y + 50.0).hypot(z - 150.0) < 0.01).unwrap()[0];
    assert!(
        speeds.iter().all(|(time, speed)| *time < begin || *speed < 100.5),
        "no faster than it should be"
    );
    // The arc: 50 mm/s around (425, -50), to (450, -50).
    let last = path.last().unwrap();
    assert!((last[1] - 450.0).abs() < 0.01 && (last[2] + 50.0).abs() < 0.01, "{last:?}");
    assert!(nearest([425.0, -25.0, 150.0, 0.0]) < 0.5);
    let picture = folder.read("made/path.svg");
    assert!(picture.starts_with("<svg") && picture.contains("from above") && picture.contains("mm/s"));
}

#[test]
fn what_only_a_program_uses_is_refused_without_one() {
    let folder = Folder::new("without");
    for (setting, name) in [("--set assignments=A.txt", "assignments"), ("--set repeat=true", "repeat")] {
        let output = folder.run(&format!("simulate fanuc --listen 127.0.0.1:0 {setting}"));
        let expected = format!("error: {name} has no effect without a program: give --set program=FILE.LS\n");
        assert_eq!((err(&output), output.status.code()), (expected.as_str(), Some(2)));
    }
}

#[test]
fn registers_conditions_loops_and_calls_decide_what_is_done() {
    let folder = Folder::new("logic");
    folder.write(
        "SUB.LS",
        &program("SUB", "IF AR[1]>2,JMP LBL[9]\nMESSAGE[small]\nEND\nLBL[9]\nMESSAGE[large]", &[]),
    );
    let instructions = "FOR R[1]=1 TO 3
        R[2]=R[2]+R[1]*10
        FOR R[3]=2 DOWNTO 1
        R[4]=R[4]+1
        ENDFOR
        ENDFOR
        IF (R[2]=60 AND R[4]=6) THEN
        MESSAGE[loops]
        IF (R[1]=99) THEN
        MESSAGE[wrong]
        ELSE
        MESSAGE[else]
        ENDIF
        ELSE
        MESSAGE[wrong]
        ENDIF
        FOR R[1]=5 TO 1
        MESSAGE[wrong]
        ENDFOR
        SELECT R[4]=1,CALL SUB(1)
        =6,CALL SUB(3)
        ELSE,CALL SUB(0)
        CALL SUB(2)
        R[10]=11
        R[R[10]]=7.5
        SR[1]='AB'
        SR[1]=SR[1]+'C'
        IF SR[1]='ABC' AND R[11]=7.5,JMP LBL[1]
        MESSAGE[wrong]
        LBL[1]
        DO[3]=ON
        DO[4]=PULSE,0.2sec
        IF (DO[3] AND DO[4] AND !DO[5]),CALL SUB(1)
        WAIT .30(sec)
        IF DO[4]=ON,CALL SUB(9)
        TIMER[1]=START
        WAIT 1.00(sec)
        TIMER[1]=STOP
        IF (TIMER[1]>.99 AND TIMER[1]<1.01),CALL SUB(1)
        WAIT DI[1]=ON
        WAIT DI[2]=ON TIMEOUT,LBL[2]
        MESSAGE[wrong]
        LBL[2]
        MESSAGE[end]
        $WAITTMOUT=500
        IF $WAITTMOUT=500,CALL SUB(1)
        RUN OTHER
        CALL NOWHERE
        MY_INSTRUCTION 5
        ABORT
        MESSAGE[wrong]";
    folder.write("MAIN.LS", &program("MAIN", instructions, &[]));
    let output = folder.run("ls run MAIN.LS --inputs DI[1]:4-9");
    let expected =
        ["loops", "else", "large", "small", "small", "small", "end", "small"].map(ToOwned::to_owned);
    assert_eq!(messages(&output), expected, "{}", out(&output));
    let events = events(&output);
    let end = events.iter().find(|event| event["text"] == "end").unwrap()["time"].as_f64().unwrap();
    assert!((34.0..34.2).contains(&end), "DI[1] after 4 s, then 30 s in vain: {end}");
    assert_eq!(events.last().unwrap()["why"], "ABORT");
    // Instructions that are not simulated are reported once, at the start, with their lines.
    let said: Vec<(&str, &Value)> = events
        .iter()
        .filter(|event| ["not_modelled", "not_understood"].map(Value::from).contains(&event["event"]))
        .map(|event| (event["what"].as_str().unwrap(), &event["at"]))
        .collect();
    assert_eq!(
        said,
        [
            ("`MY_INSTRUCTION 5` is skipped: `cellwire ls check` says what is wrong", &json!(["MAIN:49"])),
            ("CALL NOWHERE is skipped: no NOWHERE.LS in the program's folder", &json!(["MAIN:48"])),
            ("RUN is skipped: there is one task", &json!(["MAIN:47"])),
            ("system variables are 0 until set, and have no effect", &json!(["MAIN:45", "MAIN:46"])),
        ]
    );
    assert_eq!(events[0]["event"], "not_understood");
    assert!(events[1..4].iter().all(|event| event["event"] == "not_modelled"), "at the start");
}

#[test]
fn what_a_robot_cannot_do_is_an_alarm_with_its_line() {
    let folder = Folder::new("alarm");
    for (instructions, why) in [
        (
            "J P[1] 50% FINE\nL P[2] 100mm/sec FINE",
            "the robot cannot reach X 900.0 Y 0.0 Z 0.0 mm in that orientation: it is an LR Mate 200iD, since no other is described",
        ),
        ("R[9]=1/R[1]", "a division by zero"),
        ("JMP LBL[4]", "there is no LBL[4]"),
        ("L P[3] 100mm/sec FINE", "/POS does not define P[3]"),
        ("CALL MAIN", "programs call each other 100 deep"),
    ] {
        folder.write("MAIN.LS", &program("MAIN", instructions, &[SQUARE[0], [900.0, 0.0, 0.0, 0.0]]));
        let output = folder.run("ls run MAIN.LS");
        let alarm = events(&output).into_iter().find(|event| event["event"] == "alarm").unwrap();
        assert_eq!((alarm["why"].as_str(), output.status.code()), (Some(why), Some(1)), "{instructions}");
        assert!(alarm["at"].as_str().unwrap().starts_with("MAIN:"), "{alarm}");
    }
    // A program without an end is given its time, however little it does.
    folder.write("LOOP.LS", &program("LOOP", "LBL[1]\nJMP LBL[1]", &[]));
    let output = folder.run("ls run LOOP.LS --for 5s");
    assert_eq!(output.status.code(), Some(1));
    assert!(err(&output).contains("error: the program still runs after 5 s, in LOOP:"), "{}", err(&output));
    assert_eq!(folder.run("ls run NONE.LS").status.code(), Some(2));
    folder.write("HALF.LS", "/PROG HALF\n/MN\n");
    assert_eq!(folder.run("ls run HALF.LS").status.code(), Some(2));
}

const ASSIGNMENTS: &str = "\
SETVAR $SNPX_ASG[1].$ADDRESS 1
SETVAR $SNPX_ASG[1].$SIZE 20
SETVAR $SNPX_ASG[1].$VAR_NAME 'R[60]'
SETVAR $SNPX_ASG[1].$MULTIPLY 0
SETVAR $SNPX_ASG[2].$ADDRESS 101
SETVAR $SNPX_ASG[2].$SIZE 100
SETVAR $SNPX_ASG[2].$VAR_NAME 'PR[1]'
SETVAR $SNPX_ASG[2].$MULTIPLY 0
SETVAR $SNPX_ASG[3].$ADDRESS 301
SETVAR $SNPX_ASG[3].$SIZE 80
SETVAR $SNPX_ASG[3].$VAR_NAME 'SR[1]'
SETVAR $SNPX_ASG[3].$MULTIPLY -1
SETVAR $SNPX_ASG[4].$ADDRESS 401
SETVAR $SNPX_ASG[4].$SIZE 50
SETVAR $SNPX_ASG[4].$VAR_NAME 'POS[0]'
SETVAR $SNPX_ASG[4].$MULTIPLY 0
";

#[test]
fn a_program_is_seen_over_modbus_as_the_assignments_say_and_obeys_what_is_written() {
    let folder = Folder::new("modbus");
    let instructions = "R[60]=1.5
        SR[1]='WAITING'
        SR[2]='PART'
        PR[1]=P[2]
        J P[1] 100% FINE
        DO[7]=ON
        WAIT F[1]=ON
        SR[1]='MOVING'
        L PR[2] R[61]mm/sec FINE
        DO[8]=ON";
    folder.write("CELL.LS", &program("CELL", instructions, &SQUARE[..2]));
    folder.write("asg.txt", ASSIGNMENTS);
    let (file, listing) = (folder.0.join("CELL.LS"), folder.0.join("asg.txt"));
    let (file, listing) = (file.to_str().unwrap(), listing.to_str().unwrap());
    let simulator = Simulator::start(
        "127.0.0.1:0",
        &["--set", &format!("program={file}"), "--set", &format!("assignments={listing}")],
    );
    let address = simulator.address.as_str();
    let read = |kind: &str, at: u16| {
        let output = folder.run(&format!("fanuc read {address} {kind} --address {at} --size 10"));
        object(&output)["value"].clone()
    };
    let write = |kind: &str, at: &str, value: &str| {
        let arguments = ["fanuc", "write", address, kind, "--address", at, value];
        let output = folder.command(&arguments).output().unwrap();
        assert_eq!(output.status.code(), Some(0), "{}", err(&output));
    };
    let coil = |number: u16| {
        folder.write(
            "coil.jsonl",
            &format!("{{\"unit\":1,\"function\":1,\"address\":{},\"quantity\":1}}", number - 1),
        );
        object(&folder.run(&format!("modbus send {address} coil.jsonl")))["bits"][0] == true
    };
    let wait = |condition: &dyn Fn() -> bool| {
        let begin = Instant::now();
        while !condition() {
            assert!(begin.elapsed() < Duration::from_secs(30), "in vain");
            thread::sleep(Duration::from_millis(20));
        }
    };
    wait(&|| coil(7));
    assert_eq!((read("real", 0), read("string", 300)), (json!(1.5), json!("WAITING")));
    assert_eq!(read("string", 340), "PART", "SR[2]");
    assert_eq!(read("position", 100)["cartesian"]["xyzwpr"][0], 500.0, "PR[1] is P[2]");
    let here = |part: usize| read("position", 400)["cartesian"]["xyzwpr"][part].as_f64().unwrap();
    assert!((here(0) - 400.0).abs() < 0.01 && (here(1) + 50.0).abs() < 0.01, "at P[1]");
    // The client teaches PR[2], sets the speed, and lets the robot go.
    let target = r#"{"cartesian": {"xyzwpr": [450, 20, 160, 180, 0, 0]}}"#;
    write("position", "150", target);
    write("real", "2", "200");
    folder.write("go.jsonl", "{\"unit\":1,\"function\":5,\"address\":20000,\"value\":true}");
    assert_eq!(folder.run(&format!("modbus send {address} go.jsonl")).status.code(), Some(0));
    wait(&|| coil(8));
    assert_eq!(read("string", 300), "MOVING");
    assert!(
        (here(0) - 450.0).abs() < 0.01 && (here(1) - 20.0).abs() < 0.01 && (here(2) - 160.0).abs() < 0.01
    );
    let event = simulator.events.recv_timeout(Duration::from_secs(20)).unwrap();
    assert!(
        ["connected", "disconnected", "assumed"].contains(&event["event"].as_str().unwrap())
            || event["event"] == "program_ended"
    );
}

/// The list of the page of fanuc-hmi-modbus: the telemetry block, and registers of the user's own.
#[test]
fn the_list_of_the_page_shows_the_telemetry_and_the_users_own_registers() {
    let page = concat!(env!("CARGO_MANIFEST_DIR"), "/../fanuc-hmi-modbus/README.md");
    let page = std::fs::read_to_string(page).unwrap();
    let (_, list) = page.split_once("```text\nSETVAR").unwrap();
    let list = format!("SETVAR{}", list.split_once("```").unwrap().0);
    let folder = Folder::new("own");
    folder.write("cell.txt", &list);
    let instructions = "R[101]=-7\nR[105]=5\nSR[1]='PART 7'\nLBL[1]\nWAIT .10(sec)\nJMP LBL[1]";
    folder.write("CELL.LS", &program("CELL", instructions, &[]));
    let set = |name, file| format!("{name}={}", folder.0.join(file).display());
    let arguments = ["--set", &set("program", "CELL.LS"), "--set", &set("assignments", "cell.txt")];
    let simulator = Simulator::start("127.0.0.1:0", &arguments);
    thread::sleep(Duration::from_millis(300));
    let address = simulator.address.as_str();
    let read = |what: &str| {
        let output = folder.run(&format!("fanuc read {address} {what}"));
        let lines = out(&output).lines().map(|line| serde_json::from_str::<Value>(line).unwrap());
        lines.map(|line| line["value"].clone()).collect::<Vec<_>>()
    };
    assert!(read("int32 --address 0")[0].as_f64() > Some(5.0), "the life counter");
    assert_eq!(read("int16 --address 1000 --count 5"), [-7.0, 0.0, 0.0, 0.0, 5.0]);
    assert!(read("position --address 1100")[0]["cartesian"]["xyzwpr"][0].as_f64() > Some(100.0));
    assert_eq!(read("string --address 1200"), ["PART 7"]);
    // Off by one: the last register of R[101] to R[105], and one after it.
    assert_eq!(read("int32 --address 1004").len(), 1);
    let unassigned = simulator.events.iter().find(|event| event["event"] == "unassigned").unwrap();
    assert_eq!(
        (&unassigned["address"], &unassigned["count"], &unassigned["why"]),
        (&json!(1005), &json!(1), &json!("no assignment covers $ADDRESS 1006"))
    );
}

#[test]
fn overlapping_assignments_are_refused_with_both_names() {
    let folder = Folder::new("overlap");
    folder.write("asg.txt", &ASSIGNMENTS.replace("[3].$ADDRESS 301", "[3].$ADDRESS 200"));
    folder.write("CELL.LS", &program("CELL", "R[60]=1", &[]));
    let arguments = "simulate fanuc --listen 127.0.0.1:0 --set program=CELL.LS --set assignments=asg.txt";
    let output = folder.run(arguments);
    assert_eq!(output.status.code(), Some(2));
    let why = "asg.txt: slots 2 (PR[1]) and 3 (SR[1]) overlap from $ADDRESS 200";
    assert!(err(&output).contains(why), "{}", err(&output));
}

#[test]
fn a_program_keeps_the_registers_that_it_uses() {
    let folder = Folder::new("kept");
    folder.write("A.LS", &program("A", "R[1]=1234\nLBL[1]\nWAIT .10(sec)\nJMP LBL[1]", &[]));
    let file = format!("program={}", folder.0.join("A.LS").display());
    let first = |more: &[&str]| {
        let simulator = Simulator::start("127.0.0.1:0", &[&["--set", &file], more].concat());
        thread::sleep(Duration::from_millis(300));
        let read = format!("fanuc read {} int16 --address 0", simulator.address);
        (object(&folder.run(&read))["value"].as_f64(), simulator.events.try_recv().ok())
    };
    let (value, event) = first(&[]);
    assert_eq!(value, Some(1234.0));
    assert!(event.unwrap()["what"].as_str().unwrap().contains("the program uses R[1]; set telemetry=N"));
    // As it is set.
    let (value, event) = first(&["--set", "telemetry=1"]);
    assert!(value < Some(1234.0), "{value:?}");
    assert_eq!(event.unwrap()["event"], "connected");
}

#[test]
fn the_telemetry_of_a_program_is_a_sound_log_of_where_it_goes() {
    let folder = Folder::new("logged");
    let instructions = "J P[1] 100% FINE\nLBL[1]\nL P[2] 200mm/sec FINE\nL P[1] 200mm/sec FINE\nJMP LBL[1]";
    folder.write("LINE.LS", &program("LINE", instructions, &SQUARE[..2]));
    folder.write("robot.json", r#"{"joints": [{"min":-170,"max":170,"speed":450},{"min":-100,"max":145,"speed":380},
        {"min":-70,"max":205,"speed":520},{"min":-190,"max":190,"speed":550},{"min":-125,"max":125,"speed":545},
        {"min":-360,"max":360,"speed":1000}]}"#);
    let file = folder.0.join("LINE.LS");
    let simulator = Simulator::start("127.0.0.1:0", &["--set", &format!("program={}", file.display())]);
    thread::sleep(Duration::from_secs(1));
    let output = folder
        .run(&format!("fanuc log {} --csv run.csv --for 2s --limits robot.json --json", simulator.address));
    assert_eq!(output.status.code(), Some(0), "{}", err(&output));
    let table = folder.read("run.csv");
    let column = |row: &str, n: usize| row.split(',').nth(n).unwrap().parse::<f64>().unwrap();
    let mut fastest: f64 = 0.0;
    for row in table.lines().skip(1) {
        let (x, y, z) = (column(row, 5), column(row, 6), column(row, 7));
        assert!((399.9..500.1).contains(&x) && (y + 50.0).abs() < 0.01 && (z - 150.0).abs() < 0.01, "{row}");
        fastest = fastest.max(column(row, 22).abs());
    }
    assert!((fastest - 200.0).abs() < 1.0, "{fastest} mm/s");
    // A program that cannot begin is refused, with a reason.
    for (arguments, message) in [
        ("simulate fanuc --listen 127.0.0.1:0 --set program=NONE.LS", "error: cannot read NONE.LS"),
        (
            "simulate fanuc --listen 127.0.0.1:0 --set program=LINE.LS --set assignments=NONE",
            "error: cannot read NONE",
        ),
        (
            "simulate fanuc --listen 127.0.0.1:0 --set program=LINE.LS --set assignments=LINE.LS",
            "error: LINE.LS: there is no assignment",
        ),
        (
            "simulate fanuc --listen 127.0.0.1:0 --set program=LINE.LS --set inputs=XX[1]:0-",
            "error: inputs=XX[1]:0- is not INPUT:FROM-TO",
        ),
        (
            "simulate kawasaki-pc --listen 127.0.0.1:0 --set program=LINE.LS",
            "error: kawasaki-pc has no setting `program`",
        ),
    ] {
        let output = folder.run(arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments}");
        assert!(err(&output).starts_with(message), "{arguments}: {}", err(&output));
    }
}
