//! Edits of a description by name: frozen joints, motor inertia, mismatch.

use super::{Description, Joint, JointKind, Placement};
use crate::rotation::axis_angle;

/// Errors of an edit.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum EditError {
    /// No joint of that name.
    #[error("there is no joint `{name}`; the moving joints are: {known}")]
    NoSuchJoint {
        /// The requested name.
        name: String,
        /// The existing names.
        known: String,
    },
    /// No link of that name.
    #[error("there is no link `{name}`; the links are: {known}")]
    NoSuchLink {
        /// The requested name.
        name: String,
        /// The existing names.
        known: String,
    },
    /// An invalid value for the quantity.
    #[error("{what} of `{name}` cannot be {value}; {remedy}")]
    Value {
        /// The quantity to set.
        what: &'static str,
        /// Name of the link or joint.
        name: String,
        /// The rejected value.
        value: f64,
        /// What is allowed.
        remedy: &'static str,
    },
}

impl Description {
    /// Welds the moving joint `name` at position `at` (rad or m), and the joints that follow it at their resulting positions. The bodies
    /// that it carries become part of its parent; freezing the slosh joints at zero gives the controller's model with the propellant as a
    /// rigid mass on the base.
    pub fn freeze(&mut self, name: &str, at: f64) -> Result<&mut Self, EditError> {
        let j = self.moving_joint_mut(name)?;
        if !at.is_finite() {
            return Err(value("the frozen position", name, at, "give a finite position"));
        }
        let axis = j.axis.normalize();
        let motion = match j.kind {
            JointKind::Prismatic => Placement {
                p: axis * at,
                ..Placement::identity()
            },
            _ => Placement {
                r: axis_angle(&axis, at),
                ..Placement::identity()
            },
        };
        j.origin = j.origin.then(&motion);
        j.kind = JointKind::Fixed;
        j.mimic = None;
        for (follower, at) in self.followers(name, at) {
            self.freeze(&follower, at)?;
        }
        Ok(self)
    }

    /// Adds `inertia` (kg m², or kg for a prismatic joint), as seen at the joint's output, to joint `name`.
    pub fn add_motor_inertia(&mut self, name: &str, inertia: f64) -> Result<&mut Self, EditError> {
        let j = self.moving_joint_mut(name)?;
        j.motor_inertia = not_negative("the motor inertia", name, j.motor_inertia + inertia)?;
        Ok(self)
    }

    /// Sets the viscous damping of joint `name` (N m s/rad or N s/m).
    pub fn set_damping(&mut self, name: &str, damping: f64) -> Result<&mut Self, EditError> {
        self.moving_joint_mut(name)?.damping = not_negative("the damping", name, damping)?;
        Ok(self)
    }

    /// Puts a spring of `stiffness` (N m/rad or N/m) on joint `name`, relaxed at `rest` (rad or m).
    pub fn set_stiffness(&mut self, name: &str, stiffness: f64, rest: f64) -> Result<&mut Self, EditError> {
        let j = self.moving_joint_mut(name)?;
        j.stiffness = not_negative("the stiffness", name, stiffness)?;
        if !rest.is_finite() {
            return Err(value("the rest position", name, rest, "give a finite position"));
        }
        j.rest = rest;
        Ok(self)
    }

    /// Multiplies the mass and the inertia of link `name` by `factor`: a denser or lighter link of the same shape.
    pub fn scale_mass(&mut self, name: &str, factor: f64) -> Result<&mut Self, EditError> {
        let factor = not_negative("the mass factor", name, factor)?;
        if let Some(i) = &mut self.link_mut(name)?.inertia {
            i.mass *= factor;
            i.about_com *= factor;
        }
        Ok(self)
    }

    /// Multiplies the inertia about the centre of mass of link `name` by `factor`, leaving its mass.
    pub fn scale_inertia(&mut self, name: &str, factor: f64) -> Result<&mut Self, EditError> {
        let factor = not_negative("the inertia factor", name, factor)?;
        if let Some(i) = &mut self.link_mut(name)?.inertia {
            i.about_com *= factor;
        }
        Ok(self)
    }

    /// Multiplies every mass and inertia by `factor`.
    pub fn scale_all(&mut self, factor: f64) -> Result<&mut Self, EditError> {
        let factor = not_negative("the mass factor", &self.name, factor)?;
        for i in self.links.iter_mut().filter_map(|l| l.inertia.as_mut()) {
            i.mass *= factor;
            i.about_com *= factor;
        }
        Ok(self)
    }

    /// Removes link `name`, the joint that carries it and everything below it; used to replace the two-hinge pendulum
    /// by [`SphericalSlosh`](crate::SphericalSlosh).
    pub fn remove_branch(&mut self, name: &str) -> Result<&mut Self, EditError> {
        self.link_mut(name)?;
        let index = |links: &[super::Link], name: &str| links.iter().position(|l| l.name == name);
        let mut removed: Vec<usize> = index(&self.links, name).into_iter().collect();
        let mut next = 0;
        while let Some(&link) = removed.get(next) {
            removed.extend(self.joints.iter().filter(|j| j.parent == link).map(|j| j.child));
            next += 1;
        }
        self.joints.retain(|j| !removed.contains(&j.child));
        let kept: Vec<usize> = (0..self.links.len()).filter(|i| !removed.contains(i)).collect();
        let new_index = |old: usize| kept.iter().position(|&k| k == old).unwrap_or(0);
        for j in &mut self.joints {
            j.parent = new_index(j.parent);
            j.child = new_index(j.child);
        }
        self.links = kept.iter().map(|&k| self.links[k].clone()).collect();
        Ok(self)
    }

    fn moving_joint_mut(&mut self, name: &str) -> Result<&mut Joint, EditError> {
        let found = self
            .joints
            .iter()
            .position(|j| j.name == name && j.kind != JointKind::Fixed);
        match found {
            Some(i) => Ok(&mut self.joints[i]),
            None => Err(EditError::NoSuchJoint {
                name: name.to_owned(),
                known: list(self.moving_joints().map(|j| j.name.as_str())),
            }),
        }
    }

    fn link_mut(&mut self, name: &str) -> Result<&mut super::Link, EditError> {
        match self.links.iter().position(|l| l.name == name) {
            Some(i) => Ok(&mut self.links[i]),
            None => Err(EditError::NoSuchLink {
                name: name.to_owned(),
                known: list(self.links.iter().map(|l| l.name.as_str())),
            }),
        }
    }
}

fn list<'a>(names: impl Iterator<Item = &'a str>) -> String {
    let names: Vec<&str> = names.collect();
    if names.is_empty() {
        "none".to_owned()
    } else {
        names.join(", ")
    }
}

fn value(what: &'static str, name: &str, value: f64, remedy: &'static str) -> EditError {
    EditError::Value {
        what,
        name: name.to_owned(),
        value,
        remedy,
    }
}

fn not_negative(what: &'static str, name: &str, x: f64) -> Result<f64, EditError> {
    if x >= 0.0 && x.is_finite() {
        Ok(x)
    } else {
        Err(value(what, name, x, "give a finite number, zero or more"))
    }
}
