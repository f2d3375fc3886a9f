//! The listings of `reference/ls`: read, warned about, written, and refused with the place of the error.

use fanuc_ls::{
    AxisName, CommentRule, Configuration, DecodeError, Document, EncodeError, Finding, Group, Instruction,
    Motion, MotionKind, Position, Problem, Program, Rules, Speed, SpeedUnit, Target, Termination, Warning,
};

fn text(name: &str) -> String {
    let path = format!("{}/../reference/ls/{name}.ls", env!("CARGO_MANIFEST_DIR"));
    std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{path}: {e}"))
}

fn cutting() -> Rules {
    let mut rules = Rules::default();
    rules.comment = CommentRule::Truncate;
    rules
}

fn warnings(text: &str) -> Vec<Warning> {
    let warning = |finding: Finding| match finding.problem {
        Problem::Warning(warning) => Some(warning),
        Problem::Error(error) => panic!("{error}\n{text}"),
        // `mistakes.rs` has them.
        Problem::Mistake(_) => None,
    };
    Document::decode(text).unwrap().findings(&Rules::default()).into_iter().filter_map(warning).collect()
}

fn read(name: &str) -> (Program, Vec<Warning>) {
    let text = text(name);
    (Program::decode(&text).unwrap(), warnings(&text))
}

#[test]
fn each_listing_is_written_as_its_canonical_form_which_reads_as_the_same() {
    for name in ["figure-4", "figure-8", "controller", "post-processor", "minimal"] {
        let (program, _) = read(name);
        let written = program.to_text(&cutting()).unwrap();
        assert_eq!(written, text(&format!("{name}.canonical")), "{name}");
        let again = Program::decode(&written).unwrap();
        assert_eq!(again.to_text(&Rules::default()).unwrap(), written, "{name}: write, read, write");
        if name == "controller" {
            assert_eq!(again, program);
        }
    }
}

#[test]
fn a_document_is_written_as_it_was_read() {
    for name in ["figure-4", "figure-8", "controller", "post-processor", "minimal"] {
        let text = text(name);
        let document = Document::decode(&text).unwrap();
        assert_eq!((document.to_string(), document.to_bytes()), (text.clone(), text.into_bytes()), "{name}");
        assert_eq!(document.program().unwrap(), read(name).0, "{name}");
    }
}

/// Setting a motion or a position to its own value has no effect; setting it to another value changes only the
/// differences.
#[test]
fn what_is_set_to_what_it_is_stays_as_it_is_spelled() {
    for name in ["figure-4", "figure-8", "controller", "post-processor", "minimal"] {
        let before = Document::decode(&text(name)).unwrap();
        let mut document = before.clone();
        for index in 0..before.statements().count() {
            if let Some(Instruction::Motion(motion)) = before.instruction(index) {
                document.set_motion(index, &motion).unwrap();
            }
        }
        for position in before.positions() {
            document.set_position(&position).unwrap();
        }
        assert_eq!(document.as_str(), before.as_str(), "{name}");
        for index in 0..before.statements().count() {
            let Some(Instruction::Motion(mut motion)) = before.instruction(index) else { continue };
            motion.target = Target::position(77);
            let mut document = before.clone();
            document.set_motion(index, &motion).unwrap();
            assert_eq!(document.instruction(index), Some(Instruction::Motion(motion)), "{name}");
            assert_eq!(Document::decode(document.as_str()).unwrap(), document, "{name}");
            let differ =
                document.as_str().lines().zip(before.as_str().lines()).filter(|(a, b)| a != b).count();
            assert_eq!(differ, 1, "{name}: {document}");
        }
    }
}

#[test]
fn a_controllers_own_style_is_the_canonical_form_to_the_byte() {
    assert_eq!(read("controller").0.to_text(&Rules::default()).unwrap(), text("controller"));
}

/// "Obrázek 4": line 3, a comment of 26 characters; five positions, three motions.
#[test]
fn the_sources_listing_reads_with_its_oddities_named() {
    let (program, warnings) = read("figure-4");
    assert_eq!(program.name, "FanucTest2_tdMax05tdMin005");
    assert_eq!(program.comment(), Some("FanucTest2_tdMax05tdMin005"));
    assert_eq!(
        warnings,
        [
            Warning::CommentLength { found: 26 },
            Warning::UnusedPosition { number: 4 },
            Warning::UnusedPosition { number: 5 }
        ]
    );
    assert_eq!(program.application.as_deref(), Some(&[][..]));
    assert_eq!(program.instructions[..2], [Instruction::UserTool(1), Instruction::UserFrame(0)]);
    let spline = |number, speed| {
        let cnt100 = Termination::Continuous(100);
        Instruction::Motion(Motion::new(
            MotionKind::Spline,
            Target::position(number),
            Speed::mm_per_sec(speed),
            cnt100,
        ))
    };
    assert_eq!(program.instructions[3..], [spline(2, 10.0), spline(3, 31.0)]);
    assert_eq!(
        program.position(4).unwrap().joints(),
        Some([-106.663, -12.074, 5.581, 0.7, 82.104, -286.745])
    );
    assert_eq!(program.to_text(&Rules::default()), Err(EncodeError::CommentLength { found: 26 }));
}

