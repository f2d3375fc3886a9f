//! The background task that feeds the telemetry, as a program.

use std::time::Duration;

use fanuc_ls::{Builder, EncodeError, Program, Rules};

/// The source's background task (its Figure 8): in each period the controller puts a life counter, the override, the
/// tool's pose, its quaternion and their differences into registers that can be read over Modbus.
///
/// `Default` is the figure to the letter. Its results have three properties that the reader must know and undo, as
/// [`Tracker`](cellwire_motion::Tracker) does:
///
/// - it makes Q1 positive, so the quaternion jumps to its negative near 180°, and its difference with it;
/// - it divides by the period although a period may be lost;
/// - its first difference is taken against unset registers.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BackgroundTask {
    /// The name of the program.
    pub name: String,
    /// The COMMENT of the program.
    pub comment: String,
    /// The period of the task: 8 ms, the interpolation period of most controllers. 1 ms to 999 s, in whole ms.
    pub period: Duration,
    /// The number of the life counter's register, followed by 18 more (override, X Y Z W P R, Q1 to Q4, and seven speeds).
    pub first: u16,
    /// The number of the first of 13 scratch registers of the task. They must not be among the other 19.
    pub scratch: u16,
    /// The motion group to observe, from 1.
    pub group: u8,
}

impl Default for BackgroundTask {
    fn default() -> Self {
        Self {
            name: "BG_TELEMETRY".to_string(),
            comment: "Modbus telemetry".to_string(),
            period: Duration::from_millis(8),
            first: 1,
            scratch: 30,
            group: 1,
        }
    }
}

const PUBLIC: u16 = 19;
const SCRATCH: u16 = 13;

impl BackgroundTask {
    /// Returns the task as a program without a motion group, as a background task must be.
    ///
    /// # Errors
    /// If the registers overlap or are outside 1 to 65535, the period is not within its range, or the name or the comment is
    /// not valid by these rules.
    pub fn program(&self, rules: &Rules) -> Result<Program, TaskError> {
        let (first, scratch) = (u32::from(self.first), u32::from(self.scratch));
        let apart = first + u32::from(PUBLIC) <= scratch || scratch + u32::from(SCRATCH) <= first;
        let last = (first + u32::from(PUBLIC)).max(scratch + u32::from(SCRATCH));
        if !apart || first == 0 || scratch == 0 || last > u32::from(u16::MAX) {
            return Err(TaskError::Registers);
        }
        let whole = self.period.subsec_nanos().is_multiple_of(1_000_000);
        if !whole || self.period.is_zero() || self.period > Duration::from_secs(999) {
            return Err(TaskError::Period);
        }
        let mut builder = Builder::new(&self.name);
        builder.comment(&self.comment).motion_groups("*,*,*,*,*");
        for line in LINES {
            builder.instruction(&self.fill(line));
        }
        Ok(builder.build(rules)?)
    }

    /// Returns the period as controllers print it: `.008`, `1.000`.
    fn seconds(&self) -> String {
        let text = format!("{:.3}", self.period.as_secs_f64());
        text.strip_prefix('0').unwrap_or(&text).into()
    }

    /// Returns a line of the figure with this task's registers in place of the figure's.
    fn fill(&self, line: &str) -> String {
        let mut text = String::new();
        let mut rest = line;
        while let Some((before, after)) = rest.split_once("R[") {
            text.push_str(before);
            let digits: String = after.chars().take_while(char::is_ascii_digit).collect();
            let number = digits.parse::<u16>().unwrap_or(0);
            let number = if number < 30 { number + self.first - 1 } else { number - 30 + self.scratch };
            text += &format!("R[{number}");
            rest = after.get(digits.len()..).unwrap_or("");
        }
        text.push_str(rest);
        let group = format!("$SCR_GRP[{}]", self.group);
        text.replace("/.008)", &format!("/{})", self.seconds())).replace("$SCR_GRP[1]", &group)
    }
}

/// The reason that a task is invalid.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum TaskError {
    /// The registers overlap, or are not in 1..=65535.
    #[error("the registers of the background task overlap, or are outside 1 to 65535")]
    Registers,
    /// The period is not 1 ms to 999 s in whole ms.
    #[error("the period of the background task must be 1 ms to 999 s, in whole ms")]
    Period,
    /// The name or the comment is not valid by the rules.
    #[error(transparent)]
    Encode(#[from] EncodeError),
}

