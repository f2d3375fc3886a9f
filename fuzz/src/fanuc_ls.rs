//! LS programs: the reader over any text, and trajectories made into programs by any step.

use arbitrary::Arbitrary;
use cellwire_motion::{Acceleration, Arm, JointSample, Resampling, Sampling, SpeedStep, Trajectory};
use fanuc_ls::{
    CommentRule, Document, Encoding, Finding, Instruction, Mistake, Problem, Program, Rules, Target,
};

use crate::Bytes;

/// A table of joint positions, and the way to resample it.
#[derive(Debug, Arbitrary)]
pub(crate) struct Table {
    sampling: Unit,
    is_speed_in_tenths: bool,
    /// The step, in sixteenths of a mm, degree or second, less one.
    step: u8,
    csv: Bytes,
}

#[derive(Debug, Arbitrary)]
enum Unit {
    Distance,
    Angle,
    Time,
    /// Up to a number of eighths more than the step.
    Translation(u8),
    Rotation(u8),
    Either(u8),
}

/// Checks the bytes of an LS file. A readable file is written as it was, and an edit reads back as it was set. A
/// program that can be written as values reads back as them, and is written the same again.
pub(crate) fn program(Bytes(data): Bytes) {
    let data = data.as_slice();
    let placed = |text: &str, (line, column, offset): (usize, usize, usize)| {
        assert!(text.is_char_boundary(offset), "a finding has a place in the text");
        assert!(line <= text.matches('\n').count() + 1 && column >= 1);
    };
    let document = match Document::decode_bytes(data) {
        Ok(document) => document,
        Err(error) => {
            let text = String::from_utf8_lossy(data);
            if data == text.as_bytes() {
                placed(&text, (error.line, error.column, error.offset));
            }
            return;
        }
    };
    assert_eq!(document.to_bytes(), data, "what is read is written as it was");
    for finding in document.findings(&Rules::default()) {
        placed(document.as_str(), (finding.line, finding.column, finding.offset));
    }
    let mut edited = document.clone();
    for (index, statement) in document.statements().enumerate() {
        let instruction = statement.instruction();
        drop(instruction.operation());
        let Instruction::Motion(mut motion) = instruction else { continue };
        motion.target = Target::position(77);
        if edited.set_motion(index, &motion).is_ok() {
            assert_eq!(
                edited.instruction(index),
                Some(Instruction::Motion(motion)),
                "an edit is read as it was set"
            );
        }
    }
    if document.encoding() == Encoding::Utf8 {
        assert_eq!(Document::decode(edited.as_str()), Ok(edited), "its places are those of its text");
    }
    let Ok(program) = document.program() else { return };
    let mut rules = Rules::default();
    rules.comment = CommentRule::Truncate;
    let Ok(written) = program.to_text(&rules) else { return };
    let again = Program::decode(&written).expect("what is written reads");
    assert_eq!(again.to_text(&rules).as_ref(), Ok(&written), "write, read, write");
    assert_eq!(again.instructions.len(), program.instructions.len());
    assert_eq!(again.positions.len(), program.positions.len());
    assert_eq!(again.application, program.application);
}

/// Asserts that the program of a trajectory can be written and read, and begins and ends where the table does.
pub(crate) fn trajectory(Table { sampling, is_speed_in_tenths, step, csv: Bytes(csv) }: Table) {
    let Ok(trajectory) = Trajectory::from_csv(&String::from_utf8_lossy(&csv)) else { return };
    let step = (f64::from(step) + 1.0) / 16.0;
    let dynamic = |range, by| Sampling::Dynamic { min: step, max: step + f64::from(range) / 8.0, by };
    let mut resampling = Resampling::new(match sampling {
        Unit::Distance => Sampling::Distance(step),
        Unit::Angle => Sampling::Angle(step),
        Unit::Time => Sampling::Time(step),
        Unit::Translation(range) => dynamic(range, Acceleration::Translation),
        Unit::Rotation(range) => dynamic(range, Acceleration::Rotation),
        Unit::Either(range) => dynamic(range, Acceleration::Either),
    });
    resampling.speed = if is_speed_in_tenths { SpeedStep::Tenth } else { SpeedStep::Whole };
    let made = resampling.program("A", "", &trajectory, &Arm::LR_MATE_200ID, &Rules::default());
    let Ok((program, report)) = made else { return };
    assert_eq!(program.positions.len(), report.moves + 1);
    let (first, last) = (program.positions.first(), program.positions.last());
    let written = program.to_text(&Rules::default()).expect("what is made can be written");
    let again = Document::decode(&written).expect("what is written reads");
    // A joint or a speed of the table may be beyond that of every robot: the check reports it, and nothing else.
    let is_beyond = trajectory.samples().iter().any(|it| it.joints.iter().any(|joint| joint.abs() > 720.0));
    let is_of_table = |it: &Finding| match it.problem {
        Problem::Mistake(Mistake::Joint { .. }) => is_beyond,
        Problem::Mistake(Mistake::HighSpeed { .. }) => true,
        _ => false,
    };
    let found: Vec<Finding> =
        again.findings(&Rules::default()).into_iter().filter(|it| !is_of_table(it)).collect();
    assert_eq!(found, []);
    assert_eq!(again.program().expect("it is understood").to_text(&Rules::default()), Ok(written));
    let rounded =
        |joints: [f64; 6]| joints.map(|joint| format!("{joint:.3}").parse().expect("it is a number"));
    let joints = |sample: Option<&JointSample>| sample.map(|sample| rounded(sample.joints));
    assert_eq!(first.and_then(fanuc_ls::Position::joints), joints(trajectory.samples().first()));
    assert_eq!(last.and_then(fanuc_ls::Position::joints), joints(trajectory.samples().last()));
}
