//! The capture of a tumbling satellite: what only this application has.
//!
//! - [`assessment`]: its figures of merit and criteria, under the name `capture`;
//! - [`actuators`]: the list of every single failure of an actuator of the stock plant;
//! - [`provenance`]: whether gains fit the robot and the period that they are used with;
//! - [`velocity_loop`]: whether gains are stable with the delays of a scenario, along the path that it flies;
//! - [`flight`]: closed-loop verification of tuned gains in the simulator;
//! - [`pictures`]: its figures in the report.

pub mod actuators;
pub mod assessment;
pub mod flight;
pub mod pictures;
pub mod provenance;
pub mod velocity_loop;
