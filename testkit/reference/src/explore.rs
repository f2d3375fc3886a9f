//! Random stories that reach cells, and need rules, that no story does yet: to be read and added to the inputs.

use std::collections::BTreeSet;
use std::path::Path;

use anyhow::{Context, Result};
use robot_session::contract::Rng;

use crate::ends;
use crate::json::{self, Object};
use crate::story::{Inputs, Story, play, reachable};

/// The cells that a story reaches, and the rules that need it.
type Reached = BTreeSet<String>;

fn pick(rng: &mut Rng, from: &[String]) -> String {
    from.get(rng.below(from.len())).cloned().unwrap_or_default()
}

/// Prints the stories.
pub(crate) fn explore(root: &Path, link: &str, seeds: u64) -> Result<()> {
    let inputs: Inputs =
        crate::input(root, "stories", link)?.with_context(|| format!("{link} has no stories"))?;
    let mut id = u32::try_from(inputs.stories.len())?;
    for (end, about) in &inputs.ends {
        let rules = ends::rules(link, end)?;
        let mut cells = reachable(link, &about.machines);
        cells.retain(|cell| !about.unreachable.contains_key(cell));
        let found = |story: &Story| -> Result<Reached> {
            Ok(play(link, &inputs, story, None)?.cells.intersection(&cells).cloned().collect())
        };
        let needs = |story: &Story| -> Result<Reached> {
            let played = play(link, &inputs, story, None)?;
            let mut needs = BTreeSet::new();
            for (index, rule) in rules.iter().enumerate() {
                if play(link, &inputs, story, Some(index)).map_or(true, |other| other != played) {
                    needs.insert(format!("rule {rule}"));
                }
            }
            Ok(needs)
        };
        let mut known = BTreeSet::new();
        for story in inputs.stories.iter().filter(|story| story.end == *end) {
            known.extend(found(story)?);
            known.extend(needs(story)?);
        }
        let wanted = cells.len() + rules.len();
        for seed in 0..seeds {
            if known.len() == wanted {
                break;
            }
            let mut rng = Rng::new(seed);
            let mut script = vec!["0 connected".to_owned()];
            for _ in 0..5 + seed % 25 {
                let hold =
                    ["", "", "", "hold "].get((rng.next_u64() % 4) as usize).copied().unwrap_or_default();
                let (time, verb) = (pick(&mut rng, &about.times), pick(&mut rng, &about.moves));
                script.push(format!("{time} {hold}{verb}"));
            }
            let config = about.configs.get(rng.below(about.configs.len())).cloned().unwrap_or_default();
            let story = Story {
                id: 0,
                comment: String::new(),
                end: end.clone(),
                config,
                clauses: Vec::new(),
                script,
            };
            let mut all = found(&story)?;
            if rules.iter().any(|rule| !known.contains(&format!("rule {rule}"))) {
                all.extend(needs(&story)?);
            }
            let fresh: Reached = all.difference(&known).cloned().collect();
            if fresh.is_empty() {
                continue;
            }
            let story = shortest(story, &|story| {
                let mut all = found(story)?;
                if fresh.iter().any(|found| found.starts_with("rule ")) {
                    all.extend(needs(story)?);
                }
                Ok(fresh.is_subset(&all))
            })?;
            id += 1;
            let mut names: Vec<&str> = fresh.iter().map(String::as_str).collect();
            names.sort_unstable();
            println!(
                "{}",
                Object::new()
                    .value("id", &id)?
                    .value("comment", &format!("Found by exploration: {}", names.join("; ")))?
                    .value("end", end)?
                    .value("config", &story.config)?
                    .value("clauses", &story.clauses)?
                    .raw("script", json::text(&story.script)?)
                    .end()
            );
            known.extend(fresh);
        }
        let left: Vec<String> = cells
            .iter()
            .cloned()
            .chain(rules.iter().map(|rule| format!("rule {rule}")))
            .filter(|wanted| !known.contains(wanted))
            .collect();
        eprintln!("{link} {end}: not reached: {left:#?}");
    }
    Ok(())
}

/// Returns the story without unnecessary steps.
fn shortest(mut story: Story, serves: &dyn Fn(&Story) -> Result<bool>) -> Result<Story> {
    let mut at = story.script.len();
    while at > 0 {
        at -= 1;
        let mut shorter = story.clone();
        shorter.script.remove(at);
        if serves(&shorter).unwrap_or(false) {
            story = shorter;
        }
    }
    Ok(story)
}
