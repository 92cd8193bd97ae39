//! The services of a run in one domain of shared memory. A run moves to a new domain whenever it is
//! resumed or relocated, so that no object of a dead process can be opened by mistake.

use lockstep::plan::Plan;
use lockstep::transport::iceoryx::{Address, ClockWriter, Domain, LinkService};

use super::ports::Ports;
use super::resources;
use super::sigbus;
use crate::run::outcome::RunFailure;
use crate::scenario::ORCHESTRATOR;

/// The services of a run in one domain of shared memory; they are dropped before the domain.
pub(crate) struct RunServices {
    pub(crate) clock: ClockWriter,
    _links: Vec<LinkService>,
    domain: Domain,
}

/// The services that follow from the plan.
pub(crate) struct PlannedServices {
    clock: ClockWriter,
    links: Vec<LinkService>,
}

impl PlannedServices {
    /// Creates the links and the clock of `plan` in `domain`.
    pub(crate) fn create(domain: &Domain, plan: &Plan) -> Result<PlannedServices, RunFailure> {
        let mut links = Vec::new();
        for (number, link) in plan.links.iter().enumerate() {
            let output = &plan.participants[link.from.0].interface.outputs[link.from.1];
            let size = output.descriptor.size as usize;
            links.push(LinkService::create(domain, number as u32, size, link.capacity)?);
        }
        let clock = ClockWriter::create(domain, plan.participants.len())?;
        check_pages()?;
        Ok(PlannedServices { clock, links })
    }
}

impl RunServices {
    /// Enters `address` and creates what participants need in order to enter too.
    pub(crate) fn enter_domain<'a>(
        address: Address,
        names: impl ExactSizeIterator<Item = &'a str>,
    ) -> Result<(Domain, Vec<Ports>), RunFailure> {
        let domain = Domain::enter(address, ORCHESTRATOR)?;
        let count = names.len();
        let ports = names.map(|name| Ports::create(&domain, name, count));
        let ports = ports.collect::<Result<_, _>>()?;
        check_pages()?;
        Ok((domain, ports))
    }

    /// The services in `domain`.
    pub(crate) fn new(domain: Domain, planned: PlannedServices) -> RunServices {
        RunServices {
            clock: planned.clock,
            _links: planned.links,
            domain,
        }
    }

    /// The address of the domain.
    pub(crate) fn address(&self) -> &Address {
        self.domain.address()
    }
}

/// Checks that no page of shared memory was missing when it was touched.
pub(crate) fn check_pages() -> Result<(), RunFailure> {
    if sigbus::take_missed_page() {
        Err(resources::memory_full())
    } else {
        Ok(())
    }
}
