//! The complete state of a guidance as plain numbers.

use guidance_laws::navigation::{self, NavigationFilter};
use guidance_laws::{capture, reference};
use lockstep::participant::Failure;
use lockstep::wire;
use serde::{Deserialize, Serialize};

use crate::guidance::Guidance;
use crate::law::Law;

#[derive(Serialize, Deserialize)]
struct Saved {
    end_effector: SavedCapture,
    base: Option<SavedBase>,
    navigation: Option<SavedNavigation>,
}

#[derive(Serialize, Deserialize)]
struct SavedCapture {
    started: bool,
    start_position: [f64; 3],
    start_attitude: [f64; 4],
    rotation: [f64; 3],
}

#[derive(Serialize, Deserialize)]
struct SavedBase {
    started: bool,
    position: [f64; 3],
    attitude: [f64; 4],
}

#[derive(Serialize, Deserialize)]
struct SavedNavigation {
    started: bool,
    stamps: [f64; 2],
    refusals: u32,
    position: [f64; 3],
    attitude: [f64; 4],
    velocity: [f64; 3],
    rate: [f64; 3],
    position_drift: [f64; 3],
    attitude_drift: [f64; 3],
    covariance: [[f64; 18]; 18],
    refused: u64,
    innovation: f64,
}

impl From<capture::State> for SavedCapture {
    fn from(state: capture::State) -> Self {
        Self {
            started: state.started,
            start_position: state.start_position,
            start_attitude: state.start_attitude,
            rotation: state.rotation,
        }
    }
}

impl From<SavedCapture> for capture::State {
    fn from(saved: SavedCapture) -> Self {
        Self {
            started: saved.started,
            start_position: saved.start_position,
            start_attitude: saved.start_attitude,
            rotation: saved.rotation,
        }
    }
}

/// The state of `guidance`.
pub fn save(guidance: &Guidance) -> Option<Vec<u8>> {
    let (end_effector, base) = match &guidance.law {
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
    let navigation = guidance.navigation.as_ref().map(|navigation| {
        let state = navigation.filter.state();
        SavedNavigation {
            started: state.started,
            stamps: [state.stamp_s, state.estimate_s],
            refusals: state.refusals,
            position: state.position,
            attitude: state.attitude,
            velocity: state.velocity,
            rate: state.rate,
            position_drift: state.position_drift,
            attitude_drift: state.attitude_drift,
            covariance: state.covariance,
            refused: navigation.refused,
            innovation: navigation.innovation,
        }
    });
    let saved = Saved {
        end_effector: end_effector.into(),
        base,
        navigation,
    };
    wire::encode("the guidance's state", &saved).ok()
}

/// Puts `guidance` into a state that [`save`] gave.
pub fn restore(guidance: &mut Guidance, state: &[u8]) -> Result<(), Failure> {
    let saved: Saved = wire::decode("the guidance's state", state)?;
    match (&mut guidance.law, saved.base) {
        (Law::Capture(law), None) => {
            **law = capture::CaptureGuidance::from_state(*law.parameters(), &saved.end_effector.into())?;
        }
        (Law::Reference(law), Some(base)) => {
            let state = reference::State {
                end_effector: saved.end_effector.into(),
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
    match (&mut guidance.navigation, saved.navigation) {
        (None, None) => {}
        (Some(navigation), Some(saved)) => {
            let state = navigation::State {
                started: saved.started,
                stamp_s: saved.stamps[0],
                estimate_s: saved.stamps[1],
                refusals: saved.refusals,
                position: saved.position,
                attitude: saved.attitude,
                velocity: saved.velocity,
                rate: saved.rate,
                position_drift: saved.position_drift,
                attitude_drift: saved.attitude_drift,
                covariance: saved.covariance,
            };
            navigation.filter = NavigationFilter::from_state(navigation.parameters, &state)?;
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
