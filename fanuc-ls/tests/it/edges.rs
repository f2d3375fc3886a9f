//! The borders: every kind of motion of a builder.

use fanuc_ls::{
    AttributeValue, Axis, AxisName, AxisUnit, Builder, Configuration, Document, Group, Motion, MotionKind,
    Position, Program, Rules, Speed, Target, Termination,
};

#[test]
fn a_builder_makes_every_kind_of_motion() {
    let flip = Configuration { keyword: "CONFIG".into(), text: "N U T, 0, 0, 0".into() };
    let mut builder = Builder::new("ARC");
    builder.user_frame(2).user_tool(3);
    let via = builder.cartesian([100.0, 0.0, 50.5, 180.0, 0.0, -90.0], flip.clone());
    let end = builder.joints([0.0; 6]);
    builder
        .linear(via.clone(), Speed::mm_per_sec(250.0), Termination::Continuous(50))
        .circular(via, end, Speed::mm_per_sec(12.5), Termination::Fine)
        .linear(Target::register(7), Speed::mm_per_sec(1.0), Termination::Fine)
        .instruction("CALL WELD_ON")
        .instruction("L P[");
    let broken = builder.build(&Rules::default()).unwrap_err();
    assert!(!broken.to_string().is_empty());
    let mut builder = Builder::new("ARC");
    builder.user_frame(2).user_tool(3);
    let via = builder.cartesian([100.0, 0.0, 50.5, 180.0, 0.0, -90.0], flip);
    let end = builder.joints([0.0; 6]);
    builder
        .linear(via.clone(), Speed::mm_per_sec(250.0), Termination::Continuous(50))
        .circular(via, end, Speed::mm_per_sec(12.5), Termination::Fine)
        .linear(Target::register(7), Speed::mm_per_sec(1.0), Termination::Fine)
        .instruction("CALL WELD_ON");
    let program = builder.build(&Rules::default()).unwrap();
    let text = program.to_text(&Rules::default()).unwrap();
    let (_, main) = text.split_once("/MN\r\n").unwrap();
    let lines: Vec<_> = main.lines().map(str::trim_end).collect();
    assert_eq!(
        lines[..8],
        [
            "   1:  UFRAME_NUM=2 ;",
            "   2:  UTOOL_NUM=3 ;",
            "   3:L P[1] 250mm/sec CNT50    ;",
            "   4:C P[1]",
            "    :  P[2] 12.5mm/sec FINE    ;",
            "   5:L PR[7] 1mm/sec FINE    ;",
            "   6:  CALL WELD_ON ;",
            "/POS",
        ]
    );
    assert!(text.contains("GP1:\r\n\tUF : 2, UT : 3,\t\tCONFIG : 'N U T, 0, 0, 0',\r\n"), "{text}");
    assert!(text.contains("X =   100.000  mm,\tY =     0.000  mm,\tZ =    50.500  mm,"), "{text}");
    assert!(text.contains("W =   180.000 deg,\tP =     0.000 deg,\tR =   -90.000 deg"), "{text}");
    assert_eq!(Program::decode(&text).unwrap(), program);
    assert_eq!((program.positions[0].joints(), program.positions[1].joints()), (None, Some([0.0; 6])));
}

