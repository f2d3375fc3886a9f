//! The corners of the grammar: ambiguous texts, and texts that are written as they stand.

use fanuc_ls::{
    Attribute, CommentRule, Document, Finding, Instruction, Motion, MotionKind, Problem, Program, Rules,
    Speed, Target, Termination, Warning,
};

fn read(text: &str) -> (Program, Vec<Warning>) {
    let document = Document::decode(text).unwrap_or_else(|e| panic!("{e}\n{text}"));
    let warning = |finding: Finding| match finding.problem {
        Problem::Warning(warning) => Some(warning),
        Problem::Error(error) => panic!("{error}\n{text}"),
        // `mistakes.rs` has them.
        Problem::Mistake(_) => None,
    };
    let warnings = document.findings(&Rules::default()).into_iter().filter_map(warning).collect();
    (document.program().unwrap(), warnings)
}

fn instructions(lines: &str) -> (Vec<Instruction>, Vec<Warning>) {
    let (program, warnings) = read(&format!("/PROG A\n/MN\n{lines}\n/END"));
    (program.instructions, warnings)
}

fn motion(body: &str) -> Motion {
    match instructions(&format!("   1:{body} ;")).0.as_slice() {
        [Instruction::Motion(motion)] => motion.clone(),
        other => panic!("{body}: {other:?}"),
    }
}

fn linear(termination: Option<Termination>, options: &str) -> Motion {
    let motion =
        Motion::new(MotionKind::Linear, Target::position(1), Speed::mm_per_sec(5.0), Termination::Fine);
    Motion { termination, options: options.to_string(), ..motion }
}

fn written(instruction: Instruction) -> String {
    let program = Program { name: "A".to_string(), instructions: vec![instruction], ..Program::default() };
    program.to_text(&Rules::default()).unwrap()
}

#[test]
fn an_attribute_goes_on_in_the_next_line() {
    let (program, _) = read("/PROG A\n/ATTR\nOWNER = one\r\n\t two;\nCOMMENT = \"x\";\n/MN\n/END");
    assert_eq!((program.attribute("OWNER"), program.comment()), (Some("one two"), Some("x")));
}

#[test]
fn a_nested_line_is_deeper_than_the_four_columns_of_a_number() {
    let first = "   1:L P[1] 5mm/sec FINE";
    let end = Instruction::Other("END".to_string());
    let (deep, _) = instructions(&format!("{first} ;\n     7:  END ;"));
    assert_eq!(deep[1], Instruction::Nested("     7:  END ;".to_string()));
    let (flat, warnings) = instructions(&format!("{first} ;\n    7:  END ;"));
    assert_eq!(flat[1], end);
    assert!(warnings.contains(&Warning::LineNumber { expected: 2, found: 7 }));
    // A line above the first motion does not belong to any motion.
    let alone = instructions("      7:  END ;");
    assert_eq!(alone, (vec![end], vec![Warning::LineNumber { expected: 1, found: 7 }]));
}

#[test]
fn blanks_between_the_parts_of_a_motion_may_be_missing() {
    let joint =
        Motion::new(MotionKind::Joint, Target::position(1), Speed::percent(5), Termination::Continuous(7));
    assert_eq!(motion("J P[1]5%CNT7"), joint);
    assert_eq!(motion("J P[1]5%FINE"), Motion { termination: Some(Termination::Fine), ..joint });
}

#[test]
fn a_word_that_only_begins_like_a_termination_is_an_option() {
    assert_eq!(motion("L P[1] 5mm/sec FINE"), linear(Some(Termination::Fine), ""));
    for option in ["FINER", "FINE_1", "FINE2"] {
        assert_eq!(motion(&format!("L P[1] 5mm/sec {option}")), linear(None, option));
    }
}

