//! Programs with all their findings, word by word, and programs that are close to a mistake but do not contain one.

use fanuc_ls::{Document, Problem, Rules};

use crate::mistakes::program;

/// Returns the findings in a sound program with these statements, each with the statement's number, from 1.
fn findings(text: &str) -> Vec<String> {
    let (program, first) = program("mn", text);
    let findings = Document::decode(&program).unwrap().findings(&Rules::default());
    { findings.into_iter() }.map(|it| format!("{}: {}", it.line + 1 - first, it.problem)).collect()
}

fn check(table: &[(&str, &[&str])]) {
    for (text, expected) in table {
        assert_eq!(findings(text), *expected, "{text}");
    }
}

#[test]
fn blocks_are_opened_and_closed_by_instructions_alone() {
    check(&[
        ("!before\n=1,JMP LBL[2]", &["2: no SELECT is open here"]),
        ("SELECT R[1]=1,JMP LBL[2]\n!between\n=2,JMP LBL[2]", &[]),
        ("SELECT R[1]=1,JMP LBL[2]\nL P[1] 5mm/sec FINE\n=2,JMP LBL[2]", &["3: no SELECT is open here"]),
        ("!IF IT IS SO THEN\n!FOR ALL", &[]),
        // A line that is not understood opens a block if it begins like one, and then has a matching end.
        ("IF (R[1]=) THEN\nENDIF", &["1: expected a value such as `R[1]`, `5` or `ON`"]),
        ("IF R[1]=,JMP LBL[2]", &["1: expected a value such as `R[1]`, `5` or `ON`"]),
        ("R[1]=", &["1: expected a value such as `R[1]`, `5` or `ON`"]),
        ("FOR R[1]= TO 5\nENDFOR", &["1: expected a value such as `R[1]`, `5` or `ON`"]),
        ("FOR R[1]=1 TO 1\nENDFOR\nFOR R[1]=1 DOWNTO 1\nENDFOR", &[]),
        (
            "FOR R[1]=-(1) TO -(5)\nENDFOR\nFOR R[1]=-(5) TO -(1)\nENDFOR",
            &["1: the loop never runs: its first value is beyond its last"],
        ),
        ("FOR R[1]=1 TO 2\nELSE\nENDFOR", &["2: no IF … THEN is open here"]),
        ("IF (R[1]=1) THEN\nFOR R[2]=1 TO 2\nELSE\nENDFOR\nENDIF", &["3: FOR inside it is not closed"]),
        ("IF (R[1]=1) THEN\nFOR R[2]=1 TO 2\nENDIF", &["3: FOR inside it is not closed"]),
        ("IF (R[1]=1) THEN", &["1: IF … THEN has no ENDIF"]),
        ("FOR R[2]=1 TO 2", &["1: FOR has no ENDFOR"]),
    ]);
}

#[test]
fn a_jump_inside_of_a_command_has_its_label_as_well() {
    let text = "VISION GET_OFFSET SR[1] VR[R[1]] JMP LBL[77]";
    check(&[(text, &["1: there is no LBL[77]"])]);
}

#[test]
fn a_frame_stays_chosen_over_what_chooses_none() {
    let wrong = "P[1] has UF 0, but the program selected UFRAME_NUM=3";
    for (between, stays) in [
        ("R[1]=1", true),
        ("DO[1]=PULSE,0.5sec", true),
        ("TIMER[1]=START", true),
        ("WAIT 1.00(sec)", true),
        ("WAIT DI[1]=ON", true),
        ("MESSAGE[x]", true),
        ("PAYLOAD[1]", true),
        ("OVERRIDE=50%", true),
        ("IF R[1]=1,JMP LBL[2]", true),
        ("!comment", true),
        ("WAIT DI[1]=ON TIMEOUT,LBL[2]", false),
        ("CALL OTHER", false),
        ("LBL[5]", false),
    ] {
        let found = findings(&format!("UFRAME_NUM=3\n{between}\nJ P[1] 5% FINE"));
        let expected = if stays { vec![format!("3: {wrong}")] } else { vec![] };
        assert_eq!(found, expected, "{between}");
    }
}

