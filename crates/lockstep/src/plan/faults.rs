//! Signal faults in a plan: where they act, and the streams that record their effect.

use super::{Cut, Plan, PlanError, Seen, StuckValues};
use crate::fault::{Effect, FaultPort, Injector, ScheduledSignalFault, SignalFault, Slot};
use crate::link::{Read, interpolate};
use crate::port::Descriptor;
use crate::random::Stream;
use crate::time::{Rational, TickError, Ticks};

impl Plan {
    /// Adds signal faults. Inputs then have the faulty values, and every input that a fault reaches gets a stream of its own on the
    /// tape.
    ///
    /// # Errors
    /// Every fault that is not possible.
    pub fn add_signal_faults(&mut self, faults: Vec<SignalFault>) -> Result<(), Vec<PlanError>> {
        let mut errors = Vec::new();
        for fault in faults {
            match self.check_fault(&fault) {
                Ok(()) => {
                    self.seen.extend(self.affected_inputs(fault.place));
                    self.faults.push(fault);
                }
                Err(reason) => errors.push(PlanError::Fault {
                    fault: fault.name,
                    reason,
                }),
            }
        }
        self.seen.sort_unstable();
        self.seen.dedup();
        if errors.is_empty() { Ok(()) } else { Err(errors) }
    }

    /// The payload at `place`.
    fn descriptor(&self, place: FaultPort) -> Option<&Descriptor> {
        match place {
            FaultPort::Input { participant, port } => {
                let interface = &self.participants.get(participant)?.interface;
                Some(&interface.inputs.get(port)?.descriptor)
            }
            FaultPort::Output { participant, port } => {
                let interface = &self.participants.get(participant)?.interface;
                Some(&interface.outputs.get(port)?.descriptor)
            }
        }
    }

    fn check_fault(&self, fault: &SignalFault) -> Result<(), String> {
        let descriptor = self.descriptor(fault.place).ok_or("there is no such port")?;
        if fault.slots.is_empty() || !fault.slots.iter().all(|slot| slot.fits(descriptor)) {
            return Err(format!("`{}` has no such elements", descriptor.name));
        }
        fault.effect.check(&fault.slots)?;
        if let Effect::Stuck(Some(values)) = &fault.effect {
            let field = |slot: &Slot| {
                let mut fields = descriptor.fields.iter();
                fields.find(|field| field.range().contains(&(slot.offset as usize)))
            };
            let mut stuck = fault.slots.iter().zip(values);
            let allowed = |(slot, value): &(&Slot, &f64)| {
                slot.element.room().is_none() && field(slot).is_some_and(|field| field.allows(**value))
            };
            if let Some((slot, value)) = stuck.find(|stuck| !allowed(stuck)) {
                let field = field(slot).map(ToString::to_string).unwrap_or_default();
                return Err(format!("`{field}` cannot be stuck at {value}"));
            }
        }
        if let FaultPort::Input { participant, port } = fault.place
            && self.participants[participant].inputs[port].is_empty()
        {
            let input = self.input_name((participant, port));
            return Err(format!(
                "the input `{input}` is not connected: there is nothing to disturb"
            ));
        }
        self.window(fault.span.at, fault.span.until)
            .map_err(|error| error.to_string())?;
        Ok(())
    }

    /// The inputs at which a fault at `place` is visible.
    fn affected_inputs(&self, place: FaultPort) -> Vec<Seen> {
        match place {
            FaultPort::Input { participant, port } => vec![Seen {
                participant,
                input: port,
            }],
            FaultPort::Output { participant, port } => {
                let links = self.links.iter().filter(|link| link.from == (participant, port));
                links
                    .map(|link| Seen {
                        participant: link.to.0,
                        input: link.to.1,
                    })
                    .collect()
            }
        }
    }

    /// For whole ticks t, `at <= t < until` and `ceil(at) <= t < ceil(until)` are equivalent.
    fn window(&self, at: Rational, until: Option<Rational>) -> Result<(Ticks, Ticks), TickError> {
        let until = until.map_or(Ok(Ticks::MAX), |until| self.timebase.ceil(until))?;
        Ok((self.timebase.ceil(at)?, until))
    }

    pub(super) fn faults_at(&self, place: FaultPort) -> Vec<ScheduledSignalFault> {
        let own_faults = self.faults.iter().filter(|fault| fault.place == place);
        own_faults
            .filter_map(|fault| {
                let (from, until) = self.window(fault.span.at, fault.span.until).ok()?;
                Some(ScheduledSignalFault {
                    name: fault.name.clone(),
                    from,
                    until,
                    at: fault.span.at.seconds(),
                    slots: fault.slots.clone(),
                    effect: fault.effect.clone(),
                    random: Stream::new(self.seed, &format!("fault {}", fault.name)),
                })
            })
            .collect()
    }

    /// Sample `index` of an output as it is sent to consumers, after signal faults; `truth` reads the output's samples from the tape.
    pub(super) fn sent_sample<E>(
        &self,
        (participant, port): (usize, usize),
        index: u64,
        truth: &mut impl FnMut(u64) -> Result<Vec<u8>, E>,
    ) -> Result<Vec<u8>, E> {
        let mut payload = truth(index)?;
        let faults = self.faults_at(FaultPort::Output { participant, port });
        if let Some(mut injector) = Injector::new(&faults, self.timebase) {
            let instants = self.participants[participant].sample_time;
            injector.restore_stuck_values(index, instants, &mut *truth)?;
            injector.apply(index, instants.instant(index), &mut payload);
        }
        Ok(payload)
    }