#[test]
fn joints_are_six_angles_in_degrees() {
    let group = Group::joints(0, 1, [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
    let with = |change: fn(&mut Vec<Axis>)| {
        let mut group = group.clone();
        change(&mut group.axes);
        Position::new(1, group).joints()
    };
    assert_eq!(with(|_| ()), Some([1.0, 2.0, 3.0, 4.0, 5.0, 6.0]));
    assert_eq!(with(|axes| axes.truncate(5)), None);
    assert_eq!(with(|axes| axes[5].name = AxisName::J(7)), None);
    assert_eq!(with(|axes| axes[5].unit = AxisUnit::Mm), None);
    assert_eq!(with(|axes| axes[5].value = None), None);
    assert_eq!(Position { groups: vec![], ..Position::new(1, group) }.joints(), None);
}

#[test]
fn a_program_is_read_from_a_str_and_its_lists_are_no_text() {
    let text = "/PROG  A\r\n/ATTR\r\nOWNER\t\t= MNEDITOR;\r\nTCD:  STACK_SIZE\t= 0,\r\n      TASK_PRIORITY\t= 50;\r\n/MN\r\n/POS\r\n/END\r\n";
    let program: Program = text.parse().unwrap();
    assert_eq!(program, Program::decode(text).unwrap());
    let list =
        program.attributes.iter().flatten().find(|a| matches!(a.value, AttributeValue::List(_))).unwrap();
    assert_eq!(program.attribute(&list.name), None);
    assert_eq!(program.attribute("NO_SUCH"), None);
    let motion = Motion::new(MotionKind::Linear, Target::register(3), Speed::percent(10), Termination::Fine);
    assert_eq!(motion.target, Target::Register { number: 3, name: None });
}

#[test]
fn what_stands_in_the_wrong_place_is_named() {
    let error = |text: &str| Program::decode(text).unwrap_err().to_string();
    let motion = |body: &str| error(&format!("/PROG  A\n/ATTR\n/MN\n   1:L P[1] {body} ;\n/END\n"));
    assert_eq!(motion("R[x 10mm/sec FINE"), "line 4, column 15: expected `]`");
    assert_eq!(motion("R[ FINE"), "line 4, column 15: expected `]`");
    assert_eq!(motion("10mm/sec CNTR["), "line 4, column 27: expected `]`");
    assert_eq!(error("/PROG  A\n/ATTR\n/MN x\n/END\n"), "line 3, column 4: expected the section `/MN`");
}

/// Returns the axes of a position, if it can be read.
fn axes(block: &str) -> Option<Vec<(&'static str, Option<f64>)>> {
    let text = format!("/PROG  A\n/MN\n/POS\nP[1]{{\n   GP1:\n\tUF : 0, UT : 1,\t\n\t{block}\n/END\n");
    let position = Document::decode(&text).unwrap().positions().next()?;
    Some(position.groups[0].axes.iter().map(|axis| (axis.name.name(), axis.value)).collect())
}

#[test]
fn an_axis_is_read_by_its_name_and_nothing_follows_the_last() {
    for name in ["X", "Y", "Z", "W", "P", "R", "RX", "RY", "RZ", "RW", "RP", "RR", "J9", "E9"] {
        assert_eq!(axes(&format!("{name}\t=\t1.5 deg\n}};")), Some(vec![(name, Some(1.5))]));
    }
    let two = Some(vec![("J1", Some(1.5)), ("J2", Some(2.5))]);
    for comma in [",", ",\t", ",\r\n\t", ", \t\n "] {
        assert_eq!(axes(&format!("J1=1.5 deg{comma}J2=2.5 deg\n}};")), two, "{comma:?}");
        assert_eq!(axes(&format!("J1=1.5 deg,J2=2.5 deg{comma}}};")), None, "{comma:?}");
    }
    for behind in ["", " \t", "\u{a0}", "\n\n"] {
        assert_eq!(axes(&format!("J1=1.5 deg,J2=2.5 deg}};{behind}")), two, "{behind:?}");
    }
}

#[test]
fn a_closed_line_has_a_semicolon_at_its_end_or_before_blanks() {
    for end in [";", "; ", ";\t", ";\u{a0}"] {
        let text = format!("/PROG  A\n/MN\n : CALL A {end}\n : CALL B {end}\n/END\n");
        let document = Document::decode(&text).unwrap();
        let bodies: Vec<_> = document.statements().map(|statement| statement.body().to_owned()).collect();
        assert_eq!(bodies, ["CALL A", "CALL B"], "{end:?}");
    }
}
