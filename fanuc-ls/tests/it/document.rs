//! A file is kept to the byte; an edit changes what it names.

use fanuc_ls::{
    AxisName, Document, EncodeError, Encoding, Finding, Instruction, Motion, Position, Problem, Reason,
    Rules, Speed, SpeedUnit, Target, Termination, Warning,
};

fn document(main: &str) -> Document {
    Document::decode(&format!("/PROG  A\n/MN\n{main}\n/END\n")).unwrap()
}

fn motion(document: &Document, index: usize) -> Motion {
    match document.instruction(index) {
        Some(Instruction::Motion(motion)) => motion,
        other => panic!("{other:?}"),
    }
}

fn found(text: &str) -> Vec<(usize, usize, Problem)> {
    let findings = Document::decode(text).unwrap().findings(&Rules::default()).into_iter();
    // `mistakes.rs` tests the mistakes in statements and positions that can be read.
    let findings = findings.filter(|finding| !matches!(finding.problem, Problem::Mistake(_)));
    findings.map(|Finding { line, column, problem, .. }| (line, column, problem)).collect()
}

/// Returns the lines that differ, before and after.
fn difference<'a>(before: &'a str, after: &'a str) -> Vec<(&'a str, &'a str)> {
    assert_eq!(before.split('\n').count(), after.split('\n').count(), "{after}");
    before.split('\n').zip(after.split('\n')).filter(|(before, after)| before != after).collect()
}

/// Spellings that occur in files but not in the canonical layout. All are understood unless a comment states otherwise.
const SPELLINGS: [&str; 22] = [
    "   1:  WAIT (F[7])    ;",
    "    :  UFRAME_NUM=0 ;",
    " : J P[1] 20% FINE ;\n :  ;",
    "   1:J P[1] 10sek CNT100TB   .50sec,CALL UP1    ;",
    "   1:L P[1] 10mm/sek FINE    ;",
    "   1:L P[1] max_Geschw. CNT50    ;",
    "   1:  SELECT R[1]=1,CALL A ;\n   2:         =2,CALL B ;\n   3:         ELSE,JMP LBL[9] ;",
    "   1:C P[1] Tool_Offset,PR[2]    \n    :  P[2] 5mm/sec CNT100 Tool_Offset,PR[2]    ;",
    "   1:L P[1] 5mm/sec FINE\n    :  Arc Start[6]    ;",
    "   1:J P[1] 5% CNT0 TB   .20sec,CALL X    ;\n       ------ ;\n      1:  DO[1]=ON ;\n       ------ ;\n   2:  END ;",
    "1578:   ;\n1579:  ! late ;",
    "\t 7:  CALL X \t;",
    "   1:  !a ; b ;",
    "\n   1:  END ;\n\n",
    "   1:  R[1] = 1.50 ;  ",
    "   1:J P[1] 3.0sec FINE    ;\r\n   2:  END ;",
    "   1:  !\u{fffd}ber ;",
    // Not understood, and kept.
    "   1:J PR[92];",
    "   1:  CALL X",
    "   1:  LBL[3] ; ! retry",
    "  no number ;",
    "   1:L P[1] 5cm/sec FINE ;",
];

#[test]
fn every_spelling_is_written_as_it_was_read() {
    for main in SPELLINGS {
        for text in [
            format!("/PROG  A\n/ATTR\n/MN\n{main}\n/POS\n/END\n"),
            format!("/PROG A\tMacro\r\n/MN\r\n{main}\r\n/END"),
        ] {
            let document = Document::decode(&text).unwrap_or_else(|e| panic!("{e}\n{text}"));
            assert_eq!(document.to_string(), text);
            assert_eq!(document.to_bytes(), text.as_bytes());
        }
    }
}

#[test]
fn what_is_understood_has_no_error_and_what_is_not_has_one() {
    for (index, main) in SPELLINGS.iter().enumerate() {
        let findings = document(main).findings(&Rules::default());
        let errors = findings.iter().filter(|finding| matches!(finding.problem, Problem::Error(_))).count();
        assert_eq!(errors, usize::from(index >= 17), "{main}: {findings:?}");
    }
}

