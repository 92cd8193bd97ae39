//! Bundles: a campaign with all files that it needs in one folder, which runs wherever the folder is copied to.
//!
//! Below `tree` the files keep their positions relative to each other, so that relative paths stay valid.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Component, Path, PathBuf};
use std::sync::Arc;

use toml::{Table, Value};

use crate::Catalogue;
use crate::campaign::file::CampaignFile;
use crate::campaign::folder::any_path::AnyPath;
use crate::campaign::folder::identity::{Identity, io_error};
use crate::campaign::{Campaign, CampaignError, Options};
use crate::scenario::{FileReference, RunSpec, Scenario, value, visit_file_references, visit_file_references_at};

/// A bundle: its contents, and what it lacks.
#[derive(Debug)]
pub struct Bundle {
    /// The folder.
    pub root: PathBuf,
    /// The program in the bundle that runs it.
    pub program: PathBuf,
    /// The identity of its campaign.
    pub identity: Identity,
    /// Dependencies that the bundle does not contain: every machine must have them.
    pub left: Vec<String>,
}

fn refuse(path: &Path, reason: impl Into<String>) -> CampaignError {
    CampaignError::Folder {
        path: path.to_owned(),
        reason: reason.into(),
    }
}

/// Writes `campaign` with its scenario, all files that belong to it, the files and folders `include`, and this program to
/// the folder `root`. The folder is new, or holds a bundle of the same campaign or of one that has grown to this one. The stopping rule
/// and the share of the points that is run twice, which are in `options`, come along.
///
/// # Errors
/// When the folder belongs to something else, a file cannot be read, or the scenario in the bundle differs.
pub fn bundle(
    root: &Path,
    catalogue: &Arc<Catalogue>,
    campaign: &Campaign,
    scenario: &Scenario,
    options: &Options,
    include: &[PathBuf],
) -> Result<Bundle, CampaignError> {
    let mut identity = Identity {
        until: options.stopping_rule(),
        audit: options.audit,
        ..Identity::of(campaign, scenario)?
    };
    if root.join("campaign.json").exists() {
        let known = Identity::read(root)?;
        known
            .check_can_become(&identity, campaign)
            .map_err(|reason| refuse(root, reason))?;
    } else if fs::read_dir(root).is_ok_and(|mut entries| entries.next().is_some()) {
        return Err(refuse(root, "is not empty and no bundle: name a new folder"));
    }
    let mut contents = BundleContents::new(&campaign.scenario)?;
    contents.scenario(&campaign.scenario)?;
    if let Some(source) = &campaign.source {
        contents.campaign_file(&source.file.0)?;
    }
    let mut changes = campaign.overrides.clone();
    for change in &mut changes.set {
        *change = contents.change(change, true);
    }
    for (participant, run) in &mut changes.substitutes {
        contents.substitute(participant, run);
    }
    let values: BTreeSet<&String> = campaign.points.iter().flatten().collect();
    for change in values {
        contents.change(change, false);
    }
    for path in include {
        let from = std::path::absolute(path).map_err(io_error(path, "find the file"))?;
        contents.add(&from);
    }
    // Written completely under another name first: a partial bundle never looks like a complete one.
    let mut draft = root.as_os_str().to_owned();
    draft.push(".part");
    let draft = PathBuf::from(draft);
    let _ = fs::remove_dir_all(&draft);
    contents.write(&draft)?;
    let own = fs::read_link("/proc/self/exe").map_err(io_error(Path::new("/proc/self/exe"), "find the program"))?;
    let program = Path::new("bin").join(own.file_name().unwrap_or_default());
    copy(Path::new("/proc/self/exe"), &draft.join(&program))?;
    identity.file = AnyPath(contents.bundle_path(&contents.folder.join(&contents.name)));
    if let Some(source) = &mut identity.source {
        source.file = AnyPath(contents.bundle_path(&source.file.0));
    }
    // A participant that is substituted in all points does not need its own program.
    let replaced = |one: &str| {
        let mut names = changes.substitutes.iter().map(|(name, _)| name);
        names.any(|name| one.starts_with(&format!("participants.{name}.run=")))
    };
    let relocated: Vec<String> = contents.changes.into_iter().filter(|one| !replaced(one)).collect();
    changes.set.splice(0..0, relocated);
    identity.changes = changes;
    identity.write(&draft, campaign)?;
    check_same_scenario(&draft, catalogue, &identity)?;
    let _ = fs::remove_dir_all(root);
    fs::rename(&draft, root).map_err(io_error(root, "name the folder"))?;
    Ok(Bundle {
        program: root.join(program),
        root: root.to_owned(),
        identity,
        left: contents.excluded,
    })
}

