//! `cargo xtask`: the tasks of this workspace in one place.

#![forbid(unsafe_code)]

mod circles;
mod new_link;

use std::collections::BTreeSet;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode, Stdio};
use std::time::Instant;

use anyhow::{Context, Result, bail, ensure};
use clap::{Parser, Subcommand};

#[derive(Parser)]
#[command(name = "cargo xtask", about = "The tasks of this workspace in one place")]
struct Args {
    #[command(subcommand)]
    task: Task,
}

#[derive(Subcommand)]
enum Task {
    /// Format, lints and tests of the packages that differ from the last commit. For a link: under a minute, if it was built
    /// before
    Check {
        /// These packages instead
        packages: Vec<String>,
    },
    /// Fails if two files of a crate import each other
    Circles,
    /// Makes a link: a crate with a codec of lines and two ends to replace, its row in the table, vectors and a specification
    NewLink {
        /// The crate's name, such as `acme-feeder`
        name: String,
    },
    /// The checks of a change (.ci/run), or some of its steps
    Ci {
        /// Steps, as `lints` or `tests`
        steps: Vec<String>,
    },
    /// The checks of a release (.ci/deep), or some of its steps
    Deep {
        /// Steps, as `model` or `soak`
        steps: Vec<String>,
    },
    /// Every state of every pair of ends; `must-fail` takes each rule out
    Model {
        /// Passed on: `--link LINK`, `--deep`, `must-fail`, `--help`
        #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
        arguments: Vec<String>,
    },
    /// Both ends of every session over bad transports
    Soak {
        /// Passed on: `--seeds N`, `--link LINK`, `--help`
        #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
        arguments: Vec<String>,
    },
    /// Writes every generated file: diagrams, the reference's data, tables on the pages. Read the difference
    Bless {
        /// Only the reference's data of this link
        link: Option<String>,
    },
}

