//! Campaign files: a scenario, dispersions, a design, a seed.

use std::path::{Path, PathBuf};

use sampling::distribution::InvalidParameter;
use sampling::subset::{Settings, Subset};
use tape::Digest;
use toml::{Table, Value};

use super::declared::{Declared, dimension_of};
use super::dispersions::{
    Context, DESIGNS, Design, DimensionedValue, Dispersion, Quantity, ValueSource, at_key, read_dispersion,
    unrounded_instants,
};
use super::folder::any_path::AnyPath;
use super::plan::Plan;
use super::rare::Rare;
use super::source::Source;
use super::{Campaign, CampaignError, CampaignKind, Number};
use crate::assessment::Criterion;
use crate::scenario::{Changes, KeyLines, Mistake, Scenario, ScenarioError};
use crate::text::check_title;

/// A file that declares a campaign: a separate file that names a scenario, or a scenario with the table `campaign`.
#[derive(Debug)]
pub struct CampaignFile {
    path: PathBuf,
    text: String,
    /// The campaign's declaration.
    table: Table,
    /// The prefix of its keys in the file.
    prefix: &'static str,
    /// The scenario.
    scenario: PathBuf,
}

const KEYS: [&str; 8] = [
    "title", "scenario", "points", "seed", "design", "seeds", "vary", "subset",
];

/// Maximum number of levels: enough for probabilities down to a tenth to this power.
const LEVELS_MAX: i64 = 100;

/// Keys of the table `subset`.
const SUBSET_KEYS: [&str; 3] = ["criterion", "share", "levels"];

impl CampaignFile {
    /// Reads `path`; `None` where it declares no campaign, so that it is a scenario or something else.
    ///
    /// # Errors
    /// When it declares a campaign without a scenario.
    pub fn open(path: &Path) -> Result<Option<CampaignFile>, CampaignError> {
        let Some((text, table)) = std::fs::read_to_string(path)
            .ok()
            .and_then(|text| text.parse::<Table>().ok().map(|table| (text, table)))
        else {
            return Ok(None);
        };
        let own = table.contains_key("vary") || table.contains_key("scenario");
        let (table, prefix) = match table.get("campaign") {
            Some(Value::Table(inner)) if !own => (inner.clone(), "campaign."),
            _ if own => (table, ""),
            _ => return Ok(None),
        };
        let mut file = CampaignFile {
            path: path.to_owned(),
            scenario: path.to_owned(),
            text,
            table,
            prefix,
        };
        if let Err(reason) = check_title(file.title()) {
            return Err(file.error(vec![file.mistake("title", reason)]));
        }
        if prefix.is_empty() {
            let folder = path.parent().unwrap_or(Path::new(""));
            file.scenario = match file.table.get("scenario").and_then(Value::as_str) {
                Some(name) => folder.join(name),
                None => {
                    let reason = "names no scenario: write scenario = \"FILE.toml\", relative to this file";
                    return Err(file.error(vec![file.mistake("scenario", reason)]));
                }
            };
        }
        Ok(Some(file))
    }

    /// The scenario of the campaign.
    pub fn scenario(&self) -> &Path {
        &self.scenario
    }

    /// The one-line description; empty where there is none.
    pub fn title(&self) -> &str {
        self.table.get("title").and_then(Value::as_str).unwrap_or_default()
    }

    /// The same with another number of points.
    #[must_use]
    pub fn with_points(mut self, points: u32) -> CampaignFile {
        self.table.insert("points".to_owned(), Value::Integer(points.into()));
        self
    }

    /// Files that it names, each with its key, with paths as written: the scenario, and the files that values are taken
    /// from.
    pub fn files(&self) -> Vec<(String, &str)> {
        let scenario = self.table.get("scenario").and_then(Value::as_str);
        let vary = self.table.get("vary").and_then(Value::as_table).into_iter().flatten();
        let values = vary.filter_map(|(name, one)| Some((format!("vary.{name}.file"), one.get("file")?.as_str()?)));
        let scenario = scenario.map(|file| ("scenario".to_owned(), file));
        scenario.into_iter().chain(values).collect()
    }