/// Checks that the scenario in the bundle is equal to the one outside.
fn check_same_scenario(root: &Path, catalogue: &Arc<Catalogue>, identity: &Identity) -> Result<(), CampaignError> {
    let (campaign, _) = Campaign::of_folder(root)?;
    let scenario = Scenario::changed(catalogue, &campaign.scenario, &campaign.overrides)?;
    let there = Identity::of(&campaign, &scenario)?;
    if (there.program, there.content) == (identity.program, identity.content) {
        return Ok(());
    }
    Err(refuse(
        root,
        format!(
            "does not say what the campaign says: {}; name missing files with --include",
            identity.difference(&there)
        ),
    ))
}

/// The files of a bundle while they are collected.
struct BundleContents {
    /// The absolute path of the folder that relative paths refer to.
    folder: PathBuf,
    /// The scenario as it will be written.
    text: String,
    name: PathBuf,
    /// Files and folders to be copied; and, for those outside the folder, their place in the bundle.
    files: BTreeSet<PathBuf>,
    outside: BTreeMap<PathBuf, PathBuf>,
    /// Changes that the bundle needs because a path in the scenario points outside.
    changes: Vec<String>,
    excluded: Vec<String>,
}

/// The path without `.` and `..`, resolved lexically.
fn normalised(path: &Path) -> PathBuf {
    let mut normalised = PathBuf::new();
    for part in path.components() {
        match part {
            Component::CurDir => {}
            Component::ParentDir => {
                normalised.pop();
            }
            part => normalised.push(part),
        }
    }
    normalised
}

impl BundleContents {
    fn new(scenario: &Path) -> Result<BundleContents, CampaignError> {
        let text = fs::read_to_string(scenario).map_err(io_error(scenario, "read the file"))?;
        let file = std::path::absolute(scenario).map_err(io_error(scenario, "find the file"))?;
        Ok(BundleContents {
            folder: file.parent().unwrap_or(Path::new("/")).to_owned(),
            text,
            name: file.file_name().unwrap_or_default().into(),
            files: BTreeSet::new(),
            outside: BTreeMap::new(),
            changes: Vec::new(),
            excluded: Vec::new(),
        })
    }

    /// Collects the files that the scenario file names.
    fn scenario(&mut self, path: &Path) -> Result<(), CampaignError> {
        let table = self.text.parse::<Table>();
        let mut table = table.map_err(|error| refuse(path, format!("is not TOML: {}", error.message())))?;
        if let Some(Value::String(folder)) = table.remove("folder") {
            // The bundle puts the scenario into the folder that it names.
            self.folder = self.folder.join(folder);
            self.text = table.to_string();
        }
        let mut relocated = Vec::new();
        visit_file_references(&mut table, &mut |key, named| {
            if let Some(value) = self.collect(key, named, true) {
                relocated.push((key.to_owned(), value));
            }
        });
        for (key, value) in relocated {
            if key.starts_with("faults.") {
                self.excluded.push(format!(
                    "{key}: the files of {value} are where they are: every machine must have them"
                ));
            } else {
                self.changes.push(format!("{key}={value}"));
            }
        }
        Ok(())
    }

    /// Adds the campaign file `path` and the files that it takes values from.
    fn campaign_file(&mut self, path: &Path) -> Result<(), CampaignError> {
        let path = std::path::absolute(path).map_err(io_error(path, "find the file"))?;
        let folder = path.parent().unwrap_or(Path::new("/"));
        let file = CampaignFile::open(&path)?;
        for (key, name) in file.iter().flat_map(CampaignFile::files) {
            if Path::new(name).is_absolute() {
                self.excluded.push(format!(
                    "{key}: `{name}` is where it is: a machine that draws more points must have it"
                ));
            } else if key != "scenario" {
                self.add(&folder.join(name));
            }
        }
        // A scenario that declares its campaign itself is already there.
        if normalised(&path) != normalised(&self.folder.join(&self.name)) {
            self.add(&path);
        }
        Ok(())
    }

    /// Collects the files that a change names; returns the change for the bundle, in which paths that point outside may be
    /// replaced.
    fn change(&mut self, change: &str, may_change: bool) -> String {
        let Some((key, text)) = change.split_once('=').filter(|(_, text)| text.contains('{')) else {
            return change.to_owned();
        };
        let (mut read, mut changed) = (value(text.trim()), false);
        visit_file_references_at(key.trim(), &mut read, &mut |key, named| {
            changed |= self.collect(key, named, may_change).is_some();
        });
        if changed {
            format!("{key}={read}")
        } else {
            change.to_owned()
        }
    }

