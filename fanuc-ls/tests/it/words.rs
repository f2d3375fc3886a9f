//! The texts and the advice of all mistakes, word by word; and the text of parts of a motion.

use fanuc_ls::{
    AxisName, Block, Document, Expected, ItemKind, Level, Mistake, Problem, Reason, Rules, Speed, SpeedUnit,
    Syntax, Target, Termination, Warning,
};

const TAKEN: &str = "correct it: a controller would not take it";
const SPELLING: &str =
    "check its spelling; if an option of the controller has it, name it in a file (--instructions)";
const BLOCK: &str = "check which block it belongs to";
const FRAME: &str = "choose the position's frame before the motion, or teach it in the one that is chosen";

/// Returns each mistake with its level, its text and its advice.
fn mistakes() -> Vec<(Mistake, Level, &'static str, &'static str)> {
    use Level::{Error, Hint, Warning};
    let (number, axis) = (7, AxisName::J(2));
    vec![
        (Mistake::Expected { what: Expected::Comma }, Error, "expected `,`", TAKEN),
        (
            Mistake::Misspelled { word: "CALL" },
            Error,
            "unknown instruction or option: did you mean `CALL`?",
            TAKEN,
        ),
        (Mistake::Unknown, Hint, "the instruction is not known", SPELLING),
        (Mistake::UnknownOption, Hint, "the motion option is not known", SPELLING),
        (Mistake::UnknownItem, Hint, "unknown register, input or output", SPELLING),
        (
            Mistake::Similar { word: "Track" },
            Hint,
            "unknown instruction, similar to `Track`: it may be a macro",
            SPELLING,
        ),
        (
            Mistake::Edge,
            Error,
            "`ON+` and `OFF-` belong in a condition without parentheses",
            "use ON or OFF, or a condition without parentheses",
        ),
        (
            Mistake::PositionSum { found: 3 },
            Warning,
            "3 positions in one instruction: not every controller takes more than two",
            "add them two at a time",
        ),
        (
            Mistake::Acceleration { found: 500 },
            Hint,
            "ACC500: the manuals name 150 at most",
            "check the number: above 100, robots may shake and wear more",
        ),
        (
            Mistake::HighSpeed { highest: 4000, unit: SpeedUnit::MmPerSec },
            Hint,
            "the speed is above 4000mm/sec",
            "check the number, and the robot's greatest speed",
        ),
        (
            Mistake::Macro,
            Hint,
            "unknown instruction: it must be a macro",
            "check its spelling; name the controller's macros in a file",
        ),
        (
            Mistake::MissingProgram,
            Hint,
            "no program has this name",
            "check its spelling; it may be a KAREL program, or one that is not in this folder",
        ),
        (Mistake::Range { low: 1, high: 9 }, Error, "expected a number from 1 to 9", TAKEN),
        (Mistake::TooDeep, Error, "the instruction is too long, or its brackets are too deep", TAKEN),
        (Mistake::Arguments { expected: 3, found: 2 }, Error, "the function takes 3 values, not 2", TAKEN),
        (
            Mistake::MixedLogic,
            Error,
            "AND and OR are mixed without parentheses",
            "write it as mixed logic: one pair of parentheses around all of it, and one around each part",
        ),
        (Mistake::Untaught, Hint, "an operand is missing", "fill it in before the program runs"),
        (Mistake::ReadOnly { item: ItemKind::DigitalInput }, Error, "DI cannot be set", TAKEN),
        (
            Mistake::UndefinedLabel { number },
            Error,
            "there is no LBL[7]",
            "add the label, or correct the number",
        ),
        (
            Mistake::RepeatedLabel { number },
            Error,
            "LBL[7] is already defined",
            "give one of them another number, and its jumps as well",
        ),
        (Mistake::Open { block: Block::If }, Error, "IF … THEN has no ENDIF", "close it, or delete it"),
        (Mistake::Open { block: Block::For }, Error, "FOR has no ENDFOR", "close it, or delete it"),
        (Mistake::Open { block: Block::Select }, Error, "SELECT has no end", "close it, or delete it"),
        (Mistake::NotOpen { block: Block::Select }, Error, "no SELECT is open here", BLOCK),
        (Mistake::Crossed { block: Block::For }, Error, "FOR inside it is not closed", BLOCK),
        (Mistake::RepeatedElse, Error, "the block already has an ELSE", BLOCK),
        (
            Mistake::EmptyLoop,
            Warning,
            "the loop never runs: its first value is beyond its last",
            "change the values, or use DOWNTO or TO instead",
        ),
        (
            Mistake::Capitals { word: "CALL" },
            Hint,
            "controllers write `CALL`",
            "use this spelling: which controllers accept another one is unknown",
        ),
        (
            Mistake::SkipCondition,
            Hint,
            "the program has no SKIP CONDITION before this motion",
            "add one, unless the program that calls this one has it",
        ),
        (Mistake::Joint { number, axis }, Warning, "J2 of P[7] is beyond 720 degrees", "check the number"),
        (Mistake::Unreachable, Warning, "unreachable line", "delete it, or put a label before it"),
        (
            Mistake::NoGroup,
            Error,
            "DEFAULT_GROUP has no motion group: the program cannot move",
            "give the program a group, or take the motions out",
        ),
        (
            Mistake::Groups { number },
            Warning,
            "P[7] lacks motion groups of DEFAULT_GROUP",
            "teach the position with the program's groups",
        ),
        (Mistake::MissingAxis { number, axis }, Error, "P[7] has no J2", TAKEN),
        (Mistake::ForeignAxis { number, axis }, Error, "J2 of P[7] is duplicate or not allowed there", TAKEN),
        (Mistake::AxisUnit { number, axis }, Error, "J2 of P[7] has the wrong unit", TAKEN),
        (
            Mistake::Configuration { number },
            Error,
            "CONFIG of P[7] is not N or F, U or D, T or B, and turns from -8 to 7",
            TAKEN,
        ),
        (
            Mistake::Frame { number, found: 1, chosen: 2 },
            Warning,
            "P[7] has UF 1, but the program selected UFRAME_NUM=2",
            FRAME,
        ),
        (
            Mistake::Tool { number, found: 1, chosen: 2 },
            Warning,
            "P[7] has UT 1, but the program selected UTOOL_NUM=2",
            FRAME,
        ),
        (Mistake::Termination, Warning, "the motion has no FINE or CNT", "add FINE or CNT100"),
        (Mistake::Attribute, Error, "the attribute has a value that a controller does not take", TAKEN),
    ]
}

