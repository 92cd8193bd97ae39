//! Common interface of the guidance laws.

use guidance_laws::capture::{self, CaptureGuidance};
use guidance_laws::reference::{self, ReferenceGuidance};
use guidance_laws::{Pose, SetPoint, TargetState};
use lockstep::participant::ParameterError;

use crate::parameters::{LawName, Parameters, refused};

/// A guidance law.
#[derive(Debug, Clone)]
pub enum Law {
    /// The law of the paper.
    Capture(Box<CaptureGuidance>),
    /// The comparison law.
    Reference(Box<ReferenceGuidance>),
}

/// Outputs of a law.
#[derive(Debug, Clone, Copy)]
pub struct Answer {
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
                ReferenceGuidance::new(parameters.comparison()).map(|law| Law::Reference(Box::new(law)))
            }
        }
        .map_err(|error| refused(&error))
    }

    /// The set-points at this instant.
    pub fn step(&mut self, time_s: f64, poses: Option<(Pose, Pose)>, target: Option<TargetState>) -> Answer {
        let end_effector = poses.map(|(_, end_effector)| end_effector);
        match self {
            Law::Capture(law) => Answer {
                end_effector: law.step(&capture::Input {
                    time_s,
                    end_effector,
                    target,
                }),
                base: None,
            },
            Law::Reference(law) => {
                let output = law.step(&reference::Input {
                    time_s,
                    base: poses.map(|(base, _)| base),
                    end_effector,
                    target,
                });
                Answer {
                    end_effector: output.end_effector,
                    base: output.base,
                }
            }
        }
    }
}