#[test]
fn a_colon_continues_a_line_only_at_its_beginning() {
    let (read, _) = instructions("   1::X ;\n   2:!:x ;\n   3:  a\n    ::b ;");
    assert_eq!(
        read,
        [
            Instruction::Other(":X".to_string()),
            Instruction::Comment(":x".to_string()),
            Instruction::Other("a\n:b".to_string())
        ]
    );
}

#[test]
fn a_positions_name_may_lack_its_quotes() {
    for name in ["\"home 2\"", "home 2", " home 2 ", "\" home 2 \""] {
        let (program, _) = read(&format!("/PROG A\n/MN\n/POS\nP[2:{name}]{{GP1:UF:0,UT:1,J1=0 deg}};\n/END"));
        assert_eq!(program.position(2).unwrap().name.as_deref(), Some("home 2"), "{name}");
    }
}

#[test]
fn blanks_at_the_end_of_an_instruction_are_not_written() {
    assert!(written(Instruction::Comment(" note \t".to_string())).contains("   1:  ! note ;\r\n"));
    assert!(written(Instruction::Other("CALL X  ".to_string())).contains("   1:  CALL X ;\r\n"));
}

#[test]
fn a_comment_that_fits_is_written_as_it_stands() {
    let mut rules = Rules::default();
    rules.comment = CommentRule::Truncate;
    let comment = |value: &str| {
        let attributes = ["OWNER", "COMMENT", "VERSION"].map(|name| match name {
            "COMMENT" => Attribute::text(name, value),
            _ => Attribute::text(name, "0"),
        });
        let program =
            Program { name: "A".to_string(), attributes: Some(attributes.to_vec()), ..Program::default() };
        program.to_text(&rules).unwrap()
    };
    for value in ["sixteen letters!", "\"sixteen letters!  \"", "short", "\"short  \""] {
        assert!(comment(value).contains(&format!("COMMENT\t\t= {value};\r\n")), "{value}");
    }
    assert!(
        comment("\"seventeen letters\"")
            .contains("/ATTR\r\nOWNER\t\t= 0;\r\nCOMMENT\t\t= \"seventeen letter\";\r\nVERSION\t\t= 0;\r\n")
    );
}

#[test]
fn a_comment_of_sixteen_characters_is_no_reason_to_warn() {
    let warnings = |comment: &str| read(&format!("/PROG A\n/ATTR\nCOMMENT = \"{comment}\";\n/MN\n/END")).1;
    assert_eq!(warnings("sixteen letters!"), []);
    assert_eq!(warnings("seventeen letters"), [Warning::CommentLength { found: 17 }]);
}

#[test]
fn a_line_count_of_zero_says_nothing() {
    let warnings = |count| read(&format!("/PROG A\n/ATTR\nLINE_COUNT = {count};\n/MN\n 1: END;\n/END")).1;
    assert_eq!((warnings(0), warnings(1)), (vec![], vec![]));
    assert_eq!(warnings(2), [Warning::LineCount { expected: 2, found: 1 }]);
}

#[test]
fn a_position_is_used_where_an_instruction_names_it_or_may_choose_it() {
    let unused = |instruction: &str| {
        let points: String = (1..=2).map(|n| format!("P[{n}]{{GP1:UF:0,UT:1,J1=0 deg}};\n")).collect();
        let warnings = read(&format!("/PROG A\n/MN\n 1:{instruction};\n/POS\n{points}/END")).1;
        let number = |warning: Warning| match warning {
            Warning::UnusedPosition { number } => number,
            other => panic!("{other}"),
        };
        warnings.into_iter().map(number).collect::<Vec<_>>()
    };
    assert_eq!(unused("END"), [1, 2]);
    assert_eq!(unused("PR[2]=P[1]"), [2]);
    assert_eq!(unused("P[ 2 ]=PR[1]"), [1]);
    assert_eq!(unused("PR[2]=P[R[1]]"), [0_u32; 0]);
    // Something else whose name ends in P.
    for other in ["SKIP[1]=2", "R[1]=$GRP[1].$P", "R[1]=$X_P[2]", "R[1]=$X2P[R[1]]"] {
        assert_eq!(unused(other), [1, 2], "{other}");
    }
}

