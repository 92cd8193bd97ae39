//! The origin of a scenario: the line of a mistake, or the change that caused it.

use std::collections::HashMap;
use std::path::PathBuf;
use std::sync::{Arc, OnceLock};

use serde::de::DeserializeOwned;
use toml::Value;

use crate::scenario::error::{Mistake, ScenarioError};
use crate::scenario::key_lines::KeyLines;
use crate::scenario::value::toml_reason;

/// The origin of a change by `--set`.
pub(super) const WITH_SET: &str = "given with --set";

/// The file and the changes from which a scenario was made. They have no influence on the scenario's content.
#[derive(Debug, Clone, Default)]
pub(in crate::scenario) struct Origin {
    pub(in crate::scenario) file: PathBuf,
    text: Arc<SourceText>,
    /// The keys that were changed afterwards, and how.
    changed: HashMap<String, &'static str>,
    /// The files whose contents were included in the scenario.
    pub(in crate::scenario) files: Vec<PathBuf>,
}

#[derive(Debug, Default)]
struct SourceText {
    text: String,
    /// The lines of its keys, once there is a mistake.
    lines: OnceLock<KeyLines>,
}

impl PartialEq for Origin {
    /// Scenarios with the same content are equal, wherever they were read.
    fn eq(&self, _: &Origin) -> bool {
        true
    }
}

impl Origin {
    pub(super) fn of(file: PathBuf, text: String) -> Origin {
        Origin {
            file,
            text: Arc::new(SourceText {
                text,
                lines: OnceLock::new(),
            }),
            ..Origin::default()
        }
    }

    /// Registers that `key` was changed; `how` is the origin of the change.
    pub(super) fn record_change(&mut self, key: String, how: &'static str) {
        self.changed.insert(key, how);
    }

    /// Whether `key` itself was changed.
    pub(in crate::scenario) fn is_changed(&self, key: &str) -> bool {
        self.changed.contains_key(key)
    }

    /// Whether `key` itself was changed by an option that puts a program in the place of another one. A program that was set is the one
    /// that the scenario now has.
    pub(in crate::scenario) fn is_substituted(&self, key: &str) -> bool {
        self.changed.get(key).is_some_and(|how| *how != WITH_SET)
    }

    /// A mistake about `key`, with its line, or with the change that made it. Changes below the key are named too if the file has
    /// no line for it.
    pub(in crate::scenario) fn mistake(&self, key: &str, reason: impl Into<String>) -> Mistake {
        let reason = reason.into();
        // The key itself, then the tables that contain it.
        let ends = key.rmatch_indices('.').map(|(at, _)| at);
        let mut around = std::iter::once(key.len()).chain(ends).map(|end| &key[..end]);
        if let Some(how) = around.find_map(|key| self.changed.get(key)) {
            return Mistake {
                line: None,
                key: key.to_owned(),
                reason: format!("{reason} ({how})"),
            };
        }
        let lines = self.text.lines.get_or_init(|| KeyLines::of(&self.text.text));
        Mistake {
            line: lines.line(key),
            key: key.to_owned(),
            reason: match self.changed_below(key) {
                below if below.is_empty() => reason,
                below => format!("{reason} ({below})"),
            },
        }
    }

    /// The changes below `key`, and how they were made; only the first ones if there are many.
    fn changed_below(&self, key: &str) -> String {
        const SHOWN_MAX: usize = 3;
        let below = |(changed, how): (&String, &&str)| {
            let rest = changed.strip_prefix(key)?.strip_prefix('.')?;
            Some(format!("`{rest}` {how}"))
        };
        let mut all: Vec<String> = self.changed.iter().filter_map(below).collect();
        all.sort();
        let more = all.len().saturating_sub(SHOWN_MAX);
        all.truncate(SHOWN_MAX);
        if more > 0 {
            all.push(format!("{more} more"));
        }
        all.join(", ")
    }

    pub(in crate::scenario) fn error(&self, mistakes: Vec<Mistake>) -> ScenarioError {
        ScenarioError {
            file: self.file.clone(),
            mistakes,
        }
    }
}

/// Reads one section; a mistake is reported with its key.
pub(super) fn deserialize_at<T: DeserializeOwned>(origin: &Origin, key: &str, value: Value) -> Result<T, Mistake> {
    serde_path_to_error::deserialize(value).map_err(|error| {
        let path = error.path().to_string();
        let key = match (key, path.as_str()) {
            (key, ".") => key.to_owned(),
            ("", path) => path.to_owned(),
            (key, path) => format!("{key}.{path}"),
        };
        origin.mistake(&key, toml_reason(&error.into_inner()))
    })
}
