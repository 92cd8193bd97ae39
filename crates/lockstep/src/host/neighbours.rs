//! Neighbours: the participants at the other ends of a participant's links, and waking those that sleep.

use std::cell::Cell;
use std::rc::Rc;

use crate::plan::{Consumer, InputLink};
use crate::transport::iceoryx::{Domain, DomainError, WaitReason, Waker};
use crate::transport::{Broken, Header, Receiver, Sender};

/// Something for which a neighbour may sleep, and whether it has happened since the neighbour was last checked.
struct News {
    what: WaitReason,
    came: Rc<Cell<bool>>,
}

struct Neighbour {
    name: String,
    waker: Waker,
    news: Vec<News>,
}

/// A link's end that records when a sample went through it.
struct Noted<E> {
    end: E,
    came: Rc<Cell<bool>>,
}

impl<S: Sender> Sender for Noted<S> {
    fn prepare(&mut self) -> Result<(), Broken> {
        self.end.prepare()
    }

    fn try_send(&mut self, header: Header, payload: &[u8]) -> Result<bool, Broken> {
        let sent = self.end.try_send(header, payload)?;
        if sent {
            self.came.set(true);
        }
        Ok(sent)
    }
}

impl<R: Receiver> Receiver for Noted<R> {
    fn prepare(&mut self) -> Result<(), Broken> {
        self.end.prepare()
    }

    fn try_receive(&mut self, payload: &mut [u8]) -> Result<Option<Header>, Broken> {
        let received = self.end.try_receive(payload)?;
        if received.is_some() {
            self.came.set(true);
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
        let came = self.meet(domain, &to.to, WaitReason::for_sample(to.link))?;
        Ok(Box::new(Noted { end, came }))
    }

    /// The end of a link from a neighbour that may sleep for room on it.
    pub(super) fn receiver(
        &mut self,
        domain: &Domain,
        from: &InputLink,
        end: impl Receiver + 'static,
    ) -> Result<Box<dyn Receiver>, DomainError> {
        let came = self.meet(domain, &from.from, WaitReason::for_room(from.link))?;
        Ok(Box::new(Noted { end, came }))
    }

    fn meet(&mut self, domain: &Domain, port: &str, what: WaitReason) -> Result<Rc<Cell<bool>>, DomainError> {
        let name = port.split('.').next().unwrap_or(port);
        let came = Rc::new(Cell::new(false));
        // A participant that feeds itself is awake when it does.
        if name != self.own {
            let known = self.others.iter().position(|other| other.name == name);
            let at = match known {
                Some(at) => at,
                None => {
                    self.others.push(Neighbour {
                        name: name.to_owned(),
                        waker: Waker::open(domain, name)?,
                        news: Vec::new(),
                    });
                    self.others.len() - 1
                }
            };
            let came = came.clone();
            self.others[at].news.push(News { what, came });
        }
        Ok(came)
    }

    /// Wakes the neighbours that sleep for what has happened since the last call. Once is enough: a participant polls again before it
    /// sleeps.
    pub(super) fn wake(&self) {
        for Neighbour { waker, news, .. } in &self.others {
            if news.iter().any(|news| news.came.get()) {
                waker.wake(|what| news.iter().any(|news| news.what == what && news.came.get()));
                news.iter().for_each(|news| news.came.set(false));
            }
        }
    }
}
