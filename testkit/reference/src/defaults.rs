//! `reference/defaults.json`: every field of every configuration, with the values that the code has.

use anyhow::Result;
use cellwire_links::LINKS;
use cellwire_links::link::Config;
use cellwire_links::settings::{Setting, fields};
use fanuc_ls::Rules;
use serde_json::Map;

use crate::json::{self, Object};

/// The only configuration of a crate that is not a link.
const RULES: Config = Config { name: "Rules", fields: |given| fields(Rules::default(), given) };

/// Returns the text of the file.
pub(crate) fn file() -> Result<String> {
    let links = LINKS.iter().map(|link| (link.name, link.configs));
    let mut rows = Vec::new();
    for (link, configs) in links.chain([("fanuc-ls", [RULES].as_slice())]) {
        for config in configs {
            for field in (config.fields)(&Map::new())? {
                rows.push(row(link, config.name, &field)?);
            }
        }
    }
    Ok(json::file("defaults.schema.json", &[], "fields", &rows).replacen("../", "", 1))
}

fn row(link: &str, config: &str, field: &Setting) -> Result<String> {
    let Setting { name, unit, values, choices: _, default, about, source } = field;
    Ok(Object::new()
        .value("link", link)?
        .value("config", config)?
        .value("field", name)?
        .value("unit", unit)?
        .value("range", values)?
        .value("default", default)?
        .value("about", about)?
        .value("source", source)?
        .end())
}
