//! The names of the states and inputs of an end's machine in testkit's tables.

use core::time::Duration;

use cellwire_links::end::End;
use kawasaki_msg::pc::machine as pc;
use kawasaki_msg::robot::machine as robot;
use serde_json::{Map, Value};
use testkit::links::{self, fanuc_hmi_modbus::rows, kawasaki_msg::rows as kawasaki};
use testkit::model::Rows;

type Moves<M> = Option<Vec<(Duration, M, <M as robot_session::end::Machine>::Input)>>;

/// The names of an end in the tables; its configuration may choose the table.
pub(super) struct Names {
    /// Returns the cells reached since the last call. The first call starts the recording.
    pub(super) cells: Cells,
    /// Returns the name of the state in a story.
    pub(super) state: State,
}

type Cells = fn(&mut dyn End) -> Vec<String>;
type State = fn(&dyn End) -> String;

/// Returns the names of an end.
pub(super) fn names(link: &str, end: &str, config: &Map<String, Value>) -> Names {
    use links::{isra_ball, laser_eb90, mmacell_proto, val2_alter, val2_viewer};
    use rows::{Rtu, RtuOverTcp, Tcp};
    let framing = config.get("framing").and_then(Value::as_str).unwrap_or("tcp");
    let (cells, state): (Cells, State) = match (link, end) {
        ("isra-ball", "host") => (cells::<isra_ball::rows::Host>, name),
        ("isra-ball", _) => (cells::<isra_ball::rows::Ball>, name),
        ("val2-viewer", "host") => (cells::<val2_viewer::rows::Host>, name),
        ("val2-viewer", _) => (cells::<val2_viewer::rows::Workstation>, name),
        ("laser-eb90", "host") => (cells::<laser_eb90::rows::Host>, row::<laser_eb90::rows::Host>),
        ("laser-eb90", _) => (cells::<laser_eb90::rows::Controller>, row::<laser_eb90::rows::Controller>),
        ("mmacell-proto", "central") => {
            (both::<mmacell_proto::rows::Central, mmacell_proto::rows::Progress>, name)
        }
        ("mmacell-proto", _) => (both::<mmacell_proto::rows::Device, mmacell_proto::rows::Moved>, name),
        ("val2-alter", "host") => (cells::<val2_alter::rows::Host>, row::<val2_alter::rows::Host>),
        ("val2-alter", _) => (cells::<val2_alter::rows::Controller>, row::<val2_alter::rows::Controller>),
        ("fanuc-hmi-modbus", end) => match (end, framing) {
            ("client", "tcp") => (client::<Tcp>, client_state),
            ("client", "rtu") => (client::<Rtu>, client_state),
            ("client", _) => (client::<RtuOverTcp>, client_state),
            (_, "tcp") => (server::<Tcp>, server_state),
            (_, "rtu") => (server::<Rtu>, server_state),
            _ => (server::<RtuOverTcp>, server_state),
        },
        ("kawasaki-msg", "pc") => (cells::<kawasaki::Pc>, pc_state),
        ("kawasaki-msg", _) => (cells::<kawasaki::Robot>, robot_state),
        // A link whose machines have no tables yet.
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

/// Returns the cells of a table, if there are any: `state: input`.
fn cell<R: Rows>(
    machine: &R::Machine,
    at: Duration,
    input: &<R::Machine as robot_session::end::Machine>::Input,
) -> Vec<String> {
    let column = R::column_at(machine, at, input);
    if column.is_empty() { Vec::new() } else { vec![format!("{}: {column}", R::row(machine, at))] }
}

fn reached<M: robot_session::end::Machine + 'static>(
    end: &mut dyn End,
    cells: impl Fn(&M, Duration, &M::Input) -> Vec<String>,
) -> Vec<String> {
    let moves = end.moves().downcast_mut::<Moves<M>>().and_then(|moves| moves.replace(Vec::new()));
    moves.into_iter().flatten().flat_map(|(at, machine, input)| cells(&machine, at, &input)).collect()
}

/// Returns the cells of a machine with two tables.
fn both<A: Rows<Machine: 'static>, B: Rows<Machine = A::Machine>>(end: &mut dyn End) -> Vec<String> {
    reached(end, |machine, at, input| [cell::<A>(machine, at, input), cell::<B>(machine, at, input)].concat())
}

/// Returns the state's row, for machines whose rows have more than the state's name. The time is the latest possible.
fn row<R: Rows<Machine: 'static>>(end: &dyn End) -> String {
    of(end, |machine: &R::Machine| R::row(machine, Duration::MAX)).unwrap_or_default()
}

fn of<M: 'static>(end: &dyn End, show: impl Fn(&M) -> String) -> Option<String> {
    end.machine().downcast_ref().map(show)
}

fn pc_state(end: &dyn End) -> String {
    let is_alone = |machine: &pc::Machine| !machine.is_connected() && machine.order != pc::Order::Idle;
    of(end, |machine| not_connected(end, is_alone(machine))).unwrap_or_default()
}

fn robot_state(end: &dyn End) -> String {
    let is_alone = |machine: &robot::Machine| !machine.is_connected() && machine.order != robot::Order::Idle;
    of(end, |machine| not_connected(end, is_alone(machine))).unwrap_or_default()
}

/// Returns the state's name, with a mark if it is alone: an order continues without a connection.
fn not_connected(end: &dyn End, is_alone: bool) -> String {
    format!("{}{}", end.state(), if is_alone { ", not connected" } else { "" })
}

fn client<T: rows::Transport>(end: &mut dyn End) -> Vec<String> {
    [cells::<rows::Client<T, 2>>(end), cells::<rows::Client<T, 8>>(end)].concat()
}

fn client_state(end: &dyn End) -> String {
    of(end, rows::client_state::<2>).or_else(|| of(end, rows::client_state::<8>)).unwrap_or_default()
}

fn server<T: rows::Transport>(end: &mut dyn End) -> Vec<String> {
    [cells::<rows::Server<T, 2>>(end), cells::<rows::Server<T, 8>>(end)].concat()
}

fn server_state(end: &dyn End) -> String {
    of(end, rows::server_state::<2>).or_else(|| of(end, rows::server_state::<8>)).unwrap_or_default()
}
