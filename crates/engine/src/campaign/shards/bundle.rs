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
use crate::campaign::folder::identity::{Identity, failed};
use crate::campaign::{Campaign, CampaignError};
use crate::scenario::{Named, RunSpec, Scenario, each_in, each_named, value};

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
/// the folder `root`. The folder is new, or holds a bundle of the same campaign or of one that has grown to this one.
///
/// # Errors
/// When the folder belongs to something else, a file cannot be read, or the scenario in the bundle differs.
pub fn bundle(
    root: &Path,
    catalogue: &Arc<Catalogue>,
    campaign: &Campaign,
    scenario: &Scenario,
    include: &[PathBuf],
) -> Result<Bundle, CampaignError> {
    let mut identity = Identity::of(campaign, scenario)?;
    if root.join("campaign.json").exists() {
        let known = Identity::read(root)?;
        known
            .may_become(&identity, campaign)
            .map_err(|reason| refuse(root, reason))?;
    } else if fs::read_dir(root).is_ok_and(|mut entries| entries.next().is_some()) {
        return Err(refuse(root, "is not empty and no bundle: name a new folder"));
    }
    let mut contents = Contents::new(&campaign.scenario)?;
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
        let from = std::path::absolute(path).map_err(failed(path, "find the file"))?;
        contents.bring(&from);
    }
    // Written completely under another name first: a partial bundle never looks like a complete one.
    let mut draft = root.as_os_str().to_owned();
    draft.push(".part");
    let draft = PathBuf::from(draft);
    let _ = fs::remove_dir_all(&draft);
    contents.write(&draft)?;
    let own = fs::read_link("/proc/self/exe").map_err(failed(Path::new("/proc/self/exe"), "find the program"))?;
    let program = Path::new("bin").join(own.file_name().unwrap_or_default());
    copy(Path::new("/proc/self/exe"), &draft.join(&program))?;
    identity.file = AnyPath(contents.place(&contents.folder.join(&contents.name)));
    if let Some(source) = &mut identity.source {
        source.file = AnyPath(contents.place(&source.file.0));
    }
    // A participant that is substituted in all points does not need its own program.
    let replaced = |one: &str| {
        let mut names = changes.substitutes.iter().map(|(name, _)| name);
        names.any(|name| one.starts_with(&format!("participants.{name}.run=")))
    };
    let moved: Vec<String> = contents.changes.into_iter().filter(|one| !replaced(one)).collect();
    changes.set.splice(0..0, moved);
    identity.changes = changes;
    identity.write(&draft, campaign)?;
    same(&draft, catalogue, &identity)?;
    let _ = fs::remove_dir_all(root);
    fs::rename(&draft, root).map_err(failed(root, "name the folder"))?;
    Ok(Bundle {
        program: root.join(program),
        root: root.to_owned(),
        identity,
        left: contents.left,
    })
}

