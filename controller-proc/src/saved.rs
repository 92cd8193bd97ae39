//! The complete state of a controller as plain numbers.

use control_laws::filter::FilterState;
use control_laws::outer::AttitudeState;
use control_laws::tracker::TrackerState;
use control_laws::{hierarchical, reference, stabilise};
use lockstep::participant::Failure;
use lockstep::wire;
use serde::{Deserialize, Serialize};

use crate::law::{Approach, Law};

#[derive(Serialize, Deserialize)]
struct Saved {
    approach: SavedApproach,
    /// Start of the stabilisation and time to rest.
    stabilise: Option<[f64; 2]>,
}

#[derive(Serialize, Deserialize)]
enum SavedApproach {
    Hierarchical {
        attitude: SavedAttitude,
        tracker: SavedTracker,
    },
    Reference {
        end_effector: SavedAttitude,
        base: SavedAttitude,
        tracker: SavedTracker,
    },
}

#[derive(Serialize, Deserialize)]
struct SavedAttitude {
    started: bool,
    h: f64,
    quaternion: [f64; 4],
}

#[derive(Serialize, Deserialize)]
struct SavedTracker {
    started: bool,
    velocity: [f64; 13],
    acceleration: [f64; 13],
    sigma: [f64; 13],
}

impl From<AttitudeState> for SavedAttitude {
    fn from(state: AttitudeState) -> Self {
        Self {
            started: state.started,
            h: state.h,
            quaternion: state.quaternion,
        }
    }
}

impl From<SavedAttitude> for AttitudeState {
    fn from(saved: SavedAttitude) -> Self {
        Self {
            started: saved.started,
            h: saved.h,
            quaternion: saved.quaternion,
        }
    }
}

impl From<TrackerState> for SavedTracker {
    fn from(state: TrackerState) -> Self {
        Self {
            started: state.filter.started,
            velocity: state.filter.velocity,
            acceleration: state.filter.acceleration,
            sigma: state.sigma,
        }
    }
}

impl From<SavedTracker> for TrackerState {
    fn from(saved: SavedTracker) -> Self {
        Self {
            filter: FilterState {
                started: saved.started,
                velocity: saved.velocity,
                acceleration: saved.acceleration,
            },
            sigma: saved.sigma,
        }
    }
}

/// The state of `law`.
pub fn save(law: &Law) -> Option<Vec<u8>> {
    let approach = match &law.approach {
        Approach::Hierarchical(law) => {
            let hierarchical::State { attitude, tracker } = law.state();
            SavedApproach::Hierarchical {
                attitude: attitude.into(),
                tracker: tracker.into(),
            }
        }
        Approach::Reference(law) => {
            let reference::State {
                end_effector,
                base,
                tracker,
            } = law.state();
            SavedApproach::Reference {
                end_effector: end_effector.into(),
                base: base.into(),
                tracker: tracker.into(),
            }
        }
    };
    let stabilise = law.stabilise.as_ref().map(|law| {
        let stabilise::State {
            start_s,
            time_to_rest_s,
        } = law.state();
        [start_s, time_to_rest_s]
    });
    wire::encode("the controller's state", &Saved { approach, stabilise }).ok()
}

/// Puts `law` into a state that [`save`] gave.
pub fn restore(law: &mut Law, state: &[u8]) -> Result<(), Failure> {
    let saved: Saved = wire::decode("the controller's state", state)?;
    match (&mut law.approach, saved.approach) {
        (Approach::Hierarchical(law), SavedApproach::Hierarchical { attitude, tracker }) => {
            law.restore(&hierarchical::State {
                attitude: attitude.into(),
                tracker: tracker.into(),
            });
        }
        (
            Approach::Reference(law),
            SavedApproach::Reference {
                end_effector,
                base,
                tracker,
            },
        ) => law.restore(&reference::State {
            end_effector: end_effector.into(),
            base: base.into(),
            tracker: tracker.into(),
        }),
        _ => {
            return Err(
                "the state is of a controller with another law; start it without the state, or with the same `law`"
                    .into(),
            );
        }
    }
    match (&mut law.stabilise, saved.stabilise) {
        // a law that stabilises from now on, or no longer, has nothing to remember
        (None, _) | (_, None) => {}
        (Some(law), Some([start_s, time_to_rest_s])) => law.restore(&stabilise::State {
            start_s,
            time_to_rest_s,
        }),
    }
    Ok(())
}
