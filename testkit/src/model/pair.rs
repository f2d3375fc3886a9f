//! The explorations of a link, for the command `model`.

use core::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use super::against::{EndWithPeer, Peer};
use super::diagram::mermaid;
use super::explore::{Options, explore};
use super::machine::Edge;
use super::refine::Refined;
use super::system::{System, trace};
#[cfg(feature = "links")]
use super::{walk::walk, wired::Wired};
#[cfg(feature = "links")]
use crate::soak::{Log, Tally};

/// An end and any peer, or two ends, that are explored together.
#[derive(Debug, Clone, Copy)]
pub struct Pair {
    /// The crate and the ends: `laser-eb90 host × any controller`.
    pub name: &'static str,
    /// The systems to explore: each with its bounds and faults.
    pub settings: fn(Depth) -> Vec<Setting>,
    /// Systems without one rule, assumption or bound each; every rule has one.
    pub must_fail: fn() -> Vec<MustFail>,
    /// The diagrams that its crate commits, see [`draw`].
    pub diagrams: fn() -> Vec<Diagram>,
    /// Walks small systems with the real ends, and panics where they differ from the model.
    pub refined: fn() -> Vec<Refined>,
}

/// The size of the bounds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Depth {
    /// A few seconds a pair.
    Quick,
    /// Up to five minutes per pair.
    Deep,
}

/// A system to explore, and the names of its bounds and faults.
pub struct Setting {
    /// Bounds and faults in words: `2 batches, 2 faults of any kind`.
    pub name: String,
    /// The assumptions about a peer without a machine, and the properties that hold under them, if any.
    pub terms: Option<PeerAssumptions>,
    system: Box<dyn Explorable>,
    #[cfg(feature = "links")]
    walk: Option<Walk>,
}

/// A random walk of a seed over bytes.
#[cfg(feature = "links")]
type Walk = Box<dyn Fn(u64, Log) -> Tally + Send + Sync>;

/// The assumptions about a peer without a machine.
#[derive(Debug, Clone, Copy)]
pub struct PeerAssumptions {
    /// The clauses of the specification that the peer keeps; empty for a peer that does anything.
    pub keeps: &'static str,
    /// The behaviour that is left open.
    pub free: &'static str,
    /// The clauses that the end is shown to keep, each with the property that shows it: the other end relies on them.
    pub shows: &'static [(&'static str, &'static str)],
    /// The properties that hold.
    pub properties: &'static [&'static str],
}

impl fmt::Debug for Setting {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Setting").field(&self.name).finish()
    }
}

impl Setting {
    /// Creates a setting: a system under a name.
    pub fn new(name: impl Into<String>, system: impl System) -> Self {
        Self {
            name: name.into(),
            terms: None,
            system: Box::new(Arc::new(system)),
            #[cfg(feature = "links")]
            walk: None,
        }
    }

    /// Creates a setting of one end against any peer, which can also be walked at random over bytes.
    #[cfg(feature = "links")]
    pub fn walked<P: Wired>(name: impl Into<String>, against: EndWithPeer<P>) -> Self {
        let against = Arc::new(against);
        let walked = against.clone();
        Self {
            name: name.into(),
            terms: None,
            system: Box::new(against),
            walk: Some(Box::new(move |seed, log| walk(&walked, seed, log))),
        }
    }

    /// Walks the session of the end at random over bytes, if its peer is [`Wired`].
    #[cfg(feature = "links")]
    pub fn walk(&self, seed: u64, log: Log) -> Option<Tally> {
        self.walk.as_ref().map(|walk| walk(seed, log))
    }

    /// Returns the setting with one end against a peer about which only this is known.
    pub fn on(self, terms: PeerAssumptions) -> Self {
        Self { terms: Some(terms), ..self }
    }

    /// Explores it.
    pub fn explore(&self, options: &Options<'_>) -> ExplorationResult {
        self.system.explored(self.name.clone(), options)
    }

    /// Returns the number of states and steps that another model checker counts.
    #[cfg(feature = "stateright")]
    pub fn count(&self) -> (usize, usize) {
        self.system.count()
    }

    /// Returns every transition of its machines.
    pub fn edges(&self) -> Vec<Edge> {
        self.system.edges()
    }
}

/// The result of a [`Setting`]: a row of the table.
#[derive(Debug, Clone)]
pub struct ExplorationResult {
    /// The setting's name.
    pub setting: String,
    /// The number of states.
    pub states: usize,
    /// The number of steps from one state to another.
    pub steps: usize,
    /// The time of the exploration.
    pub time: Duration,
    /// Whether every state was visited.
    pub complete: bool,
    /// The properties that do not hold, the one with the shortest path first.
    pub broken: Vec<BrokenProperty>,
    /// The longest run without faults to the end of all work, in ticks.
    pub longest_benign: u32,
}