#[test]
fn attributes_sections_and_positions_may_be_spelled_in_any_way() {
    let text = "\u{feff}/PROG  -BCKEDT-\n/ATTR\nEIGN.\t\t= MNEDITOR;\nSPEICHERGR.\t= 2568;\nCOMMENT\t\t= \"2\"TEMPLATE\";\nTCD:  STACK_GR\u{fffd}E\t= 500,\n      ZEITSCHEIBE\t= 0;\n/APPL\n/APPL\n  SPOT : TRUE ; \n/MN\n/POS\nP[1] {\n   GP1:\n\tUF : F, UT : 2,\t\tCONFIG: 'N U T',\n\tRX =   50.971001  mm,\tRR = ********  deg\n\tE1= 0.0 mm\n};\n/END.\n\u{1a}";
    let document = Document::decode(text).unwrap();
    assert_eq!(document.to_string(), text);
    let errors: Vec<_> =
        document.findings(&Rules::default()).into_iter().filter(|f| f.problem.is_error()).collect();
    assert_eq!(errors, []);
    let program = document.program().unwrap();
    assert_eq!((document.name(), document.kind()), ("-BCKEDT-", None));
    assert_eq!(program.attribute("SPEICHERGR."), Some("2568"));
    assert_eq!(program.comment(), Some("2\"TEMPLATE"));
    let axes = &program.positions[0].groups[0].axes;
    let values: Vec<_> = axes.iter().map(|axis| (axis.name, axis.value)).collect();
    assert_eq!(values, [(AxisName::RX, Some(50.971001)), (AxisName::RR, None), (AxisName::E(1), Some(0.0))]);
}

#[test]
fn bytes_that_are_no_utf_8_are_latin_1_and_stay_so() {
    let bytes = b"/PROG A\n/MN\n   1:  !f\xfcr ;\n/END\n";
    let mut document = Document::decode_bytes(bytes).unwrap();
    assert_eq!((document.encoding(), document.to_bytes()), (Encoding::Latin1, bytes.to_vec()));
    document.set_instruction(0, "!h\u{f6}r \u{201e}").unwrap();
    assert_eq!(document.to_bytes(), b"/PROG A\n/MN\n   1:  !h\xf6r ? ;\n/END\n");
}

#[test]
fn a_speed_that_is_changed_changes_its_line_alone() {
    let before = "/PROG  A\r\n/MN\r\n   1:J  P[1:a b]   20%   FINE ;\r\n1578:L P[2] 10mm/sek CNT100TB   .50sec,CALL UP1    ;\r\n\r\n/POS\r\n/END\r\n";
    let mut document = Document::decode(before).unwrap();
    let mut joint = motion(&document, 0);
    joint.speed = Speed::percent(5);
    document.set_motion(0, &joint).unwrap();
    assert_eq!(
        difference(before, document.as_str()),
        [("   1:J  P[1:a b]   20%   FINE ;\r", "   1:J  P[1:a b]   5%   FINE ;\r")]
    );
    let mut linear = motion(&document, 1);
    linear.speed = Speed::mm_per_sec(12.5);
    linear.target = Target::position(3);
    let first = document.to_string();
    document.set_motion(1, &linear).unwrap();
    assert_eq!(
        difference(&first, document.as_str()),
        [(
            "1578:L P[2] 10mm/sek CNT100TB   .50sec,CALL UP1    ;\r",
            "1578:L P[3] 12.5mm/sek CNT100TB   .50sec,CALL UP1    ;\r"
        )]
    );
    assert_eq!(motion(&document, 1), linear);
    // The places are those of a reread file.
    assert_eq!(Document::decode(document.as_str()).unwrap(), document);
}

#[test]
fn a_motion_that_gets_or_loses_words_keeps_the_others() {
    let change = |before: &str, change: &dyn Fn(&mut Motion)| {
        let mut document = document(before);
        let mut motion = motion(&document, 0);
        change(&mut motion);
        document.set_motion(0, &motion).unwrap();
        assert_eq!(self::motion(&document, 0), motion);
        assert_eq!(Document::decode(document.as_str()).unwrap(), document);
        let text = document.to_string();
        text.strip_prefix("/PROG  A\n/MN\n").unwrap().strip_suffix("\n/END\n").unwrap().to_string()
    };
    let fine = |m: &mut Motion| m.termination = Some(Termination::Fine);
    assert_eq!(change("   1:L  P[1]  5mm/sec  CNT50  ACC20 ;", &fine), "   1:L  P[1]  5mm/sec FINE  ACC20 ;");
    assert_eq!(
        change("   1:L  P[1]  5mm/sec  FINE ;", &|m| m.options = "ACC20".into()),
        "   1:L  P[1]  5mm/sec  FINE ACC20 ;"
    );
    assert_eq!(
        change("   1:L  P[1]  5mm/sec  FINE  ACC20 ;", &|m| m.options.clear()),
        "   1:L  P[1]  5mm/sec  FINE ;"
    );
    assert_eq!(
        change(" : C P[1]  PTH\n :  P[2] 5mm/sec FINE ;", &|m| m.speed = Speed::mm_per_sec(7.0)),
        " : C P[1]  PTH\n :  P[2] 7mm/sec FINE ;"
    );
    // Spelled with other words than the writer's: the instruction is rewritten.
    assert_eq!(
        change("   1:L P[1:] 5.0sec FINE;", &|m| m.speed = Speed::Fixed { value: 6.0, unit: SpeedUnit::Sec }),
        "   1:L P[1:] 6.0sec FINE;"
    );
}