    /// The value of an input at activation `k` before signal faults at the input. `sample` reads the tape.
    fn input_value<E>(
        &self,
        (participant, port): (usize, usize),
        k: u64,
        sample: &mut impl FnMut(u32, u64) -> Result<Vec<u8>, E>,
    ) -> Result<Vec<u8>, E> {
        let descriptor = self.descriptor(FaultPort::Input { participant, port });
        let mut payload = vec![0; descriptor.map_or(0, |descriptor| descriptor.size as usize)];
        let links = &self.participants[participant].inputs[port];
        let conversions = links.iter().filter_map(|&link| self.links[link].conversion.as_ref());
        conversions.for_each(|conversion| conversion.clear(&mut payload));
        for &number in links {
            let mut schedule = self.schedule(number);
            schedule.skip_to(k);
            let link = &self.links[number];
            let stream = self.participants[link.from.0].first_stream + link.from.1 as u32;
            let mut sent_sample = |index| self.sent_sample(link.from, index, &mut |index| sample(stream, index));
            let received = match schedule.advance() {
                Read::Initial => None,
                Read::Sample(index) => Some(sent_sample(index)?),
                Read::Between(before, after) => {
                    let t = self.participants[participant].sample_time.instant(k);
                    let weight = link.delivery.weight(t, before, after);
                    let sent_descriptor = &self.participants[link.from.0].interface.outputs[link.from.1].descriptor;
                    let (before, after) = (sent_sample(before)?, sent_sample(after)?);
                    let mut received = before.clone();
                    interpolate(sent_descriptor, &before, &after, weight, &mut received);
                    Some(received)
                }
            };
            match (&link.conversion, received) {
                (None, Some(received)) => payload = received,
                (None, None) => payload = link.initial.payload(payload.len()),
                (Some(conversion), Some(received)) => conversion.apply(&received, &mut payload),
                (Some(conversion), None) => {
                    conversion.apply_initial(&link.initial.payload(payload.len()), &mut payload);
                }
            }
        }
        Ok(payload)
    }

    /// The state of the faults of a participant's ports at `cut`. `sample` reads the tape.
    pub(super) fn stuck_values<E>(
        &self,
        cut: &Cut,
        participant: usize,
        sample: &mut impl FnMut(u32, u64) -> Result<Vec<u8>, E>,
    ) -> Result<StuckValues, E> {
        let own = &self.participants[participant];
        let (instants, next) = (own.sample_time, cut.next[participant]);
        let mut stuck = StuckValues::default();
        for port in 0..own.inputs.len() {
            let faults = self.faults_at(FaultPort::Input { participant, port });
            stuck.inputs.push(match Injector::new(&faults, self.timebase) {
                Some(mut injector) => injector
                    .restore_stuck_values(next, instants, |k| self.input_value((participant, port), k, sample))?
                    .to_vec(),
                None => Vec::new(),
            });
        }
        let samples = self.samples_before(participant, next);
        for port in 0..own.interface.outputs.len() {
            let faults = self.faults_at(FaultPort::Output { participant, port });
            let stream = own.first_stream + port as u32;
            stuck.outputs.push(match Injector::new(&faults, self.timebase) {
                Some(mut injector) => injector
                    .restore_stuck_values(samples, instants, |index| sample(stream, index))?
                    .to_vec(),
                None => Vec::new(),
            });
        }
        Ok(stuck)
    }

    pub(super) fn has_output_fault(&self, (participant, port): (usize, usize)) -> bool {
        let place = FaultPort::Output { participant, port };
        self.faults.iter().any(|fault| fault.place == place)
    }

    /// The number of the stream that records the values of this input.
    pub(super) fn seen_stream(&self, participant: usize, input: usize) -> Option<u32> {
        let position = self.seen.binary_search(&Seen { participant, input }).ok()?;
        Some((self.output_count() + position) as u32)
    }
}

impl Effect {
    /// Checks whether the effect can be applied to `slots`.
    fn check(&self, slots: &[Slot]) -> Result<(), String> {
        let finite = |values: &[f64]| {
            if values.len() != slots.len() {
                Err(format!("{} values for {} elements", values.len(), slots.len()))
            } else if let Some(bad) = values.iter().find(|value| !value.is_finite()) {
                Err(format!("the value {bad} is not finite"))
            } else {
                Ok(())
            }
        };
        let probable = |p: f64| match (0.0..=1.0).contains(&p) {
            true => Ok(()),
            false => Err(format!("the probability {p} does not lie between 0 and 1")),
        };
        let symbols = slots.iter().any(|slot| !slot.element.is_number());
        if symbols && !matches!(self, Effect::Stuck(_) | Effect::Dropout(_)) {
            return Err("a bool, an enumeration, a text or bytes can be stuck or drop out, and nothing else".into());
        }
        match self {
            Effect::Bias(values) | Effect::Scale(values) | Effect::Ramp(values) | Effect::Stuck(Some(values)) => {
                finite(values)
            }
            Effect::Noise(sigma) => match sigma.iter().find(|sigma| **sigma < 0.0) {
                Some(sigma) => Err(format!("the standard deviation {sigma} is negative")),
                None => finite(sigma),
            },
            Effect::Stuck(None) => Ok(()),
            Effect::Dropout(probability) => probable(*probability),
            Effect::BitFlip { bit, probability } => {
                let width = slots
                    .iter()
                    .map(|slot| slot.element.size() as u32 * 8)
                    .min()
                    .unwrap_or(0);
                match bit {
                    Some(bit) if *bit >= width => {
                        Err(format!("there is no bit {bit}: an element has bits 0 to {}", width - 1))
                    }
                    _ => probable(*probability),
                }
            }
        }
    }
}