impl ExplorationResult {
    /// Returns whether every state was visited and every property holds.
    pub fn holds(&self) -> bool {
        self.complete && self.broken.is_empty()
    }
}

/// A property that does not hold, and a shortest way to see it.
#[derive(Debug, Clone)]
pub struct BrokenProperty {
    /// The name of the property.
    pub property: &'static str,
    /// The number of steps that lead there.
    pub steps: usize,
    /// The steps.
    pub trace: String,
}

/// A system with one rule taken out, and the property that then breaks.
#[derive(Debug)]
pub struct MustFail {
    /// The rule, by the name that the code has for it.
    pub rule: &'static str,
    /// The property that catches it.
    pub property: &'static str,
    /// The system without the rule, named as a setting is.
    pub without: Setting,
}

impl MustFail {
    /// Creates a case of a rule, the property that catches its removal, and the system without it.
    pub fn new(
        rule: &'static str,
        property: &'static str,
        setting: impl Into<String>,
        without: impl System,
    ) -> Self {
        Self { rule, property, without: Setting::new(setting, without) }
    }

    /// Creates the same case of one end against any peer.
    #[cfg(feature = "links")]
    pub fn walked<P: Wired>(
        rule: &'static str,
        property: &'static str,
        setting: impl Into<String>,
        without: EndWithPeer<P>,
    ) -> Self {
        Self { rule, property, without: Setting::walked(setting, without) }
    }

    /// Returns the property broken, with the shortest trace; `None` if the removal is not caught.
    pub fn caught(&self, options: &Options<'_>) -> Option<BrokenProperty> {
        let explored = self.without.explore(&Options { until: Some(self.property), ..*options });
        explored.broken.into_iter().find(|broken| broken.property == self.property)
    }
}

/// A diagram, and the file that holds it.
#[derive(Debug, Clone)]
pub struct Diagram {
    /// The file: `<crate>/diagrams/<end>.md` in the workspace.
    pub path: PathBuf,
    /// The contents of the file.
    pub text: String,
}

/// Draws the diagrams of the ends of a link, from the transitions in some settings.
pub fn draw(link: &str, ends: &[&str], settings: &[Setting]) -> Vec<Diagram> {
    let edges: Vec<Edge> = settings.iter().flat_map(Setting::edges).collect();
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).with_file_name(link).join("diagrams");
    let draw = |end: &&str| Diagram { path: folder.join(format!("{end}.md")), text: mermaid(&edges, end) };
    ends.iter().map(draw).collect()
}

/// Returns the name of the setting of such a peer.
pub const fn at(keeps_rules: bool) -> &'static str {
    if keeps_rules { "keeps the rules" } else { "does anything" }
}

/// Returns the settings of a peer that follows the rules, and of one with any behaviour.
pub fn both<P: Peer>(
    system: impl Fn(bool) -> EndWithPeer<P>,
    rules: PeerAssumptions,
    anything: PeerAssumptions,
) -> Vec<Setting> {
    [(true, rules), (false, anything)]
        .map(|(keeps_rules, terms)| Setting::new(at(keeps_rules), system(keeps_rules)).on(terms))
        .into()
}

/// A [`System`] with erased types.
trait Explorable: Send + Sync {
    fn explored(&self, setting: String, options: &Options<'_>) -> ExplorationResult;
    fn edges(&self) -> Vec<Edge>;
    #[cfg(feature = "stateright")]
    fn count(&self) -> (usize, usize);
}

impl<S: System> Explorable for Arc<S> {
    fn explored(&self, setting: String, options: &Options<'_>) -> ExplorationResult {
        let begin = Instant::now();
        let graph = explore(&**self, options);
        let broken = graph.findings().into_iter().map(|finding| {
            let path = graph.path(finding.at);
            BrokenProperty { property: finding.property, steps: path.len(), trace: trace(&**self, &path) }
        });
        ExplorationResult {
            setting,
            states: graph.states,
            steps: graph.steps,
            time: begin.elapsed(),
            complete: graph.complete,
            broken: broken.collect(),
            longest_benign: graph.longest_benign.0,
        }
    }

    fn edges(&self) -> Vec<Edge> {
        explore(&**self, &Options { edges: true, ..Options::default() }).edges.into_keys().collect()
    }

    #[cfg(feature = "stateright")]
    fn count(&self) -> (usize, usize) {
        super::second::count(self.clone())
    }
}
