//! Programs with one mistake each: it is found, at its line. Programs without one: nothing is found.

use fanuc_ls::{CheckContext, Document, Level, Mistake, Problem, Rules, Warning};

/// Returns a sound program, with one text put into one of its sections; and the line at which the text begins.
pub(crate) fn program(section: &str, text: &str) -> (String, usize) {
    let mut lines: Vec<String> = vec!["/PROG  A".into(), "/ATTR".into()];
    let mut first = lines.len() + 1;
    match section {
        "attr" => lines.extend(text.split('\n').map(Into::into)),
        _ => lines.push("DEFAULT_GROUP\t= 1,*,*,*,*;".into()),
    }
    lines.push("/MN".into());
    let main = if section == "mn" { text } else { "" };
    let statements =
        ["LBL[1]", "UFRAME_NUM=0", "UTOOL_NUM=1", "J P[1] 50% FINE", "PR[1]=P[9]", "LBL[2]", "JMP LBL[1]"];
    let (before, behind) = statements.split_at(5);
    let added = main.split('\n').filter(|line| !line.is_empty());
    for (number, statement) in (1..).zip(before.iter().copied().chain(added).chain(behind.iter().copied())) {
        if section == "mn" && number == before.len() + 1 {
            first = lines.len() + 1;
        }
        let is_motion = matches!(statement.as_bytes(), [b'J' | b'L' | b'C', b' ', ..]);
        lines.push(format!("{number:4}:{}{statement} ;", if is_motion { "" } else { "  " }));
    }
    lines.push("/POS".into());
    let taught = |number| format!("P[{number}]{{\n   GP1:\n\tUF : 0, UT : 1,\n\tJ1= 0.500 deg\n}};");
    lines.extend(taught(1).split('\n').map(Into::into));
    match section {
        "pos" => {
            first = lines.len() + 1;
            lines.extend(text.split('\n').map(Into::into));
            if !text.starts_with("P[9]") {
                lines.extend(taught(9).split('\n').map(Into::into));
            }
        }
        _ => lines.extend(taught(9).split('\n').map(Into::into)),
    }
    lines.push("/END\n".into());
    (lines.join("\n"), first)
}

fn found(text: &str) -> Vec<(usize, String, Level)> {
    let kind = |problem: Problem| serde_json::to_value(problem).unwrap()["kind"].as_str().unwrap().to_owned();
    let findings = Document::decode(text).unwrap().findings(&Rules::default());
    findings.into_iter().map(|f| (f.line, kind(f.problem), f.problem.level())).collect()
}

#[test]
fn each_mistake_is_found_at_its_line() {
    let (mut missed, mut count) = (Vec::new(), 0);
    for line in include_str!("mistakes.tsv").lines().filter(|line| !line.starts_with('#')) {
        let [kind, section, at, expected, text] = line.split('\t').collect::<Vec<_>>()[..] else {
            panic!("{line}")
        };
        let text = text.replace("\\n", "\n").replace("\\t", "\t");
        let (program, first) = program(section, &text);
        let findings = found(&program);
        count += 1;
        let wanted = match at.parse::<usize>().unwrap() {
            // At the first motion.
            0 => program.lines().position(|line| line.contains("J P[1]")).unwrap() + 1,
            at => first + at - 1,
        };
        if !findings.iter().any(|(line, found, _)| (*line, found.as_str()) == (wanted, expected)) {
            missed.push(format!("{kind}: {text:?}: {expected} at {wanted}, found {findings:?}"));
        }
    }
    assert!(missed.is_empty(), "{} of {count} missed:\n{}", missed.len(), missed.join("\n"));
    assert!(count >= 200, "{count}");
}