/// Figure 8, line by line.
const LINES: [&str; 56] = [
    "! Sign of life counter",
    "R[1:Life counter]=(R[1:Life counter]+1)",
    "",
    "! Actual Override",
    "R[2:Override]=($MCR.$GENOVERRIDE)",
    "",
    "! Cartesian pos WORLD",
    "R[3:POS_X]=($SCR_GRP[1].$MCH_POS_X)",
    "R[4:POS_Y]=($SCR_GRP[1].$MCH_POS_Y)",
    "R[5:POS_Z]=($SCR_GRP[1].$MCH_POS_Z)",
    "R[6:POS_W]=($SCR_GRP[1].$MCH_POS_W)",
    "R[7:POS_P]=($SCR_GRP[1].$MCH_POS_P)",
    "R[8:POS_R]=($SCR_GRP[1].$MCH_POS_R)",
    "",
    "!Quaternions",
    "R[31:sy]=R[8:POS_R]*.5",
    "R[30:cy]=(COS[R[31]])",
    "R[31:sy]=(SIN[R[31]])",
    "R[33:sp]=R[7:POS_P]*.5",
    "R[32:cp]=(COS[R[33]])",
    "R[33:sp]=(SIN[R[33]])",
    "R[35:sr]=R[6:POS_W]*.5",
    "R[34:cr]=(COS[R[35]])",
    "R[35:sr]=(SIN[R[35]])",
    "R[9:Q_1]=(R[34:cr]*R[32:cp]*R[30:cy]+R[35:sr]*R[33:sp]*R[31:sy])",
    "R[10:Q_2]=(R[35:sr]*R[32:cp]*R[30:cy]-R[34:cr]*R[33:sp]*R[31:sy])",
    "R[11:Q_3]=(R[34:cr]*R[33:sp]*R[30:cy]+R[35:sr]*R[32:cp]*R[31:sy])",
    "R[12:Q_4]=(R[34:cr]*R[32:cp]*R[31:sy]-R[35:sr]*R[33:sp]*R[30:cy])",
    "",
    "!Q1 > 0",
    "IF (R[9:Q_1]<0) THEN",
    "R[9:Q_1]=(0-R[9:Q_1])",
    "R[10:Q_2]=(0-R[10:Q_2])",
    "R[11:Q_3]=(0-R[11:Q_3])",
    "R[12:Q_4]=(0-R[12:Q_4])",
    "ENDIF",
    "",
    "! Cartesian axes speed calc",
    "R[13:SPD_X]=(($SCR_GRP[1].$MCH_POS_X-R[36:POS_PREV_X])/.008)",
    "R[14:SPD_Y]=(($SCR_GRP[1].$MCH_POS_Y-R[37:POS_PREV_Y])/.008)",
    "R[15:SPD_Z]=(($SCR_GRP[1].$MCH_POS_Z-R[38:POS_PREV_Z])/.008)",
    "",
    "!Quaternions difference calc",
    "R[16:SPD_Q1]=((R[9:Q_1]-R[39:POS_PREV_Q1])/.008)",
    "R[17:SPD_Q2]=((R[10:Q_2]-R[40:POS_PREV_Q2])/.008)",
    "R[18:SPD_Q3]=((R[11:Q_3]-R[41:POS_PREV_Q3])/.008)",
    "R[19:SPD_Q4]=((R[12:Q_4]-R[42:POS_PREV_Q4])/.008)",
    "",
    "! Store positions for speed calc",
    "R[36:POS_PREV_X]=($SCR_GRP[1].$MCH_POS_X)",
    "R[37:POS_PREV_Y]=($SCR_GRP[1].$MCH_POS_Y)",
    "R[38:POS_PREV_Z]=($SCR_GRP[1].$MCH_POS_Z)",
    "R[39:POS_PREV_Q1]=(R[9:Q_1])",
    "R[40:POS_PREV_Q2]=(R[10:Q_2])",
    "R[41:POS_PREV_Q3]=(R[11:Q_3])",
    "R[42:POS_PREV_Q4]=(R[12:Q_4])",
];
