//! Edits of a whole file, and the controller's layout.

use fanuc_ls::{Document, EncodeError, ItemKind, Motion, Rules, Speed, SpeedUnit};

const TEXT: &str = "/PROG  A\n/ATTR\nLINE_COUNT\t= 9;\n/MN\n\
\x20\x20\x201:  UFRAME_NUM=1 ;\n\
\x20\x20\x202:  LBL[3:again] ;\n\
\x20\x20\x207:J P[1:home]  20% FINE ;\n\
\x20\x20\x208:L P[2] 3.0sec CNT100 Offset,PR[5:PR[1] up]    ;\n\
\x20\x20\x209:  IF (DI[5:gate]=ON AND R[5]>R[R[7]]),JMP LBL[3] ;\n\
\x20\x20\x209:  !R[5], DI[5] ;\n\
\x20\x20\x209:  MESSAGE[R[5]] ;\n\
/POS\nP[1:\"home\"]{\n   GP1:\n\tUF : 1, UT : 2,\t\n\tJ1=     1.000 deg,\tJ2=     2.000 deg\n};\n\
P[2]{\n   GP1:\n\tUF : 1, UT : 2,\t\tCONFIG : 'N U T, 0, 0, 0',\n\tX =   100.000  mm,\tY =  -200.500  mm,\tZ =     0.000  mm,\n\
\tW =   180.000 deg,\tP =     0.000 deg,\tR =     0.000 deg\n};\n/END\n";

fn document() -> Document {
    Document::decode(TEXT).unwrap()
}

/// Returns the lines that differ, before and after.
fn difference(after: &Document) -> Vec<(&'static str, String)> {
    let after = after.to_string();
    assert_eq!(TEXT.lines().count(), after.lines().count(), "{after}");
    let pairs = TEXT.lines().zip(after.lines().map(str::to_owned));
    pairs.filter(|(before, after)| before != after).collect()
}

#[test]
fn a_speed_is_one_word_of_its_line() {
    let mut document = document();
    let slower = |motion: &Motion| match motion.speed {
        Speed::Fixed { value, unit: SpeedUnit::Sec } => {
            Some(Speed::Fixed { value: value / 4.0, unit: SpeedUnit::Sec })
        }
        _ => None,
    };
    assert_eq!(document.set_speeds(slower), Ok(1));
    let before = "   8:L P[2] 3.0sec CNT100 Offset,PR[5:PR[1] up]    ;";
    assert_eq!(difference(&document), [(before, before.replace("3.0", "0.75"))]);
    assert_eq!(
        document.set_speeds(|_| Some(Speed::mm_per_sec(5.0))),
        Err(EncodeError::SpeedUnit { line: 3 })
    );
    assert_eq!(difference(&document).len(), 1);
}

#[test]
fn what_is_named_by_a_number_changes_wherever_it_is_named_and_nowhere_else() {
    let mut document = document();
    let swap = |kind, number| match (kind, number) {
        (ItemKind::Register, 5) => Some((kind, 70)),
        (ItemKind::Register, 7) => Some((kind, 5)),
        (ItemKind::DigitalInput, 5) => Some((ItemKind::RobotInput, 5)),
        (ItemKind::Label, 3) => Some((kind, 30)),
        (ItemKind::UserFrame, 1) => Some((kind, 4)),
        (ItemKind::Position, 1) => Some((ItemKind::PositionRegister, 1)),
        (ItemKind::Position, 2) => Some((kind, 9)),
        _ => None,
    };
    assert_eq!(document.replace_items(swap), Ok(11));
    let expected = [
        ("   1:  UFRAME_NUM=1 ;", "   1:  UFRAME_NUM=4 ;"),
        ("   2:  LBL[3:again] ;", "   2:  LBL[30:again] ;"),
        // The letter in `/POS` is that of the section.
        ("   7:J P[1:home]  20% FINE ;", "   7:J PR[1:home]  20% FINE ;"),
        (
            "   8:L P[2] 3.0sec CNT100 Offset,PR[5:PR[1] up]    ;",
            "   8:L P[9] 3.0sec CNT100 Offset,PR[5:PR[1] up]    ;",
        ),
        (
            "   9:  IF (DI[5:gate]=ON AND R[5]>R[R[7]]),JMP LBL[3] ;",
            "   9:  IF (RI[5:gate]=ON AND R[70]>R[R[5]]),JMP LBL[30] ;",
        ),
        ("\tUF : 1, UT : 2,\t", "\tUF : 4, UT : 2,\t"),
        ("P[2]{", "P[9]{"),
        (
            "\tUF : 1, UT : 2,\t\tCONFIG : 'N U T, 0, 0, 0',",
            "\tUF : 4, UT : 2,\t\tCONFIG : 'N U T, 0, 0, 0',",
        ),
    ];
    assert_eq!(difference(&document), expected.map(|(before, after)| (before, after.to_owned())));
}