/// Statements as controllers write them, and people by hand.
const SOUND: &[&str] = &[
    "!a comment ; with a semicolon",
    "!IF IT IS READY, THEN",
    "--eg:PASTE (FR1L2)",
    "//CALL A(",
    "CALL WELD_ON",
    "CALL MERGE(62,R[1],'a b',AR[1],(-5))",
    "CALL SR[25]",
    "RUN LOGGER",
    "R[1:n: [a]]=R[1:n: [a]]+1",
    "R[R[2]]=(R[3]*(-1))",
    "R[1]=DI[1]",
    "R[1]=PR[1,2]",
    "R[1]=R[2] DIV 3+R[4] MOD 5",
    "R[1]=SIN[R[2]]+ABS[R[3]]-ATAN2[R[4],R[5]]",
    "R[1]=STRLEN SR[1]",
    "R[1]=FINDSTR SR[1],SR[2]",
    "SR[1]=SUBSTR SR[2],R[1],R[2]",
    "SR[1]=SR[2]+'abc'",
    "R[1]=TIMER[1]",
    "R[1]=VR[1].MODELID",
    "R[1]=($MCR.$GENOVERRIDE)",
    "$WAITTMOUT=500",
    "$WVSCH[1].$FREQUENCY=R[1]",
    "PR[1]=LPOS",
    "PR[1]=P[9]-PR[R[3]]",
    "PR[GP1:1,3]=26.5",
    "PR[GP1,2:1,3:up]=PR[GP1,2:1,3]+R[1]",
    "UFRAME[5]=PR[1]",
    "DO[5:clamp]=ON",
    "DO[5]=(!DI[1] AND (F[2] OR TIMER[1]>=2.5))",
    "DO[5]=PULSE,0.5sec",
    "DO[5]=R[1]",
    "SO[0]=ON",
    "GO[1]=GI[1]",
    "AO[1]=2.5",
    "F[1]=(ON)",
    "M[1]=(DI[1] AND !DI[2])",
    "TIMER[1]=START",
    "TIMER[2]MS=500",
    "TIMER[1]=((-.5))",
    "WAIT    .50(sec)",
    "WAIT R[5]",
    "WAIT R[5](sec)",
    "WAIT DI[1]=ON AND DI[2]=OFF",
    "WAIT DI[1]=ON TIMEOUT,LBL[2]",
    "WAIT DI[1]=ON+",
    "WAIT DI[1]=OFF- AND RI[2]<>ON+ TIMEOUT,LBL[2]",
    "WAIT ERR_NUM=11006",
    "IF DI[1]=ON+,JMP LBL[2]",
    "WHEN DI[1]=OFF-,CALL A",
    "SKIP CONDITION DI[1]=OFF-",
    "JOINT_MAX_SPEED[1]=50",
    "JOINT_MAX_SPEED[R[1]]=R[2]",
    "JOINT_MAX_SPEED=50",
    "LINEAR_MAX_SPEED[2]=1200",
    "PAYLOAD[GP1:2]",
    "PAYLOAD[GP2:R[1:load]]",
    "RSR[1]=ENABLE",
    "RSR[AR[1]]=DISABLE",
    "SEND R[1]",
    "RCV R[1:x],LBL[2]",
    "RUN LOGGER(1,'text',R[2])",
    "WO[1]=PULSE,0.5sec",
    "SEMAPHORE[1]=ON\nWAIT SEMAPHORE[1]=ON\nCLEAR SEMAPHORE[1]\nPOST SEMAPHORE[1]",
    "PL[1]=[1,R[2],1]\nPL[1]=PL[2]\nIF PL[1]=[1,*,*],JMP LBL[2]",
    "PALLETIZING-B_1\nL PAL_1[A_1] R[4]mm/sec CNT100\nL PAL_1[BTM] 50mm/sec FINE\nPALLETIZING-END_1",
    "SPO[1]=ON\nWAIT SPI[1]=OFF",
    "R[1]=(1.5e-06+R[2]*(-2E3))",
    "L P[1] 100mm/sec CR5",
    "L P[1] 100mm/sec CR5,10",
    "L P[1] 100mm/sec CR5,10 ACC50",
    "L P[1] 100mm/sec CTV",
    "L P[1] 100mm/sec FINE CTV-50",
    "L P[1] 4000mm/sec CNT100 ACC250",
    "L P[1] 100mm/sec CNT100 RT_LDR[1]",
    "L P[1] 100mm/sec CNT100 AP_LDR[1:near] RT_LD50",
    "L P[1] 100mm/sec FINE SkipJump,LBL[2]",
    "L P[1] 100mm/sec CNT100 DA 5.0mm,CALL A",
    "L P[1] 100mm/sec FINE Arc Start E2[R[1],R[2]]",
    "WAIT (!F[1] OR (TIMER[1]>=5))",
    "IF R[1]=1 AND R[2]<>R[3],JMP LBL[2]",
    "IF (R[1]=1),R[2]=(5)",
    "IF (R[1]=1)PR[1]=LPOS",
    "IF (DI[1]),CALL A",
    "IF R[1]=1,CALL A(1)\nIF R[1]=2 OR R[2]=3,JMP LBL[2]",
    "IF (R[1]=1 OR R[2]=2 AND DI[1]) THEN\nR[1]=1\nELSE\nR[1]=2\nENDIF",
    "FOR R[1]=1 TO R[2]\nFOR R[3]=9 DOWNTO 1\nENDFOR\nENDFOR",
    "SELECT R[1]=1,JMP LBL[2]\n=2,CALL A\n!between\nELSE,CALL B",
    "SELECT SR[1]='a',CALL A\nCASE 'b',CALL B",
    "SKIP CONDITION DI[1]=ON OR $A.$B=0",
    "MONITOR WATCH",
    "MONITOR END WATCH",
    "WHEN DI[1]=ON,CALL A",
    "SOFTFLOAT[1]",
    "SOFTFLOAT END",
    "COL GUARD ADJUST 50",
    "COL GUARD ADJUST R[1]",
    "COL DETECT OFF",
    "VISION RUN_FIND 'A'",
    "VISION GET_OFFSET SR[1] VR[R[1]] JMP LBL[2]",
    "SET PATH",
    "LOCK PREG",
    "UNLOCK PREG",
    "MESSAGE[a;b]",
    "UALM[20]",
    "PAYLOAD[1:gripper]",
    "OVERRIDE=R[1]",
    "OVERRIDE=100%",
    "UFRAME_NUM=R[3]",
    "UTOOL_NUM[GP2]=1",
    "Arc Start[1]",
    "Weave Sine[5]",
    "PAUSE",
    "L P[1] 100mm/sec CNT100 ACC50 Offset,PR[1:off] Tool_Offset,PR[2]",
    "L P[1:name] R[1]mm/sec CNT R[2] PTH COORD",
    "SKIP CONDITION DI[1]=ON\nL P[1] 100mm/sec FINE Skip,LBL[2],PR[1]=LPOS",
    "L P[1] 100cm/min CNT50 TB .50sec,DO[1]=ON TA .10sec,CALL A(1)",
    "L P[1] 100mm/sec CNT100 DB 5.0mm,P-SPS RTCP",
    "L P[1] max_speed CNT100 Wjnt INC",
    "L P[1] WELD_SPEED FINE Arc End[R[1]]",
    "L P[1] 90.0deg/sec FINE",
    "J P[1] 0.6sec FINE",
    "J P[R[1]] R[2]% CNT100",
    "C P[1] P[9] 100mm/sec FINE",
    // As controllers set to German write them.
    "WENN (F[1] [&] !E[2]),SPRUNG LABEL[2]",
    "WARTE (E[1] [+] (TIMER[1]>=5))",
    "IST i[1]=0,SPRUNG LABEL[2]\nSONST,SPRUNG LABEL[2]",
    "A[1]=(AUS)",
    "gA[1]=(gE[2])",
    "IRQ BEDINGUNG E[1]=AN [+] A[2]=AN",
    "J P[1] 100% CNT100 ACC100 ZEIT VOR .10sek,P-SPS",
    "FREIG. PREG",
];