#[test]
fn every_mistake_says_what_it_is_how_bad_and_what_to_do() {
    for (mistake, level, text, advice) in mistakes() {
        let problem = Problem::Mistake(mistake);
        let said = (problem.level(), problem.to_string(), problem.advice());
        assert_eq!(said, (level, text.to_owned(), advice), "{mistake:?}");
        assert_eq!(problem.is_error(), level == Level::Error, "{mistake:?}");
    }
    let names = [Level::Hint, Level::Warning, Level::Error].map(Level::text);
    assert_eq!(names, ["hint", "warning", "error"]);
    assert_eq!(Problem::Error(Reason::Target).advice(), TAKEN);
    let warning = Warning::UndefinedPosition { number: 7 };
    assert_eq!(Problem::Warning(warning).advice(), "teach the position, or correct the number");
    assert!(Problem::Warning(Warning::SpeedUnit).is_error() && !Problem::Warning(warning).is_error());
}

#[test]
fn a_finding_says_where_it_is_in_characters() {
    let text = "/PROG  -A\n/MN\n   1:  CALL Ä ;\n   2:  R[1:ä]=5 5 ;\n/END\n";
    let findings = Document::decode(text).unwrap().findings(&Rules::default());
    // A name with one bar is not that of the editor's copy, which has two.
    assert_eq!(
        findings.iter().map(ToString::to_string).collect::<Vec<_>>(),
        [
            "line 1, column 8: the program's name is not letters, digits and `_`, or begins with a digit",
            "line 4, column 17: expected the end of the instruction",
        ]
    );
    let bars = |name: &str| {
        let text = text.replace("-A", name).replace("5 5", "5");
        Document::decode(&text).unwrap().findings(&Rules::default()).len()
    };
    assert_eq!(["-A", "A-", "-A-"].map(bars), [1, 1, 0]);
}

