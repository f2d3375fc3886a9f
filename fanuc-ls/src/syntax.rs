//! The forms of instructions and motion options, in words for a person: from the tables that read them.

use alloc::format;
use alloc::string::{String, ToString};
use core::fmt;
use core::ops::RangeInclusive;

use crate::expression::ItemKind;
use crate::grammar::{Form, OPTIONS, ROWS};
use crate::motion::MotionKind;

/// The form of an instruction or of a motion option.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Syntax {
    /// The spellings of its words: in English, then on controllers set to German.
    pub words: &'static [&'static str],
    /// The text that may follow the words, with the ranges of numbers, as markdown, such as `` `UALM[n]`, n from 1 to 9999 ``.
    pub form: String,
}

impl Syntax {
    /// Returns the instructions that begin with a word, in the sequence of the table that parses them.
    pub fn instructions() -> impl Iterator<Item = Self> {
        ROWS.iter().map(|row| {
            let word = row.words.first().copied().unwrap_or("");
            let form = match &row.form {
                Form::Alone(_) => format!("`{word}`"),
                Form::Index(low, high) | Form::IndexOfGroup(low, high) => {
                    format!("`{word}[n]`, n from {low} to {high}")
                }
                Form::Set(low, high) => format!("`{word}=value`, a number from {low} to {high}"),
                Form::Value(low, high) => format!("`{word} value`, a number from {low} to {high}"),
                Form::State => format!("`{word}=ON`, `{word}=OFF`, or a condition"),
                Form::Condition => format!("`{word} condition`"),
                Form::Text => format!("`{word} …`, as the manual of its option describes"),
                Form::Own(_) => own(word).to_string(),
            };
            Self { words: row.words, form }
        })
    }

    /// Returns the words that may follow the speed of a motion.
    pub fn options() -> impl Iterator<Item = Self> {
        OPTIONS.iter().map(|choice| {
            let word = choice.words.first().copied().unwrap_or("");
            Self { words: choice.words, form: option(word) }
        })
    }

    /// Returns the form of a motion.
    pub fn motion(kind: MotionKind) -> &'static str {
        match kind {
            MotionKind::Joint => {
                "`J P[n] speed FINE|CNTn options`: every joint arrives at the same time; speed above 0 to 100 %, or in sec or msec"
            }
            MotionKind::Linear => {
                "`L P[n] speed FINE|CNTn options`: a straight line; speed above 0, in mm/sec, cm/min, inch/min, deg/sec, sec or msec"
            }
            MotionKind::Circular => {
                "`C P[n]` and on the next line `P[m] speed FINE|CNTn options`: an arc through P[n] to P[m]"
            }
            MotionKind::Arc => "`A P[n] speed FINE|CNTn options`: an arc through the neighbouring A points",
            MotionKind::Spline => {
                "`S P[n] speed FINE|CNTn options`: a spline through the neighbouring S points"
            }
        }
    }
}

impl fmt::Display for Syntax {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.form)
    }
}

impl ItemKind {
    /// Returns the kind in words: `position register`.
    pub fn text(self) -> &'static str {
        match self {
            Self::Register => "numeric register",
            Self::PositionRegister => "position register",
            Self::StringRegister => "string register",
            Self::Position => "position",
            Self::Argument => "argument of the call",
            Self::Flag => "flag",
            Self::Marker => "marker",
            Self::DigitalInput => "digital input",
            Self::DigitalOutput => "digital output",
            Self::RobotInput => "robot input",
            Self::RobotOutput => "robot output",
            Self::GroupInput => "group input",
            Self::GroupOutput => "group output",
            Self::AnalogInput => "analog input",
            Self::AnalogOutput => "analog output",
            Self::OperatorInput => "operator panel input",
            Self::OperatorOutput => "operator panel output",
            Self::UserInput => "user operator panel input",
            Self::UserOutput => "user operator panel output",
            Self::Timer => "timer",
            Self::UserFrame => "user frame",
            Self::UserTool => "tool frame",
            Self::Label => "label",
            Self::VisionRegister => "vision register",
            Self::PalletRegister => "pallet register",
            Self::WeldInput => "weld input",
            Self::WeldOutput => "weld output",
            Self::WireInput => "wire stick input",
            Self::WireOutput => "wire stick output",
            Self::TimerOverflow => "overflow of a timer",
            Self::ToolSpeed => "tool speed",
            Self::SpotInput => "spot input",
            Self::SpotOutput => "spot output",
            Self::Semaphore => "semaphore",
        }
    }

    /// Returns the numbers that a controller can have for the kind.
    pub fn numbers(self) -> RangeInclusive<u32> {
        self.range()
    }
}

