//! A project of FMUs that the user names: a participant for each, connected where names and units fit.

use std::collections::BTreeMap;
use std::path::Path;

use fmu::{Draft, DraftParticipant, Model, Names};

use super::{File, Project};

/// The simulated duration of a model without a stop time, s.
const DURATION: f64 = 10.0;

pub(super) fn files(project: &Project<'_>) -> Result<Vec<File>, String> {
    if project.files.is_empty() {
        return Err(
            "--template fmu: name the FMUs behind the folder, such as escapement new FOLDER --template fmu a.fmu b.fmu"
                .into(),
        );
    }
    let (mut files, mut places, mut models) = (Vec::new(), BTreeMap::new(), Vec::new());
    let (mut names, mut stems) = (Names::default(), Names::default());
    for path in project.files {
        let model = Model::open(path).map_err(|error| error.to_string())?;
        model.library().map_err(|error| error.to_string())?;
        let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        // A file that is named twice becomes two participants.
        let real = std::fs::canonicalize(path).unwrap_or_else(|_| path.clone());
        let place = places
            .entry(real)
            .or_insert_with(|| format!("fmus/{}.fmu", stems.unique(&stem)))
            .clone();
        if files.iter().all(|file: &File| file.path != place) {
            files.push(copy(path, &place)?);
        }
        models.push((names.unique(&stem), place, model));
    }
    let parts = models.iter().map(|(name, place, model)| DraftParticipant {
        name: name.clone(),
        file: place.clone(),
        about: &model.description,
        period: format!("{} s", fmu::suggested_period(&model.description)),
        offset: Some(fmu::suggested_span(&model.description).0)
            .filter(|first| *first > 0.0)
            .map(|first| format!("{first} s")),
        parameters: fmu::parameter_entries(&model.description),
    });
    // A model without a stop time needs no certain end, except one after its start.
    let ends = models.iter().filter_map(|(_, _, model)| {
        let (first, end) = fmu::suggested_span(&model.description);
        (model.description.experiment.stop.is_some() || first > 0.0).then_some(end)
    });
    let stop = ends.fold(0.0, f64::max);
    let mut draft = Draft {
        title: format!("{}: FMUs together", project.name),
        duration: format!("{} s", if stop > 0.0 { stop } else { DURATION }),
        parts: parts.collect(),
        ..Draft::default()
    };
    fmu::connect_matching(&mut draft);
    files.insert(0, File::new("scenario.toml", draft.text()));
    Ok(files)
}

fn copy(path: &Path, place: &str) -> Result<File, String> {
    let contents = std::fs::read(path).map_err(|error| format!("{}: {error}", path.display()))?;
    Ok(File {
        path: place.to_owned(),
        contents,
    })
}