#[test]
fn a_controllers_own_style_reads_whole() {
    let (program, warnings) = read("controller");
    assert_eq!(warnings, [Warning::UntaughtPosition { number: 5 }]);
    assert_eq!(program.kind.as_deref(), Some("Macro"));
    assert_eq!(program.comment(), Some("Seam; first try"));
    assert_eq!(program.attribute("CONTROL_CODE"), Some("00000000 00000000"));
    assert_eq!(program.application.as_ref().unwrap().len(), 3);
    let nested = program.instructions.iter().filter(|i| matches!(i, Instruction::Nested(_))).count();
    assert_eq!((program.instructions.len() - nested, nested), (24, 3));
    assert_eq!(
        program.instructions[7],
        Instruction::Other(
            "IF (DI[34:Dry cycle]=ON OR $SPOTCONFIG.$STROKE_ENBL=0 OR\nDO[470:Fault]=ON),JMP LBL[99]".into()
        )
    );
    let motions: Vec<&Motion> = program
        .instructions
        .iter()
        .filter_map(|i| if let Instruction::Motion(m) = i { Some(m) } else { None })
        .collect();
    assert_eq!(motions.len(), 9);
    assert_eq!(motions[1].target, Target::Register { number: 2, name: Some("Pounce/Home 2".into()) });
    let register = Speed::Register { register: "R[23:fast]".into(), unit: SpeedUnit::Percent };
    assert_eq!(motions[1].speed, register);
    assert_eq!(motions[1].termination, Some(Termination::ContinuousRegister("R[25]".into())));
    assert_eq!(motions[2].options, "Wjnt Offset,PR[90:z up]");
    assert_eq!(motions[3].target, Target::Other("P[R[5]]".into()));
    assert_eq!(motions[4].via, Some(Target::position(4)));
    assert_eq!(motions[5].speed, Speed::Named("WELD_SPEED".into()));
    assert_eq!(motions[8].termination, None);
    assert_eq!(motions[8].options, "CD50");
    let home = program.position(1).unwrap();
    assert_eq!(home.name.as_deref(), Some("home"));
    assert_eq!(home.groups.len(), 2);
    assert_eq!(home.joints(), Some([15.145, -0.0, 0.582, -0.593, -88.918, 0.0]));
    assert_eq!(program.position(3).unwrap().groups[0].axes[6].name, AxisName::E(1));
    assert_eq!(program.position(4).unwrap().groups[0].user_frame, None);
    assert_eq!(program.position(4).unwrap().groups[0].configuration.as_ref().unwrap().keyword, "KONFIG");
}

#[test]
fn a_damaged_text_is_refused_with_its_line_and_column() {
    let path = format!("{}/../reference/vectors/fanuc-ls.json", env!("CARGO_MANIFEST_DIR"));
    let file: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    let vectors = file["vectors"].as_array().unwrap().iter();
    let cases: Vec<_> = vectors.filter(|v| v["result"] == "invalid" && v["part"].is_null()).collect();
    assert!(cases.len() >= 37);
    for case in cases {
        let error = Program::decode(case["text"].as_str().unwrap()).expect_err(&case["comment"].to_string());
        assert_eq!(serde_json::to_value(error).unwrap(), case["error"], "{}", case["comment"]);
    }
}

#[test]
fn an_error_says_where_and_what_was_expected() {
    let error: DecodeError = Program::decode("/PROG A\n/MN\n   1:L P[1] 100mm/s FINE ;\n/END").unwrap_err();
    assert_eq!(
        error.to_string(),
        "line 3, column 16: expected a unit: %, sec, msec, mm/sec, cm/min, inch/min or deg/sec"
    );
}

#[test]
fn every_beginning_of_a_listing_is_refused_and_none_is_read_as_another_program() {
    let whole = text("controller");
    let end = whole.trim_end().len();
    for cut in (0..end).filter(|&cut| whole.is_char_boundary(cut)) {
        assert!(Program::decode(&whole[..cut]).is_err(), "cut at byte {cut}");
    }
}

/// A line of a block is deeper than the four columns of a number; a file whose numbers are all that deep has no blocks.
#[test]
fn deep_numbers_that_count_up_are_no_nested_block() {
    let body: String = (1..=12).map(|n| format!("{n:8}:J P[1] 5% FINE ;\n")).collect();
    let program =
        Program::decode(&format!("/PROG A\n/MN\n{body}/POS\nP[1]{{GP1:UF:0,UT:1,J1=0 deg}};\n/END")).unwrap();
    assert_eq!((program.motions(MotionKind::Joint), program.line_count()), (12, 12));
}