#[test]
fn two_positions_never_get_one_number_and_no_number_is_out_of_range() {
    let mut document = document();
    let onto = |number: u32| move |kind, _: u32| (kind == ItemKind::Position).then_some((kind, number));
    let taken = EncodeError::Taken { item: ItemKind::Position, number: 1 };
    assert_eq!(document.replace_items(onto(1)), Err(taken));
    assert_eq!(taken.to_string(), "P[1] is already defined");
    let range = document.replace_items(onto(40_000)).unwrap_err();
    assert_eq!(range.to_string(), "there is no P[40000]: the numbers are 1 to 32767");
    assert_eq!(document.as_str(), TEXT);
}

#[test]
fn a_name_is_set_changed_and_taken_away() {
    let mut document = document();
    assert_eq!(document.set_item_name(ItemKind::Label, 3, "once more"), Ok(1));
    assert_eq!(document.set_item_name(ItemKind::Position, 1, ""), Ok(2));
    assert_eq!(document.set_item_name(ItemKind::Position, 2, "part"), Ok(2));
    assert_eq!(document.set_item_name(ItemKind::Register, 5, "count"), Ok(1));
    let after: Vec<String> = difference(&document).into_iter().map(|(_, after)| after).collect();
    assert_eq!(
        after,
        [
            "   2:  LBL[3:once more] ;",
            "   7:J P[1]  20% FINE ;",
            "   8:L P[2:part] 3.0sec CNT100 Offset,PR[5:PR[1] up]    ;",
            "   9:  IF (DI[5:gate]=ON AND R[5:count]>R[R[7]]),JMP LBL[3] ;",
            "P[1]{",
            "P[2:\"part\"]{",
        ]
    );
    assert_eq!(document.set_item_name(ItemKind::Label, 3, "a]"), Err(EncodeError::ItemName));
}

#[test]
fn positions_move_in_their_columns_and_those_in_joints_are_named() {
    let mut document = document();
    assert_eq!(document.shift_positions([0.5, 200.5, -1.25], |_| true), Ok((1, vec![1])));
    let after: Vec<String> = difference(&document).into_iter().map(|(_, after)| after).collect();
    assert_eq!(after, ["\tX =   100.500  mm,\tY =     0.000  mm,\tZ =    -1.250  mm,"]);
}

#[test]
fn lines_are_numbered_anew() {
    let mut document = document();
    assert_eq!(document.renumber_lines(), Ok(6));
    let after: Vec<String> = difference(&document).into_iter().map(|(_, after)| after).collect();
    assert_eq!(
        after.iter().map(|line| &line[..5]).collect::<Vec<_>>(),
        ["LINE_", "   3:", "   4:", "   5:", "   6:", "   7:"]
    );
    assert_eq!(after[0], "LINE_COUNT\t= 7;");
}