#[test]
fn a_coordinate_that_is_changed_changes_its_line_alone() {
    let before = "/PROG  A\n/MN\n/POS\nP[1]{\n   GP1:\n\tUF : 0, UT : 1,\t\tCONFIG: 'N U T, 0, 0, 0',\n\tX = 50.971001 mm,\tY =   -10.000  mm,\tZ =  ******** mm,\n\tW =   180.000 deg,\tP =     0.000 deg,\tR =   -90.000 deg\n};\nP[2]{\n   GP1:\n\tUF : 0, UT : 1,\n\tJ1=0.0 deg\n};\n/END\n";
    let mut document = Document::decode(before).unwrap();
    let mut position = document.positions().next().unwrap();
    position.groups[0].axes[1].value = Some(5.25);
    document.set_position(&position).unwrap();
    assert_eq!(
        difference(before, document.as_str()),
        [(
            "\tX = 50.971001 mm,\tY =   -10.000  mm,\tZ =  ******** mm,",
            "\tX = 50.971001 mm,\tY =     5.250  mm,\tZ =  ******** mm,"
        )]
    );
    assert_eq!(document.positions().next(), Some(position));
    assert_eq!(Document::decode(document.as_str()).unwrap(), document);
    let mut joints = document.positions().nth(1).unwrap();
    joints.groups[0].axes[0].value = Some(-0.5);
    document.set_position(&joints).unwrap();
    assert!(document.as_str().contains("\tJ1=-.500 deg\n"), "{document}");
    let missing = Position { number: 9, ..joints };
    assert_eq!(document.set_position(&missing), Err(EncodeError::Position { number: 9 }));
}

#[test]
fn names_attributes_and_instructions_are_set_in_their_places() {
    let mut document = Document::decode("/PROG  A  Macro\n/ATTR\nOWNER       = MNEDITOR ;\nTCD:  A = 1;\n/MN\n   1:   ;\n   2:L P[1] 5mm/sec FINE    ;\n       ------ ;\nno number\n/END\n").unwrap();
    document.set_name("SEAM_2").unwrap();
    document.set_attribute("OWNER", "ME").unwrap();
    document.set_attribute("COMMENT", "\"x\"").unwrap();
    document.set_instruction(0, "CALL X").unwrap();
    document.set_instruction(1, "R[1]=2").unwrap();
    assert_eq!(
        document.to_string(),
        "/PROG  SEAM_2  Macro\n/ATTR\nOWNER       = ME ;\nTCD:  A = 1;\nCOMMENT\t\t= \"x\";\n/MN\n   1:  CALL X   ;\n   2:  R[1]=2    ;\n       ------ ;\nno number\n/END\n"
    );
    assert_eq!(Document::decode(document.as_str()).unwrap(), document);
    let unchanged = document.clone();
    for index in [2, 3, 4] {
        assert_eq!(
            document.set_instruction(index, "END"),
            Err(EncodeError::Instruction { line: index + 1 }),
            "{index}"
        );
    }
    assert_eq!(document.set_instruction(0, "a ;\nb"), Err(EncodeError::Instruction { line: 1 }));
    assert_eq!(document.set_name("1A"), Err(EncodeError::Name));
    assert_eq!(document.set_attribute("OWNER", "A; B = C"), Err(EncodeError::Attribute { index: 1 }));
    assert_eq!(document.set_attribute("TCD", "1"), Err(EncodeError::Attribute { index: 2 }));
    assert_eq!(document, unchanged);
}

#[test]
fn each_finding_is_reported_once_with_its_place() {
    let text = "/PROG  2A\n/ATTR\nCOMMENT = \"seventeen letters\";\nOWNER\nLINE_COUNT = 9;\n/MN\n   1:J P[7] 5mm/sec FINE ;\n   2:J P[7] 200% FINE ;\n   5:L P[1 ;\n   6:  CALL X\n   7:  END ; rest\n/POS\nP[1]{\n GP1:\n UF : 0, UT : 1,\n J1= x deg\n};\nP[2]{GP1:UF:0,UT:1,J1=**** deg};\nP[2]{GP1:UF:0,UT:1,J1=0 deg};\n/END\n";
    let (error, warning) = (Problem::Error, Problem::Warning);
    assert_eq!(
        found(text),
        [
            (1, 8, warning(Warning::Name)),
            (3, 1, warning(Warning::CommentLength { found: 17 })),
            (4, 6, error(Reason::AttributeValue)),
            (7, 6, warning(Warning::SpeedUnit)),
            (7, 6, warning(Warning::UndefinedPosition { number: 7 })),
            (8, 6, error(Reason::SpeedRange)),
            (9, 4, warning(Warning::LineNumber { expected: 3, found: 5 })),
            (9, 10, error(Reason::Bracket)),
            (10, 14, error(Reason::InstructionEnd)),
            (11, 14, error(Reason::AfterInstruction)),
            (16, 6, error(Reason::Number)),
            (18, 1, warning(Warning::UnusedPosition { number: 2 })),
            (18, 1, warning(Warning::UntaughtPosition { number: 2 })),
            (19, 1, warning(Warning::RepeatedPosition { number: 2 })),
        ]
    );
    for (.., problem) in found(text) {
        assert!(!problem.advice().is_empty());
    }
}

