//! The state of a controller before a program begins: registers, frames, signals and macros, from a file.

use std::path::Path;

use anyhow::{Context, Result, bail, ensure};
use fanuc_ls::{Index, Item, ItemKind};
use toml::Value;

use super::load::Macros;
use super::machine::{Machine, parsed};
use super::memory::{is_word, signal};
use super::position::RobotPosition;
use cellwire_sim::fanuc::Tables;

/// The file: lines such as `"R[1]" = 5`, and a table `[macros]` of names and programs.
#[derive(Debug, Default)]
pub struct Preset {
    /// The programs of macros, by the macros' names.
    pub macros: Macros,
    values: Vec<(String, Value)>,
}

impl Preset {
    /// Reads the file.
    ///
    /// # Errors
    /// If the file cannot be read, or is not TOML.
    pub fn read(path: &Path) -> Result<Self> {
        let text =
            std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
        Self::parse(&text).with_context(|| path.display().to_string())
    }

    fn parse(text: &str) -> Result<Self> {
        let mut preset = Self::default();
        for (name, value) in text.parse::<toml::Table>()? {
            let Value::Table(macros) = value else {
                preset.values.push((name, value));
                continue;
            };
            ensure!(name == "macros", "[{name}] is not a table of this file; the only one is [macros]");
            for (name, program) in macros {
                let program = program.as_str().with_context(|| format!("{name} = \"PROGRAM\" is a macro"))?;
                preset.macros.insert(name.to_uppercase(), program.to_owned());
            }
        }
        Ok(preset)
    }

    /// Gives a machine and the signals around it these values.
    ///
    /// # Errors
    /// A name is of nothing that is modelled, or does not take its value.
    pub fn apply(&self, machine: &mut Machine, tables: &mut Tables) -> Result<()> {
        for (name, value) in &self.values {
            set(name, value, machine, tables).with_context(|| name.clone())?;
        }
        Ok(())
    }
}

fn set(name: &str, value: &Value, machine: &mut Machine, tables: &mut Tables) -> Result<()> {
    let number = value.as_float().or_else(|| value.as_integer().map(|whole| whole as f64));
    let selected = value.as_integer().and_then(|n| u32::try_from(n).ok()).filter(|n| *n <= 61);
    match name {
        "UFRAME_NUM" | "UTOOL_NUM" => {
            let selected = Some(selected.context("a frame is a number, 0 to 61")?);
            let slot = if name == "UFRAME_NUM" { &mut machine.frame } else { &mut machine.tool };
            *slot = selected;
            return Ok(());
        }
        _ if name.starts_with('$') => {
            machine.memory.system.insert(name.to_owned(), number.context("give a number")?);
            return Ok(());
        }
        _ => {}
    }
    let (kind, n) = match parsed(name) {
        Some(Item { kind, index: Index::Number(n), element: None, .. }) => (kind, n),
        _ => bail!("expected R[1], PR[1], SR[1], DI[1], F[1], UFRAME[1], UTOOL[1], UFRAME_NUM or $NAME"),
    };
    if let Some(signal) = signal(kind, n) {
        let bit = match value {
            Value::Boolean(bit) if !is_word(kind) => u16::from(*bit),
            Value::Integer(word) if is_word(kind) => u16::try_from(*word)?,
            _ => bail!("{}", if is_word(kind) { "give a number, 0 to 65535" } else { "give true or false" }),
        };
        machine.memory.set_signal(signal, bit, tables);
        return Ok(());
    }
    match kind {
        ItemKind::Register => drop(machine.memory.numbers.insert(n, number.context("give a number")?)),
        ItemKind::StringRegister => {
            machine.memory.strings.insert(n, value.as_str().context("give a text")?.to_owned());
        }
        ItemKind::PositionRegister => drop(machine.memory.positions.insert(n, place(value)?)),
        ItemKind::UserFrame | ItemKind::UserTool => {
            machine.memory.frames.insert((kind == ItemKind::UserTool, n), six(value)?);
        }
        _ => bail!("this kind cannot be preset"),
    }
    Ok(())
}

/// Parses `[X, Y, Z, W, P, R]`, or `{ joints = [J1, …, J6] }`.
fn place(value: &Value) -> Result<RobotPosition> {
    match value.get("joints") {
        Some(joints) => Ok(RobotPosition::Joints(six(joints)?)),
        None => Ok(RobotPosition::Cartesian { xyzwpr: six(value)?, folded: None }),
    }
}

fn six(value: &Value) -> Result<[f64; 6]> {
    let number = |value: &Value| value.as_float().or_else(|| value.as_integer().map(|whole| whole as f64));
    let numbers: Option<Vec<f64>> = value.as_array().and_then(|array| array.iter().map(number).collect());
    let six = numbers.and_then(|numbers| <[f64; 6]>::try_from(numbers).ok());
    six.context("give six numbers: [X, Y, Z, W, P, R]")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_preset_is_named() {
        assert_eq!(
            Preset::parse("[other]\na = 1").unwrap_err().to_string(),
            "[other] is not a table of this file; the only one is [macros]"
        );
        let preset = Preset::parse("\"R[1]\" = 5\n[macros]\n\"Open hand\" = \"OPEN\"").unwrap();
        assert_eq!(preset.macros.get("OPEN HAND").map(String::as_str), Some("OPEN"));
        assert_eq!(preset.values.len(), 1);
        assert!(six(&Value::Array(vec![Value::Integer(1); 5])).is_err());
    }
}
