//! The velocity loop of a free-flying robot: from a URDF file and a specification to a tuning problem, margins and a
//! verification of the sampled loop.

mod body;
mod design;
mod file;
mod margins;
mod plant;
mod sampled;
mod spec;
mod validate;

pub use body::{Body, Robot, RobotError};
pub use design::{Design, OptimumError, Round, Step, design, options, report, tracking_optimum};
pub use file::{
    ChannelEntry, ExportedProblem, FlownEntry, GainTable, GainsFile, MarginEntry, NoSlidingGain, OptimumEntry,
    Provenance, SampledEntry, ValidationEntry, export,
};
pub use margins::{MarginError, StatedMargin, margins, multiplicative_loop, parametric_loop};
pub use plant::{Gains, generalised_plant, problem, tracking_weights};
pub use sampled::{LoopTiming, Sampled, SampledLoop, sampled, spectral_radius};
pub use spec::{
    FlightSpec, GainSpec, GainStructure, LoadSpec, ModelSpec, Payload, RobotSpec, SamplingSpec, ScaleSpec, SearchSpec,
    Spec, UncertaintySpec, ValidationSpec, WeightSpec,
};
pub use validate::{Sample, ValidateError, Validation, adversary, assess, draw, sampled_models, validate};
