//! What testkit's tables call the states and the inputs of an end's machine.

use core::time::Duration;

use cellwire_links::end::End;
use serde_json::{Map, Value};
use testkit::links;
use testkit::model::Rows;

type Moves<M> = Option<Vec<(Duration, M, <M as robot_session::Machine>::Input)>>;

/// What an end is called in the tables: where its configuration chooses the table, too.
pub(super) struct Names {
    /// The cells that were reached since it was asked last; from the first time on they are noted.
    pub(super) cells: Cells,
    /// What a story calls the state.
    pub(super) state: fn(&dyn End) -> String,
}

type Cells = fn(&mut dyn End) -> Vec<String>;

/// The names of an end.
pub(super) fn names(link: &str, end: &str, _config: &Map<String, Value>) -> Names {
    let (cells, state): (Cells, fn(&dyn End) -> String) = match (link, end) {
        ("isra-ball", "host") => (cells::<links::isra_ball::rows::Host>, name),
        ("isra-ball", _) => (cells::<links::isra_ball::rows::Ball>, name),
        _ => (|_| Vec::new(), name),
    };
    Names { cells, state }
}

fn name(end: &dyn End) -> String {
    end.state().into()
}

fn cells<R: Rows<Machine: 'static>>(end: &mut dyn End) -> Vec<String> {
    reached(end, cell::<R>)
}

/// The cell of a table, if it has one: `state: input`.
fn cell<R: Rows>(
    machine: &R::Machine,
    at: Duration,
    input: &<R::Machine as robot_session::Machine>::Input,
) -> Vec<String> {
    let column = R::column_at(machine, at, input);
    if column.is_empty() { Vec::new() } else { vec![format!("{}: {column}", R::row(machine, at))] }
}

fn reached<M: robot_session::Machine + 'static>(
    end: &mut dyn End,
    cells: impl Fn(&M, Duration, &M::Input) -> Vec<String>,
) -> Vec<String> {
    let moves = end.moves().downcast_mut::<Moves<M>>().and_then(|moves| moves.replace(Vec::new()));
    moves.into_iter().flatten().flat_map(|(at, machine, input)| cells(&machine, at, &input)).collect()
}
