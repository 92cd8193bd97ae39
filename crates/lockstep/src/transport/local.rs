//! Links inside one process: a bounded ring behind a mutex.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::interface::{Broken, Header, Receiver, Sender};

struct Ring {
    headers: Vec<Header>,
    payloads: Vec<u8>,
    size: usize,
    first: usize,
    count: usize,
}

/// The sending end.
pub struct LocalSender(Arc<Mutex<Ring>>);

/// The receiving end.
pub struct LocalReceiver(Arc<Mutex<Ring>>);

/// A link that holds up to `capacity` samples of `size` bytes. All of its memory is taken here.
pub fn link(size: usize, capacity: usize) -> (LocalSender, LocalReceiver) {
    let ring = Arc::new(Mutex::new(Ring {
        headers: vec![Header::default(); capacity],
        payloads: vec![0; size * capacity],
        size,
        first: 0,
        count: 0,
    }));
    (LocalSender(ring.clone()), LocalReceiver(ring))
}

/// A panic of the other end leaves the ring as it was between two calls, so it stays usable.
fn lock(ring: &Mutex<Ring>) -> MutexGuard<'_, Ring> {
    ring.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Sender for LocalSender {
    fn try_send(&mut self, header: Header, payload: &[u8]) -> Result<bool, Broken> {
        let ring = &mut *lock(&self.0);
        if payload.len() != ring.size {
            return Err(Broken(format!(
                "a sample of {} bytes on a link of {}",
                payload.len(),
                ring.size
            )));
        }
        let capacity = ring.headers.len();
        if ring.count == capacity {
            return Ok(false);
        }
        let slot = (ring.first + ring.count) % capacity;
        ring.headers[slot] = header;
        ring.payloads[slot * ring.size..][..ring.size].copy_from_slice(payload);
        ring.count += 1;
        Ok(true)
    }
}

impl Receiver for LocalReceiver {
    fn try_receive(&mut self, payload: &mut [u8]) -> Result<Option<Header>, Broken> {
        let ring = &mut *lock(&self.0);
        if ring.count == 0 {
            return Ok(None);
        }
        if payload.len() != ring.size {
            return Err(Broken(format!(
                "a sample of {} bytes where {} are expected",
                ring.size,
                payload.len()
            )));
        }
        let slot = ring.first;
        payload.copy_from_slice(&ring.payloads[slot * ring.size..][..ring.size]);
        ring.first = (slot + 1) % ring.headers.len();
        ring.count -= 1;
        Ok(Some(ring.headers[slot]))
    }
}