#[test]
fn a_motion_has_a_target_a_speed_and_an_end() {
    let text = "L P[1] 100mm/sec";
    let at_end = |end: &str| findings(&format!("{text} {end}"));
    assert_eq!(at_end(""), ["1: the motion has no FINE or CNT"]);
    assert_eq!(at_end("ACC50"), ["1: the motion has no FINE or CNT"]);
    // An application's own word may be what ends it.
    assert_eq!(at_end("QUICKLY"), ["1: the motion option is not known"]);
    assert_eq!(at_end("CD50"), [] as [&str; 0]);
    check(&[
        ("L P[1] max_Geschw. FINE", &[]),
        ("L P[1] FAST_ONE FINE", &["1: the motion option is not known"]),
        ("L PAL_1[A_1] 100mm/sec FINE", &[]),
        ("L PX_1[1] 100mm/sec FINE", &["1: expected a target such as `P[1]` or `PR[1]`"]),
        ("L PAL-1[1] 100mm/sec FINE", &["1: expected a target such as `P[1]` or `PR[1]`"]),
        ("L P[1] 100mm/sec FINE Arc Start[1]", &[]),
        ("L P[1] 100mm/sec FINE Offset,VR[1]", &[]),
        ("L P[1] 100mm/sec FINE Offset,R[1", &["1: expected a position register such as `PR[1]`"]),
        ("L P[1] 100mm/sec FINE TCX", &["1: the motion option is not known"]),
        ("L P[1] 100mm/sec FINE INCX", &["1: unknown instruction or option: did you mean `INC`?"]),
    ]);
}

#[test]
fn an_instruction_goes_on_in_the_next_line_and_a_name_does_not() {
    let found = |main: &str| {
        let text = format!("/PROG  A\n/MN\n{main} ;\n/END\n");
        let findings = Document::decode(&text).unwrap().findings(&Rules::default());
        let errors = { findings.into_iter() }.filter(|it| matches!(it.problem, Problem::Mistake(_)));
        errors.map(|it| it.to_string()).collect::<Vec<_>>()
    };
    let arc = |option: &str| found(&format!("   1:C P[1] {option}    \n    :  P[9] 100mm/sec FINE"));
    assert_eq!(arc("Tool_Offset,PR[1]"), [] as [&str; 0]);
    // An application's own word may be one; a wrong one of the controller's is not.
    assert_eq!(arc("QUICKLY"), [] as [&str; 0]);
    assert_eq!(arc("Tool_Offset,R[1]"), ["line 3, column 6: the motion option is not known"]);
    assert_eq!(found("   1:  R[1:a b]=\n    :  5"), [] as [&str; 0]);
    assert_eq!(found("   1:  R[1:a\n    :  b]=5"), ["line 4, column 12: expected `]`"]);
}

#[test]
fn a_position_of_joints_may_have_other_axes_and_any_turn_that_a_robot_has() {
    let position = |axes: &str| {
        let (program, first) = program("pos", &format!("P[9]{{\n   GP1:\n\tUF : 0, UT : 1,\n\t{axes}\n}};"));
        let findings = Document::decode(&program).unwrap().findings(&Rules::default());
        { findings.into_iter() }
            .map(|it| format!("{}: {}", it.line + 1 - first, it.problem))
            .collect::<Vec<_>>()
    };
    assert_eq!(position("J1= 720.000 deg,\tJ2= -720.000 deg,\tE1= 5.000 mm"), [] as [&str; 0]);
    assert_eq!(position("J1= 720.001 deg"), ["1: J1 of P[9] is beyond 720 degrees"]);
    // A joint along a rail has no turns.
    assert_eq!(position("J1= 0.500 deg,\tJ2= 2500.000 mm"), [] as [&str; 0]);
}