    /// The campaign of the points `plan`, with the changes that all of them share.
    pub fn campaign(&self, overrides: Changes, plan: &Plan) -> Campaign {
        let mut declaration = self.table.clone();
        // The number of points is left out, because more points make the same campaign larger; the scenario's content is
        // digested separately.
        declaration.retain(|key, _| !["points", "scenario"].contains(&key));
        let source = Source {
            file: AnyPath(self.path.clone()),
            digest: Digest::of(declaration.to_string().as_bytes()),
            title: self.title().to_owned(),
            factors: plan.factors(),
            sample: plan.is_sample(),
            grows: plan.grows(),
            rare: self.is_rare(),
        };
        Campaign {
            source: Some(source),
            ..Campaign::of_plan(CampaignKind::Sweep, self.scenario.clone(), overrides, plan)
        }
    }

    /// Checks that no column of `plan` has the name of a figure of merit, which is a column of the table too.
    ///
    /// # Errors
    /// The dispersion with that name.
    pub fn check_names(&self, plan: &Plan, figures: &[Number]) -> Result<(), CampaignError> {
        let names: Vec<String> = plan.heads().into_iter().map(|head| head.name).collect();
        let taken = |name: &&String| figures.iter().any(|figure| figure.name == **name);
        let mistakes: Vec<Mistake> = names
            .iter()
            .filter(taken)
            .map(|name| {
                let stem = name.split('[').next().unwrap_or(name);
                let reason = format!(
                    "the name `{name}` is not possible: the table has a figure of merit with it; choose another"
                );
                self.mistake(&format!("vary.{stem}"), reason)
            })
            .collect();
        match mistakes.is_empty() {
            true => Ok(()),
            false => Err(self.error(mistakes)),
        }
    }

    /// Whether the campaign looks for a rare event.
    pub fn is_rare(&self) -> bool {
        self.table.get("design").and_then(Value::as_str) == Some(Design::Subset.name())
    }

    /// The rare event that the campaign looks for, if any, and the method; `plan` is its own.
    ///
    /// # Errors
    /// Mistakes in the table `subset`, or in the number of points.
    pub fn rare(&self, plan: &Plan) -> Result<Option<Rare>, CampaignError> {
        let Plan::Declared(declared) = plan else {
            return Ok(None);
        };
        let Some(coordinates) = declared.coordinates() else {
            return match self.table.contains_key("subset") {
                true => Err(self.error(vec![self.mistake(
                    "subset",
                    "says how a rare event is looked for: write design = \"subset\", or take the table out",
                )])),
                false => Ok(None),
            };
        };
        let empty = Table::new();
        let table = match self.table.get("subset") {
            None => &empty,
            Some(Value::Table(table)) => table,
            Some(other) => {
                let reason = format!("{other} is no table: write [subset] with its keys");
                return Err(self.error(vec![self.mistake("subset", reason)]));
            }
        };
        let mut mistakes = Vec::new();
        let mut wrong = |key: &str, reason: String| mistakes.push(self.mistake(&format!("subset.{key}"), reason));
        for key in table.keys().filter(|key| !SUBSET_KEYS.contains(&key.as_str())) {
            wrong(key, format!("unknown key; there is {}", SUBSET_KEYS.join(", ")));
        }
        let mut settings = Settings {
            points: declared.count(),
            ..Settings::default()
        };
        let criterion = table.get("criterion").map(|value| {
            let name = value.as_str().map(str::to_owned);
            name.unwrap_or_else(|| {
                wrong("criterion", format!("{value} is no name of a criterion"));
                String::new()
            })
        });
        match table.get("share").map(|value| (value, value.as_float())) {
            Some((_, Some(share))) => settings.share = share,
            Some((value, None)) => wrong("share", format!("{value} is no share such as 0.1")),
            None => {}
        }
        match table.get("levels").map(|value| (value, value.as_integer())) {
            Some((_, Some(levels @ 1..=LEVELS_MAX))) => settings.levels = levels as usize,
            Some((value, _)) => wrong("levels", format!("{value} is no whole number from 1 to {LEVELS_MAX}")),
            None => {}
        }
        if !mistakes.is_empty() {
            return Err(self.error(mistakes));
        }
        match Subset::new(settings, declared.seed(), coordinates) {
            Ok(subset) => Ok(Some(Rare::new(subset, criterion))),
            Err(InvalidParameter { parameter, reason }) => {
                let key = match parameter {
                    "share" | "levels" => format!("subset.{parameter}"),
                    "points" => parameter.to_owned(),
                    _ => "vary".to_owned(),
                };
                Err(self.error(vec![self.mistake(&key, reason)]))
            }
        }
    }

