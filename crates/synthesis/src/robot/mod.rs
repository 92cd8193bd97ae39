//! The velocity loop of a free-flying robot: from a URDF file and a specification to a tuning problem, margins and a
//! verification of the sampled loop.

mod check;
mod design;
mod doubts;
mod file;
mod linearise;
mod margins;
mod plant;
mod sampled;
mod spec;
mod validate;

pub use design::{Design, OptimumError, Round, Step, design, options, report, tracking_optimum};
pub use file::{
    ChannelEntry, ClosedLoopEntry, ExportedProblem, GainTable, GainsFile, MarginEntry, OptimumEntry, Provenance,
    SampledEntry, SlidingGainError, ValidationEntry, export,
};
pub use linearise::{Body, Robot, RobotError};
pub use margins::{MarginError, StatedMargin, margins, multiplicative_loop, parametric_loop};
pub use plant::{Gains, generalised_plant, problem, tracking_weights};
pub use sampled::{LoopTiming, SampledLoop, SampledStability, sampled, spectral_radius};
pub use spec::{
    ClosedLoopSpec, GainSpec, GainStructure, LoadSpec, ModelSpec, Payload, RobotSpec, SamplingSpec, ScaleSpec,
    SearchSpec, Spec, UncertaintySpec, ValidationSpec, WeightSpec,
};
pub use validate::{Sample, ValidateError, Validation, adversary, assess, random_situation, sampled_models, validate};
