//! The content of an exported FMU: the resources that its library reads when it is instantiated.

use std::path::Path;
use std::sync::Arc;

use engine::Catalogue;
use engine::scenario::Scenario;
use serde::{Deserialize, Serialize};
use tape::Digest;

use crate::kind::Version;

/// The name of the scenario among the resources.
pub const SCENARIO: &str = "scenario.toml";
/// The name of the manifest among the resources.
pub const MANIFEST: &str = "export.toml";
/// The format of the manifest.
pub const FORMAT: u32 = 1;

/// The part of the scenario that is exported.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    /// `FORMAT`.
    pub format: u32,
    /// The major version of the standard, 2 or 3.
    pub fmi: u32,
    /// The name of the model.
    pub model: String,
    /// The exported participant; if absent, the whole scenario.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub participant: Option<String>,
    /// For a whole scenario: the inputs that the importer sets, each `PARTICIPANT.INPUT`.
    #[serde(default)]
    pub inputs: Vec<String>,
    /// For a whole scenario: the outputs that the importer reads, each `PARTICIPANT.OUTPUT`.
    #[serde(default)]
    pub outputs: Vec<String>,
    /// Whether the state can be saved and restored.
    pub state: bool,
}

impl Manifest {
    /// The version of the standard.
    pub fn version(&self) -> Version {
        if self.fmi == 3 { Version::Fmi3 } else { Version::Fmi2 }
    }
}

/// The resources of an FMU.
pub struct Content {
    /// The manifest.
    pub manifest: Manifest,
    /// The scenario.
    pub scenario: Scenario,
    /// The token by which an importer matches library and description.
    pub token: String,
}

impl Content {
    /// Reads the folder `resources`.
    ///
    /// # Errors
    /// Names the file and what is wrong with it.
    pub fn read(catalogue: &Arc<Catalogue>, resources: &Path) -> Result<Content, String> {
        let read = |name: &str| {
            let file = resources.join(name);
            std::fs::read_to_string(&file).map_err(|error| format!("`{}` cannot be read: {error}", file.display()))
        };
        let (manifest, scenario) = (read(MANIFEST)?, read(SCENARIO)?);
        let token = token(&manifest, &scenario);
        let manifest: Manifest =
            toml::from_str(&manifest).map_err(|error| format!("`{MANIFEST}` is damaged: {}", error.message()))?;
        if manifest.format != FORMAT {
            return Err(format!(
                "`{MANIFEST}` has the format {}, not {FORMAT}: export the FMU again",
                manifest.format
            ));
        }
        let scenario = Scenario::read(catalogue, &resources.join(SCENARIO), &[]).map_err(|error| error.to_string())?;
        Ok(Content {
            manifest,
            scenario,
            token,
        })
    }
}

/// The token of an FMU with these texts, in the form of a GUID.
pub fn token(manifest: &str, scenario: &str) -> String {
    let digest = Digest::of(format!("{manifest}\n{scenario}").as_bytes());
    let hex: String = digest.as_bytes()[..16]
        .iter()
        .map(|byte| format!("{byte:02x}"))
        .collect();
    format!(
        "{{{}-{}-{}-{}-{}}}",
        &hex[..8],
        &hex[8..12],
        &hex[12..16],
        &hex[16..20],
        &hex[20..]
    )
}
