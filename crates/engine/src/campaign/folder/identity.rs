//! Identity of a campaign's folder: `campaign.json`.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use tape::Digest;

use super::any_path::AnyPath;
use crate::campaign::shards::shard::Shard;
use crate::campaign::source::Source;
use crate::campaign::stopping_rule::Until;
use crate::campaign::{Campaign, CampaignError, CampaignKind, Column};
use crate::scenario::{Changes, Scenario, ScenarioSpec};

/// `campaign.json`: the identity of the folder.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Identity {
    /// The command that creates it.
    pub kind: CampaignKind,
    /// The scenario's name.
    pub scenario: String,
    /// One line about the campaign, or the scenario's.
    pub title: String,
    /// The absolute path of the scenario file; in a bundle relative to the bundle.
    pub file: AnyPath,
    /// The campaign file that the points are drawn from, where there is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub source: Option<Source>,
    /// Changes that all points share.
    #[serde(flatten)]
    pub changes: Changes,
    /// The labels of the points, as columns.
    pub columns: Vec<Heading>,
    /// Number of points of the campaign, regardless of how many the folder is for.
    pub points: usize,
    /// Digests: of the program with the scenario's own programs, of the scenario with its files, and of both with the
    /// points.
    pub program: Digest,
    /// See `program`.
    pub content: Digest,
    /// See `program`.
    pub digest: Digest,
    /// The version of the program.
    pub version: String,
    /// The shard that the folder is for, where it is not for all points.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shard: Option<Shard>,
    /// Whether its points have the digests of their tapes.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub digests: bool,
    /// The share of the points that is run twice.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub audit: f64,
    /// The stopping rule, where the campaign has one: it may end before its last point.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub until: Option<Until>,
}

fn is_zero(share: &f64) -> bool {
    *share == 0.0
}

/// The head of a column that distinguishes points.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Heading {
    name: String,
    unit: String,
    numbers: bool,
    whole: bool,
}

pub(crate) fn io_error(path: &Path, action: &'static str) -> impl FnOnce(io::Error) -> CampaignError + use<> {
    let path = path.to_owned();
    move |source| CampaignError::Io { path, action, source }
}

/// The digest of a scenario with the contents of its files.
pub fn digest_of_scenario(spec: &ScenarioSpec) -> Digest {
    blake3::hash(spec.to_table().to_string().as_bytes()).into()
}

/// A digest of several parts.
pub(crate) struct DigestBuilder(blake3::Hasher);

impl DigestBuilder {
    pub(crate) fn new(about: &str) -> DigestBuilder {
        DigestBuilder(blake3::Hasher::new_derive_key(about))
    }

    pub(crate) fn add(&mut self, bytes: &[u8]) {
        self.0.update(&(bytes.len() as u64).to_le_bytes());
        self.0.update(bytes);
    }

    pub(crate) fn digest(&self) -> Digest {
        self.0.finalize().into()
    }
}

/// Results of two builds of the program must not be in one table; nor results of a user's program before and after a
/// change.
fn digest_of_programs(scenario: &Scenario) -> Result<Digest, CampaignError> {
    let mut parts = DigestBuilder::new("escapement campaign programs 1");
    let own = Path::new("/proc/self/exe");
    let others = scenario.programs().filter_map(|program| program.file());
    for program in std::iter::once(own).chain(others) {
        let bytes = fs::read(program).map_err(io_error(program, "read the program"))?;
        parts.add(blake3::hash(&bytes).as_bytes());
    }
    Ok(parts.digest())
}

/// The digest of the scenario does not depend on its place: its programs enter with their content.
fn digest_of_content(scenario: &Scenario) -> Digest {
    let mut spec = scenario.spec().clone();
    spec.folder = None;
    // The table `campaign` enters as the points.
    spec.campaign = None;
    for run in spec.runs_mut() {
        for file in [&mut run.exe, &mut run.library, &mut run.fmu].into_iter().flatten() {
            let name = Path::new(&*file).file_name();
            *file = name.map_or(String::new(), |name| name.to_string_lossy().into_owned());
        }
    }
    digest_of_scenario(&spec)
}