    /// The criterion that `rare` refers to, among those of the points of `scenario`.
    ///
    /// # Errors
    /// When there is no criterion of the name in the file, or when the file must give a name.
    pub fn criterion(&self, rare: &Rare, known: &[Criterion], scenario: &Scenario) -> Result<Criterion, CampaignError> {
        let measured = |name: &str| scenario.spec().measures.contains_key(name);
        let found = rare.criterion(known, measured);
        found.map_err(|reason| self.error(vec![self.mistake("subset.criterion", reason)]))
    }

    fn mistake(&self, key: &str, reason: impl Into<String>) -> Mistake {
        let key = format!("{}{key}", self.prefix);
        Mistake {
            line: KeyLines::of(&self.text).line(&key),
            key,
            reason: reason.into(),
        }
    }

    fn error(&self, mistakes: Vec<Mistake>) -> CampaignError {
        ScenarioError {
            file: self.path.clone(),
            mistakes,
        }
        .into()
    }

    /// The points that it declares for `scenario`, which is its own with the changes of the command line.
    ///
    /// # Errors
    /// All mistakes, with file, line, key and remedy.
    pub fn plan(&self, scenario: &Scenario) -> Result<Plan, CampaignError> {
        let mut mistakes = Vec::new();
        for key in self.table.keys().filter(|key| !KEYS.contains(&key.as_str())) {
            mistakes.push(self.mistake(key, format!("unknown key; there is {}", KEYS.join(", "))));
        }
        if !self.prefix.is_empty() && self.table.contains_key("scenario") {
            mistakes.push(self.mistake("scenario", "is this file itself: take the key out"));
        }
        let mut number = |key: &str, least: i64, most: i64| -> Option<u64> {
            let value = self.table.get(key)?;
            let whole = value.as_integer().filter(|whole| (least..=most).contains(whole));
            if whole.is_none() {
                let reason = format!("{value} is no whole number from {least} to {most}");
                mistakes.push(self.mistake(key, reason));
            }
            whole.and_then(|whole| u64::try_from(whole).ok())
        };
        let points = number("points", 1, super::POINTS_MAX as i64);
        let seed = number("seed", 0, i64::MAX).unwrap_or(1);
        let design = self.one_of("design", &DESIGNS, &mut mistakes).unwrap_or(Design::Random);
        let seeds = self.one_of("seeds", &[("each", true), ("same", false)], &mut mistakes);
        let dispersions = self.dispersions(scenario, &mut mistakes);
        for [name, key, unit] in unrounded_instants(&dispersions, scenario) {
            let reason = format!(
                "draws {key}, an exact fraction of seconds, and a drawn number has too many digits for one: say to which step it is \
                 rounded, for example round = \"0.1 {unit}\""
            );
            mistakes.push(self.mistake(&format!("vary.{name}"), reason));
        }
        if !mistakes.is_empty() {
            return Err(self.error(mistakes));
        }
        let own_seed = dispersions
            .iter()
            .flat_map(|one| &one.targets)
            .any(|target| target.key == "seed");
        let mut nominal = std::collections::BTreeMap::new();
        for target in dispersions.iter().flat_map(|one| &one.targets) {
            if let Some(own) = at_key(scenario.resolved(), &target.key).and_then(Quantity::of) {
                nominal.insert(target.key.clone(), own);
            }
        }
        let first_seed = (seeds.unwrap_or(!own_seed) && !own_seed).then_some(scenario.seed);
        if own_seed && seeds == Some(true) {
            return Err(self.error(vec![self.mistake(
                "seeds",
                "gives each point its seed, and so does a dispersion: take one out",
            )]));
        }
        let declared = Declared::new(dispersions, design, seed, points, nominal, first_seed);
        let declared = declared.map_err(|(key, reason)| self.error(vec![self.mistake(&key, reason)]))?;
        Ok(Plan::Declared(Box::new(declared)))
    }

