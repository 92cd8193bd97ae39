//! Random faults, and a second implementation of their effect without state: stuck values are looked up at the beginning of the fault.

use lockstep::fault::{Effect, FaultPort, FaultWindow, LinkFault, SignalFault, Slot};
use lockstep::plan::Plan;
use lockstep::random::Stream;
use lockstep::time::{Rational, Ticks};
use proptest::prelude::*;

/// A random signal fault: its numbers are taken modulo the number of participants and ports.
#[derive(Debug, Clone)]
pub struct RandomSignalFault {
    output: bool,
    participant: usize,
    port: usize,
    slots: Vec<Slot>,
    span: FaultWindow,
    effect: Effect,
}

/// The faults of a random scenario.
#[derive(Debug, Clone, Default)]
pub struct Faults {
    pub signals: Vec<RandomSignalFault>,
    pub links: Vec<(usize, LinkFault)>,
}

impl Faults {
    /// The signal faults that are possible in `plan`.
    pub fn signals(&self, plan: &Plan) -> Vec<SignalFault> {
        let place = |one: &RandomSignalFault| {
            let participant = one.participant % plan.participants.len();
            let own = &plan.participants[participant];
            let connected: Vec<usize> = (0..own.inputs.len()).filter(|&at| !own.inputs[at].is_empty()).collect();
            if one.output {
                let port = one.port % own.interface.outputs.len();
                return Some(FaultPort::Output { participant, port });
            }
            let port = *connected.get(one.port % connected.len().max(1))?;
            Some(FaultPort::Input { participant, port })
        };
        let fault = |(number, one): (usize, &RandomSignalFault)| {
            Some(SignalFault {
                name: format!("s{number}"),
                place: place(one)?,
                span: one.span,
                slots: one.slots.clone(),
                effect: one.effect.clone(),
                description: String::new(),
            })
        };
        self.signals.iter().enumerate().filter_map(fault).collect()
    }
}

/// What the faults number `..count` of `plan` at `place` make of sample or activation `index`, of which `truth(index)` is
/// what there is without faults and `instant(index)` the time.
pub fn with_faults(
    plan: &Plan,
    place: FaultPort,
    count: usize,
    index: u64,
    instant: &dyn Fn(u64) -> Ticks,
    truth: &dyn Fn(u64) -> Vec<u8>,
) -> Vec<u8> {
    let Some(last) = count.checked_sub(1) else {
        return truth(index);
    };
    let before = |index| with_faults(plan, place, last, index, instant, truth);
    let fault = &plan.faults[last];
    let time = |index| plan.timebase.time(instant(index)).unwrap();
    let is_active = |index| time(index) >= fault.span.at && fault.span.until.is_none_or(|until| time(index) < until);
    let mut bytes = before(index);
    if fault.place != place || !is_active(index) {
        return bytes;
    }
    let draws = Stream::new(plan.seed, &format!("fault {}", fault.name));
    let n = fault.slots.len() as u64;
    let mut flipped = None;
    if let Effect::BitFlip { bit, probability } = fault.effect
        && draws.uniform(3 * index) < probability
    {
        let slot = draws.bits(3 * index + 1) % n;
        flipped = Some((slot, bit.map_or(draws.bits(3 * index + 2) % 64, u64::from)));
    }
    for (number, slot) in fault.slots.iter().enumerate() {
        let range = slot.offset as usize..slot.offset as usize + 8;
        let integer = slot.offset == 0;
        let raw: [u8; 8] = bytes[range.clone()].try_into().unwrap();
        let x = if integer {
            u64::from_le_bytes(raw) as f64
        } else {
            f64::from_le_bytes(raw)
        };
        let y = match &fault.effect {
            Effect::Bias(amount) => x + amount[number],
            Effect::Scale(factor) => x * factor[number],
            Effect::Ramp(rate) => x + rate[number] * (plan.timebase.seconds(instant(index)) - fault.span.at.seconds()),
            Effect::Noise(sigma) => x + sigma[number] * draws.normal(index * n + number as u64),
            Effect::Stuck(Some(value)) => value[number],
            Effect::Stuck(None) => {
                let first = (0..=index).find(|&k| is_active(k)).unwrap();
                let stuck = before(first)[range.clone()].to_vec();
                bytes[range].copy_from_slice(&stuck);
                continue;
            }
            Effect::Dropout(probability) => {
                if draws.uniform(index) < *probability {
                    bytes[range].fill(0);
                }
                continue;
            }
            Effect::BitFlip { .. } => {
                if let Some((slot, bit)) = flipped
                    && slot == number as u64
                {
                    let flipped = u64::from_le_bytes(raw) ^ (1 << bit);
                    bytes[range].copy_from_slice(&flipped.to_le_bytes());
                }
                continue;
            }
        };
        let new = if integer {
            (y.round_ties_even() as u64).to_le_bytes()
        } else {
            y.to_le_bytes()
        };
        bytes[range].copy_from_slice(&new);
    }
    bytes
}

