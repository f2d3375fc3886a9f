//! Write, read, write is the identity for whatever can be written; no text makes the reader panic.
#![allow(clippy::cast_possible_truncation, reason = "generated numbers are small")]

use fanuc_ls::{
    Attribute, AttributeValue, Axis, AxisName, AxisUnit, Configuration, Document, Group, Instruction, Motion,
    MotionKind, Position, Problem, Program, Rules, Speed, SpeedUnit, Target, Termination,
};
use proptest::prelude::*;
use robot_session::contract::Rng;

/// Coordinates and speeds with at most three decimals, so that the decoded values can be compared.
fn thousandths(rng: &mut Rng, below: usize) -> f64 {
    let value = rng.below(below * 1000) as f64 / 1000.0;
    if rng.chance(0.5) { -value } else { value }
}

fn pick<T: Clone>(rng: &mut Rng, from: &[T]) -> T {
    from[rng.below(from.len())].clone()
}

fn name(rng: &mut Rng) -> Option<String> {
    rng.chance(0.3).then(|| pick(rng, &["home", "Pounce/Home 2", "z up", "čep", "a:b"]).to_string())
}

fn target(rng: &mut Rng) -> Target {
    match rng.below(4) {
        0 => Target::Register { number: rng.below(100) as u32, name: name(rng) },
        1 => Target::Other(pick(rng, &["P[R[5]]", "PR[GP1:3]", "P[AR[1]]", "PR[R[2:i]]"]).to_string()),
        _ => Target::Position { number: rng.below(30) as u32, name: name(rng) },
    }
}

fn motion(rng: &mut Rng) -> Motion {
    use MotionKind::{Arc, Circular, Joint, Linear, Spline};
    let kind = pick(rng, &[Joint, Linear, Circular, Arc, Spline]);
    use SpeedUnit::{CmPerMin, DegPerSec, InchPerMin, MmPerSec, Msec, Percent, Sec};
    let units = [Sec, Msec, Percent, MmPerSec, CmPerMin, InchPerMin, DegPerSec];
    let fitting: Vec<SpeedUnit> = units.into_iter().filter(|unit| unit.fits(kind)).collect();
    let unit = pick(rng, &fitting);
    let speed = match rng.below(6) {
        0 => Speed::Register { register: pick(rng, &["R[23:slow]", "AR[2]", "R[R[1]]"]).to_string(), unit },
        1 => Speed::Named(pick(rng, &["max_speed", "WELD_SPEED"]).to_string()),
        _ if unit == Percent => Speed::percent(1 + rng.below(100) as u8),
        2 => Speed::Fixed { value: f64::from(1 + rng.below(4000) as u32), unit },
        _ => Speed::Fixed { value: f64::from(1 + rng.below(2_000_000) as u32) / 1000.0, unit },
    };
    let termination = match rng.below(4) {
        0 => Some(Termination::Fine),
        1 => Some(Termination::ContinuousRegister("R[7:cnt]".to_string())),
        2 => Some(Termination::Continuous(rng.below(101) as u8)),
        _ => None,
    };
    let options =
        ["", "", "", "ACC50", "Offset,PR[90:z up] PTH", "TB   .10sec,P-SPOT", "COORD\nTA 1.00sec,CALL X"];
    Motion {
        kind,
        via: (kind == Circular).then(|| target(rng)),
        via_options: if kind == Circular {
            pick(rng, &["", "Offset,PR[2]"]).to_string()
        } else {
            String::new()
        },
        target: target(rng),
        speed,
        termination,
        options: pick(rng, &options).to_string(),
    }
}