#[test]
fn what_is_sound_has_no_finding() {
    for text in SOUND {
        let (program, _) = program("mn", text);
        assert_eq!(found(&program), [], "{text}");
    }
}

#[test]
fn a_long_instruction_of_a_block_goes_on_in_the_next_line() {
    let program = |second: &str| {
        format!(
            "/PROG  A\n/MN\n   1:J P[1] 100% CNT0 TB   0.00sec,P-SPS    ;\n      1:  TC_ONLINE (!DI[63:out] AND \n\
             \x20      :  {second} ;\n      2:  F[1]=(M[1] [&] \n       :  !M[2] [+] \n       :  M[3]) ;\n       ------ ;\n\
             \x20  2:  END ;\n/POS\nP[1]{{\n GP1:\n UF : 0, UT : 1,\n J1= 0.500 deg\n}};\n/END\n"
        )
    };
    assert_eq!(found(&program("M[95:safe] AND M[3])")), []);
    // An empty line and a comment do not have findings.
    assert_eq!(found(&program("M[3]) ;\n      3:   ;\n      4:  !a ( b")), []);
    // A mistake is found in the line that it is in.
    assert_eq!(found(&program("M[95:safe] AND [3])")), [(5, "expected".to_owned(), Level::Error)]);
}

#[test]
fn a_line_is_of_the_block_of_a_motion_only_below_one() {
    let text = |first: &str| {
        let text = format!("/PROG  A\n/MN\n   1:{first} ;\n     14:  IF (R[1]=1) THEN ;\n   2:  ENDIF ;\n");
        text + "/POS\nP[1]{\n GP1:\n UF : 0, UT : 1,\n J1= 0.500 deg\n};\n/END\n"
    };
    assert_eq!(found(&text("  PR[1]=P[1]")), []);
    assert_eq!(found(&text("J P[1] 5% FINE")), [(5, "not_open".to_owned(), Level::Error)]);
}