/// The layout of controllers is unchanged; the layouts of people and post-processors become that of controllers.
#[test]
fn the_layout_is_that_of_controllers_and_stays_so() {
    for (before, after) in [
        ("1:J P[1] .6sec FINE ;", "   1:J P[1] 0.6sec FINE    ;"),
        ("   1:L P[1] 2sec CNT100;", "   1:L P[1] 2.0sec CNT100    ;"),
        ("   1:L P[1] 10mm/sek CNT100    ;", "   1:L P[1] 10mm/sek CNT100    ;"),
        (
            " 7: L  P[1:a  b] 0.50mm/sec  CNT100 Offset,PR[1]  ;",
            "   1:L P[1:a  b] .5mm/sec CNT100 Offset,PR[1]    ;",
        ),
        (": CALL A(1, 2);", "   1:  CALL A(1, 2) ;"),
        ("   1:  CALL A    ;", "   1:  CALL A    ;"),
        ("   1:WAIT 1.5(sec) ;", "   1:  WAIT   1.50(sec) ;"),
        ("   1:  WARTE    .50(sek) ;", "   1:  WARTE    .50(sek) ;"),
        ("   1:  WAIT .125(sec) ;", "   1:  WAIT   .125(sec) ;"),
        ("   1:  DO[1]=PULSE, .5sec ;", "   1:  DO[1]=PULSE,0.5sec ;"),
        (" 12:!two ;\n\n 12:;", "   1:  !two ;\n   2:   ;"),
        // A text whose meaning would change is unchanged.
        ("1:--eg PULSE,1sec ;", "   1:  --eg PULSE,1sec ;"),
        ("1:CALL A\u{a0} ;", "1:CALL A\u{a0} ;"),
        // A comment keeps its text, without blanks at its end.
        ("1:!a\u{a0} ;", "   1:  !a ;"),
        ("1:!two    ;", "   1:  !two ;"),
        ("1:!DO[1]=PULSE, .5sec ;", "   1:  !DO[1]=PULSE, .5sec ;"),
        ("   1:  DO[1]=PULSE,.25sec ;", "   1:  DO[1]=PULSE,0.25sec ;"),
        ("   1:  DO[1]=PULSE,2sec ;", "   1:  DO[1]=PULSE,2.0sec ;"),
        ("   1:      CALL A ;", "   1:  CALL A ;"),
        // A case stays in its column, if it has one.
        (
            " 1: SELECT R[1]=1,CALL A ;\n 2:     =2,CALL B ;\n 3: =3,CALL B ;\n 4:  =4,CALL B ;\n 5:     ELSE,CALL C ;",
            "   1:  SELECT R[1]=1,CALL A ;\n   2:     =2,CALL B ;\n   3:         =3,CALL B ;\n   4:         =4,CALL B ;\n   5:     ELSE,CALL C ;",
        ),
        (
            " 1: IST i[1]=1,SPRUNG LABEL[1] ;\n 2:     SONST,SPRUNG LABEL[1] ;",
            "   1:  IST i[1]=1,SPRUNG LABEL[1] ;\n   2:     SONST,SPRUNG LABEL[1] ;",
        ),
        ("   1:  nonsense and ( more ;", "   1:  nonsense and ( more ;"),
        ("   1:J P[1] 5 FINE ;", "   1:J P[1] 5 FINE ;"),
        (
            "   1:J P[1] 5% CNT0 TB    .20sec,P-SPS    ;\n      1:  IF (DI[1] AND\n       :  DI[2]),DO[1]=(ON) ;\n   2:  END ;",
            "   1:J P[1] 5% CNT0 TB    .20sec,P-SPS    ;\n      1:  IF (DI[1] AND\n       :  DI[2]),DO[1]=(ON) ;\n   2:  END ;",
        ),
    ] {
        let mut document = Document::decode(&format!("/PROG  A\n/MN\n{before}\n/POS\n/END\n")).unwrap();
        document.format().unwrap();
        assert_eq!(document.to_string(), format!("/PROG  A\n/MN\n{after}\n/POS\n/END\n"));
        assert_eq!(document.format(), Ok(0), "{after}");
    }
    let mut document = document();
    document.format().unwrap();
    assert!(document.as_str().contains("\n   3:J P[1:home] 20% FINE    ;\n"));
    assert_eq!(document.findings(&Rules::default()).iter().filter(|f| f.problem.is_error()).count(), 0);
}

