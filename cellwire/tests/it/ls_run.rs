//! `cellwire ls run` where a controller stops, waits or goes elsewhere; and what it has before a program begins.

use crate::fanuc_cell::{Folder, err, out};

/// Returns a program of instructions, one per line, and of positions in frame 1 and tool 0, given as X.
fn program(name: &str, instructions: &str, positions: &[f64]) -> String {
    let mut text = format!("/PROG  {name}\n/MN\n");
    for (number, line) in (1..).zip(instructions.lines().map(str::trim).filter(|line| !line.is_empty())) {
        text += &format!("{number:4}:{line} ;\n");
    }
    text += "/POS\n";
    for (number, x) in (1..).zip(positions) {
        text += &format!(
            "P[{number}]{{\n   GP1:\n\tUF : 1, UT : 0,\t\tCONFIG : 'N U T, 0, 0, 0',\n\tX = {x} mm,\tY = 0 mm,\tZ = 150 mm,\n\
             \tW = 180.0 deg,\tP = 0.0 deg,\tR = 0.0 deg\n}};\n"
        );
    }
    text + "/END\n"
}

const REACHED: [f64; 2] = [400.0, 500.0];

#[test]
fn a_position_of_another_frame_stops_the_program() {
    let folder = Folder::new("run-frame");
    folder.write("A.LS", &program("A", "UFRAME_NUM=2\nJ P[1] 50% FINE", &REACHED));
    let output = folder.run("ls run A.LS");
    assert!(
        out(&output).contains(r#""why":"P[1] is of UFRAME 1, and UFRAME_NUM=2 is selected""#),
        "{}",
        out(&output)
    );
    assert_eq!(output.status.code(), Some(1));
    // A frame that no instruction selects is that of the first position, which is reported.
    folder.write("A.LS", &program("A", "J P[1] 50% FINE", &REACHED));
    let output = folder.run("ls run A.LS");
    let assumed = r#""what":"UFRAME_NUM=1 and UTOOL_NUM=0, as in P[1], without a selection""#;
    assert!(out(&output).contains(assumed), "{}", out(&output));
    assert_eq!(output.status.code(), Some(0));
}

#[test]
fn what_is_not_modelled_stops_the_program_with_its_reason() {
    let folder = Folder::new("run-reason");
    let why = |text: &str| {
        folder.write("A.LS", text);
        let output = folder.run("ls run A.LS");
        assert_eq!(output.status.code(), Some(1), "{}", out(&output));
        let (_, why) = out(&output).split_once(r#""why":""#).unwrap();
        why.split('"').next().unwrap().to_owned()
    };
    let motion = program("A", "J P[1] 50% FINE", &[400.0]);
    let mut fixed_tool = motion.clone();
    for name in ["X", "Y", "Z", "W", "P", "R"] {
        fixed_tool = fixed_tool.replace(&format!("\t{name} ="), &format!("\tR{name} ="));
    }
    assert_eq!(why(&fixed_tool), "P[1] has RX to RR: a tool that is fixed in the cell is not modelled");
    let untaught = motion.replace("X = 400 mm", "X = ******** mm");
    assert_eq!(why(&untaught), "P[1] was never taught, or lacks an axis of the robot");
    assert_eq!(why(&motion.replace("J P[1]", "J P[2]")), "/POS does not define P[2]");
    assert_eq!(why(&program("A", "WAIT DI[1]=ON+", &[])), "edges, ON+ and OFF-, are not modelled");
    assert_eq!(why(&program("A", "WAIT ERR_NUM=0", &[])), "ERR_NUM is not modelled");
}

#[test]
fn an_open_block_is_refused() {
    let folder = Folder::new("run-block");
    folder.write("A.LS", &program("A", "IF (R[1]=0) THEN\nR[1]=1", &[]));
    let output = folder.run("ls run A.LS");
    let refused = "error: A.LS: `cellwire ls check` shows more: line 3, column 6: IF … THEN has no ENDIF\n";
    assert_eq!((err(&output), out(&output)), (refused, ""));
}

#[test]
fn skip_ends_a_motion_or_goes_on_at_its_label() {
    let folder = Folder::new("run-skip");
    let skips = "J P[1] 50% FINE\nSKIP CONDITION DI[1]=ON\nL P[2] 100mm/sec FINE Skip,LBL[1:none],PR[1]=LPOS\n\
                 R[1]=PR[1,1]\nIF (R[1]>400 AND R[1]<490),CALL MET\nEND\nLBL[1]\nMESSAGE[not met]";
    folder.write("A.LS", &program("A", skips, &REACHED));
    folder.write("MET.LS", &program("MET", "MESSAGE[met]", &[]));
    let in_vain = folder.run("ls run A.LS");
    assert!(out(&in_vain).contains(r#""text":"not met""#), "{}", out(&in_vain));
    let met = folder.run("ls run A.LS --inputs DI[1]:1.0-");
    assert!(out(&met).contains(r#""text":"met""#) && !out(&met).contains("not met"), "{}", out(&met));
    assert!(!out(&met).contains("Skip"), "{}", out(&met));
    // Without its condition it is a mistake.
    folder.write("A.LS", &program("A", "L P[2] 100mm/sec FINE Skip,LBL[1]\nLBL[1]", &REACHED));
    assert!(out(&folder.run("ls run A.LS")).contains("Skip without a SKIP CONDITION"));
}

#[test]
fn a_controller_begins_with_what_a_file_says() {
    let folder = Folder::new("run-preset");
    let instructions = "UFRAME_NUM=1\nUTOOL_NUM=0\nJ P[1] 50% FINE Offset,PR[1:Z offset]\nOPEN HAND\n\
                        IF (R[2]=5 AND SR[1]='x' AND GI[1]=7),CALL ALL\nWAIT DI[3]=ON";
    folder.write("A.LS", &program("A", instructions, &REACHED));
    folder.write("HAND.LS", &program("HAND", "MESSAGE[hand]", &[]));
    folder.write("ALL.LS", &program("ALL", "MESSAGE[all]", &[]));
    folder.write(
        "cell.toml",
        "\"R[2]\" = 5\n\"SR[1]\" = \"x\"\n\"PR[1]\" = [0, 0, 20, 0, 0, 0]\n\"UFRAME[1]\" = [1.5, 0, 0, 0, 0, 0]\n\"DI[3]\" = true\n\
         \"GI[1]\" = 7\n[macros]\n\"Open Hand\" = \"HAND\"\n",
    );
    let output = folder.run("ls run A.LS --preset cell.toml --out made");
    assert_eq!(output.status.code(), Some(0), "{}{}", out(&output), err(&output));
    for text in ["hand", "all"] {
        assert!(out(&output).contains(&format!(r#""text":"{text}""#)), "{}", out(&output));
    }
    let path = folder.read("made/path.csv");
    let last: Vec<&str> = path.lines().last().unwrap().split(',').collect();
    assert_eq!(last[7..10], ["401.5000", "0.0000", "170.0000"]);
    folder.write("bad.toml", "\"DI[3]\" = 5\n");
    let refused = folder.run("ls run A.LS --preset bad.toml");
    assert_eq!(err(&refused), "error: bad.toml: DI[3]: give true or false\n");
}

#[test]
fn signals_beyond_the_tables_of_modbus_are_there() {
    let folder = Folder::new("run-beyond");
    let instructions = "DO[11025]=PULSE,0.5sec\nDO[11017]=ON\nIF (DO[11025] AND DO[11017] AND DI[11001] AND !DO[11018]),CALL ON\n\
                        WAIT DO[11025]=OFF\nTIMER[1]=(2.5)\nR[1]=TIMER[1]\nGO[1001]=300\nIF (GO[1001]=300 AND R[1]=2.5),CALL OFF";
    folder.write("A.LS", &program("A", instructions, &[]));
    folder.write("ON.LS", &program("ON", "MESSAGE[on]", &[]));
    folder.write("OFF.LS", &program("OFF", "MESSAGE[off]", &[]));
    folder.write("cell.toml", "\"DI[11001]\" = true\n");
    let output = folder.run("ls run A.LS --preset cell.toml");
    assert_eq!(output.status.code(), Some(0), "{}{}", out(&output), err(&output));
    for text in ["on", "off"] {
        assert!(out(&output).contains(&format!(r#""text":"{text}""#)), "{}", out(&output));
    }
}

#[test]
fn what_does_not_end_says_what_it_waits_for_or_where_it_goes_around() {
    let folder = Folder::new("run-waits");
    folder.write("A.LS", &program("A", "WAIT .10(sec)\nWAIT (DI[3] AND R[1]=0)", &[]));
    let output = folder.run("ls run A.LS");
    let waits = "error: the program has waited for `WAIT (DI[3] AND R[1]=0)` in A:2 since 0.100 s, which cannot happen: \
                 give --inputs or --preset\n";
    assert!(err(&output).starts_with(waits), "{}", err(&output));
    assert_eq!(output.status.code(), Some(1));
    let comes = folder.run("ls run A.LS --inputs DI[3]:20-21");
    assert_eq!(comes.status.code(), Some(0), "{}", err(&comes));
    folder.write("A.LS", &program("A", "LBL[1]\nWAIT .10(sec)\nJMP LBL[1]", &[]));
    let output = folder.run("ls run A.LS --for 5s");
    assert!(err(&output).contains("still runs after 5 s, in A:"), "{}", err(&output));
    assert!(err(&output).contains(": it has jumped to LBL[1] of A 49 times\n"), "{}", err(&output));
}

#[test]
fn a_robot_that_does_not_reach_is_named_and_a_path_needs_none() {
    let folder = Folder::new("run-reach");
    folder.write("A.LS", &program("A", "J P[1] 50% FINE\nL P[2] 100mm/sec FINE", &[400.0, 2500.0]));
    let output = folder.run("ls run A.LS");
    let alarm = "the robot cannot reach X 2500.0 Y 0.0 Z 150.0 mm in that orientation: it is an LR Mate 200iD, since no other is described";
    assert!(out(&output).contains(alarm), "{}", out(&output));
    assert!(err(&output).contains("help: --limits FILE describes the robot, "), "{}", err(&output));
    folder.write("B.LS", &program("B", "J P[1] 50% FINE", &[2500.0]));
    let nowhere = folder.run("ls run B.LS");
    assert!(err(&nowhere).ends_with("\n0.000 s, 0.0 mm\n"), "{}", err(&nowhere));
    let drawn = folder.run("ls run A.LS --no-reach --out made");
    assert_eq!(drawn.status.code(), Some(0), "{}", err(&drawn));
    let path = folder.read("made/path.csv");
    let last: Vec<&str> = path.lines().last().unwrap().split(',').collect();
    assert_eq!(last[7..10], ["2500.0000", "0.0000", "150.0000"]);
}
