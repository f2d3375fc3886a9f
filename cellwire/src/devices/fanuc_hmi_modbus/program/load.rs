//! Loads LS files for the simulator, and lists their instructions that it does not simulate.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::Arc;

use anyhow::{Context, Result};
use fanuc_ls::{Document, Instruction, Mistake, Motion, MotionKind, Operation, Problem, Program, Rules};

/// A program that runs.
#[derive(Debug)]
pub struct LoadedProgram {
    /// The contents of the LS file.
    pub program: Program,
    /// The instructions of the program.
    pub steps: Vec<Step>,
}

/// An instruction that runs.
#[derive(Debug, Clone)]
pub enum Step {
    /// A motion of the robot.
    Motion(Box<Motion>),
    /// An instruction that is not a motion, and is simulated.
    Operation(Box<Operation>),
    /// No effect: a comment, or an instruction that is not simulated.
    Pass,
}

/// The programs that a program needs, by their names in capitals.
pub type Programs = BTreeMap<String, Arc<LoadedProgram>>;

/// The programs of macros, by the names of these in capitals.
pub type Macros = BTreeMap<String, String>;

/// Something of the programs that the simulation does not do, or does otherwise.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Finding {
    /// The name of its event: `not_modelled`, or `not_understood` of an instruction.
    event: &'static str,
    /// The unsupported part, and the simulation's behaviour instead.
    pub what: String,
    /// In which programs and lines, as `NAME:3`.
    pub places: Vec<String>,
}

/// Reads a program and the programs that it calls, in the same folder. Returns its name, all programs, and the instructions
/// that are not simulated, each once.
///
/// # Errors
/// If the file cannot be read, or a controller would not take it.
pub fn load(path: &Path, macros: &Macros) -> Result<(String, Programs, Vec<Finding>)> {
    let mut programs = Programs::new();
    let mut survey = Survey::default();
    let first = read(path, macros)?;
    let main = first.program.name.to_uppercase();
    let mut open = vec![first];
    while let Some(loaded) = open.pop() {
        let name = loaded.program.name.to_uppercase();
        survey.look(&name, &loaded, macros);
        let calls =
            (1..).zip(&loaded.steps).filter_map(|(line, step)| Some((line, step.called()?.to_uppercase())));
        let calls: Vec<(usize, String)> = calls.collect();
        programs.insert(name.clone(), Arc::new(loaded));
        for (line, called) in calls {
            let known = programs.contains_key(&called)
                || open.iter().any(|other: &LoadedProgram| other.program.name.to_uppercase() == called);
            if known {
                continue;
            }
            match beside(path, &called) {
                Some(path) => open.push(read(&path, macros)?),
                None => {
                    let what = format!("CALL {called} is skipped: no {called}.LS in the program's folder");
                    survey.add(what, &name, line);
                }
            }
        }
    }
    Ok((main, programs, survey.findings()))
}

fn read(path: &Path, macros: &Macros) -> Result<LoadedProgram> {
    let bytes = std::fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
    parse(&bytes, macros, || format!("{}: `cellwire ls check` shows more", path.display()))
}

/// Loads a program that calls no other one.
///
/// # Errors
/// If a controller would not take it.
pub fn load_text(text: &str) -> Result<(String, Programs)> {
    let loaded = parse(text.as_bytes(), &Macros::new(), || "the program is invalid".into())?;
    let name = loaded.program.name.to_uppercase();
    Ok((name.clone(), Programs::from([(name, Arc::new(loaded))])))
}

fn parse(bytes: &[u8], macros: &Macros, wrong: impl Fn() -> String) -> Result<LoadedProgram> {
    let document = Document::decode_bytes(bytes).with_context(&wrong)?;
    let program = document.program().with_context(&wrong)?;
    // A controller does not run a block without its end.
    let is_block = |problem: &Problem| {
        use Mistake::{Crossed, NotOpen, Open, RepeatedElse};
        matches!(problem, Problem::Mistake(Open { .. } | NotOpen { .. } | Crossed { .. } | RepeatedElse))
    };
    let findings = document.findings(&Rules::default());
    if let Some(finding) = findings.iter().find(|finding| is_block(&finding.problem)) {
        return Err(anyhow::anyhow!("{finding}").context(wrong()));
    }
    let steps = program.instructions.iter().map(|instruction| Step::of(instruction, macros)).collect();
    Ok(LoadedProgram { program, steps })
}

