//! `reference/states/<link>.json`: every cell of every machine, from the rows in testkit or from the matrix that a link still has as a text.

use std::path::Path;

use anyhow::{Context, Result};

use crate::json::{self, Object};

/// The crate of the operator's latch, which is no link, and has states alone.
pub(crate) const LATCH: &str = "cellwire-motion";

/// What a machine does in a state with an input; no `to`: the input is not expected.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Cell {
    pub(crate) machine: String,
    pub(crate) state: String,
    pub(crate) input: String,
    pub(crate) to: Option<String>,
    pub(crate) actions: String,
}

/// The cells of a link whose rows testkit has.
fn tables(link: &str) -> Option<Vec<testkit::model::Cell>> {
    use testkit::links;
    use testkit::model::cells;
    Some(match link {
        "isra-ball" => {
            [cells::<links::isra_ball::rows::Host>(), cells::<links::isra_ball::rows::Ball>()].concat()
        }
        "val2-viewer" => {
            [cells::<links::val2_viewer::rows::Host>(), cells::<links::val2_viewer::rows::Workstation>()]
                .concat()
        }
        "kawasaki-msg" => cells::<links::kawasaki_msg::rows::Pc>(),
        "val2-alter" => {
            [cells::<links::val2_alter::rows::Host>(), cells::<links::val2_alter::rows::Controller>()]
                .concat()
        }
        "laser-eb90" => {
            [cells::<links::laser_eb90::rows::Host>(), cells::<links::laser_eb90::rows::Controller>()]
                .concat()
        }
        "fanuc-hmi-modbus" => {
            use links::fanuc_hmi_modbus::rows::{Client, Rtu, RtuOverTcp, Server, Tcp};
            [
                cells::<Client<Tcp>>(),
                cells::<Client<Rtu>>(),
                cells::<Client<RtuOverTcp>>(),
                cells::<Server<Tcp>>(),
                cells::<Server<Rtu>>(),
                cells::<Server<RtuOverTcp>>(),
            ]
            .concat()
        }
        "mmacell-proto" => {
            use links::mmacell_proto::rows::{Central, Device, Moved, Progress};
            [cells::<Central>(), cells::<Progress>(), cells::<Device>(), cells::<Moved>()].concat()
        }
        LATCH => cells::<links::latch::rows::Operator>(),
        _ => return None,
    })
}

/// A file, the machine that it begins with if the file does not name it, and the state and the name of the second one in it.
type Matrix = (&'static str, &'static str, Option<(&'static str, &'static str)>);

/// A link's matrices.
fn matrices(link: &str) -> &'static [Matrix] {
    match link {
        "kawasaki-msg" => &[("robot_matrix.txt", "robot", None)],
        _ => &[],
    }
}

/// The text of a link's file.
pub(crate) fn file(root: &Path, link: &str) -> Result<Option<String>> {
    let mut lines = Vec::new();
    for cell in cells(root, link)? {
        let object = Object::new()
            .value("machine", &cell.machine)?
            .value("state", &cell.state)?
            .value("input", &cell.input)?;
        let object = match &cell.to {
            None => object.raw("unexpected", true),
            Some(to) => object.value("to", to)?,
        };
        let has_actions = !matches!(cell.actions.as_str(), "" | "None" | "Nothing");
        lines.push(object.optional("actions", has_actions.then_some(&cell.actions))?.end());
    }
    Ok(Some(json::file("states.schema.json", &[("link", json::text(link)?)], "cells", &lines)))
}

/// Every cell of a link.
pub(crate) fn cells(root: &Path, link: &str) -> Result<Vec<Cell>> {
    let mut cells: Vec<Cell> = tables(link)
        .unwrap_or_default()
        .into_iter()
        .map(|cell| Cell {
            machine: cell.end.into(),
            state: cell.state,
            input: cell.input,
            to: cell.to,
            actions: cell.action,
        })
        .collect();
    for (file, first, second) in matrices(link) {
        let path = root.join(link).join("tests").join(file);
        let text = std::fs::read_to_string(&path).with_context(|| path.display().to_string())?;
        let (mut machine, mut state) = ((*first).to_owned(), String::new());
        let lines: Vec<&str> = text.lines().collect();
        for (index, line) in lines.iter().enumerate() {
            let next_is_blank = lines.get(index + 1).is_some_and(|next| next.is_empty());
            if line.is_empty() {
                continue;
            }
            if let Some(cell) = line.strip_prefix("    ") {
                cells.push(nested(&machine, &state, cell).with_context(|| format!("{file}: {line}"))?);
            } else if let Some((place, result)) = line.split_once(" -> ") {
                let (state, input) = place
                    .split_once(" × ")
                    .or_else(|| place.split_once(" + "))
                    .with_context(|| (*line).to_owned())?;
                if let Some((_, name)) = second.filter(|(begins, _)| *begins == state) {
                    machine = name.to_owned();
                }
                cells.push(cell(&machine, state, input, result));
            } else if next_is_blank {
                machine = (*line).to_owned();
            } else if let Some((name, found)) =
                line.split_once(": ").filter(|_| machine.is_empty() || !line.contains('{'))
            {
                (machine, state) = (name.to_owned(), found.to_owned());
            } else {
                state = (*line).to_owned();
            }
        }
    }
    Ok(cells)
}

fn nested(machine: &str, state: &str, line: &str) -> Option<Cell> {
    let (input, result) = line.split_once(" → ").or_else(|| line.split_once(": "))?;
    Some(cell(machine, state, input, result))
}

fn cell(machine: &str, state: &str, input: &str, result: &str) -> Cell {
    let (to, actions) = match result {
        "unexpected" => (None, ""),
        _ => {
            let (to, actions) = result
                .split_once("; ")
                .or_else(|| result.split_once(" / "))
                .or_else(|| {
                    last_comma(result).and_then(|at| Some((result.get(..at)?, result.get(at + 2..)?)))
                })
                .unwrap_or((result, ""));
            (Some(to.to_owned()), actions)
        }
    };
    let [machine, state, input, actions] = [machine, state, input, actions].map(str::to_owned);
    Cell { machine, state, input, to, actions }
}

/// The last comma that is in no bracket.
fn last_comma(text: &str) -> Option<usize> {
    let (mut depth, mut last) = (0_i32, None);
    for (at, c) in text.char_indices() {
        match c {
            '{' | '(' | '[' => depth += 1,
            '}' | ')' | ']' => depth -= 1,
            ',' if depth == 0 => last = Some(at),
            _ => {}
        }
    }
    last
}