impl Identity {
    /// The identity of `campaign`.
    ///
    /// # Errors
    /// When a program cannot be read.
    pub fn of(campaign: &Campaign, scenario: &Scenario) -> Result<Identity, CampaignError> {
        let whole = |path: &Path| AnyPath(std::path::absolute(path).unwrap_or_else(|_| path.to_owned()));
        let source = campaign.source.as_ref().map(|source| Source {
            file: whole(&source.file.0),
            ..source.clone()
        });
        let own = source.as_ref().map_or("", |source| &source.title);
        let mut identity = Identity {
            kind: campaign.kind,
            scenario: scenario.name.clone(),
            title: if own.is_empty() { &scenario.title } else { own }.to_owned(),
            file: whole(&campaign.scenario),
            source,
            changes: campaign.overrides.clone(),
            columns: campaign.columns.iter().map(Heading::of).collect(),
            points: campaign.points.len(),
            program: digest_of_programs(scenario)?,
            content: digest_of_content(scenario),
            digest: Digest::of(b""),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            shard: None,
            digests: campaign.digests,
            audit: 0.0,
            until: None,
        };
        identity.digest = identity.digest_of(campaign, campaign.points.len());
        Ok(identity)
    }

    /// The campaign's name on its page: its title, or the scenario's name where it has none.
    pub fn heading(&self) -> &str {
        if self.title.is_empty() {
            &self.scenario
        } else {
            &self.title
        }
    }

    /// The digest of the campaign with only its first `count` points.
    pub(crate) fn digest_of(&self, campaign: &Campaign, count: usize) -> Digest {
        let mut parts = DigestBuilder::new("escapement campaign 2");
        parts.add(self.program.as_bytes());
        parts.add(self.content.as_bytes());
        if let Some(source) = &self.source {
            parts.add(source.digest.as_bytes());
        }
        for heading in &self.columns {
            parts.add(heading.name.as_bytes());
        }
        if self.digests {
            parts.add(b"digests");
        }
        for changes in campaign.points.iter().take(count) {
            parts.add(changes.join("\n").as_bytes());
        }
        parts.digest()
    }

    /// Reads the identity of the folder `root`.
    ///
    /// # Errors
    /// When it is not a campaign's folder.
    pub fn read(root: &Path) -> Result<Identity, CampaignError> {
        let path = root.join("campaign.json");
        let refuse = |reason: String| CampaignError::Folder {
            path: root.to_owned(),
            reason,
        };
        let text = match fs::read_to_string(&path) {
            Ok(text) => text,
            Err(error) if matches!(error.kind(), io::ErrorKind::NotFound | io::ErrorKind::NotADirectory) => {
                return Err(refuse("is no campaign's folder: it has no campaign.json".into()));
            }
            Err(error) => return Err(io_error(&path, "read the file")(error)),
        };
        serde_json::from_str(&text).map_err(|error| {
            refuse(format!(
                "campaign.json cannot be read ({error}): name a new folder with --out"
            ))
        })
    }

    /// Whether point `at` (from 0) belongs to the folder.
    pub fn owns(&self, at: usize) -> bool {
        self.shard.is_none_or(|shard| shard.owns(at))
    }

    /// Whether the folder is for a second run of point `at` (from 0), which belongs to another shard.
    pub fn audits(&self, at: usize) -> bool {
        self.shard.is_some_and(|shard| shard.audits(at, self.audit))
    }

    /// The digests that determine the points besides their number.
    fn input_digests(&self) -> (Digest, Digest, Option<Digest>) {
        let source = self.source.as_ref().map(|source| source.digest);
        (self.program, self.content, source)
    }

    /// Whether `other` is the same campaign, with more or fewer points, or a shard of it.
    pub(crate) fn is_same_except_points(&self, other: &Identity) -> bool {
        let headings = |one: &Identity| {
            one.columns
                .iter()
                .map(|heading| heading.name.clone())
                .collect::<Vec<_>>()
        };
        self.input_digests() == other.input_digests()
            && self.digests == other.digests
            && headings(self) == headings(other)
    }

    /// A summary as text: `200 points of `close`, digest 0123456789…`
    pub(crate) fn summary(&self) -> String {
        let digest = self.digest.to_string();
        let shard = self.shard.map_or(String::new(), |shard| format!("shard {shard} of "));
        format!(
            "{shard}{} points of `{}`, digest {}…",
            self.points,
            self.scenario,
            &digest[..10]
        )
    }

