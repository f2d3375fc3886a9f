//! `--set` and `--settings`, and their values.

mod list;

use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use anyhow::{Context, Result, anyhow};
use fanuc_hmi_modbus::{ClientConfig, WordOrder};
use serde_json::{Map, Value};

use cellwire_io::input;
use cellwire_io::output::remark;
use cellwire_io::tcp::{Dialing, MAX_PAUSE, TimeoutArgs};
use cellwire_links::LINKS;
use cellwire_links::fanuc_hmi_modbus::{ClientSettings, ViewSettings, client_settings};
use cellwire_links::settings::{self, Configure, FieldVisitor, RefusedSetting, Setting};

pub(super) use self::list::toml_value;
pub use self::list::{Args, named, run};

/// Settings other than the defaults.
#[derive(Debug, Clone, clap::Args)]
pub(super) struct SetArgs {
    /// A setting, such as baud=19200; `cellwire settings` prints all
    ///
    /// It overrides --settings; an option for the same setting overrides both. `cellwire settings COMMAND NAME` prints all
    /// settings of a command, with their values and defaults.
    #[arg(long, value_name = "NAME=VALUE", value_parser = settings::parse)]
    set: Vec<(String, Value)>,
    /// A TOML file of settings, as `cellwire settings COMMAND NAME` prints one
    #[arg(long, value_name = "FILE")]
    settings: Option<PathBuf>,
}

impl SetArgs {
    /// Returns the options, as words of a command line.
    pub(super) fn words(&self) -> Vec<String> {
        let file = self.settings.iter().flat_map(|file| ["--settings".into(), file.display().to_string()]);
        let set = self.set.iter().flat_map(|(name, value)| {
            let value = value.as_str().map_or_else(|| value.to_string(), str::to_owned);
            ["--set".into(), format!("{name}={value}")]
        });
        file.chain(set).collect()
    }

    /// Returns whether no settings are given.
    pub(super) fn is_empty(&self) -> bool {
        self.set.is_empty() && self.settings.is_none()
    }

    /// Returns the given values, for a command that has these settings.
    ///
    /// # Errors
    /// When the file cannot be read or is not TOML, with line and column; when a name is a table and a value at once.
    pub(super) fn read(&self, known: &[Setting]) -> Result<Map<String, Value>> {
        self.read_over(None, known)
    }

    /// Returns the given values, which override those of another file of settings.
    ///
    /// # Errors
    /// As [`read`](Self::read).
    pub(super) fn read_over(&self, base: Option<&Path>, known: &[Setting]) -> Result<Map<String, Value>> {
        self.note(base);
        let mut given = files(base.into_iter().chain(self.settings.as_deref()))?;
        adopt(&mut given, known)?;
        for (name, value) in &self.set {
            settings::insert(&mut given, name, value.clone())?;
        }
        // It belongs to the connection: `dialing` reads it.
        if known.iter().any(|it| it.name == CONNECT_PAUSE) {
            given.remove(CONNECT_PAUSE);
        }
        Ok(given)
    }

    /// Returns the settings of a client's connections: the option, and the setting `connect_pause` of the file or of `--set`.
    ///
    /// # Errors
    /// As [`read`](Self::read); when the pause is not one.
    pub(super) fn dialing(&self, base: Option<&Path>, timeout: TimeoutArgs) -> Result<Dialing> {
        self.note(base);
        let mut given = files(base.into_iter().chain(self.settings.as_deref()))?;
        for (name, value) in &self.set {
            settings::insert(&mut given, name, value.clone())?;
        }
        given.retain(|name, _| name == CONNECT_PAUSE);
        let read = settings::read("the connection", ConnectSettings::default(), &given);
        Ok(timeout.dialing(read?.pause))
    }

