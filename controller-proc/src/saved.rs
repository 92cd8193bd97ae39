//! The complete state of a controller: that of its laws.

use control_laws::{comparison, hierarchical, stabilise};
use lockstep::participant::{Failure, state};
use serde::{Deserialize, Serialize};

use crate::law::{Approach, Law};

#[derive(Serialize, Deserialize)]
struct Saved {
    approach: SavedApproach,
    stabilise: Option<stabilise::State>,
}

#[derive(Serialize, Deserialize)]
enum SavedApproach {
    Hierarchical(hierarchical::State),
    Comparison(comparison::State),
}

/// The state of `law`.
pub fn save(law: &Law) -> Option<Vec<u8>> {
    let approach = match &law.approach {
        Approach::Hierarchical(law) => SavedApproach::Hierarchical(law.state()),
        Approach::Comparison(law) => SavedApproach::Comparison(law.state()),
    };
    let stabilise = law.stabilise.as_ref().map(|law| law.state());
    state::to_bytes(&Saved { approach, stabilise })
}

/// Restores `law` from a state returned by [`save`].
pub fn restore(law: &mut Law, state: &[u8]) -> Result<(), Failure> {
    let saved: Saved = state::from_bytes(state)?;
    match (&mut law.approach, &saved.approach) {
        (Approach::Hierarchical(law), SavedApproach::Hierarchical(saved)) => law.restore(saved),
        (Approach::Comparison(law), SavedApproach::Comparison(saved)) => law.restore(saved),
        _ => {
            return Err(
                "the state is of a controller with another law; start it without the state, or with the same `law`"
                    .into(),
            );
        }
    }
    // stabilisation added or removed since the save has no state to restore
    if let (Some(law), Some(saved)) = (&mut law.stabilise, &saved.stabilise) {
        law.restore(saved);
    }
    Ok(())
}
