//! The complete state of a guidance: that of its law and its filter.

use guidance_laws::navigation::{self, NavigationFilter};
use guidance_laws::{capture, comparison};
use lockstep::participant::{Failure, state};
use serde::{Deserialize, Serialize};

use crate::law::Law;
use crate::navigation::Navigation;

/// The serialised state: the state of the law and of the filter, and which of them are present.
#[derive(Serialize, Deserialize)]
struct Saved {
    law: SavedLaw,
    navigation: Option<SavedNavigation>,
}

#[derive(Serialize, Deserialize)]
enum SavedLaw {
    Capture(capture::State),
    Comparison(comparison::State),
}

#[derive(Serialize, Deserialize)]
struct SavedNavigation {
    filter: navigation::State,
    rejected: u64,
    innovation: f64,
}

/// The state of a guidance with this law and this filter.
pub fn save(law: &Law, navigation: Option<&Navigation>) -> Option<Vec<u8>> {
    let law = match law {
        Law::Capture(law) => SavedLaw::Capture(law.state()),
        Law::Comparison(law) => SavedLaw::Comparison(law.state()),
    };
    let navigation = navigation.map(|navigation| SavedNavigation {
        filter: navigation.filter.state(),
        rejected: navigation.rejected,
        innovation: navigation.innovation,
    });
    state::to_bytes(&Saved { law, navigation })
}

/// Restores law and filter from a state returned by [`save`].
pub fn restore(law: &mut Law, navigation: Option<&mut Navigation>, state: &[u8]) -> Result<(), Failure> {
    let saved: Saved = state::from_bytes(state)?;
    match (law, &saved.law) {
        (Law::Capture(law), SavedLaw::Capture(state)) => {
            **law = capture::CaptureGuidance::from_state(*law.parameters(), state)?;
        }
        (Law::Comparison(law), SavedLaw::Comparison(state)) => {
            **law = comparison::ComparisonGuidance::from_state(*law.parameters(), state)?;
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
            navigation.rejected = saved.rejected;
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
