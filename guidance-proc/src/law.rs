//! Common interface of the guidance laws.

use guidance_laws::capture::{self, CaptureGuidance};
use guidance_laws::comparison::{self, ComparisonGuidance};
use guidance_laws::{Pose, SetPoint, TargetState};
use lockstep::participant::ParameterError;

use crate::parameters::{LawName, Parameters, scenario_error};

/// A guidance law.
#[derive(Debug, Clone)]
pub enum Law {
    /// The law of the paper.
    Capture(Box<CaptureGuidance>),
    /// The comparison law.
    Comparison(Box<ComparisonGuidance>),
}

/// Outputs of a law.
#[derive(Debug, Clone, Copy)]
pub struct LawOutput {
    /// Set-point of the end effector, with the progress.
    pub end_effector: capture::Output,
    /// Set-point of the base.
    pub base: Option<SetPoint>,
}

impl Law {
    /// The law selected by the scenario.
    ///
    /// # Errors
    /// Names the rejected parameter.
    pub fn new(parameters: &Parameters) -> Result<Self, ParameterError> {
        match parameters.law {
            LawName::Capture => CaptureGuidance::new(parameters.capture()).map(|law| Law::Capture(Box::new(law))),
            LawName::Reference => {
                ComparisonGuidance::new(parameters.comparison()).map(|law| Law::Comparison(Box::new(law)))
            }
        }
        .map_err(|error| scenario_error(&error))
    }

    /// The set-points at this instant.
    pub fn step(&mut self, time_s: f64, poses: Option<(Pose, Pose)>, target: Option<TargetState>) -> LawOutput {
        let end_effector = poses.map(|(_, end_effector)| end_effector);
        match self {
            Law::Capture(law) => LawOutput {
                end_effector: law.step(&capture::Input {
                    time_s,
                    end_effector,
                    target,
                }),
                base: None,
            },
            Law::Comparison(law) => {
                let output = law.step(&comparison::Input {
                    time_s,
                    base: poses.map(|(base, _)| base),
                    end_effector,
                    target,
                });
                LawOutput {
                    end_effector: output.end_effector,
                    base: output.base,
                }
            }
        }
    }
}