/// Returns the instructions whose forms are functions.
fn own(word: &str) -> &'static str {
    match word {
        "IF" => {
            "`IF condition, action`, or `IF (condition) THEN` with `ELSE` and `ENDIF` on lines of their own"
        }
        "ELSE" => "`ELSE` of the IF above, or `ELSE, action` of the SELECT above",
        "SELECT" => "`SELECT R[n]=value, action`, then `=value, action` and `ELSE, action` on the next lines",
        "CASE" => "`=value, action`: another case of the SELECT above",
        "FOR" => "`FOR R[n]=value TO value` or `DOWNTO value`, with `ENDFOR` on a line of its own",
        "WAIT" => "`WAIT n(sec)`, n 0 or more; or `WAIT condition`, and `TIMEOUT,LBL[n]`",
        "CALL" => "`CALL PROGRAM(argument, …)`: goes on when the program has ended",
        "RUN" => "`RUN PROGRAM`: starts the program, and goes on",
        "JMP" => "`JMP LBL[n]`",
        "LBL" => "`LBL[n:name]`, n from 1 to 32767",
        "MESSAGE" => "`MESSAGE[text]`",
        "RSR" => "`RSR[n]=ENABLE` or `DISABLE`, n from 1 to 8",
        "UFRAME_NUM" => "`UFRAME_NUM=n`, n from 0 to 61",
        "UTOOL_NUM" => "`UTOOL_NUM=n`, n from 0 to 30",
        "OVERRIDE" => "`OVERRIDE=n%`, n from 1 to 100",
        "MONITOR" => "`MONITOR PROGRAM`: looks at the conditions of a program from here on",
        "WHEN" => "`WHEN condition, action`: a condition of a program that is monitored",
        "SEND" => "`SEND R[n]`: a number for a sensor",
        "RCV" => "`RCV R[n],LBL[m]`: a number from a sensor; without one, the program goes on at the label",
        _ => "",
    }
}

fn option(word: &str) -> String {
    let number = |low: i32, high: i32| format!("`{word}n`, n from {low} to {high}, or a register");
    match word {
        "ACC" | "PSPD" => number(0, 500),
        "CD" | "CR" => number(0, 1000),
        "CTV" => number(-100, 100),
        "EV" | "Ind.EV" => number(0, 100),
        "AP_LD" | "RT_LD" | "RampTo" | "ALIM" => number(0, 100_000),
        "Skip" | "SkipJump" => format!(
            "`{word},LBL[n]`, and `,PR[m]=LPOS`: where the program goes on if the condition was not met"
        ),
        "Offset" | "Tool_Offset" | "VOFFSET" => format!("`{word}` or `{word},PR[n]`: moves the target"),
        "TB" | "TA" => format!("`{word} n sec, action`: {} the target by this time", before_or_after(word)),
        "DB" | "DA" => {
            format!("`{word} n mm, action`: {} the target by this distance", before_or_after(word))
        }
        "COORD" => "`COORD` or `COORD[n]`: in the frame of another group".to_string(),
        "FINE" => "`FINE`: stops at the target".to_string(),
        "Arc Start" | "Arc End" | "Weld Start" | "Weld End" | "Search" | "SPOT" | "PRESSURE" | "Touch" => {
            format!("`{word}[…]`, as the manual of its option describes")
        }
        "ORNT_BASE" | "TA_REF" | "CALL" | "Weave" | "TC" => {
            format!("`{word} …`, as the manual of its option describes")
        }
        _ => format!("`{word}`"),
    }
}

fn before_or_after(word: &str) -> &'static str {
    if word.ends_with('B') { "before" } else { "after" }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_row_has_a_form() {
        for syntax in Syntax::instructions().chain(Syntax::options()) {
            assert!(syntax.form.contains('`'), "{syntax:?}");
        }
        let alarm = Syntax::instructions().find(|syntax| syntax.words[0] == "UALM").unwrap();
        assert_eq!(alarm.to_string(), "`UALM[n]`, n from 1 to 9999");
        assert_eq!(alarm.words, ["UALM", "BALM"]);
    }
}
