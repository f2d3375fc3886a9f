//! The fuzz targets. Each has a program of one line in `fuzz_targets`; its body is here. The targets of the links come from
//! the table of links: a decoder, messages, and every end.
//!
//! A target's input is a type with a derived [`Arbitrary`]. Its body panics when an oracle fails. The oracles are more than
//! "no panic": decode(encode(x)) = x, any chunking gives the same items, an accepted message encodes to the same bytes, a
//! session keeps the contract.

mod codec;
mod fanuc_hmi;
mod fanuc_ls;
mod kawasaki_work;
#[doc(hidden)]
pub mod program;
#[cfg(test)]
mod tests;

use core::fmt::{self, Debug, Formatter};
use std::path::Path;
use std::{fs, io};

use arbitrary::{Arbitrary, Result, Unstructured};
use cellwire_links::LINKS;
use cellwire_links::end::EndRow;
use cellwire_links::link::Link;
use robot_session::contract::{Rng, Script, scripted};
use testkit::contract::{Call, Piece, TestedEnd};

type Body = dyn Fn(&[u8]);

/// A target that belongs to no link: its name, and how it is made.
type OtherTarget = (&'static str, fn() -> Target);

/// A target.
pub struct Target {
    seeds: Vec<Vec<u8>>,
    run: Box<Body>,
    show: fn(&[u8]) -> String,
}

impl Target {
    /// Creates a target with the body `run`. `seeds` are initial inputs, in addition to the files in `seeds/<target>`.
    fn new<I: for<'a> Arbitrary<'a> + Debug>(seeds: Vec<Vec<u8>>, run: impl Fn(I) + 'static) -> Self {
        let read = |data: &[u8]| I::arbitrary(&mut Unstructured::new(data));
        Self {
            seeds,
            run: Box::new(move |data| {
                let _ = read(data).map(&run); // too few bytes for a value
            }),
            show: |data| format!("{:#?}", I::arbitrary(&mut Unstructured::new(data))),
        }
    }

    /// Runs the body on an input.
    ///
    /// # Panics
    /// If an oracle fails.
    pub fn run(&self, data: &[u8]) {
        (self.run)(data);
    }

    /// Returns the value of an input, as text.
    pub fn show(&self, data: &[u8]) -> String {
        (self.show)(data)
    }
}

/// Makes a target.
pub type Make = Box<dyn Fn() -> Target>;

/// Returns every target by its name.
pub fn targets() -> impl Iterator<Item = (String, Make)> {
    let others: [OtherTarget; 5] = [
        ("fanuc_hmi_modbus_assignment", || Target::new(Vec::new(), fanuc_hmi::assignment)),
        ("fanuc_hmi_modbus_motion", || Target::new(Vec::new(), fanuc_hmi::motion)),
        ("fanuc_ls_program", || Target::new(Vec::new(), fanuc_ls::program)),
        ("fanuc_ls_trajectory", || Target::new(Vec::new(), fanuc_ls::trajectory)),
        ("kawasaki_msg_work", || Target::new(Vec::new(), kawasaki_work::work)),
    ];
    let others = others.into_iter().map(|(name, make)| (name.to_owned(), Box::new(make) as Make));
    others.chain(LINKS.iter().flat_map(|link| {
        let name = |of: &str| format!("{}_{of}", link.name.replace('-', "_"));
        let codecs: [(String, Make); 2] = [
            (name("decoder"), Box::new(|| codec::decoder(link))),
            (name("message"), Box::new(|| codec::message(link))),
        ];
        let ends = link.ends.iter().map(move |row| (name(row.name), Box::new(|| end(link, row)) as Make));
        codecs.into_iter().chain(ends)
    }))
}

/// Returns the target with a name.
///
/// # Panics
/// If there is no target of this name.
pub fn target(name: &str) -> Target {
    let (_, make) = targets().find(|(known, _)| known == name).unwrap_or_else(|| panic!("no target {name}"));
    make()
}

/// Returns a target for an end, which must meet the contract of sessions.
fn end(link: &Link, row: &EndRow) -> Target {
    let held = TestedEnd::of(link, row);
    let seeds = (0..64).map(|seed| Rng::new(seed).bytes(500)).collect();
    Target::new(seeds, move |script: Script<Piece, Call>| scripted(&held, &script))
}

/// Returns the initial inputs of a target, by name: generated ones, and the files in its folder of `seeds`.
///
/// # Errors
/// If a file cannot be read.
pub fn seeds(name: &str, target: &Target) -> io::Result<Vec<(String, Vec<u8>)>> {
    let made = target.seeds.iter().enumerate().map(|(number, seed)| (format!("seed-{number}"), seed.clone()));
    let mut all: Vec<_> = made.collect();
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("seeds").join(name);
    for file in folder.is_dir().then(|| fs::read_dir(folder)).transpose()?.into_iter().flatten() {
        let file = file?;
        all.push((file.file_name().to_string_lossy().into(), fs::read(file.path())?));
    }
    Ok(all)
}

/// All bytes that are left of an input.
struct Bytes(Vec<u8>);

impl Arbitrary<'_> for Bytes {
    fn arbitrary(u: &mut Unstructured<'_>) -> Result<Self> {
        Ok(Self(u.bytes(u.len())?.into()))
    }
}

impl Debug for Bytes {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(f, "b\"{}\"", self.0.escape_ascii())
    }
}
