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

/// The lines that differ, before and after.
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
        (ItemKind::Position, 2) => Some((kind, 9)),
        _ => None,
    };
    assert_eq!(document.replace_items(swap), Ok(10));
    let expected = [
        ("   1:  UFRAME_NUM=1 ;", "   1:  UFRAME_NUM=4 ;"),
        ("   2:  LBL[3:again] ;", "   2:  LBL[30:again] ;"),
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

/// What controllers print stays; what people and post-processors write becomes it.
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
