//! The connection from a participant to the recorder in the same process.

use std::sync::{Arc, Mutex, PoisonError};

use lockstep::transport::{Header, Recording, TransportError};

use crate::run::recording::recorder::Recorder;

/// The connection of one participant to the recorder in the same process.
pub struct Direct {
    /// The recorder, shared by all participants.
    pub recorder: Arc<Mutex<Recorder>>,
    /// The participant's number.
    pub participant: usize,
}

impl Recording for Direct {
    fn try_append(&mut self, stream: u32, header: Header, payload: &[u8]) -> Result<bool, TransportError> {
        let mut recorder = self.recorder.lock().unwrap_or_else(PoisonError::into_inner);
        // The stepper has made the header from the plan itself.
        recorder
            .take(self.participant, stream as usize, header, payload)
            .map(|()| true)
    }
}
