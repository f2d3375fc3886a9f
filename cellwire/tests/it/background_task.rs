//! The background task that a controller gets.

use cellwire::telemetry::task::{BackgroundTask, TaskError};
use fanuc_ls::{Program, Rules};

#[test]
fn the_background_task_is_figure_8_to_the_letter() {
    let path = format!("{}/../reference/ls/figure-8.ls", env!("CARGO_MANIFEST_DIR"));
    let figure = Program::decode(&std::fs::read_to_string(path).unwrap()).unwrap();
    let task = BackgroundTask::default().program(&Rules::default()).unwrap();
    assert_eq!(task.instructions.len(), 56);
    assert_eq!(task.instructions, figure.instructions);
    assert_eq!(task.attribute("DEFAULT_GROUP"), Some("*,*,*,*,*"));
    let text = task.to_text(&Rules::default()).unwrap();
    assert!(text.contains("  39:  R[13:SPD_X]=(($SCR_GRP[1].$MCH_POS_X-R[36:POS_PREV_X])/.008) ;\r\n"));
    assert_eq!(Program::decode(&text).unwrap(), task);
}

#[test]
fn the_background_task_takes_other_registers_another_period_and_another_group() {
    let task = BackgroundTask {
        first: 101,
        scratch: 50,
        group: 2,
        period: core::time::Duration::from_millis(12),
        ..BackgroundTask::default()
    };
    let text = task.program(&Rules::default()).unwrap().to_text(&Rules::default()).unwrap();
    assert!(text.contains("   2:  R[101:Life counter]=(R[101:Life counter]+1) ;"));
    assert!(text.contains("  17:  R[50:cy]=(COS[R[51]]) ;"));
    assert!(text.contains("  44:  R[116:SPD_Q1]=((R[109:Q_1]-R[59:POS_PREV_Q1])/.012) ;"));
    assert!(text.contains("($SCR_GRP[2].$MCH_POS_Z)") && !text.contains("SCR_GRP[1]"));
    let refused = |task: BackgroundTask| task.program(&Rules::default()).unwrap_err();
    let base = BackgroundTask::default;
    for (first, scratch) in [(1, 19), (18, 30), (0, 30), (1, 0), (65_530, 1), (1, 65_530)] {
        assert_eq!(
            refused(BackgroundTask { first, scratch, ..base() }),
            TaskError::Registers,
            "{first} {scratch}"
        );
    }
    for micros in [0, 500, 8_500, 1_000_000_000] {
        let period = core::time::Duration::from_micros(micros);
        assert_eq!(refused(BackgroundTask { period, ..base() }), TaskError::Period, "{micros} µs");
    }
    assert!(BackgroundTask { first: 11, scratch: 30, ..base() }.program(&Rules::default()).is_ok());
}