#[test]
fn parts_of_a_motion_are_written_as_in_a_program() {
    let named = Target::Position { number: 3, name: Some("home".into()) };
    let targets = [Target::position(3), Target::register(4), named, Target::Other("P[R[1]]".into())];
    assert_eq!(targets.map(|it| it.to_string()), ["P[3]", "PR[4]", "P[3:home]", "P[R[1]]"]);
    assert_eq!([SpeedUnit::Percent, SpeedUnit::InchPerMin].map(|it| it.to_string()), ["%", "inch/min"]);
    assert_eq!(Speed::mm_per_sec(0.5).to_string(), ".5mm/sec");
    let ends =
        [Termination::Fine, Termination::Continuous(0), Termination::ContinuousRegister("R[1]".into())];
    assert_eq!(ends.map(|it| it.to_string()), ["FINE", "CNT0", "CNT R[1]"]);
}

#[test]
fn every_option_has_its_form() {
    let forms: Vec<String> = Syntax::options().map(|it| it.to_string()).collect();
    assert_eq!(
        forms,
        [
            "`FINE`: stops at the target",
            "`ACCn`, n from 0 to 500, or a register",
            "`CDn`, n from 0 to 1000, or a register",
            "`CRn`, n from 0 to 1000, or a register",
            "`CTVn`, n from -100 to 100, or a register",
            "`PSPDn`, n from 0 to 500, or a register",
            "`AP_LDn`, n from 0 to 100000, or a register",
            "`RT_LDn`, n from 0 to 100000, or a register",
            "`RampTon`, n from 0 to 100000, or a register",
            "`Ind.EVn`, n from 0 to 100, or a register",
            "`EVn`, n from 0 to 100, or a register",
            "`Skip,LBL[n]`, and `,PR[m]=LPOS`: where the program goes on if the condition was not met",
            "`SkipJump,LBL[n]`, and `,PR[m]=LPOS`: where the program goes on if the condition was not met",
            "`Offset` or `Offset,PR[n]`: moves the target",
            "`Tool_Offset` or `Tool_Offset,PR[n]`: moves the target",
            "`VOFFSET` or `VOFFSET,PR[n]`: moves the target",
            "`TB n sec, action`: before the target by this time",
            "`TA n sec, action`: after the target by this time",
            "`DB n mm, action`: before the target by this distance",
            "`DA n mm, action`: after the target by this distance",
            "`PTH`",
            "`ALIMn`, n from 0 to 100000, or a register",
            "`FPLIN`",
            "`ORNT_BASE …`, as the manual of its option describes",
            "`TA_REF …`, as the manual of its option describes",
            "`COORD` or `COORD[n]`: in the frame of another group",
            "`INC`",
            "`Wjnt`",
            "`RTCP`",
            "`MROT`",
            "`BREAK`",
            "`COND`",
            "`CALL …`, as the manual of its option describes",
            "`Arc Start[…]`, as the manual of its option describes",
            "`Arc End[…]`, as the manual of its option describes",
            "`Weld Start[…]`, as the manual of its option describes",
            "`Weld End[…]`, as the manual of its option describes",
            "`Weave …`, as the manual of its option describes",
            "`Search[…]`, as the manual of its option describes",
            "`SPOT[…]`, as the manual of its option describes",
            "`PRESSURE[…]`, as the manual of its option describes",
            "`Touch[…]`, as the manual of its option describes",
            "`TC …`, as the manual of its option describes",
        ]
    );
}

#[test]
fn a_document_has_what_follows_its_name() {
    let kind = |head: &str| {
        let document = Document::decode(&format!("{head}\n/MN\n/END\n")).unwrap();
        (document.name().to_owned(), document.kind().map(str::to_owned))
    };
    assert_eq!(kind("/PROG  A\t  Macro "), ("A".into(), Some("Macro".into())));
    assert_eq!(kind("/PROG  A  "), ("A".into(), None));
}