#[test]
fn a_number_is_in_its_range_wherever_it_is_read() {
    for text in [
        "$WAITTMOUT=R[0]",
        "UFRAME_NUM=R[0]",
        "UTOOL_NUM=R[0]",
        "OVERRIDE=R[0]",
        "WAIT R[0](sec)",
        "WAIT R[0]=1",
        "IF (R[0]=1) THEN\nENDIF",
        "IF R[0]=1,JMP LBL[2]",
        "SELECT R[0]=1,JMP LBL[2]",
        "SELECT R[1]=R[0],JMP LBL[2]",
        "SELECT R[1]=1,CALL A(R[0])",
        "FOR R[0]=1 TO 2\nENDFOR",
        "FOR R[1]=R[0] TO 2\nENDFOR",
        "FOR R[1]=1 TO R[0]\nENDFOR",
        "CALL A(R[0])",
        "GRIP(R[0])",
        "COL GUARD ADJUST R[0]",
        "R[1]=(-R[0])",
        "R[1]=1+R[0]",
        "R[1]=ABS[R[0]]",
        "F[1]=(!F[0])",
        "R[R[0]]=1",
    ] {
        let range = "1: expected a number from 1 to 32767";
        assert!(findings(text).iter().any(|found| found == range), "{text}: {:?}", findings(text));
    }
    check(&[
        ("SELECT R[1]=1,JMP LBL[2]\n=R[0],JMP LBL[2]", &["2: expected a number from 1 to 32767"]),
        ("SELECT R[1]=1,JMP LBL[2]\nELSE,CALL A(R[0])", &["2: expected a number from 1 to 32767"]),
    ]);
}

#[test]
fn a_value_is_of_the_kind_that_belongs_there() {
    let number = "1: expected a number";
    let state = "1: expected ON, OFF or a condition";
    check(&[
        ("SR[1]='abc'", &[]),
        ("SR[1]=ON", &["1: expected a text such as `'a'` or `SR[1]`"]),
        // A register may contain a value of any kind.
        ("R[1]=SR[1]", &[]),
        ("R[1]='1'", &[number]),
        ("IF AR[1]=ON,JMP LBL[2]", &[]),
        ("IF (AR[1] AND AR[2]),JMP LBL[2]", &[]),
        ("IF DI[1]=R[1],JMP LBL[2]", &[]),
        ("IF DI[1]=1,JMP LBL[2]", &[state]),
        ("IF R[1]=DI[1],JMP LBL[2]", &[]),
        ("IF R[1]=ON,JMP LBL[2]", &[number]),
        ("IF DI[1]=ON AND F[1]=(DI[2] OR DI[3]),JMP LBL[2]", &[]),
    ]);
}

#[test]
fn an_instruction_is_read_as_it_is_spelled() {
    let value = "1: expected a value such as `R[1]`, `5` or `ON`";
    let parenthesis = "1: expected `)`";
    check(&[
        ("R[1]=TIMER[1]MS", &[]),
        ("R[1]=R[2]MS", &["1: expected the end of the instruction"]),
        ("$=5", &["1: the instruction is not known"]),
        ("R[1]=$", &[value]),
        ("OVERRIDE[1]=5", &["1: expected `=`"]),
        ("WAIT 5", &["1: expected `(sec)`"]),
        ("WAIT 5sec", &["1: expected `(sec)`"]),
        ("WAIT 5=1", &["1: expected a comparison such as `=ON` or `>5`"]),
        // An application's own words, which begin with a letter.
        ("CALL A(Word)", &[]),
        ("CALL A(ON TIME)", &[]),
        ("CALL A(Nr=R[1])", &[]),
        ("CALL A( Nr=5)", &[]),
        ("CALL A(1 2)", &[parenthesis]),
        ("CALL A(5 a=6)", &[parenthesis]),
        ("CALL A(R[1]+)", &[value]),
        ("R[1]=5e", &["1: expected the end of the instruction"]),
        ("PL[1]=[1,*,3]", &[]),
        ("PL[1]=[1,2]", &[value]),
    ]);
}

#[test]
fn a_word_is_a_misspelled_one_if_one_letter_of_three_is_another() {
    let macro_ = "1: unknown instruction: it must be a macro";
    let meant = |word: &str| format!("1: unknown instruction or option: did you mean `{word}`?");
    for text in ["EN", "IFX", "BUN", "BUN A", "CLXX", "CLXX A", "ALLL A", "FORCEX ON"] {
        assert_eq!(findings(text), [macro_], "{text}");
    }
    for (text, word) in [("XALL A", "CALL"), ("RUT A", "RUN"), ("CLAL A", "CALL"), ("CALLL A", "CALL")] {
        assert_eq!(findings(text), [meant(word)], "{text}");
    }
    // A macro's name begins with a letter and has 36 characters at most.
    let longest = "GRIP".repeat(9);
    assert_eq!(findings(&longest), [macro_]);
    for text in [longest + "S", "5GRIP".into(), "#GRIP".into(), "GRIP]".into()] {
        assert_eq!(findings(&text), ["1: the instruction is not known"], "{text}");
    }
}