    fn one_of<T: Copy>(&self, key: &str, words: &[(&str, T)], mistakes: &mut Vec<Mistake>) -> Option<T> {
        let value = self.table.get(key)?;
        let found = words.iter().find(|(word, _)| value.as_str() == Some(word));
        if found.is_none() {
            let known: Vec<&str> = words.iter().map(|(word, _)| *word).collect();
            mistakes.push(self.mistake(key, format!("{value} is unknown; there is {}", known.join(", "))));
        }
        found.map(|(_, one)| *one)
    }

    /// The dispersions in the order of the file.
    fn dispersions(&self, scenario: &Scenario, mistakes: &mut Vec<Mistake>) -> Vec<Dispersion> {
        let remedy = "write what varies, such as [vary.delay] with key and distribution";
        let reason = match self.table.get("vary") {
            Some(Value::Table(_)) => None,
            None => Some(format!("is missing: {remedy}")),
            Some(Value::Array(_)) => Some(format!("is a list and no table: {remedy}")),
            Some(other) => Some(format!("{other} is no table: {remedy}")),
        };
        mistakes.extend(reason.map(|reason| self.mistake("vary", reason)));
        let Some(Value::Table(vary)) = self.table.get("vary") else {
            return Vec::new();
        };
        let lines = KeyLines::of(&self.text);
        let mut names: Vec<&String> = vary.keys().collect();
        names.sort_by_key(|name| lines.line(&format!("{}vary.{name}", self.prefix)));
        let folder = self.path.parent().unwrap_or(Path::new(""));
        let mut all: Vec<Dispersion> = Vec::new();
        for name in names {
            let Value::Table(table) = &vary[name] else {
                mistakes.push(self.mistake(&format!("vary.{name}"), "is no table: write [vary.NAME] with its keys"));
                continue;
            };
            let above = |name: &str| -> Option<DimensionedValue> { dimension_of(&all, name) };
            let context = Context {
                folder,
                scenario: scenario.resolved(),
                above: &above,
            };
            match read_dispersion(name, table, &context) {
                Ok(one) => all.push(one),
                Err(wrong) => mistakes.extend(wrong.into_iter().map(|(key, reason)| {
                    let dot = if key.is_empty() { "" } else { "." };
                    self.mistake(&format!("vary.{name}{dot}{key}"), reason)
                })),
            }
        }
        all
    }

    /// A mistake that affects all points that were tried, assigned to the dispersion that causes it.
    pub fn attribute_mistake(&self, plan: &Plan, error: CampaignError, tried: usize) -> CampaignError {
        let Plan::Declared(declared) = plan else { return error };
        let all = format!("all of the first {tried} points are refused, the first with");
        let assigned: Option<Vec<Mistake>> = match &error {
            CampaignError::Impossible { reason, .. } => {
                self.invalid_draw_mistake(declared, reason, &all).map(|one| vec![one])
            }
            CampaignError::Scenario(ScenarioError { mistakes, .. }) => mistakes
                .iter()
                .map(|mistake| {
                    let key = format!("vary.{}", declared.sets(&mistake.key)?.name);
                    Some(self.mistake(&key, format!("{all} {}: {}", mistake.key, mistake.reason)))
                })
                .collect(),
            _ => None,
        };
        match assigned {
            Some(mistakes) if !mistakes.is_empty() => self.error(mistakes),
            _ => error,
        }
    }

    /// The mistake in the dispersion whose draw is refused for `reason`, which begins with its key.
    fn invalid_draw_mistake(&self, declared: &Declared, reason: &str, all: &str) -> Option<Mistake> {
        let (key, reason) = reason.split_once(": ")?;
        let mut dispersions = declared.dispersions().iter();
        let found = dispersions.find(|one| format!("vary.{}", one.name) == key)?;
        Some(match found.source {
            ValueSource::Formula(..) => {
                let reason = format!(
                    "{all} a value that the formula does not have ({reason}): correct it, or what it is made of"
                );
                self.mistake(&format!("{key}.formula"), reason)
            }
            _ => self.mistake(key, format!("{all} {reason}: correct the distribution")),
        })
    }
}