#[test]
fn what_is_suspicious_is_told() {
    let body = "/PROG A\n/ATTR\nLINE_COUNT = 9;\n/MN\n 1:J P[1] 5% FINE;\n 3:J P[7] 5% FINE;\n/POS\n";
    let point = "P[1]{GP1:UF:0,UT:1,J1=0 deg};\n";
    assert_eq!(
        warnings(&format!("{body}{point}{point}/END")),
        [
            Warning::LineNumber { expected: 2, found: 3 },
            Warning::UndefinedPosition { number: 7 },
            Warning::RepeatedPosition { number: 1 },
        ]
    );
    let used = |instruction: &str| warnings(&format!("/PROG A\n/MN\n 1:{instruction};\n/POS\n{point}/END"));
    assert_eq!(used("  PR[2]=PR[1]"), [Warning::UnusedPosition { number: 1 }]);
    assert_eq!(used("  PR[2]=P[1]"), []);
    assert_eq!(used("J P[R[3]] 5% FINE"), []);
    assert_eq!(used("J P[1] 5mm/sec FINE"), [Warning::SpeedUnit]);
}

#[test]
fn what_a_controller_would_not_take_is_not_written() {
    let base = read("controller").0;
    let refused = |change: &dyn Fn(&mut Program)| {
        let mut program = base.clone();
        change(&mut program);
        program.to_text(&Rules::default()).unwrap_err()
    };
    let instruction = |i: Instruction| refused(&|p: &mut Program| p.instructions[0] = i.clone());
    let motion = |change: &dyn Fn(&mut Motion)| {
        let mut motion =
            Motion::new(MotionKind::Linear, Target::position(1), Speed::mm_per_sec(5.0), Termination::Fine);
        change(&mut motion);
        instruction(Instruction::Motion(motion))
    };
    assert_eq!(refused(&|p| p.name = "1A".into()), EncodeError::Name);
    assert_eq!(refused(&|p| p.name = "Schweißen".into()), EncodeError::Name);
    assert_eq!(refused(&|p| p.name = "A".repeat(37)), EncodeError::NameLength { found: 37, limit: 36 });
    assert_eq!(refused(&|p| p.kind = Some("Mac\nro".into())), EncodeError::Name);
    assert_eq!(refused(&|p| p.set_comment("seventeen letters")), EncodeError::CommentLength { found: 17 });
    let mut quoted = base.clone();
    quoted.set_comment("sixteen\";letters");
    assert_eq!(quoted.to_text(&cutting()), Err(EncodeError::Attribute { index: 2 }));
    assert_eq!(refused(&|p| p.set_attribute("OWNER", "A; B = C")), EncodeError::Attribute { index: 1 });
    assert_eq!(refused(&|p| p.application = Some(vec!["/MN".into()])), EncodeError::Application { index: 1 });
    assert_eq!(motion(&|m| m.kind = MotionKind::Circular), EncodeError::Via { line: 1 });
    assert_eq!(motion(&|m| m.via = Some(Target::position(2))), EncodeError::Via { line: 1 });
    let cnt = Termination::Continuous(101);
    assert_eq!(
        motion(&|m| m.termination = Some(cnt.clone())),
        EncodeError::Continuous { line: 1, found: 101 }
    );
    for value in [0.0, 0.0004, -5.0, f64::NAN, f64::INFINITY] {
        assert_eq!(motion(&|m| m.speed = Speed::mm_per_sec(value)), EncodeError::Speed { line: 1 });
    }
    assert_eq!(motion(&|m| m.speed = Speed::percent(5)), EncodeError::SpeedUnit { line: 1 });
    assert_eq!(motion(&|m| m.kind = MotionKind::Joint), EncodeError::SpeedUnit { line: 1 });
    let fast = |m: &mut Motion| (m.kind, m.speed) = (MotionKind::Joint, Speed::percent(101));
    assert_eq!(motion(&fast), EncodeError::Speed { line: 1 });
    assert_eq!(motion(&|m| m.target = Target::Other("P[1".into())), EncodeError::Instruction { line: 1 });
    assert_eq!(motion(&|m| m.options = "ACC50 ;\nX".into()), EncodeError::Instruction { line: 1 });
    for text in ["", "!x", "L P[1] 5mm/sec FINE", "UTOOL_NUM=3", "a\r\nb", "a ;\nb", " a", "a\u{1a}"] {
        let other = Instruction::Other(text.into());
        assert_eq!(instruction(other), EncodeError::Instruction { line: 1 }, "{text:?}");
    }
    for text in ["      1:  X ;", "   2:  X ;"] {
        let nested = Instruction::Nested(text.into());
        assert!(matches!(instruction(nested), EncodeError::Instruction { .. }), "{text:?}");
    }
    assert_eq!(refused(&|p| p.positions[0].groups.clear()), EncodeError::Position { number: 1 });
    assert_eq!(
        refused(&|p| p.positions[1].groups[0].axes[0].value = Some(f64::NAN)),
        EncodeError::Position { number: 3 }
    );
}

