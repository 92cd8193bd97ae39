//! Serialisation of a participant's state, by serde.

use serde::Serialize;
use serde::de::DeserializeOwned;

use super::{Failure, Participant};
use crate::wire;

/// The most bytes of a state. It travels in a message together with a position, which has room in the rest of the 64 MiB.
pub const MAX: usize = 63 << 20;

/// Why a state of `bytes` bytes cannot be saved, if it is too large, with the remedy.
pub fn too_large(bytes: u64) -> Option<String> {
    (bytes > MAX as u64).then(|| {
        format!("its state has {bytes} bytes; at most {MAX} (63 MiB) can be saved: keep in the state only what is needed to continue, or run without")
    })
}

/// The bytes of `state`, for [`super::Participant::save`]. Every `f64` keeps its bits, and a message is a state too.
///
/// ```
/// use lockstep::participant::state;
///
/// #[derive(serde::Serialize, serde::Deserialize)]
/// struct Filter {
///     value: f64,
///     seen: Vec<f64>,
/// }
///
/// let filter = Filter { value: -0.0, seen: vec![1.5, 2.5] };
/// let saved = state::to_bytes(&filter).unwrap();
/// let again: Filter = state::from_bytes(&saved)?;
/// assert!(again.value.is_sign_negative());
/// assert_eq!(again.seen, filter.seen);
/// assert!(state::from_bytes::<Filter>(&saved[1..]).is_err());
/// # Ok::<(), lockstep::participant::Failure>(())
/// ```
///
/// `None` when serde rejects `state`. A state of more than [`MAX`] bytes is refused where it is used.
pub fn to_bytes<T: Serialize>(state: &T) -> Option<Vec<u8>> {
    wire::encode_part("the state", state).ok()
}

/// The state of `participant`, for a checkpoint or for another participant; `None` when it cannot be saved at all.
///
/// # Errors
/// Why its `save` failed, in its own words; or that the state is too large.
pub fn of(participant: &dyn Participant) -> Result<Option<Vec<u8>>, String> {
    match (participant.save(), participant.save_failure()) {
        (None, Some(reason)) => Err(format!("its `save` failed: {reason}")),
        (state, _) => match state.as_ref().and_then(|state| too_large(state.len() as u64)) {
            Some(reason) => Err(reason),
            None => Ok(state),
        },
    }
}

/// The state that [`to_bytes`] serialised, for [`super::Participant::restore`].
///
/// # Errors
/// When the bytes are not exactly one `T`.
pub fn from_bytes<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, Failure> {
    Ok(wire::decode("the state", bytes)?)
}