    /// Checks whether the folder of this campaign may become that of `wanted`: the same campaign, or one that has grown.
    pub(crate) fn check_can_become(&self, wanted: &Identity, campaign: &Campaign) -> Result<(), String> {
        let another = |why: &str| {
            Err(format!(
                "is of another campaign ({}): {why}; name a new folder with --out",
                self.summary()
            ))
        };
        if self.shard != wanted.shard {
            let name = |shard: Option<_>| shard.map_or("all points".to_owned(), |shard| format!("shard {shard}"));
            return Err(format!(
                "is for {} of a campaign and not for {}: name a new folder with --out",
                name(self.shard),
                name(wanted.shard)
            ));
        }
        if self.digest == wanted.digest {
            return Ok(());
        }
        if self.points < wanted.points && self.digest == wanted.digest_of(campaign, self.points) {
            return Ok(());
        }
        let same = self.input_digests() == wanted.input_digests();
        if same && self.points < wanted.points && self.source.as_ref().is_some_and(|source| !source.grows) {
            return Err(format!(
                "has {} points of a Latin hypercube, and the number of points is part of every draw: it cannot become one of {}; name a new \
                 folder with --out, or begin with the design random or sobol, which grow",
                self.points, wanted.points
            ));
        }
        if same && self.points > wanted.points {
            return another(&format!(
                "it has {} points and not {}, and a campaign grows but does not shrink",
                self.points, wanted.points
            ));
        }
        another(&self.difference(wanted))
    }

    /// The part of `other` that differs, where its digest differs.
    pub(crate) fn difference(&self, other: &Identity) -> String {
        if self.program != other.program {
            format!(
                "the program or one of the scenario's own is another build ({} and {})",
                self.version, other.version
            )
        } else if self.content != other.content {
            "the scenario or a file of it is not the same".to_owned()
        } else if self.input_digests() != other.input_digests() {
            "the campaign file is not the same".to_owned()
        } else if self.digests != other.digests {
            "only one of them has the digests of the tapes (--digest)".to_owned()
        } else {
            format!("the points are not the same ({} and {})", self.points, other.points)
        }
    }
}

impl Heading {
    fn of(column: &Column) -> Heading {
        Heading {
            name: column.name.clone(),
            unit: column.unit.clone(),
            numbers: column.numbers.is_some(),
            whole: column.whole.is_some(),
        }
    }

    fn column(&self, count: usize) -> Column {
        Column {
            name: self.name.clone(),
            unit: self.unit.clone(),
            texts: vec![String::new(); count],
            numbers: self.numbers.then(|| vec![0.0; count]),
            whole: self.whole.then(|| vec![0; count]),
        }
    }
}

impl Campaign {
    /// The reason why point `at` (from 0) does not exist, if so. The list is sorted.
    pub fn refused_at(&self, at: usize) -> Option<&str> {
        let found = self.refused.binary_search_by_key(&at, |(point, _)| *point).ok()?;
        Some(&self.refused[found].1)
    }

    /// A campaign whose points are still to be filled in.
    pub(crate) fn without_points(identity: &Identity) -> Campaign {
        Campaign {
            kind: identity.kind,
            scenario: identity.file.0.clone(),
            overrides: identity.changes.clone(),
            columns: identity
                .columns
                .iter()
                .map(|heading| heading.column(identity.points))
                .collect(),
            points: vec![Vec::new(); identity.points],
            refused: Vec::new(),
            source: identity.source.clone(),
            digests: identity.digests,
        }
    }
}

/// The folder of a campaign unless the user names one.
pub(crate) fn default_root(identity: &Identity, digest: &Digest) -> PathBuf {
    let letters = identity.scenario.chars().map(|letter| {
        if letter.is_ascii_alphanumeric() || letter == '_' {
            letter
        } else {
            '-'
        }
    });
    let parent = match identity.kind {
        CampaignKind::Sweep => "sweeps",
        CampaignKind::Faults => "faults",
    };
    let shard = identity
        .shard
        .map_or(String::new(), |shard| format!(".{}-of-{}", shard.number, shard.of));
    let name: String = letters.collect();
    Path::new(parent).join(format!("{name}-{}{shard}", &digest.to_string()[..10]))
}
