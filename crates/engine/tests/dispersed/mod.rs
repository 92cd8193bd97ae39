//! A scenario to vary, and campaign files of it.

use std::path::PathBuf;
use std::sync::Arc;

use engine::Catalogue;
use engine::campaign::{CampaignFile, Plan};
use engine::scenario::Scenario;

const SCENARIO: &str = r#"
duration = "1 s"
seed = 5

[participants.body]
run = { exe = "/bin/true" }
period = "1 ms"

[participants.body.parameters]
mass = "12 kg"
count = 3
part = 0.5
position = "[1, 2, 3] m"
attitude = [1.0, 0.0, 0.0, 0.0]
angles = "[0, 0, 90] deg"
moments = "[3, 4, 5] kg m^2"
inertia = "[3, 4, 5, 0, 0, 0] kg m^2"
wrong = "[1, 1, 3] kg m^2"

[connections.x]
from = "body.a"
to = "body.b"

[[faults]]
name = "late"
at = "0.5 s"
connection = "x"
extra-delay = "1 ms"
"#;

/// A folder with the scenario.
pub struct Files(pub PathBuf);

impl Files {
    pub fn new(name: &str) -> Files {
        let folder = std::env::temp_dir().join(format!("campaign-files-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        std::fs::write(folder.join("scenario.toml"), SCENARIO).unwrap();
        Files(folder)
    }

    /// The plan of a campaign file, or why there is none.
    pub fn plan(&self, campaign: &str) -> Result<Plan, String> {
        let path = self.0.join("campaign.toml");
        std::fs::write(&path, format!("scenario = 'scenario.toml'\n{campaign}")).unwrap();
        let file = CampaignFile::open(&path).map_err(|error| error.to_string())?.unwrap();
        let catalogue = Arc::new(Catalogue::new("test"));
        let scenario = Scenario::read(&catalogue, file.scenario(), &[]).map_err(|error| error.to_string())?;
        file.plan(&scenario).map_err(|error| error.to_string())
    }
}

impl Drop for Files {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// The table of the parameters.
pub const B: &str = "participants.body.parameters";

/// One dispersion of a parameter.
pub fn one(key: &str, rest: &str) -> String {
    format!("[vary.x]\nkey = '{B}.{key}'\n{rest}\n")
}