/// Checks that the scenario in the bundle is equal to the one outside.
fn same(root: &Path, catalogue: &Arc<Catalogue>, identity: &Identity) -> Result<(), CampaignError> {
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
struct Contents {
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
    left: Vec<String>,
}

/// The path without `.` and `..`, resolved lexically.
fn tidy(path: &Path) -> PathBuf {
    let mut tidy = PathBuf::new();
    for part in path.components() {
        match part {
            Component::CurDir => {}
            Component::ParentDir => {
                tidy.pop();
            }
            part => tidy.push(part),
        }
    }
    tidy
}

impl Contents {
    fn new(scenario: &Path) -> Result<Contents, CampaignError> {
        let text = fs::read_to_string(scenario).map_err(failed(scenario, "read the file"))?;
        let file = std::path::absolute(scenario).map_err(failed(scenario, "find the file"))?;
        Ok(Contents {
            folder: file.parent().unwrap_or(Path::new("/")).to_owned(),
            text,
            name: file.file_name().unwrap_or_default().into(),
            files: BTreeSet::new(),
            outside: BTreeMap::new(),
            changes: Vec::new(),
            left: Vec::new(),
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
        let mut moved = Vec::new();
        each_named(&mut table, &mut |key, named| {
            if let Some(value) = self.named(key, named, true) {
                moved.push((key.to_owned(), value));
            }
        });
        for (key, value) in moved {
            if key.starts_with("faults.") {
                self.left.push(format!(
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
        let path = std::path::absolute(path).map_err(failed(path, "find the file"))?;
        let folder = path.parent().unwrap_or(Path::new("/"));
        let file = CampaignFile::open(&path)?;
        for (key, name) in file.iter().flat_map(CampaignFile::files) {
            if Path::new(name).is_absolute() {
                self.left.push(format!(
                    "{key}: `{name}` is where it is: a machine that draws more points must have it"
                ));
            } else if key != "scenario" {
                self.bring(&folder.join(name));
            }
        }
        // A scenario that declares its campaign itself is already there.
        if tidy(&path) != tidy(&self.folder.join(&self.name)) {
            self.bring(&path);
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
        each_in(key.trim(), &mut read, &mut |key, named| {
            changed |= self.named(key, named, may_change).is_some();
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
        let moved = self.named(&format!("participants.{participant}.run"), Named::Run(&mut table), true);
        if let Some(moved) = moved.and_then(|moved| moved.try_into().ok()) {
            *run = moved;
        }
    }

    /// Adds the file or folder that `named` names; returns its replacement in the bundle, if that differs.
    fn named(&mut self, key: &str, named: Named<'_>, may_change: bool) -> Option<Value> {
        match named {
            Named::File(file) => {
                *file = self.path(key, file, may_change)?;
                Some(Value::Table(Table::from_iter([(
                    "file".to_owned(),
                    Value::String(file.clone()),
                )])))
            }
            Named::Run(run) => {
                let mut changed = false;
                for which in ["library", "fmu"] {
                    if let Some(Value::String(file)) = run.get_mut(which)
                        && let Some(moved) = self.path(key, file, may_change)
                    {
                        *file = moved;
                        changed = true;
                    }
                }
                if let Some(Value::String(exe)) = run.get("exe") {
                    if exe.contains('/') && !Path::new(exe).is_absolute() {
                        self.bring(&self.folder.join(exe));
                    } else {
                        self.left.push(format!(
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
                self.left.push(format!(
                    "{key}: the argument `{arg}` leads to something that is not in the bundle: every machine must have it, or name it with --include"
                ));
            } else {
                self.bring(&path);
            }
        }
    }

    /// Adds the file `file`; returns its path in the bundle where that differs.
    fn path(&mut self, key: &str, file: &str, may_change: bool) -> Option<String> {
        let path = Path::new(file);
        if !path.is_absolute() {
            self.bring(&self.folder.join(file));
            return None;
        }
        if !may_change {
            self.left
                .push(format!("{key}: `{file}` is where it is: every machine must have it"));
            return None;
        }
        let number = self.outside.len() + 1;
        let name = path.file_name()?;
        let place = self
            .outside
            .entry(tidy(path))
            .or_insert_with(|| Path::new("outside").join(number.to_string()).join(name));
        place.to_str().map(str::to_owned)
    }

    fn bring(&mut self, path: &Path) {
        self.files.insert(path.to_owned());
    }

    /// The place in the bundle of a file or folder that was added: below the folder that all of them have in common.
    fn place(&self, path: &Path) -> PathBuf {
        let mut base = tidy(&self.folder);
        for file in &self.files {
            let file = tidy(file);
            while !file.starts_with(&base) {
                base.pop();
            }
        }
        let path = tidy(path);
        Path::new("tree").join(path.strip_prefix(&base).unwrap_or(&path))
    }

    /// Copies everything below `root`.
    fn write(&self, root: &Path) -> Result<(), CampaignError> {
        let own = root.join(self.place(&self.folder));
        let path = own.join(&self.name);
        make(&own)?;
        fs::write(&path, &self.text).map_err(failed(&path, "write the file"))?;
        for file in &self.files {
            copy(file, &root.join(self.place(file)))?;
        }
        for (file, beside) in &self.outside {
            copy(file, &own.join(beside))?;
        }
        Ok(())
    }
}

fn make(folder: &Path) -> Result<(), CampaignError> {
    fs::create_dir_all(folder).map_err(failed(folder, "create the folder"))
}

/// Copies a file or a folder.
fn copy(from: &Path, to: &Path) -> Result<(), CampaignError> {
    if from.is_dir() {
        make(to)?;
        for entry in fs::read_dir(from).map_err(failed(from, "read the folder"))? {
            let entry = entry.map_err(failed(from, "read the folder"))?;
            copy(&entry.path(), &to.join(entry.file_name()))?;
        }
        return Ok(());
    }
    if let Some(folder) = to.parent() {
        make(folder)?;
    }
    fs::copy(from, to).map(|_| ()).map_err(failed(from, "copy the file"))
}