/// Returns the file of a program in the folder of another one, in upper or lower case.
fn beside(path: &Path, name: &str) -> Option<std::path::PathBuf> {
    let folder = path.parent().filter(|folder| *folder != Path::new("")).unwrap_or(Path::new("."));
    let entries = std::fs::read_dir(folder).ok()?;
    entries.filter_map(|entry| Some(entry.ok()?.path())).find(|path| {
        let is = |part: Option<&std::ffi::OsStr>, text: &str| {
            part.is_some_and(|part| part.eq_ignore_ascii_case(text))
        };
        is(path.file_stem(), name) && is(path.extension(), "ls")
    })
}

impl LoadedProgram {
    /// Returns the numbers of the registers `R[n]` that the program's instructions name.
    pub fn registers(&self) -> BTreeSet<u32> {
        let text = self.program.to_text(&Rules::default()).unwrap_or_default();
        let lines = text
            .lines()
            .skip_while(|line| !line.starts_with("/MN"))
            .take_while(|line| !line.starts_with("/POS"));
        lines.flat_map(registers).collect()
    }
}

/// Returns the numbers of `R[n]` in a line; a longer name that ends like that, such as `PR[n]`, is not a register.
fn registers(line: &str) -> impl Iterator<Item = u32> {
    line.match_indices("R[").filter_map(|(at, name)| {
        let before = line.get(..at)?.chars().next_back();
        let inside = line.get(at + name.len()..)?;
        let digits = inside.find(|c: char| !c.is_ascii_digit()).and_then(|end| inside.get(..end))?;
        digits.parse().ok().filter(|_| !before.is_some_and(|c| c.is_alphanumeric() || c == '_'))
    })
}

impl Finding {
    /// Returns the finding as a line of JSON: the first places, and how many there are.
    pub fn event(&self) -> serde_json::Value {
        let first: Vec<&String> = self.places.iter().take(5).collect();
        serde_json::json!({"event": self.event, "what": self.what, "at": first, "count": self.places.len()})
    }
}

impl Step {
    fn of(instruction: &Instruction, macros: &Macros) -> Self {
        match (instruction, instruction.operation()) {
            (Instruction::Motion(motion), _) => Self::Motion(Box::new(motion.clone())),
            (_, Some(Operation::Macro { name, arguments })) => match macros.get(&name.to_uppercase()) {
                Some(program) => {
                    Self::Operation(Box::new(Operation::Call { program: program.clone(), arguments }))
                }
                None => Self::Pass,
            },
            (_, operation) => operation.map_or(Self::Pass, |operation| Self::Operation(Box::new(operation))),
        }
    }

    /// Returns the program that the instruction calls, if it names one.
    fn called(&self) -> Option<&str> {
        let Self::Operation(operation) = self else { return None };
        match operation.action() {
            Operation::Call { program, .. } if !program.starts_with("SR[") => Some(program),
            _ => None,
        }
    }
}

#[derive(Default)]
struct Survey {
    /// The behaviour that differs from a controller, and where.
    otherwise: BTreeMap<String, Vec<String>>,
    /// The instructions that no rule reads, and where.
    not_understood: BTreeMap<String, Vec<String>>,
}

fn place(name: &str, line: usize) -> String {
    if line == 0 { name.to_owned() } else { format!("{name}:{line}") }
}

impl Survey {
    fn add(&mut self, what: impl Into<String>, name: &str, line: usize) {
        self.otherwise.entry(what.into()).or_default().push(place(name, line));
    }