fn instruction(rng: &mut Rng) -> Instruction {
    let others = [
        "R[24:Retry]=R[24:Retry]+1",
        "IF (DI[1]=ON OR\nDO[470:Fault]=ON),JMP LBL[99]",
        "=2,JMP LBL[11]",
        "//CALL WELD_OFF",
        "MESSAGE[a;b]",
        "--eg:x",
        "UTOOL_NUM=R[3]",
        "LBL[99:DONE]",
        "PR[3,2:STK]=(-115)",
    ];
    match rng.below(8) {
        0 => Instruction::Empty,
        1 => Instruction::Comment(pick(rng, &["", " a b", "***;***", "čep\nand more"]).to_string()),
        2 => Instruction::UserFrame(rng.below(10) as u16),
        3 => Instruction::UserTool(rng.below(10) as u16),
        4 => Instruction::Other(pick(rng, &others).to_string()),
        _ => Instruction::Motion(motion(rng)),
    }
}

fn group(rng: &mut Rng, number: u8) -> Group {
    let frame = |rng: &mut Rng| rng.chance(0.9).then(|| rng.below(10) as u16);
    let value = |rng: &mut Rng| rng.chance(0.98).then(|| thousandths(rng, 3000));
    let (configuration, mut axes) = if rng.chance(0.5) {
        use AxisName::{P, R, W, X, Y, Z};
        let unit = |name| if matches!(name, X | Y | Z) { AxisUnit::Mm } else { AxisUnit::Deg };
        let axes = [X, Y, Z, W, P, R].map(|name| Axis { name, value: value(rng), unit: unit(name) });
        (Some(Configuration::new(pick(rng, &["N U T, 0, 0, 0", "F D B, 0, -1, 1"]))), axes.to_vec())
    } else {
        let axis = |n| Axis { name: AxisName::J(n), value: value(rng), unit: AxisUnit::Deg };
        (None, (1..=6).map(axis).collect())
    };
    for n in 1..=rng.below(4) as u8 {
        axes.push(Axis { name: AxisName::E(n), value: value(rng), unit: AxisUnit::Mm });
    }
    Group { number, user_frame: frame(rng), user_tool: frame(rng), configuration, axes }
}

fn program(rng: &mut Rng) -> Program {
    let mut program = Program {
        name: pick(rng, &["A", "WELD_1", "_BG", "FanucTest2_td"]).to_string(),
        ..Program::default()
    };
    program.kind = rng.chance(0.1).then(|| "Macro".to_string());
    if rng.chance(0.8) {
        program.set_comment(pick(rng, &["", "sixteen letters!", "a; b, c = d"]));
        program.set_attribute("DEFAULT_GROUP", "1,*,*,*,*");
        if rng.chance(0.5) {
            program.set_attribute("FILE_NAME", "");
            let items = [("STACK_SIZE", "0"), ("TASK_PRIORITY", "50")];
            let list = items.map(|(name, value)| (name.to_string(), value.to_string())).to_vec();
            let tcd = Attribute { name: "TCD".to_string(), value: AttributeValue::List(list) };
            program.attributes.as_mut().unwrap().push(tcd);
        }
    }
    if rng.chance(0.3) {
        let lines = ["", "AUTO_SINGULARITY_HEADER;", "  ENABLE_SINGULARITY_AVOIDANCE   : TRUE;"];
        program.application = Some(lines[..rng.below(4)].iter().map(ToString::to_string).collect());
    }
    let mut number = 0;
    for _ in 0..rng.below(8) {
        number += 1;
        program.instructions.push(instruction(rng));
        if rng.chance(0.05) {
            // A first nested line with the next line's number would be the next line.
            let first = number + 5;
            program.instructions.push(Instruction::Nested(format!("{first:7}:  DO[41]=ON ;")));
            program.instructions.push(Instruction::Nested("       ------ ;".to_string()));
        }
    }
    for n in 1..=rng.below(3) as u32 {
        let groups = (1..=1 + rng.below(2) as u8).map(|g| group(rng, g)).collect();
        program.positions.push(Position { number: n, name: name(rng), groups });
    }
    program
}

