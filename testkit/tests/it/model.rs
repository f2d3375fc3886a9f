//! The search itself, on systems whose answers are known.
#![allow(missing_docs)]

use core::time::Duration;
use std::collections::BTreeSet;

use robot_session::Unexpected;
use robot_session::end::{Expiry, Machine};
use testkit::model::{
    DEADLOCK, DrawnMachine, Edge, MustFail, Options, STANDSTILL, Setting, System, age, check_or_write, drive,
    explore, explore_whole, mermaid, trace,
};

/// A system that is written down as its steps: from, to, ticks. The first step of a state is the benign one.
#[derive(Clone, Default)]
struct Steps {
    steps: Vec<(u8, u8, u32)>,
    over: Vec<u8>,
    bad: Vec<u8>,
}

impl System for Steps {
    type State = u8;
    type Act = (u8, u32);

    fn init(&self) -> u8 {
        0
    }

    fn acts(&self, state: &u8, acts: &mut Vec<(u8, u32)>) {
        acts.extend(self.steps.iter().filter(|(from, ..)| from == state).map(|(_, to, ticks)| (*to, *ticks)));
    }

    fn step(&self, _: &u8, (to, _): (u8, u32), _: Option<&mut Vec<Edge>>) -> u8 {
        to
    }

    fn broken(&self, state: &u8, broken: &mut Vec<&'static str>) {
        if self.bad.contains(state) {
            broken.push("nothing is bad");
        }
    }

    fn fault_free_step(&self, state: &u8) -> Option<(u8, u32)> {
        self.steps.iter().find(|(from, ..)| from == state).map(|(_, to, ticks)| (*to, *ticks))
    }

    fn is_over(&self, state: &u8) -> bool {
        self.over.contains(state)
    }

    fn ticks(&self, (_, ticks): (u8, u32)) -> u32 {
        ticks
    }
}

/// Returns `0 → 1 → 2 → 3`, and over.
fn line() -> Steps {
    Steps { steps: vec![(0, 1, 1), (1, 2, 0), (2, 3, 2)], over: vec![3], ..Steps::default() }
}

#[test]
fn a_system_that_ends_holds() {
    let graph = explore(&line(), &Options::default());
    assert!(graph.holds());
    assert_eq!((graph.states, graph.steps), (4, 3));
    assert_eq!(graph.longest_benign, (3, 0), "three ticks from the first state");
    assert_eq!(graph.path(3), [(1, 1), (2, 0), (3, 2)]);
    assert_eq!(trace(&line(), &graph.path(3)), "1: (2, 0); 3.");
}

#[test]
fn a_deadlock_is_found() {
    let mut system = line();
    system.steps.push((1, 9, 0));
    let graph = explore(&system, &Options::default());
    let at = graph.deadlock.unwrap();
    assert_eq!(graph.path(at), [(1, 1), (9, 0)]);
    let findings: Vec<_> = graph.findings().iter().map(|finding| finding.property).collect();
    assert_eq!(findings, [DEADLOCK, STANDSTILL], "nothing happens there, with or without faults");
    assert!(!graph.holds());
}

#[test]
fn a_cycle_that_leads_nowhere_is_a_standstill() {
    let mut system = line();
    system.steps.extend([(1, 7, 0), (7, 8, 1), (8, 7, 1)]);
    let graph = explore(&system, &Options::default());
    assert_eq!(graph.path(graph.standstill.unwrap()), [(1, 1), (7, 0)]);
    assert_eq!(graph.deadlock, None);

    system.steps.insert(0, (8, 3, 1));
    let graph = explore(&system, &Options::default());
    assert!(graph.holds(), "a cycle that a run without faults leaves is none");
    assert_eq!(graph.longest_benign.0, 3);
}

#[test]
fn a_broken_property_comes_with_a_shortest_path() {
    let mut system = line();
    // Two ways to state 5, and from there one to 6, which is never visited.
    system.steps.extend([(3, 5, 0), (1, 5, 0), (5, 6, 0)]);
    system.bad = vec![5];
    let graph = explore(&system, &Options::default());
    assert_eq!(graph.states, 5);
    assert_eq!(graph.path(graph.broken["nothing is bad"]), [(1, 1), (5, 0)]);
    let findings = graph.findings();
    assert_eq!(
        findings.len(),
        1,
        "a state that breaks a property is neither a deadlock nor a standstill: {findings:?}"
    );
}