    fn findings(self) -> Vec<Finding> {
        let skipped = self.not_understood.into_iter().map(|(text, places)| {
            let what = format!("`{text}` is skipped: `cellwire ls check` says what is wrong");
            Finding { event: "not_understood", what, places }
        });
        let otherwise = self.otherwise.into_iter();
        skipped
            .chain(otherwise.map(|(what, places)| Finding { event: "not_modelled", what, places }))
            .collect()
    }

    fn look(&mut self, name: &str, loaded: &LoadedProgram, macros: &Macros) {
        for (line, instruction) in (1..).zip(&loaded.program.instructions) {
            if matches!(instruction, Instruction::Other(text) if text.contains('$')) {
                self.add("system variables are 0 until set, and have no effect", name, line);
            }
            match instruction {
                Instruction::Motion(motion) => self.motion(name, line, motion),
                Instruction::Nested(_) => self.add("instructions of TB and TA are skipped", name, line),
                Instruction::Other(text) => match instruction.operation() {
                    Some(Operation::Macro { name, .. }) if macros.contains_key(&name.to_uppercase()) => {}
                    Some(Operation::Command { name: "SKIP CONDITION" | "OFFSET CONDITION", .. }) => {}
                    None | Some(Operation::Macro { .. }) => {
                        self.not_understood.entry(text.clone()).or_default().push(place(name, line));
                    }
                    Some(Operation::Command { .. } | Operation::Monitor(_) | Operation::When(..)) => {
                        self.add(format!("`{text}` is not modelled and skipped"), name, line)
                    }
                    Some(Operation::Run(_)) => self.add("RUN is skipped: there is one task", name, line),
                    Some(Operation::Payload(_)) => {
                        self.add("PAYLOAD is skipped: weights are not modelled", name, line)
                    }
                    Some(_) => {}
                },
                _ => {}
            }
        }
        for position in &loaded.program.positions {
            let number = position.number;
            if position.groups.len() > 1 || position.groups.iter().any(|group| group.axes.len() > 6) {
                self.add(
                    format!("axes beyond the sixth of the first group do not move (P[{number}] …)"),
                    name,
                    0,
                );
                break;
            }
        }
        for group in loaded.program.positions.iter().filter_map(|position| position.groups.first()) {
            for (number, kind, otherwise) in
                [(group.user_frame, "UFRAME", "the world frame"), (group.user_tool, "UTOOL", "the flange")]
            {
                if let Some(number @ 1..) = number {
                    let what = format!(
                        "{kind}[{number}] is {otherwise} until the program sets it: LS files do not contain it"
                    );
                    if !self.otherwise.contains_key(&what) {
                        self.add(what, name, 0);
                    }
                }
            }
        }
    }

    fn motion(&mut self, name: &str, line: usize, motion: &Motion) {
        match motion.kind {
            MotionKind::Spline if curves(motion) => {
                self.add("S runs as a cubic of the joints: its curve is not published", name, line)
            }
            MotionKind::Spline => self.add("S with an offset or Skip runs as a straight line", name, line),
            MotionKind::Arc => self.add("A runs as a straight line", name, line),
            MotionKind::Joint | MotionKind::Linear | MotionKind::Circular => {}
        }
        for option in motion.each_option() {
            let known = ["ACC", "Offset", "Tool_Offset,", "Skip,", "Interrupt,", "FINE"];
            let is_known = known.iter().any(|known| option.starts_with(known));
            let word: String = option.chars().take_while(|c| c.is_alphabetic() || *c == '_').collect();
            if !is_known && !word.is_empty() {
                self.add(format!("the motion option {word} is ignored"), name, line);
            }
        }
    }
}

/// Returns whether a motion is a part of a curve: an S without an offset and without Skip.
pub(super) fn curves(motion: &Motion) -> bool {
    let bends = |option: &&str| {
        ["Offset", "Tool_Offset", "Skip", "Interrupt"].iter().any(|name| option.starts_with(name))
    };
    motion.kind == MotionKind::Spline && !motion.each_option().iter().any(bends)
}