    /// Returns the settings of a Modbus client, for a command that uses these settings of the link's bytes. A remark names
    /// given settings that are not used.
    ///
    /// # Errors
    /// As [`read`](Self::read); when a name is not a setting of a Modbus client, or a value is not one of the setting's.
    pub(super) fn read_client(
        &self,
        what: &'static str,
        uses: &'static [&'static str],
    ) -> Result<ClientGiven> {
        let view = settings::list(ViewSettings::default());
        let mut given = self.read(&[client_settings(), view.clone(), connect_settings()].concat())?;
        let shown: Map<String, Value> = view.iter().filter_map(|it| given.remove_entry(&it.name)).collect();
        for name in shown.keys().filter(|name| !uses.contains(&name.as_str())) {
            // A file has `view` for `decode`.
            if name != "view" || self.set.iter().any(|(set, _)| set == name) {
                no_effect(name);
            }
        }
        let known = client_known(&client_settings(), uses);
        if let Some(name) = given.keys().find(|name| !known.contains(name)) {
            return Err(RefusedSetting {
                text: settings::no_setting(what, name, &known),
                name: name.clone(),
            }
            .into());
        }
        let (has_order, frames_given) = (shown.contains_key("word_order"), shown.contains_key("framing"));
        let view = settings::read(what, ViewSettings::default(), &shown)?;
        let word_order = has_order.then_some(view.word_order);
        Ok(ClientGiven { view, word_order, frames_given, what, uses, given })
    }

    /// Sets the session of a client.
    ///
    /// # Errors
    /// When the settings include one of another kind of connection, or a value is not one of the setting's.
    pub(super) fn configure(&self, client: &ClientGiven, config: &mut ClientConfig) -> Result<()> {
        let known = client_known(&settings::list(ClientSettings(&mut config.clone())), client.uses);
        if let Some(name) = client.given.keys().find(|name| !known.contains(name)) {
            let (what, known) = (client.what, known.join(", "));
            let text = format!("{what} has no setting `{name}` on this kind of connection: it has {known}");
            return Err(RefusedSetting { name: name.clone(), text }.into());
        }
        settings::read(client.what, ClientSettings(config), &client.given)?;
        Ok(())
    }

    /// Notes where the settings of this command come from, for [`located`].
    fn note(&self, base: Option<&Path>) {
        let files = base.into_iter().chain(self.settings.as_deref()).map(Path::to_owned).collect();
        let set = self.set.iter().map(|(name, _)| name.clone()).collect();
        *ORIGIN.lock().unwrap_or_else(PoisonError::into_inner) = Origin { files, set };
    }
}

/// Where the settings of the command come from.
#[derive(Debug)]
struct Origin {
    /// The files; a later one overrides an earlier one.
    files: Vec<PathBuf>,
    /// The names that `--set` has.
    set: Vec<String>,
}

static ORIGIN: Mutex<Origin> = Mutex::new(Origin { files: Vec::new(), set: Vec::new() });

/// Returns the error of a command; if a setting is rejected, with its line of the file, and if it is unknown, with the
/// command that lists all settings.
pub fn located(error: anyhow::Error) -> anyhow::Error {
    let Some(RefusedSetting { name, .. }) = error.downcast_ref() else { return error };
    let lists = match list::settings_of_command_line() {
        Some((command, known)) => {
            let is_within =
                |inner: &str, outer: &str| inner.strip_prefix(outer).is_some_and(|it| it.starts_with('.'));
            let is_known = known
                .iter()
                .any(|it| it.name == *name || is_within(&it.name, name) || is_within(name, &it.name));
            let after = if error.to_string().ends_with('?') { "" } else { ";" };
            if is_known { String::new() } else { format!("{after} `cellwire settings {command}` lists all") }
        }
        None => String::new(),
    };
    let origin = ORIGIN.lock().unwrap_or_else(PoisonError::into_inner);
    // A setting of the command line overrides the files.
    let files = origin.files.iter().rev().filter(|_| !origin.set.contains(name));
    let line = |file: &PathBuf| Some((file.clone(), settings::line_of(&input::text(file).ok()?, name)?));
    match files.filter_map(line).next() {
        Some((file, line)) => anyhow!("{}, line {line}: {error:#}{lists}", file.display()),
        None => anyhow!("{error:#}{lists}"),
    }
}

/// The settings that were given to a Modbus client.
pub(super) struct ClientGiven {
    /// The settings of the link's codec.
    pub(super) view: ViewSettings,
    /// The order of words, if it was given.
    pub(super) word_order: Option<WordOrder>,
    /// Whether the frames were given.
    pub(super) frames_given: bool,
    /// The name of the command, for errors.
    what: &'static str,
    /// The settings of the link's bytes that the command uses.
    uses: &'static [&'static str],
    /// The settings of the session.
    given: Map<String, Value>,
}