#[test]
fn attributes_and_positions_are_laid_out_and_what_is_not_taught_stays() {
    let formatted = |attributes: &str, positions: &str| {
        let text = format!("/PROG  A\n/ATTR\n{attributes}\n/MN\n   1:  END ;\n/POS\n{positions}\n/END\n");
        let mut document = Document::decode(&text).unwrap();
        document.format().unwrap();
        let text = document.to_string();
        let (attributes, rest) = text.split_once("/ATTR\n").unwrap().1.split_once("\n/MN").unwrap();
        let positions = rest.split_once("/POS\n").unwrap().1.strip_suffix("\n/END\n").unwrap();
        (attributes.to_owned(), positions.to_owned())
    };
    let (attributes, _) = formatted("OWNER = A;\nLINE_COUNT = 9;\nCOMMENT =\"x\";\nPROTECT = READ;", "");
    assert_eq!(attributes, "OWNER\t\t= A;\nLINE_COUNT\t= 1;\nCOMMENT\t\t= \"x\";\nPROTECT\t\t= READ;");
    let position = |first: &str, second: &str| {
        let block = format!("P[1]{{\n   GP1:\n\tUF : 0, UT : 1,\t\n\tJ1={first} deg,\tJ2={second} deg\n}};");
        formatted("OWNER\t\t= A;", &block).1.split_once("\tJ1=").unwrap().1.to_owned()
    };
    assert_eq!(position(" 1.5", " 2"), "     1.500 deg,\tJ2=     2.000 deg\n};");
    // Zero is printed with the zero before its point, unless this file omits it.
    assert_eq!(position(" 1.5", " 0.000"), "     1.500 deg,\tJ2=     0.000 deg\n};");
    assert_eq!(position(" 1.5", " .000"), "     1.500 deg,\tJ2=      .000 deg\n};");
    assert_eq!(position(" 0.000", " .000"), "     0.000 deg,\tJ2=     0.000 deg\n};");
    assert_eq!(position(" 1.5", " ******"), " 1.5 deg,\tJ2= ****** deg\n};");
}

#[test]
fn a_jump_may_go_to_another_label_and_no_two_labels_become_one() {
    let text =
        "/PROG  A\n/MN\n   1:  LBL[1] ;\n   2:  lbl[2:b] ;\n   3:  JMP LBL[9] ;\n   4:  R[2]=1 ;\n/END\n";
    let mut document = Document::decode(text).unwrap();
    let taken = EncodeError::Taken { item: ItemKind::Label, number: 1 };
    let onto_one = |from: u32| move |kind, number| (number == from).then_some((kind, 1));
    assert_eq!(document.replace_items(onto_one(2)), Err(taken));
    assert_eq!(document.as_str(), text);
    assert_eq!(document.replace_items(onto_one(9)), Ok(1));
    assert_eq!(document.as_str(), text.replace("LBL[9]", "LBL[1]"));
    let items: Vec<_> = document.items().into_iter().collect();
    assert_eq!(items, [(ItemKind::Register, 2), (ItemKind::Label, 1), (ItemKind::Label, 2)]);
}

#[test]
fn a_line_without_a_number_gets_none() {
    let text = "/PROG  A\n/MN\n   1:  END ;\n no number: R[1]=1 ;\n   2:  END ;\n/END\n";
    let mut document = Document::decode(text).unwrap();
    assert_eq!(document.renumber_lines(), Ok(1));
    assert_eq!(document.as_str(), text.replace("   2:", "   3:"));
}