/// Asserts that a position reads the same, or fails for the same reason, with each blank doubled: not in the controller's
/// columns.
fn reads_the_same_out_of_its_columns(position: &str) {
    let read = |position: &str| {
        let program = Program::decode(&format!("/PROG A\n/MN\n/POS\n{position}/END\n"));
        // A configuration keeps its blanks.
        let values =
            |program: Program| format!("{:?}", program.positions).replace(' ', "").replace("\\t", "");
        program.map(values).map_err(|error| error.reason)
    };
    let twice = position.replace(' ', "  ").replace('\t', "\t\t").replace('\n', "\n\n");
    assert_eq!(read(position), read(&twice), "{position}");
}

#[test]
fn a_number_reads_the_same_in_its_columns_and_out_of_them() {
    let mut columns = Vec::new();
    for (start, point) in (0..10).flat_map(|start| (0..11).map(move |point| (start, point))) {
        for sign in [None, Some(b'-'), Some(b'+')] {
            let mut text: [u8; 10] = *b"1234567890";
            text[..start].fill(b' ');
            if let Some(sign) = sign {
                text[start] = sign;
            }
            if point < 10 {
                text[point] = b'.';
            }
            columns.push(text);
        }
    }
    for text in columns {
        for (at, byte) in (0..10).flat_map(|at| b" -.*0".map(|byte| (at, byte))) {
            let mut text = text;
            text[at] = byte;
            let number = str::from_utf8(&text).unwrap();
            reads_the_same_out_of_its_columns(&format!(
                "P[1]{{\n   GP1:\n\tUF : 0, UT : 1,\t\n\tJ1={number} deg\n}};\n"
            ));
        }
    }
}

#[test]
fn a_position_reads_the_same_in_its_columns_and_out_of_them() {
    for (axes, other) in [
        (
            "\tJ1=  -108.435 deg,\tJ2=    11.185  mm,\r\n\tJ3=     -.500 deg\r\n",
            "P[2]{GP1:UF:F,UT:F,J1=1deg};\r\n",
        ),
        ("\tCONFIG : 'N U T, 0, 0, 0',\r\n\tX =  1234.500  mm,\tW =  -180.000 deg\r\n", ""),
    ] {
        let position = format!("P[1]{{\r\n   GP1:\r\n\tUF : 0, UT : 1,\t\r\n{axes}}};\r\n{other}");
        reads_the_same_out_of_its_columns(&position);
        for (at, byte) in (0..position.len()).flat_map(|at| b" \t\r\nP[]{}:;,'-.*0F/=".map(|byte| (at, byte)))
        {
            let mut changed = position.clone().into_bytes();
            changed[at] = byte;
            reads_the_same_out_of_its_columns(str::from_utf8(&changed).unwrap());
            changed.remove(at);
            reads_the_same_out_of_its_columns(str::from_utf8(&changed).unwrap());
        }
    }
}

#[test]
fn what_a_template_leaves_open_is_no_error() {
    let main = "   1:L P[1] ...mm/sec FINE    ;\n   2:J P[1] ...% CNT50    ;\n   3:L P[1] ... FINE    ;\n\
                   4:  SELECT ...=1,CALL A ;\n   5:  SELECT R[...]=...,CALL ... ;\n   6:         =2,CALL B ;\n";
    let text = format!("/PROG  A\n/MN\n{main}/POS\n/END\n");
    let document = fanuc_ls::Document::decode(&text).unwrap();
    let findings = document.findings(&fanuc_ls::Rules::default());
    let errors: Vec<_> = findings.iter().filter(|finding| finding.problem.is_error()).collect();
    assert!(errors.is_empty(), "{errors:?}");
    let Some(fanuc_ls::Instruction::Motion(motion)) = document.instruction(0) else { panic!("no motion") };
    assert_eq!(motion.speed.to_string(), "...mm/sec");
}