#[test]
fn one_cause_is_one_finding() {
    let lines =
        |numbers: &[usize]| -> String { numbers.iter().map(|n| format!("{n:4}:  END ;\n")).collect() };
    let numbered = |numbers: &[usize], count: usize| {
        found(&format!("/PROG A\n/ATTR\nLINE_COUNT = {count};\n/MN\n{}/END", lines(numbers)))
    };
    assert_eq!(numbered(&[1, 2, 3], 3), []);
    // A line is missing: the numbers after it and LINE_COUNT have the same cause.
    assert_eq!(
        numbered(&[1, 2, 4, 5, 6], 6),
        [(7, 4, Problem::Warning(Warning::LineNumber { expected: 3, found: 4 }))]
    );
    assert_eq!(
        numbered(&[1, 2], 6),
        [(3, 1, Problem::Warning(Warning::LineCount { expected: 6, found: 2 }))]
    );
    let missing = |line: usize, expected: usize, found: usize| {
        (line, 4, Problem::Warning(Warning::LineNumber { expected, found }))
    };
    assert_eq!(numbered(&[1, 3, 4, 6], 6), [missing(6, 2, 3), missing(8, 5, 6)]);
    // Numbers that do not count the lines.
    assert_eq!(numbered(&[1, 1, 1, 1, 1], 5), [missing(6, 2, 1)]);
    assert_eq!(numbered(&[10, 20, 30, 40], 4), [(5, 3, missing(5, 1, 10).2)]);
    // Lines without numbers are a post-processor's.
    assert_eq!(found("/PROG A\n/MN\n : END ;\n  1: END ;\n  1: END ;\n/END"), []);
}

#[test]
fn reading_goes_on_behind_what_is_wrong_in_an_attribute() {
    let text = "/PROG A\n/ATTR\nTCD: A = 1,\nPPL\nB = 0;\nC\n/MN\n/END";
    let expected =
        [(4, 4, Problem::Error(Reason::AttributeValue)), (6, 2, Problem::Error(Reason::AttributeValue))];
    assert_eq!(found(text), expected);
    // Line ends of the other kind move nothing.
    assert_eq!(found(&text.replace('\n', "\r\n")), expected);
    assert_eq!(Document::decode(text).unwrap().attributes().map(|it| it.name).collect::<Vec<_>>(), ["B"]);
}

#[test]
fn numbers_of_lines_are_the_same_ones_on_every_machine() {
    let greatest = "/PROG A\n/MN\n4294967295:  X ;\n :  Y ;\n      8:  Z ;\n/END";
    let off = Problem::Warning(Warning::LineNumber { expected: 1, found: 4_294_967_295 });
    assert_eq!(found(greatest), [(3, 1, off)]);
    for number in ["4294967296", "18446744073709551615"] {
        let text = greatest.replace("4294967295", number);
        assert_eq!(found(&text), [(3, 1, Problem::Error(Reason::LineNumber))]);
    }
}

#[test]
fn a_position_is_repeated_once_whatever_is_wrong_with_others() {
    let block = |number: u32, body: &str| format!("P[{number}]{{{body}}};\n");
    let (good, bad) = (block(1, "GP1:UF:0,UT:1,J1=0 deg"), block(1, "x"));
    let repeated = |text: &str| {
        let text = format!("/PROG A\n/MN\n : J P[1] 5% FINE;\n/POS\n{text}/END");
        let warning = Problem::Warning(Warning::RepeatedPosition { number: 1 });
        found(&text).iter().filter(|(.., problem)| *problem == warning).count()
    };
    assert_eq!(repeated(&good), 0);
    assert_eq!(repeated(&[bad.as_str(), &good, &bad, &good].concat()), 1);
    assert_eq!(repeated(&[good.as_str(), &good, &bad, &good].concat()), 1);
}