fn main() -> ExitCode {
    match run(Args::parse().task) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn run(task: Task) -> Result<()> {
    let workspace = Workspace(Path::new(env!("CARGO_MANIFEST_DIR")).join(".."));
    match task {
        Task::Check { packages } => workspace.check(packages),
        Task::Circles => workspace.circles(&workspace.members()?),
        Task::NewLink { name } => {
            new_link::make(&workspace.0, &name)?;
            workspace.cargo(["fmt", "-p", &name, "-p", "cellwire-links"])
        }
        Task::Ci { steps } => workspace.run(".ci/run", steps),
        Task::Deep { steps } => workspace.run(".ci/deep", steps),
        Task::Model { arguments } => workspace.testkit("model", arguments),
        Task::Soak { arguments } => workspace.testkit("soak", arguments),
        Task::Bless { link } => workspace.bless(link),
    }
}

/// The root folder.
struct Workspace(PathBuf);

impl Workspace {
    fn check(&self, packages: Vec<String>) -> Result<()> {
        let begin = Instant::now();
        let members = self.members()?;
        if let Some(unknown) =
            packages.iter().find(|package| members.iter().all(|(_, name)| name != *package))
        {
            let names: Vec<&str> = members.iter().map(|(_, name)| name.as_str()).collect();
            bail!("there is no package {unknown}; the packages are {}", names.join(", "));
        }
        let (packages, has_data) =
            if packages.is_empty() { self.changed(&members)? } else { (packages, false) };
        self.cargo(["fmt", "--all", "--check"])?;
        self.circles(&members)?;
        if has_data || packages.iter().any(|package| package == "benches") {
            // The pages have figures of benches/results, the reference what the code does.
            self.cargo(["run", "-q", "-p", "reference", "--", "check"])?;
        }
        if packages.is_empty() {
            println!("no package differs from the last commit: name one to check it");
            return Ok(());
        }
        println!("checking {}", packages.join(", "));
        let chosen: Vec<&str> = packages.iter().flat_map(|package| ["-p", package.as_str()]).collect();
        let with = |before: &[&'static str], after: &[&'static str]| [before, &chosen, after].concat();
        self.cargo(with(&["clippy", "-q"], &["--all-targets", "--all-features", "--", "-D", "warnings"]))?;
        self.cargo(with(&["test", "-q"], &[]))?;
        for link in packages.iter().filter(|package| self.is_link(package)) {
            // Tests of testkit that the link's crate does not have itself.
            let tests = ["--test", "it", "--", "machines::", "contract::", "vectors::"];
            let mut tested =
                self.command(env!("CARGO"), ["test", "-q", "-p", "testkit"].iter().chain(&tests));
            Self::succeed(tested.env("LINK", link))?;
            let mut fuzzed = self.command(env!("CARGO"), ["test", "-q", "-p", "cellwire-fuzz"]);
            Self::succeed(fuzzed.env("LINK", link))?;
            self.cargo(["run", "-q", "-p", "reference", "--", "check", link])?;
        }
        println!("checked in {:.0} s", begin.elapsed().as_secs_f64());
        Ok(())
    }

    fn circles(&self, members: &[(String, String)]) -> Result<()> {
        let mut pairs = Vec::new();
        for (folder, _) in members {
            pairs.extend(circles::pairs(&self.0, folder)?);
        }
        ensure!(pairs.is_empty(), "{}", pairs.join("\n"));
        Ok(())
    }

    fn bless(&self, link: Option<String>) -> Result<()> {
        self.testkit("model", ["diagrams"])?;
        let write = ["run", "-q", "-p", "reference", "--", "write"].map(String::from);
        self.cargo(write.into_iter().chain(link))?;
        self.run("git", ["diff", "--stat"])
    }

    fn testkit(&self, program: &str, arguments: impl IntoIterator<Item: Into<String>>) -> Result<()> {
        let run = ["run", "-q", "--profile", "proof", "-p", "testkit"].into_iter();
        let run = run.chain(["--features", "programs", "--bin", program, "--"]).map(String::from);
        self.cargo(run.chain(arguments.into_iter().map(Into::into)))
    }

    /// Returns whether a package is a link's crate, whose specification is in the reference.
    fn is_link(&self, package: &str) -> bool {
        self.0.join("reference").join("sessions").join(package).with_extension("json").exists()
    }

    /// Returns the packages with files that differ from the last commit, and whether a file outside all packages does.
    fn changed(&self, members: &[(String, String)]) -> Result<(Vec<String>, bool)> {
        let output = Command::new("git")
            .args(["status", "--porcelain", "--untracked-files=all"])
            .current_dir(&self.0)
            .stderr(Stdio::inherit())
            .output()
            .context("cannot run git")?;
        ensure!(output.status.success(), "git status failed");
        let text = String::from_utf8(output.stdout)?;
        // `XY PATH`, or `XY OLD -> NEW`.
        let paths = text.lines().filter_map(|line| line.get(3..)).flat_map(|paths| paths.split(" -> "));
        let package = |path: &str| {
            let path = Path::new(path.trim_matches('"'));
            let mut folders = path.ancestors().filter_map(Path::to_str);
            folders
                .find_map(|at| members.iter().find(|(folder, _)| folder == at))
                .map(|(_, name)| name.clone())
        };
        let packages: BTreeSet<Option<String>> = paths.map(package).collect();
        let has_data = packages.contains(&None);
        Ok((packages.into_iter().flatten().collect(), has_data))
    }

    /// Returns the folder and the name of every member of the workspace.
    fn members(&self) -> Result<Vec<(String, String)>> {
        let read = |folder: &str| {
            let path = self.0.join(folder).join("Cargo.toml");
            std::fs::read_to_string(&path).with_context(|| path.display().to_string())
        };
        let root = read("")?;
        let list = root.split_once("members = [").and_then(|(_, rest)| rest.split_once(']'));
        let folders = list.map(|(list, _)| list).context("the root manifest has no members")?.split('"');
        let member = |folder: &str| {
            let manifest = read(folder)?;
            let name = manifest.lines().find_map(|line| line.strip_prefix("name = "));
            let name = name.with_context(|| format!("{folder} has no name"))?;
            Ok((folder.to_owned(), name.trim_matches('"').to_owned()))
        };
        folders.skip(1).step_by(2).map(member).collect()
    }

    fn cargo(&self, arguments: impl IntoIterator<Item: AsRef<OsStr>>) -> Result<()> {
        self.run(env!("CARGO"), arguments)
    }

    fn run(&self, program: &str, arguments: impl IntoIterator<Item: AsRef<OsStr>>) -> Result<()> {
        Self::succeed(&mut self.command(program, arguments))
    }

    fn command(&self, program: &str, arguments: impl IntoIterator<Item: AsRef<OsStr>>) -> Command {
        let mut command = Command::new(program);
        command.args(arguments).current_dir(&self.0);
        command
    }

    fn succeed(command: &mut Command) -> Result<()> {
        let program = command.get_program().display().to_string();
        let status = command.status().with_context(|| format!("cannot run {program}"))?;
        if !status.success() {
            bail!("{program} failed");
        }
        Ok(())
    }
}
