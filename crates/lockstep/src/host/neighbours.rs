//! Neighbours: the participants at the other ends of a participant's links, and waking those that sleep.

use std::cell::Cell;
use std::rc::Rc;

use crate::plan::{Consumer, InputLink};
use crate::transport::iceoryx::{Domain, DomainError, WaitReason, Waker};
use crate::transport::{Header, Receiver, Sender, TransportError};

/// A condition for which a neighbour may sleep, and whether it has occurred since the neighbour was last checked.
struct WakeCondition {
    what: WaitReason,
    occurred: Rc<Cell<bool>>,
}

struct Neighbour {
    name: String,
    waker: Waker,
    conditions: Vec<WakeCondition>,
}

/// A link's end that records that a sample has passed through it.
struct TrackedEnd<E> {
    end: E,
    occurred: Rc<Cell<bool>>,
}

impl<S: Sender> Sender for TrackedEnd<S> {
    fn prepare(&mut self) -> Result<(), TransportError> {
        self.end.prepare()
    }

    fn try_send(&mut self, header: Header, payload: &[u8]) -> Result<bool, TransportError> {
        let sent = self.end.try_send(header, payload)?;
        if sent {
            self.occurred.set(true);
        }
        Ok(sent)
    }
}

impl<R: Receiver> Receiver for TrackedEnd<R> {
    fn prepare(&mut self) -> Result<(), TransportError> {
        self.end.prepare()
    }

    fn try_receive(&mut self, payload: &mut [u8]) -> Result<Option<Header>, TransportError> {
        let received = self.end.try_receive(payload)?;
        if received.is_some() {
            self.occurred.set(true);
        }
        Ok(received)
    }
}

/// The neighbours of one participant, each once.
pub(super) struct Neighbours {
    own: String,
    others: Vec<Neighbour>,
}

impl Neighbours {
    /// The neighbours of the participant `own`, which has no links yet.
    pub(super) fn of(own: &str) -> Neighbours {
        Neighbours {
            own: own.to_owned(),
            others: Vec::new(),
        }
    }

    /// The end of a link to a neighbour that may sleep for its samples.
    pub(super) fn sender(
        &mut self,
        domain: &Domain,
        to: &Consumer,
        end: impl Sender + 'static,
    ) -> Result<Box<dyn Sender>, DomainError> {
        let occurred = self.register(domain, &to.to, WaitReason::for_sample(to.link))?;
        Ok(Box::new(TrackedEnd { end, occurred }))
    }

    /// The end of a link from a neighbour that may sleep for room on it.
    pub(super) fn receiver(
        &mut self,
        domain: &Domain,
        from: &InputLink,
        end: impl Receiver + 'static,
    ) -> Result<Box<dyn Receiver>, DomainError> {
        let occurred = self.register(domain, &from.from, WaitReason::for_room(from.link))?;
        Ok(Box::new(TrackedEnd { end, occurred }))
    }

    fn register(&mut self, domain: &Domain, port: &str, what: WaitReason) -> Result<Rc<Cell<bool>>, DomainError> {
        let name = port.split('.').next().unwrap_or(port);
        let occurred = Rc::new(Cell::new(false));
        // A participant that feeds itself is awake when it does.
        if name != self.own {
            let known = self.others.iter().position(|other| other.name == name);
            let at = match known {
                Some(at) => at,
                None => {
                    self.others.push(Neighbour {
                        name: name.to_owned(),
                        waker: Waker::open(domain, name)?,
                        conditions: Vec::new(),
                    });
                    self.others.len() - 1
                }
            };
            let occurred = occurred.clone();
            self.others[at].conditions.push(WakeCondition { what, occurred });
        }
        Ok(occurred)
    }

    /// Wakes the neighbours that sleep for a condition that has occurred since the last call. Once is enough: a participant polls again
    /// before it sleeps.
    pub(super) fn wake(&self) {
        for Neighbour { waker, conditions, .. } in &self.others {
            if conditions.iter().any(|condition| condition.occurred.get()) {
                waker.wake(|what| {
                    conditions
                        .iter()
                        .any(|condition| condition.what == what && condition.occurred.get())
                });
                conditions.iter().for_each(|condition| condition.occurred.set(false));
            }
        }
    }
}