/// Faults for scenarios that last up to 90 ms.
pub fn faults() -> impl Strategy<Value = Faults> {
    let span = || {
        (
            super::time(0..80),
            prop_oneof![1 => Just(None), 3 => super::time(0..40).prop_map(Some)],
        )
            .prop_map(|(at, length)| FaultWindow {
                at,
                until: length.map(|length| {
                    let d = i128::from(at.denominator()) * i128::from(length.denominator());
                    let part = |time: Rational| i128::from(time.numerator()) * (d / i128::from(time.denominator()));
                    Rational::new(part(at) + part(length), d).unwrap()
                }),
            })
    };
    let probability = || prop_oneof![Just(0.0), Just(1.0), 0.0..1.0];
    let values = || prop::collection::vec(-1e3..1e3, 2);
    let effect = prop_oneof![
        values().prop_map(Effect::Bias),
        values().prop_map(Effect::Scale),
        values().prop_map(Effect::Ramp),
        prop::collection::vec(0.0..1e3, 2).prop_map(Effect::Noise),
        values().prop_map(|values| Effect::Stuck(Some(values))),
        Just(Effect::Stuck(None)),
        probability().prop_map(Effect::Dropout),
        (prop::option::of(0_u32..64), probability())
            .prop_map(|(bit, probability)| Effect::BitFlip { bit, probability }),
    ];
    let all = Slot::all(&<super::Mixed as lockstep::port::Message>::descriptor());
    let some = (0_usize..3).prop_map(move |which| match which {
        2 => all.clone(),
        one => vec![all[one]],
    });
    let signal = (any::<bool>(), 0_usize..6, 0_usize..3, some, span(), effect).prop_map(
        |(output, participant, port, slots, span, effect)| RandomSignalFault {
            output,
            participant,
            port,
            effect: resize_effect(effect, slots.len()),
            slots,
            span,
        },
    );
    let link = (0_usize..12, span(), probability(), super::time(0..30)).prop_map(|(link, span, drop, extra_delay)| {
        let fault = LinkFault {
            name: format!("l{link}"),
            span,
            drop,
            extra_delay,
            description: String::new(),
        };
        (link, fault)
    });
    (
        prop_oneof![1 => Just(Vec::new()), 2 => prop::collection::vec(signal, 0..6)],
        prop_oneof![1 => Just(Vec::new()), 1 => prop::collection::vec(link, 0..5)],
    )
        .prop_map(|(signals, links)| Faults { signals, links })
}

/// One value for each of `count` elements.
fn resize_effect(effect: Effect, count: usize) -> Effect {
    let first = |values: Vec<f64>| values[..count].to_vec();
    match effect {
        Effect::Bias(values) => Effect::Bias(first(values)),
        Effect::Scale(values) => Effect::Scale(first(values)),
        Effect::Ramp(values) => Effect::Ramp(first(values)),
        Effect::Noise(values) => Effect::Noise(first(values)),
        Effect::Stuck(values) => Effect::Stuck(values.map(first)),
        other => other,
    }
}
