//! LS programs: the reader over any text, and trajectories made into programs by any step.

use cellwire::motion::{Acceleration, Arm, JointSample, Resampling, Sampling, SpeedStep, Trajectory};
use fanuc_ls::{CommentRule, Program, Rules};

/// The text of an LS file. What reads and can be written reads back, and is written the same again.
pub fn fanuc_ls_program(data: &[u8]) {
    let text = String::from_utf8_lossy(data);
    let program = match Program::decode(&text) {
        Ok(program) => program,
        Err(error) => {
            assert!(text.is_char_boundary(error.offset), "an error has a place in the text");
            assert!(error.line <= text.matches('\n').count() + 1 && error.column >= 1);
            return;
        }
    };
    let mut rules = Rules::default();
    rules.comment = CommentRule::Truncate;
    let Ok(written) = program.to_text(&rules) else { return };
    let again = Program::decode(&written).expect("what is written reads");
    assert_eq!(again.to_text(&rules).as_ref(), Ok(&written), "write, read, write");
    // The reader drops blanks and line numbers, rounding drops decimals: nothing else may be gone.
    assert_eq!(again.instructions.len(), program.instructions.len());
    assert_eq!(again.positions.len(), program.positions.len());
    assert_eq!(again.application, program.application);
}

/// Three bytes say how, the rest is the table.
pub fn fanuc_ls_trajectory(data: &[u8]) {
    let [how, step, range, table @ ..] = data else { return };
    let Ok(trajectory) = Trajectory::from_csv(&String::from_utf8_lossy(table)) else { return };
    let by =
        [Acceleration::Translation, Acceleration::Rotation, Acceleration::Either][usize::from(how / 8 % 3)];
    let step = (f64::from(*step) + 1.0) / 16.0;
    let sampling = match how % 4 {
        0 => Sampling::Distance(step),
        1 => Sampling::Angle(step),
        2 => Sampling::Time(step),
        _ => Sampling::Dynamic { min: step, max: step + f64::from(*range) / 8.0, by },
    };
    let mut resampling = Resampling::new(sampling);
    resampling.speed = if how & 4 == 0 { SpeedStep::Whole } else { SpeedStep::Tenth };
    let made = resampling.program("A", "", &trajectory, &Arm::LR_MATE_200ID, &Rules::default());
    let Ok((program, report)) = made else { return };
    assert_eq!(program.positions.len(), report.moves + 1);
    assert_eq!(program.warnings(), []);
    let (first, last) = (program.positions.first(), program.positions.last());
    let written = program.to_text(&Rules::default()).expect("what is made can be written");
    let again = Program::decode(&written).expect("what is written reads");
    assert_eq!(again.to_text(&Rules::default()), Ok(written));
    let joints = |sample: Option<&JointSample>| sample.map(|sample| sample.joints);
    assert_eq!(first.and_then(fanuc_ls::Position::joints), joints(trajectory.samples().first()));
    assert_eq!(last.and_then(fanuc_ls::Position::joints), joints(trajectory.samples().last()));
}
