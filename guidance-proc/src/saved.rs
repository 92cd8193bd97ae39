//! The complete state of a guidance as plain numbers.

use guidance_laws::navigation::{self, NavigationFilter};
use guidance_laws::{capture, reference};
use lockstep::participant::Failure;
use lockstep::wire;
use serde::{Deserialize, Serialize};

use crate::law::Law;
use crate::navigation::Navigation;

/// A state as it is written: what the law and the filter remember, and which of them there are.
#[derive(Serialize, Deserialize)]
struct Saved {
    end_effector: capture::State,
    base: Option<SavedBase>,
    navigation: Option<SavedNavigation>,
}

#[derive(Serialize, Deserialize)]
struct SavedBase {
    started: bool,
    position: [f64; 3],
    attitude: [f64; 4],
}

#[derive(Serialize, Deserialize)]
struct SavedNavigation {
    filter: navigation::State,
    refused: u64,
    innovation: f64,
}

/// The state of a guidance with this law and this filter.
pub fn save(law: &Law, navigation: Option<&Navigation>) -> Option<Vec<u8>> {
    let (end_effector, base) = match law {
        Law::Capture(law) => (law.state(), None),
        Law::Reference(law) => {
            let state = law.state();
            let base = SavedBase {
                started: state.base_started,
                position: state.base_position,
                attitude: state.base_attitude,
            };
            (state.end_effector, Some(base))
        }
    };
    let navigation = navigation.map(|navigation| SavedNavigation {
        filter: navigation.filter.state(),
        refused: navigation.refused,
        innovation: navigation.innovation,
    });
    let saved = Saved {
        end_effector,
        base,
        navigation,
    };
    wire::encode("the guidance's state", &saved).ok()
}

/// Puts law and filter into a state that [`save`] gave.
pub fn restore(law: &mut Law, navigation: Option<&mut Navigation>, state: &[u8]) -> Result<(), Failure> {
    let saved: Saved = wire::decode("the guidance's state", state)?;
    match (law, saved.base) {
        (Law::Capture(law), None) => {
            **law = capture::CaptureGuidance::from_state(*law.parameters(), &saved.end_effector)?;
        }
        (Law::Reference(law), Some(base)) => {
            let state = reference::State {
                end_effector: saved.end_effector,
                base_started: base.started,
                base_position: base.position,
                base_attitude: base.attitude,
            };
            **law = reference::ReferenceGuidance::from_state(*law.parameters(), &state)?;
        }
        _ => {
            return Err(
                "the state is of a guidance with another law; start it without the state, or with the same `law`"
                    .into(),
            );
        }
    }
    match (navigation, saved.navigation) {
        (None, None) => {}
        (Some(navigation), Some(saved)) => {
            navigation.filter = NavigationFilter::from_state(navigation.parameters, &saved.filter)?;
            navigation.refused = saved.refused;
            navigation.innovation = saved.innovation;
        }
        _ => {
            return Err(
                "the state is of a guidance with, and this one is without, navigation (or the other way round)".into(),
            );
        }
    }
    Ok(())
}
