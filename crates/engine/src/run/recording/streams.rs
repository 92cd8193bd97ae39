//! The streams of a run.

use lockstep::plan::Plan;
use tape::StreamSpec;

/// The streams of a run, in the order of their numbers.
pub fn streams(plan: &Plan) -> Vec<StreamSpec> {
    let mut streams = Vec::new();
    for participant in &plan.participants {
        for output in &participant.interface.outputs {
            let (name, descriptor) = (participant.name.clone(), output.descriptor.clone());
            streams.push(StreamSpec::new(
                name,
                output.name.clone(),
                descriptor,
                participant.offset,
                participant.period,
            ));
        }
    }
    for seen in &plan.seen {
        let participant = &plan.participants[seen.participant];
        let input = &participant.interface.inputs[seen.input];
        streams.push(StreamSpec::seen(
            participant.name.clone(),
            &input.name,
            input.descriptor.clone(),
            participant.offset,
            participant.period,
        ));
    }
    streams
}