    /// Collects the files of a participant's substitute; replaces paths that point outside.
    fn substitute(&mut self, participant: &str, run: &mut RunSpec) {
        let Ok(mut table) = Table::try_from(&*run) else { return };
        let relocated = self.collect(
            &format!("participants.{participant}.run"),
            FileReference::Run(&mut table),
            true,
        );
        if let Some(relocated) = relocated.and_then(|relocated| relocated.try_into().ok()) {
            *run = relocated;
        }
    }

    /// Adds the file or folder that `named` names; returns its replacement in the bundle, if that differs.
    fn collect(&mut self, key: &str, named: FileReference<'_>, may_change: bool) -> Option<Value> {
        match named {
            FileReference::File(file) => {
                *file = self.path(key, file, may_change)?;
                Some(Value::Table(Table::from_iter([(
                    "file".to_owned(),
                    Value::String(file.clone()),
                )])))
            }
            FileReference::Run(run) => {
                let mut changed = false;
                for which in ["library", "fmu"] {
                    if let Some(Value::String(file)) = run.get_mut(which)
                        && let Some(relocated) = self.path(key, file, may_change)
                    {
                        *file = relocated;
                        changed = true;
                    }
                }
                if let Some(Value::String(exe)) = run.get("exe") {
                    if exe.contains('/') && !Path::new(exe).is_absolute() {
                        self.add(&self.folder.join(exe));
                    } else {
                        self.excluded.push(format!(
                            "{key}: the program `{exe}` is one of the machine: every machine must have the same one"
                        ));
                    }
                    self.arguments(key, run.get("args"));
                }
                changed.then(|| Value::Table(run.clone()))
            }
        }
    }

    /// Adds those of a program's arguments that are files.
    fn arguments(&mut self, key: &str, args: Option<&Value>) {
        for arg in args
            .and_then(Value::as_array)
            .into_iter()
            .flatten()
            .filter_map(Value::as_str)
        {
            let path = self.folder.join(arg);
            if !path.exists() {
                continue;
            }
            if Path::new(arg).is_absolute() || !path.is_file() {
                self.excluded.push(format!(
                    "{key}: the argument `{arg}` leads to something that is not in the bundle: every machine must have it, or name it with --include"
                ));
            } else {
                self.add(&path);
            }
        }
    }

    /// Adds the file `file`; returns its path in the bundle where that differs.
    fn path(&mut self, key: &str, file: &str, may_change: bool) -> Option<String> {
        let path = Path::new(file);
        if !path.is_absolute() {
            self.add(&self.folder.join(file));
            return None;
        }
        if !may_change {
            self.excluded
                .push(format!("{key}: `{file}` is where it is: every machine must have it"));
            return None;
        }
        let number = self.outside.len() + 1;
        let name = path.file_name()?;
        let place = self
            .outside
            .entry(normalised(path))
            .or_insert_with(|| Path::new("outside").join(number.to_string()).join(name));
        place.to_str().map(str::to_owned)
    }

    fn add(&mut self, path: &Path) {
        self.files.insert(path.to_owned());
    }

    /// The place in the bundle of a file or folder that was added: below the folder that all of them have in common.
    fn bundle_path(&self, path: &Path) -> PathBuf {
        let mut base = normalised(&self.folder);
        for file in &self.files {
            let file = normalised(file);
            while !file.starts_with(&base) {
                base.pop();
            }
        }
        let path = normalised(path);
        Path::new("tree").join(path.strip_prefix(&base).unwrap_or(&path))
    }

    /// Copies everything below `root`.
    fn write(&self, root: &Path) -> Result<(), CampaignError> {
        let own = root.join(self.bundle_path(&self.folder));
        let path = own.join(&self.name);
        create_folder(&own)?;
        fs::write(&path, &self.text).map_err(io_error(&path, "write the file"))?;
        for file in &self.files {
            copy(file, &root.join(self.bundle_path(file)))?;
        }
        for (file, relative) in &self.outside {
            copy(file, &own.join(relative))?;
        }
        Ok(())
    }
}

fn create_folder(folder: &Path) -> Result<(), CampaignError> {
    fs::create_dir_all(folder).map_err(io_error(folder, "create the folder"))
}

/// Copies a file or a folder.
fn copy(from: &Path, to: &Path) -> Result<(), CampaignError> {
    if from.is_dir() {
        create_folder(to)?;
        for entry in fs::read_dir(from).map_err(io_error(from, "read the folder"))? {
            let entry = entry.map_err(io_error(from, "read the folder"))?;
            copy(&entry.path(), &to.join(entry.file_name()))?;
        }
        return Ok(());
    }
    if let Some(folder) = to.parent() {
        create_folder(folder)?;
    }
    fs::copy(from, to).map(|_| ()).map_err(io_error(from, "copy the file"))
}
