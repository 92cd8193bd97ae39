//! One place in shared memory, with all objects that the orchestrator holds in it. A run moves to a fresh place whenever it is
//! resumed or relocated, so that no object of a dead process can be opened by mistake.

use lockstep::plan::Plan;
use lockstep::transport::iceoryx::{Address, ClockWriter, Domain, LinkService};

use super::ports::Ports;
use super::resources;
use super::sigbus;
use crate::run::outcome::RunFailure;

/// A place in shared memory. Its services are dropped before the domain.
pub(crate) struct Place {
    pub(crate) clock: ClockWriter,
    _links: Vec<LinkService>,
    domain: Domain,
}

impl Place {
    /// Enters `address` and creates what participants need in order to enter too.
    pub(crate) fn enter<'a>(
        address: Address,
        names: impl ExactSizeIterator<Item = &'a str>,
    ) -> Result<(Domain, Vec<Ports>), RunFailure> {
        let domain = Domain::enter(address, "orchestrator")?;
        let count = names.len();
        let ports = names.map(|name| Ports::create(&domain, name, count));
        let ports = ports.collect::<Result<_, _>>()?;
        all_there()?;
        Ok((domain, ports))
    }

    /// Creates the links and the clock of `plan` in `domain`.
    pub(crate) fn create_services(domain: Domain, plan: &Plan) -> Result<Place, RunFailure> {
        let mut links = Vec::new();
        for (number, link) in plan.links.iter().enumerate() {
            let output = &plan.participants[link.from.0].interface.outputs[link.from.1];
            let size = output.descriptor.size as usize;
            links.push(LinkService::create(&domain, number as u32, size, link.capacity)?);
        }
        let clock = ClockWriter::create(&domain, plan.participants.len())?;
        all_there()?;
        Ok(Place {
            clock,
            _links: links,
            domain,
        })
    }

    /// The address of this place.
    pub(crate) fn address(&self) -> &Address {
        self.domain.address()
    }
}

/// Checks that no page of shared memory was missing when it was touched.
pub(crate) fn all_there() -> Result<(), RunFailure> {
    if sigbus::missed() {
        Err(resources::full())
    } else {
        Ok(())
    }
}
