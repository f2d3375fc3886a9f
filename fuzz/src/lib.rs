//! The bodies of the fuzz targets: each takes the fuzzer's bytes and panics when an oracle fails. Those of the links come from their
//! table: of each a decoder and its messages, and every end.
//!
//! The oracles are not only "no panic": decode(encode(x)) = x, any chunking gives the same items, an accepted message encodes to
//! the same bytes, a session keeps the contract.

mod codec;
mod fanuc_hmi;
mod fanuc_ls;
mod kawasaki_work;

use std::path::Path;
use std::rc::Rc;

use cellwire_links::LINKS;
use codec::Codecs;
use robot_session::contract::{Rng, scripted};
use testkit::contract::Held;

/// What a target does with an input.
pub type Body = dyn Fn(&[u8]);

/// A target.
pub struct Target {
    /// Its name.
    pub name: String,
    /// Inputs to begin with, beside those of its folder in `fuzz/corpus`.
    pub seeds: Vec<Vec<u8>>,
    /// Its body.
    pub body: Box<Body>,
}

/// The body of a target that no link has.
type Other = fn(&[u8]);

/// Those targets: their seeds are in their folders.
const OTHERS: [(&str, Other); 5] = [
    ("fanuc_hmi_modbus_assignment", fanuc_hmi::assignment),
    ("fanuc_hmi_modbus_motion", fanuc_hmi::motion),
    ("fanuc_ls_program", fanuc_ls::program),
    ("fanuc_ls_trajectory", fanuc_ls::trajectory),
    ("kawasaki_msg_work", kawasaki_work::work),
];

/// Every target.
pub fn targets() -> impl Iterator<Item = Target> {
    let of = |(name, body): (&str, Other)| Target {
        name: name.to_owned(),
        seeds: Vec::new(),
        body: Box::new(body),
    };
    let links = LINKS.iter().flat_map(|link| {
        let name = |of: &str| format!("{}_{of}", link.name.replace('-', "_"));
        let decoder = Rc::new(Codecs::of(link));
        let message = Rc::clone(&decoder);
        let codecs = [
            Target {
                name: name("decoder"),
                seeds: decoder.streams(),
                body: Box::new(move |data| decoder.stream(data)),
            },
            Target {
                name: name("message"),
                seeds: message.changes(),
                body: Box::new(move |data| message.message(data)),
            },
        ];
        let ends = link.ends.iter().map(move |row| {
            let held = Held::of(link, row);
            Target {
                name: name(row.name),
                seeds: (0..64).map(|seed| bytes(seed, 500)).collect(),
                body: Box::new(move |data| scripted(&held, data)),
            }
        });
        codecs.into_iter().chain(ends)
    });
    OTHERS.into_iter().map(of).chain(links)
}

/// How many bytes of a seed.
fn bytes(seed: u64, count: usize) -> Vec<u8> {
    let mut rng = Rng::new(seed);
    (0..count).map(|_| rng.below(256) as u8).collect()
}

/// The target of a name.
///
/// # Panics
/// When there is none.
pub fn target(name: &str) -> Target {
    targets().find(|target| target.name == name).unwrap_or_else(|| panic!("there is no target {name}"))
}

/// Writes the seeds of every target into its folder in this one.
///
/// # Errors
/// When a file cannot be written.
pub fn write_seeds(folder: &Path) -> std::io::Result<()> {
    for target in targets() {
        let folder = folder.join(&target.name);
        std::fs::create_dir_all(&folder)?;
        for (number, seed) in target.seeds.iter().enumerate() {
            std::fs::write(folder.join(number.to_string()), seed)?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::path::Path;

    use super::{Target, targets};

    fn corpus() -> &'static Path {
        Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/corpus"))
    }

    #[test]
    fn every_target_holds_over_its_corpus() {
        for Target { name, mut seeds, body } in targets().filter(|target| {
            target.name.starts_with(&std::env::var("LINK").unwrap_or_default().replace('-', "_"))
        }) {
            for input in fs::read_dir(corpus().join(&name)).into_iter().flatten() {
                seeds.push(fs::read(input.unwrap().path()).unwrap());
            }
            assert!(!seeds.is_empty(), "{name} has no corpus");
            for seed in seeds {
                println!("{name}: {}", seed.escape_ascii()); // shown when the target panics
                body(&seed);
            }
        }
    }

    #[test]
    fn every_corpus_has_a_target() {
        for folder in fs::read_dir(corpus()).unwrap() {
            let folder = folder.unwrap().file_name();
            assert!(targets().any(|target| *target.name == *folder), "{} is no target", folder.display());
        }
    }
}