#[test]
fn what_would_be_read_as_something_else_is_not_written() {
    let refused = |instruction: Instruction| {
        let mut program = read("minimal").0;
        program.instructions = vec![instruction];
        program.to_text(&Rules::default()).err()
    };
    let motion = |change: &dyn Fn(&mut Motion)| {
        let mut motion =
            Motion::new(MotionKind::Linear, Target::position(1), Speed::mm_per_sec(5.0), Termination::Fine);
        change(&mut motion);
        refused(Instruction::Motion(motion))
    };
    let error = Some(EncodeError::Instruction { line: 1 });
    assert_eq!(motion(&|_| ()), None);
    assert_eq!(motion(&|m| m.target = Target::Other("P[2]".into())), error);
    assert_eq!(motion(&|m| m.speed = Speed::Named("5mm/sec".into())), error);
    assert_eq!(motion(&|m| (m.termination, m.options) = (None, "FINE".into())), error);
    assert_eq!(motion(&|m| (m.termination, m.options) = (None, "FINER".into())), None);
    // A nested line belongs to the motion above it.
    let nested = refused(Instruction::Nested("      7:  X ;".into()));
    assert_eq!(nested, Some(EncodeError::Instruction { line: 0 }));
}

#[test]
fn names_and_attributes_are_written_as_they_are_read() {
    let written = |change: &dyn Fn(&mut Program)| {
        let mut program = read("minimal").0;
        change(&mut program);
        program.to_text(&Rules::default()).err()
    };
    assert_eq!(written(&|p| p.name = "A".repeat(36)), None);
    for kind in ["", " Macro", "Macro\t"] {
        assert_eq!(written(&|p| p.kind = Some(kind.into())), Some(EncodeError::Name), "{kind:?}");
    }
    for text in [" X", "X\r\nY", "X;"] {
        let refused = written(&|p| p.set_attribute("OWNER", text));
        assert_eq!(refused, Some(EncodeError::Attribute { index: 1 }), "{text:?}");
    }
}

#[test]
fn a_position_that_would_not_be_read_again_is_not_written() {
    let written = |change: &dyn Fn(&mut Position)| {
        let mut program = read("minimal").0;
        let group = Group::cartesian(0, 1, [0.0; 6], Configuration::new("N U T, 0, 0, 0"));
        let mut position = Position::new(7, group);
        change(&mut position);
        program.positions = vec![position];
        program.to_text(&Rules::default()).err()
    };
    let error = Some(EncodeError::Position { number: 7 });
    assert_eq!(written(&|_| ()), None);
    for name in ["a\"b", "a\nb", " a", "a "] {
        assert_eq!(written(&|p| p.name = Some(name.into())), error, "{name:?}");
    }
    let configured = |keyword: &str, text: &str| {
        let (keyword, text) = (keyword.to_string(), text.to_string());
        let configuration = Configuration { keyword, text };
        written(&|p| p.groups[0].configuration = Some(configuration.clone()))
    };
    assert_eq!(configured("KONFIG", ""), None);
    for (keyword, text) in [("CONFIG", "N'T"), ("CONFIG", "N\nT"), ("CON FIG", "N"), ("CF", "N"), ("", "N")] {
        assert_eq!(configured(keyword, text), error, "{keyword:?} {text:?}");
    }
    assert_eq!(written(&|p| p.groups[0].axes.clear()), error);
    assert_eq!(written(&|p| p.groups[0].axes[0].value = Some(f64::INFINITY)), error);
    for number in [1, 9] {
        assert_eq!(written(&|p| p.groups[0].axes[0].name = AxisName::E(number)), None, "E{number}");
    }
    for name in [AxisName::J(0), AxisName::J(10), AxisName::E(0), AxisName::E(10)] {
        assert_eq!(written(&|p| p.groups[0].axes[0].name = name), error, "{name:?}");
    }
}

/// Takes nothing.
struct Full;

impl core::fmt::Write for Full {
    fn write_str(&mut self, _: &str) -> core::fmt::Result {
        Err(core::fmt::Error)
    }
}

#[test]
fn a_writer_that_fails_is_an_error() {
    let program = Program::decode(&text("minimal")).unwrap();
    assert_eq!(program.encode(&Rules::default(), &mut Full), Err(EncodeError::Write));
}