/// Returns the names of a client's settings, for an error.
fn client_known(session: &[Setting], uses: &[&str]) -> Vec<String> {
    let session = session.iter().map(|it| it.name.clone());
    session.chain(uses.iter().map(|it| (*it).to_owned())).chain([CONNECT_PAUSE.to_owned()]).collect()
}

/// Returns the settings of a Modbus client that uses these settings of the link's bytes, for its help.
pub fn client_help(session: Vec<Setting>, uses: &[&str]) -> Vec<Setting> {
    let mut view = settings::list(ViewSettings::default());
    view.retain(|it| uses.contains(&it.name.as_str()));
    [session, view, connect_settings()].concat()
}

/// Prints the remark for a setting that a command does not use.
pub(crate) fn no_effect(name: &str) {
    remark(&format!("warning: the setting {name} has no effect on this command"));
}

/// The setting of a line that returns sent bytes: `identify` finds it, and ends of several links have it.
const ECHO: &str = "echo";

/// The name of the setting.
const CONNECT_PAUSE: &str = "connect_pause";

/// The settings of a client's connections.
#[derive(Debug, Default)]
struct ConnectSettings {
    pause: Duration,
}

impl Configure for ConnectSettings {
    fn configure(&mut self, fields: &mut impl FieldVisitor) {
        let Self { pause } = self;
        let about =
            "the pause between each new connection, or the opened serial port, and the first byte sent";
        fields.time(CONNECT_PAUSE, Duration::ZERO..=MAX_PAUSE, about, pause);
    }
}

/// Returns the settings of a client's connections, for its help.
pub fn connect_settings() -> Vec<Setting> {
    settings::list(ConnectSettings::default())
}

/// Reads the settings in these files; a later one overrides an earlier one.
fn files<'a>(files: impl Iterator<Item = &'a Path>) -> Result<Map<String, Value>> {
    let mut given = Map::new();
    for file in files {
        let text = input::text(file)?;
        let found: Map<String, Value> =
            toml::from_str(&text).with_context(|| format!("{} is not valid TOML", file.display()))?;
        for (name, value) in found {
            settings::insert(&mut given, &name, value)?;
        }
    }
    Ok(given)
}

/// Moves the settings of a link's bytes, as `identify --write` writes them, to where a command of the link has them: in the
/// tables of its ends. Those that the command does not have are left out, with a remark unless they only affect how bytes
/// are shown; so are the settings that only another command of the link has.
fn adopt(given: &mut Map<String, Value>, known: &[Setting]) -> Result<()> {
    let is_known = |name: &str| {
        let inner = format!("{name}.");
        known.iter().any(|it| it.name == name || it.name.starts_with(&inner))
    };
    let places = |name: &str| -> Vec<&str> {
        let within = format!(".{name}");
        known.iter().map(|it| it.name.as_str()).filter(|it| it.ends_with(&within)).collect()
    };
    for link in LINKS {
        let open = || link.open.settings.iter().copied();
        let shown: Vec<&str> = link.open.beside.iter().map(|(name, _)| *name).collect();
        let places_of = link.open.place_names.iter().copied();
        if !open().any(|name| is_known(name) || !places(name).is_empty()) {
            continue;
        }
        for name in
            open().chain([ECHO]).chain(shown.iter().copied()).chain(places_of).filter(|name| !is_known(name))
        {
            let Some(value) = given.remove(name) else { continue };
            let places = places(name);
            if places.is_empty() && !shown.contains(&name) {
                no_effect(name);
            }
            for place in places {
                settings::insert(given, place, value.clone())?;
            }
        }
        // A file of a plant or a cell serves all its commands.
        let others = list::of_link(link);
        let is_other = |name: &str| others.iter().any(|it| it.name.split('.').next() == Some(name));
        for name in given.keys().filter(|name| !is_known(name) && is_other(name)).cloned().collect::<Vec<_>>()
        {
            given.remove(&name);
            no_effect(&name);
        }
    }
    Ok(())
}