#[test]
fn a_name_is_perhaps_a_macro_and_nothing_worse() {
    for text in ["OPEN HAND 1", "Op. Entry Menu('Chute')", "GRIP_CLOSE", "WIDE", "WHAT"] {
        let (program, first) = program("mn", text);
        assert_eq!(found(&program), [(first, "macro".to_owned(), Level::Hint)], "{text}");
    }
    // A line that is not understood does not begin a block either, whatever it ends with.
    let (program, first) = program("mn", "R[1]=( THEN");
    assert_eq!(found(&program), [(first, "expected".to_owned(), Level::Error)]);
}

#[test]
fn what_the_table_does_not_have_is_a_hint_unless_it_is_named() {
    let hints = [
        ("TRACER ON", "macro"),
        ("TRACKS[1]=ON", "similar"),
        ("SENDS R[1],LBL[2]", "unknown"),
        ("WELDER[1]=ON", "unknown"),
        ("IF R[1]=1,WELDER[1]=ON", "unknown"),
        ("IF WELDER[1]=ON,JMP LBL[2]", "unknown_item"),
        ("L P[1] 100mm/sec FINE GLUE50", "unknown_option"),
        ("L P[1] 100mm/sec FINE ACCT[1]", "unknown_option"),
        ("L P[1] PLASMA FINE", "unknown_option"),
    ];
    let heads = ["TRACER", "TRACKS", "SENDS", "WELDER", "GLUE", "ACCT", "PLASMA"];
    let named = CheckContext {
        instructions: heads.iter().map(ToString::to_string).collect(),
        ..CheckContext::default()
    };
    for (text, kind) in hints {
        let (program, first) = program("mn", text);
        assert_eq!(found(&program), [(first, kind.to_owned(), Level::Hint)], "{text}");
        let document = Document::decode(&program).unwrap();
        assert_eq!(document.findings_among(&Rules::default(), &named), [], "{text}");
    }
    // A name is whole, and does not hide the mistakes of instructions that are known, nor a label that is not there.
    let all = |text: &str| {
        let (program, _) = program("mn", text);
        let document = Document::decode(&program).unwrap();
        let findings = document.findings_among(&Rules::default(), &named);
        findings.iter().map(|finding| finding.problem.to_string()).collect::<Vec<_>>()
    };
    assert_eq!(all("WELDERS[1]=ON"), ["the instruction is not known"]);
    assert_eq!(all("SENDS R[1],LBL[77]"), ["there is no LBL[77]"]);
    assert_eq!(all("welder(1,"), Vec::<String>::new());
    assert_eq!(all("R[1]=+"), ["expected a value such as `R[1]`, `5` or `ON`"]);
}

#[test]
fn a_macro_may_be_named_as_an_instruction_nearly_is() {
    let (program, first) = program("mn", "CELL R1");
    let known = CheckContext { macros: ["CALK A".to_owned()].into(), ..CheckContext::default() };
    assert_eq!(found(&program), [(first, "misspelled".to_owned(), Level::Error)]);
    let program = program.replace("CELL R1", "CALK A");
    assert_eq!(Document::decode(&program).unwrap().findings_among(&Rules::default(), &known), []);
}