#[test]
fn ten_thousand_generated_programs_read_back_as_they_were_and_are_written_the_same_again() {
    for seed in 0..10_000 {
        let program = program(&mut Rng::new(seed));
        let written =
            program.to_text(&Rules::default()).unwrap_or_else(|e| panic!("seed {seed}: {e}\n{program:#?}"));
        let again = Program::decode(&written).unwrap_or_else(|e| panic!("seed {seed}: {e}\n{written}"));
        assert_eq!(again, program, "seed {seed}\n{written}");
        assert_eq!(again.to_text(&Rules::default()).unwrap(), written, "seed {seed}");
    }
}

/// Pieces of the grammar in any order: text that can be decoded and encoded is decoded to the same again.
fn soup() -> impl Strategy<Value = String> {
    let pieces = [
        "/PROG A\n",
        "/ATTR\n",
        "/APPL\n",
        "/MN\n",
        "/POS\n",
        "/END\n",
        "OWNER = X;\n",
        "TCD: A = 1, B = 2;\n",
        "COMMENT = \"a;b\";\n",
        "   1:",
        "   2:",
        "      1:",
        "\n    :  ",
        "L P[1] 5mm/sec FINE",
        "J P[2:a b] 5% CNT5",
        "C P[1]",
        "!note",
        "CALL X",
        "=3,JMP",
        " ;\n",
        "------ ;\n",
        "P[1]{\n",
        "P[2:\"x\"]{\n",
        "GP1:\n",
        "UF : 0, UT : F,",
        "CONFIG : 'N U T, 0, 0, 0',",
        "J1= .5 deg",
        "X = -1 mm",
        ",",
        "};\n",
        " ",
        "\t",
        "\r\n",
        "\u{1a}",
        "ž",
        "'",
        "\"",
    ];
    let head = prop_oneof![Just("/PROG A\n/MN\n"), Just("/PROG A\n/ATTR\n"), Just("")];
    (head, prop::collection::vec(prop::sample::select(pieces.to_vec()), 0..24))
        .prop_map(|(head, body)| head.to_string() + &body.concat())
}

proptest! {
    #[test]
    fn whatever_reads_and_can_be_written_reads_back(text in soup()) {
        for text in [text.clone(), text + "/END\n"] {
            let Ok(document) = Document::decode(&text) else { continue };
            prop_assert_eq!(document.as_str(), &text);
            let errors = document.findings(&Rules::default()).into_iter().filter(|f| matches!(f.problem, Problem::Error(_)));
            let program = document.program();
            prop_assert_eq!(program.is_ok(), errors.count() == 0);
            let Ok(program) = program else { continue };
            let Ok(written) = program.to_text(&Rules::default()) else { continue };
            let again = Program::decode(&written).unwrap();
            prop_assert_eq!(again.to_text(&Rules::default()).unwrap(), written);
        }
    }

    #[test]
    fn a_byte_changed_anywhere_gives_a_program_or_an_error_with_a_place(at in 0usize..3000, to in any::<char>()) {
        let mut text: Vec<char> = include_str!("../../../reference/ls/controller.ls").chars().collect();
        let at = at % text.len();
        text[at] = to;
        let text: String = text.into_iter().collect();
        if let Err(error) = Program::decode(&text) {
            prop_assert!(error.offset <= text.len() && text.is_char_boundary(error.offset));
            prop_assert!(error.line <= text.lines().count() + 1);
        }
    }

    #[test]
    fn any_number_is_printed_as_it_is_read(value in -99_999.0..99_999.0f64) {
        let mut program = Program { name: "A".to_string(), ..Program::default() };
        program.positions.push(Position::new(1, Group::joints(0, 1, [value; 6])));
        let written = program.to_text(&Rules::default()).unwrap();
        let again = Program::decode(&written).unwrap();
        let read = again.positions[0].joints().unwrap()[0];
        prop_assert!((read - value).abs() <= 0.000_500_1);
        prop_assert!(!written.contains("=-0.") && !written.contains(" 0.") || written.contains(" 0.000 deg"));
        prop_assert_eq!(again.to_text(&Rules::default()).unwrap(), written);
    }
}
