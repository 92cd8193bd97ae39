//! Application crate for the capture of a tumbling satellite.
//!
//! - [`assessment`]: its figures of merit and criteria, under the name `capture`;
//! - [`actuators`]: campaign cases with every single failure of an actuator of the stock plant;
//! - [`late_events`]: warnings about failures and a grasp after the end of a run;
//! - [`start_values`]: warnings about start values that are changed when a run is continued;
//! - [`provenance`]: checks of gains against the robot and the period that they are used with;
//! - [`velocity_loop`]: stability of gains with the delays of a scenario, along its path;
//! - [`closed_loop`]: closed-loop verification of tuned gains in the simulator;
//! - [`report_view`]: its figures in the report.

pub mod actuators;
pub mod assessment;
#[cfg(test)]
mod close_scenario;
pub mod closed_loop;
pub mod late_events;
pub mod provenance;
pub mod report_view;
pub mod start_values;
pub mod velocity_loop;