#[test]
fn the_file_and_the_program_have_one_name() {
    let document = Document::decode("/PROG  WELD_1\n/MN\n/END\n").unwrap();
    let found = |file: Option<&str>| {
        let around = CheckContext { file: file.map(str::to_owned), ..CheckContext::default() };
        let findings = document.findings_among(&Rules::default(), &around);
        findings.iter().map(|f| (f.line, f.column, f.problem)).collect::<Vec<_>>()
    };
    assert_eq!(found(Some("other")), [(1, 8, Problem::Warning(Warning::FileName))]);
    assert_eq!([found(Some("weld_1")), found(None)], [vec![], vec![]]);
}

#[test]
fn what_is_around_a_program_is_known_by_name() {
    let (program, first) =
        program("mn", "CALL WELD_ON(1)\nIF R[1]=1,CALL MISSING\nRUN Logger\nCALL SR[1]\nOpen hand 1");
    let names = |names: &[&str]| names.iter().map(ToString::to_string).collect();
    let (programs, macros) = (Some(names(&["WELD_ON", "LOGGER"])), names(&["OPEN HAND 1"]));
    let around = CheckContext { programs, macros, ..CheckContext::default() };
    let findings = Document::decode(&program).unwrap().findings_among(&Rules::default(), &around);
    let found: Vec<_> = findings.iter().map(|finding| (finding.line, finding.problem)).collect();
    assert_eq!(found, [(first + 1, Problem::Mistake(Mistake::MissingProgram))]);
}

#[test]
fn an_editor_is_told_what_may_stand_at_a_place() {
    let complete = |text: &str| {
        let (before, behind) = text.split_once('|').unwrap();
        let text = format!(
            "/PROG A\n/MN\n1: LBL[7:x] ;\n2:{before}{behind} ;\n/POS\nP[3]{{GP1:UF:0,UT:1,J1=0 deg}};\n/END\n"
        );
        let at = text.find(before).unwrap() + before.len();
        let document = Document::decode(&text).unwrap();
        document
            .completions(at)
            .into_iter()
            .map(|found| text[found.place].to_owned() + ">" + &found.text)
            .collect::<Vec<_>>()
    };
    assert_eq!(complete(" JMP LBL[|"), [">7"]);
    assert_eq!(complete("L P[|] 5mm/sec FINE"), [">3"]);
    assert_eq!(complete(" CAL|"), ["CAL>CALL"]);
    assert_eq!(complete(" IF R[1]=1,EN|"), ["EN>END"]);
    assert_eq!(complete("L P[3] 5mm/sec FINE Tool|"), ["Tool>Tool_Offset"]);
    assert_eq!(complete(" R[1]=SU|"), ["SU>SUBSTR"]);
    // At the beginning stands an instruction, and no function.
    assert_eq!(complete(" AB|"), ["AB>ABORT"]);
    assert_eq!(complete(" R[1]=AB|"), ["AB>ABS"]);
    // Many begin with a letter of a motion.
    assert_eq!(complete(" JM|"), ["JM>JMP"]);
    assert_eq!(complete(" SELECT_|"), ["SELECT_>SELECT_CONVEYOR"]);
    assert_eq!(complete("L P[3] 5mm/sec FI|"), ["FI>FINE"]);
    assert_eq!(complete(" !R|"), Vec::<String>::new());
}

#[test]
fn a_template_is_one_hint() {
    let text = "R[...]=...\nIF R[1]=Constant,...\nWAIT Constant(sec)\nWAIT ...(sec)\nCALL ...\nCALL A(Constant)\nJMP LBL[Constant]";
    let (program, first) = program("mn", text);
    assert_eq!(found(&program), [(first, "untaught".to_owned(), Level::Hint)]);
}

#[test]
fn copies_and_templates_are_not_nagged_about() {
    let untaught = "P[1]{\n GP1:\n UF : 0, UT : 1,\n J1= ******** deg\n};\n";
    let copy = format!("/PROG  -BCKEDT-\n/MN\n   1:J P[1] 5% FINE ;\n/POS\n{untaught}/END\n");
    assert_eq!(found(&copy), []);
}