#[test]
fn what_an_edit_does_not_mean_stays_as_it_is_spelled() {
    let motion = |document: &Document| match document.instruction(0) {
        Some(fanuc_ls::Instruction::Motion(motion)) => motion,
        other => panic!("{other:?}"),
    };
    let text = "/PROG  A\n/MN\n   1:L P[1]  +5mm/sec FINE INC INC    ;\n/END\n";
    for text in [text.to_owned(), text.replace("FINE", "CNTR[1]")] {
        let mut document = Document::decode(&text).unwrap();
        let same = motion(&document);
        document.set_motion(0, &same).unwrap();
        assert_eq!(document.as_str(), text);
    }
    let text = text.replace("+5", "5");
    let mut document = Document::decode(&text).unwrap();
    let once = Motion { options: "INC".into(), ..motion(&document) };
    document.set_motion(0, &once).unwrap();
    assert_eq!(document.as_str(), text.replace("INC INC", "INC"));

    let text =
        "/PROG  A\n/MN\n/POS\nP[1]{\n  GP1:\n UF : 0, UT : 1,\n J1=  1.500 deg, J2= ****** deg\n};\n/END\n";
    let mut document = Document::decode(text).unwrap();
    let mut position = document.positions().next().unwrap();
    position.groups[0].axes[0].value = Some(2.5);
    document.set_position(&position).unwrap();
    assert_eq!(document.as_str(), text.replace("1.500", "2.500"));
}

#[test]
fn statements_and_positions_are_added_and_removed() {
    let mut document = document();
    document.insert_instruction(0, "!first").unwrap();
    document.insert_instruction(usize::MAX, "END").unwrap();
    assert_eq!(document.insert_instruction(0, "L P[1"), Err(EncodeError::Instruction { line: 1 }));
    let added = document.to_string();
    assert!(added.contains("/MN\n   1:  !first ;\n   1:  UFRAME_NUM=1 ;\n"), "{added}");
    assert!(added.contains("MESSAGE[R[5]] ;\n   9:  END ;\n/POS\n"), "{added}");
    let mut position = document.positions().next().unwrap();
    let taken = EncodeError::Taken { item: ItemKind::Position, number: 1 };
    assert_eq!(document.add_position(&position), Err(taken));
    position.number = 7;
    document.add_position(&position).unwrap();
    assert!(document.as_str().ends_with(
        "P[7:\"home\"]{\n   GP1:\n\tUF : 1, UT : 2,\t\n\tJ1=     1.000 deg,\tJ2=     2.000 deg\n};\n/END\n"
    ));
    assert_eq!(document.remove_position(7), Ok(1));
    assert_eq!(document.remove_position(7), Ok(0));
    assert_eq!(document.as_str(), added);
    let mut bare = Document::decode("/PROG A\n/MN\n/END\n").unwrap();
    bare.insert_instruction(3, "ABORT").unwrap();
    bare.add_position(&position).unwrap();
    assert!(bare.as_str().starts_with("/PROG A\n/MN\n   1:  ABORT ;\n/POS\nP[7:\"home\"]{\n"), "{bare}");
}

#[test]
fn every_reference_has_its_place() {
    let document = document();
    let shown: Vec<String> = { document.references() }
        .map(|found| {
            let name = found.name.map_or("", |name| &TEXT[name]);
            let mark = if found.is_definition { "*" } else { "" };
            format!("{mark}{}{}{name}", &TEXT[found.letters], &TEXT[found.digits])
        })
        .collect();
    assert_eq!(
        shown.join(" "),
        "UFRAME_NUM1 *LBL3again P1home P2 PR5PR[1] up DI5gate R5 R7 LBL3 *P1home UF1 UT2 *P2 UF1 UT2"
    );
    let text = "/PROG A\n/MN\n1: CALL B-1 ;\n2: IF R[1]=1,RUN C ;\n3: CALL SR[1] ;\n4: MONITOR END ;\n\
                5:L P[1] 9sec FINE TB .5sec,CALL D(1) ;\n6: !CALL E ;\n7: MESSAGE[CALL F] ;\n8: SR[1]='CALL G' ;\n\
                9: IF R[1]=1,CALL H(R[2]) ;\n10: MONITOR I ;\n11: CALL ... ;\n12: CALL 5 ;\n13: CALL-J ;\n/END\n";
    let document = Document::decode(text).unwrap();
    assert!(document.references().all(|found| !found.is_definition));
    let programs: Vec<&str> = document.program_references().map(|name| &text[name]).collect();
    assert_eq!(programs, ["B-1", "C", "D", "H", "I"]);
    let body = document.statements().next().unwrap().body();
    assert_eq!(&text[document.place(body)], "CALL B-1");
}