#[test]
fn an_exploration_that_is_cut_off_says_so() {
    for (limit, states, complete) in [(0, 0, false), (3, 3, false), (4, 4, true), (5, 4, true)] {
        let graph = explore(&line(), &Options { limit, ..Options::default() });
        assert_eq!(
            (graph.states, graph.complete, graph.holds()),
            (states, complete, complete),
            "limit {limit}"
        );
    }
    // Stalls are not judged by half of the states.
    let mut system = line();
    system.steps.extend([(1, 7, 0), (7, 7, 1)]);
    let graph = explore(&system, &Options { limit: 3, ..Options::default() });
    assert!(graph.findings().is_empty() && !graph.holds());
}

#[test]
#[should_panic(expected = "is benign and cannot happen")]
fn what_is_benign_can_happen() {
    struct Wrong;
    impl System for Wrong {
        type State = ();
        type Act = u8;
        fn init(&self) {}
        fn acts(&self, _: &(), acts: &mut Vec<u8>) {
            acts.push(1);
        }
        fn step(&self, _: &(), _: u8, _: Option<&mut Vec<Edge>>) {}
        fn broken(&self, _: &(), _: &mut Vec<&'static str>) {}
        fn fault_free_step(&self, _: &()) -> Option<u8> {
            Some(2)
        }
        fn is_over(&self, _: &()) -> bool {
            false
        }
        fn ticks(&self, _: u8) -> u32 {
            0
        }
    }
    explore(&Wrong, &Options::default());
}

/// A door that a user opens, and that shuts automatically after two ticks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
enum Door {
    Shut { opened: u8 },
    Open { opened: u8, until: Duration },
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum DoorInput {
    Connected,
    Disconnected,
    Timeout,
    Push,
}

robot_session::inputs!(DoorInput: Push);

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum DoorAction {
    Nothing,
    Ring { times: u8 },
}

const TICK: Duration = Duration::from_secs(1);

impl Machine for Door {
    const END: &'static str = "door";
    type Input = DoorInput;
    type Action = DoorAction;
    type Transmit = ();
    type Config = Duration;
    const EXPIRY: Expiry = Expiry::First;

    fn on(&mut self, now: Duration, input: DoorInput, stays: &Duration) -> Result<DoorAction, Unexpected> {
        let (next, action) = match (*self, input) {
            (Self::Shut { opened }, DoorInput::Push) => {
                let opened = (opened + 1).min(3);
                (Self::Open { opened, until: now + *stays }, DoorAction::Ring { times: opened })
            }
            (Self::Open { opened, .. }, DoorInput::Push) => {
                (Self::Open { opened, until: now + *stays }, DoorAction::Nothing)
            }
            (Self::Open { opened, until }, DoorInput::Timeout) if until <= now => {
                (Self::Shut { opened }, DoorAction::Nothing)
            }
            (Self::Shut { .. } | Self::Open { .. }, input) => return Err(self.unexpected(&input)),
        };
        *self = next;
        Ok(action)
    }

    fn transmit(&self, _: Duration, _: &Duration) -> Option<()> {
        None
    }

    fn deadline(&self) -> Option<Duration> {
        match *self {
            Self::Shut { .. } => None,
            Self::Open { until, .. } => Some(until),
        }
    }

    fn expires(&self, now: Duration) -> bool {
        self.deadline().is_some_and(|until| until <= now)
    }

    fn each_time(&mut self, mut f: impl FnMut(&mut Duration)) {
        match self {
            Self::Shut { .. } => {}
            Self::Open { until, .. } => f(until),
        }
    }

    fn name(&self) -> &'static str {
        match self {
            Self::Shut { .. } => "Shut",
            Self::Open { .. } => "Open",
        }
    }
}

impl DrawnMachine for Door {}

/// The door alone. With `early` its timer is asked before it is due, which is unexpected.
#[derive(Debug, Clone)]
struct Doorway {
    early: bool,
}

impl System for Doorway {
    type State = (Door, bool);
    type Act = Option<DoorInput>;

    fn init(&self) -> (Door, bool) {
        (Door::Shut { opened: 0 }, false)
    }

    fn acts(&self, (door, _): &(Door, bool), acts: &mut Vec<Self::Act>) {
        match door {
            Door::Shut { .. } => acts.push(Some(DoorInput::Push)),
            Door::Open { until, .. } => {
                if until.is_zero() || self.early {
                    acts.push(Some(DoorInput::Timeout));
                }
                acts.extend([Some(DoorInput::Push), None]);
            }
        }
    }

    fn step(
        &self,
        (door, _): &(Door, bool),
        act: Self::Act,
        mut edges: Option<&mut Vec<Edge>>,
    ) -> (Door, bool) {
        let mut door = *door;
        let unexpected = match act {
            Some(input) => drive(&mut door, input, &(TICK * 2), &mut edges).is_err(),
            None => {
                age(&mut door, TICK);
                false
            }
        };
        (door, unexpected)
    }

    fn broken(&self, (_, unexpected): &(Door, bool), broken: &mut Vec<&'static str>) {
        if *unexpected {
            broken.push("nothing is unexpected");
        }
    }

    fn fault_free_step(&self, (door, _): &(Door, bool)) -> Option<Self::Act> {
        match door {
            Door::Open { until, .. } if until.is_zero() => Some(Some(DoorInput::Timeout)),
            Door::Open { .. } => Some(None),
            Door::Shut { .. } => None,
        }
    }

    fn is_over(&self, (door, _): &(Door, bool)) -> bool {
        matches!(door, Door::Shut { .. })
    }

    fn ticks(&self, act: Self::Act) -> u32 {
        u32::from(act.is_none())
    }
}

#[test]
fn the_states_are_finitely_many_though_time_goes_on() {
    let graph = explore(&Doorway { early: false }, &Options::default());
    assert!(graph.holds());
    // Four that are shut, and three times three that are open.
    assert_eq!(graph.states, 13);
    assert_eq!(graph.longest_benign.0, 2);
}

#[test]
fn what_is_unexpected_is_a_property() {
    let system = Doorway { early: true };
    let graph = explore(&system, &Options::default());
    let path = graph.path(graph.broken["nothing is unexpected"]);
    assert_eq!(path, [Some(DoorInput::Push), Some(DoorInput::Timeout)]);
    let case = MustFail::new("the timer waits", "nothing is unexpected", "a doorway", system.clone());
    let caught = case.caught(&Options::default()).unwrap();
    assert_eq!((caught.steps, caught.trace.as_str()), (2, "0: Some(Push), Some(Timeout); 0."));
    let case = MustFail::new("the timer waits", "something else", "a doorway", system);
    assert!(case.caught(&Options::default()).is_none());
}

#[test]
fn time_never_goes_below_zero_and_never_stays_never() {
    let mut door = Door::Open { opened: 1, until: TICK };
    age(&mut door, TICK * 3);
    assert_eq!(door, Door::Open { opened: 1, until: Duration::ZERO });
    let mut door = Door::Open { opened: 1, until: Duration::MAX };
    age(&mut door, TICK);
    assert_eq!(door, Door::Open { opened: 1, until: Duration::MAX });
}

#[test]
fn the_walks_visit_every_state_and_take_every_transition() {
    let system = Doorway { early: false };
    let graph = explore(&system, &Options { edges: true, ..Options::default() });
    let (mut states, mut edges, mut walks) = (BTreeSet::new(), Vec::new(), 0);
    for walk in graph.walks() {
        walks += 1;
        let mut state = system.init();
        states.insert(format!("{state:?}"));
        for act in walk {
            state = system.step(&state, act, Some(&mut edges));
            states.insert(format!("{state:?}"));
        }
    }
    assert_eq!(states.len(), graph.states);
    let edges: BTreeSet<_> = edges.into_iter().collect();
    assert!(edges.iter().eq(graph.edges.keys()), "{edges:?}");
    assert_eq!(edges.len(), 3);
    assert!(walks < graph.states, "only the leaves");
}

#[test]
fn a_diagram_shows_what_can_happen() {
    let edges = Setting::new("a doorway", Doorway { early: false }).edges();
    assert_eq!(
        mermaid(&edges, "door"),
        "```mermaid\nstateDiagram-v2\n    Open --> Shut: Timeout\n    Shut --> Open: Push / Ring\n```\n"
    );
    assert_eq!(mermaid(&edges, "window"), "```mermaid\nstateDiagram-v2\n```\n");
}

#[test]
fn a_file_that_differs_is_an_error() {
    let path = std::env::temp_dir().join(format!("testkit-model-{}/door.md", std::process::id()));
    check_or_write(&path, "a", false).unwrap_err();
    check_or_write(&path, "a", true).unwrap();
    check_or_write(&path, "a", false).unwrap();
    let error = check_or_write(&path, "b", false).unwrap_err().to_string();
    assert!(error.ends_with("write it with: cargo xtask model diagrams"), "{error}");
    std::fs::remove_dir_all(path.parent().unwrap()).unwrap();
}

/// Two counters, and every way to raise them.
struct Grid;

impl System for Grid {
    type State = (u16, Vec<u8>);
    type Act = bool;

    fn init(&self) -> Self::State {
        (0, Vec::new())
    }

    fn acts(&self, (first, second): &Self::State, acts: &mut Vec<bool>) {
        if *first < 100 {
            acts.push(true);
        }
        if second.len() < 100 {
            acts.push(false);
        }
    }

    fn step(&self, state: &Self::State, first: bool, _: Option<&mut Vec<Edge>>) -> Self::State {
        let mut state = state.clone();
        if first {
            state.0 += 1;
        } else {
            state.1.push(state.1.len() as u8);
        }
        state
    }

    fn broken(&self, _: &Self::State, _: &mut Vec<&'static str>) {}

    fn fault_free_step(&self, (first, _): &Self::State) -> Option<bool> {
        Some(*first < 100)
    }

    fn is_over(&self, (first, second): &Self::State) -> bool {
        *first == 100 && second.len() == 100
    }

    fn ticks(&self, _: bool) -> u32 {
        1
    }
}

#[test]
fn fingerprints_count_as_whole_states_do() {
    let (graph, whole) = (explore(&Grid, &Options::default()), explore_whole(&Grid, &Options::default()));
    assert_eq!((graph.states, graph.steps), (101 * 101, 2 * 101 * 100));
    assert_eq!((whole.states, whole.steps), (graph.states, graph.steps));
    assert_eq!(graph.longest_benign, (200, 0));
    assert!(graph.holds() && whole.holds());
}

#[cfg(feature = "stateright")]
#[test]
fn another_checker_counts_the_same() {
    let mut broken = line();
    broken.steps.extend([(3, 5, 0), (1, 5, 0), (5, 6, 0), (2, 0, 1)]);
    broken.bad = vec![5];
    let systems =
        [Setting::new("a line", line()), Setting::new("a broken one", broken), Setting::new("a grid", Grid)];
    for (setting, counts) in systems.iter().zip([(4, 3), (5, 6), (101 * 101, 2 * 101 * 100)]) {
        let explored = setting.explore(&Options::default());
        assert_eq!((explored.states, explored.steps), counts, "{setting:?}");
        assert_eq!(setting.count(), counts, "{setting:?}");
    }
}

#[cfg(feature = "links")]
mod pairs {
    use testkit::links::PAIRS;
    use testkit::model::{Depth, PeerAssumptions, WRITTEN, check_or_write};

    /// The clauses that the peer of one end keeps are those that the other end is shown to keep with any peer: both hold
    /// together.
    #[test]
    fn what_a_peer_keeps_the_other_end_is_shown_to_keep() {
        let link = |name: &'static str| name.split(' ').next();
        let terms: Vec<(&str, PeerAssumptions)> = PAIRS
            .iter()
            .flat_map(|pair| (pair.settings)(Depth::Quick).into_iter().map(|setting| (pair.name, setting)))
            .filter_map(|(name, setting)| Some((name, setting.terms?)))
            .collect();
        for (name, PeerAssumptions { keeps, shows, properties, .. }) in &terms {
            for (clause, property) in *shows {
                assert!(*property == WRITTEN || properties.contains(property), "{name}: {clause}");
            }
            // The other entries are assumptions about time.
            for clause in keeps.split(", ").filter(|clause| clause.starts_with(char::is_uppercase)) {
                let shown = |(other, terms): &(&'static str, PeerAssumptions)| {
                    link(other) == link(name)
                        && other != name
                        && terms.shows.iter().any(|(shown, _)| *shown == clause)
                };
                assert!(terms.iter().any(shown), "{name} relies on {clause}");
            }
        }
    }

    #[test]
    fn the_committed_diagrams_are_what_the_model_shows() {
        for diagram in PAIRS.iter().flat_map(|pair| (pair.diagrams)()) {
            check_or_write(&diagram.path, &diagram.text, false).unwrap();
        }
    }
}
