//! Validation: conditions for a description to be a mechanism.

use super::merge::Merged;
use super::{Description, DescriptionError as E, Inertia, JointKind, Link};
use nalgebra::Matrix3;

/// Tolerance of the triangle inequality: published inertias are rounded to a few digits, so a flat body may violate it by that much.
const TRIANGLE_SLACK: f64 = 1.0e-6;
const ROTATION_SLACK: f64 = 1.0e-9;

/// Inertia below which a value counts as zero: a milligram within a micrometre has more. Exporters leave products of inertia of that size.
const INERTIA_SLACK: f64 = 1.0e-18;

impl Description {
    /// Checks that this is a single tree of physically possible bodies with unique names.
    ///
    /// Links that are fixed to each other form one body, and only the body has to be physically possible: a placeholder link of a
    /// microgram may have any inertia.
    pub fn validate(&self) -> Result<(), E> {
        match self.errors().into_iter().next() {
            Some(error) => Err(error),
            None => Ok(()),
        }
    }

    /// All errors.
    pub(super) fn errors(&self) -> Vec<E> {
        if self.links.is_empty() {
            return vec![E::Empty];
        }
        let mut out = self.part_errors();
        let tree: Vec<E> = self.check_tree().err().into_iter().collect();
        let is_tree = out.is_empty() && tree.is_empty();
        out.extend(tree);
        let total = self.total_mass();
        if is_tree && !total.is_finite() {
            // no sum of the links' properties is meaningful
            out.push(E::TotalMass { value: total });
        } else if is_tree {
            out.extend(self.check_inertials());
            let moving = (0..self.joints.len()).filter(|&j| self.joints[j].kind != JointKind::Fixed);
            out.extend(moving.filter_map(|joint| self.joint_coupling(joint).err()));
            if !self.allow_unphysical {
                out.extend(
                    self.unphysical_links()
                        .into_iter()
                        .filter(|(_, merged)| !merged)
                        .map(|(error, _)| error),
                );
            }
        }
        out
    }

    /// Errors of single links and joints, independent of the tree.
    pub(super) fn part_errors(&self) -> Vec<E> {
        let mut out = Vec::new();
        unique("link", self.links.iter().map(|l| &l.name), &mut out);
        unique("joint", self.joints.iter().map(|j| &j.name), &mut out);
        for link in &self.links {
            out.extend(
                link.inertia
                    .and_then(|inertia| check_numbers(&link.name, &inertia).err()),
            );
        }
        out.extend((0..self.joints.len()).filter_map(|joint| self.check_joint(joint).err()));
        out
    }

    /// Tolerated errors of the inertias; with each, whether the body that the link is part of is possible. Call only on a checked
    /// tree.
    pub(super) fn tolerated_errors(&self) -> Vec<(E, bool)> {
        let unphysical = self.unphysical_links();
        unphysical
            .into_iter()
            .filter(|(_, merged)| *merged || self.allow_unphysical)
            .collect()
    }

    /// Links with physically impossible inertias, and whether the body that each is part of is possible.
    fn unphysical_links(&self) -> Vec<(E, bool)> {
        let error = |link: &Link| {
            link.inertia
                .and_then(|inertia| check_physics(&link.name, &inertia).err())
        };
        if self.links.iter().all(|link| error(link).is_none()) {
            return Vec::new(); // sums of possible bodies are possible
        }
        let merged = Merged::of(self);
        let body_of = |link: &Link| {
            merged
                .frames
                .iter()
                .find(|frame| frame.name == link.name)
                .and_then(|frame| frame.body)
        };
        let possible = |link: &Link| {
            let inertia = match body_of(link) {
                Some(body) => &merged.bodies[body].inertia,
                None => &merged.base,
            };
            // a negative mass is not a placeholder
            link.inertia.is_none_or(|own| own.mass >= 0.0) && check_physics(&link.name, inertia).is_ok()
        };
        let unphysical = self
            .links
            .iter()
            .filter_map(|link| error(link).map(|error| (error, possible(link))));
        unphysical.collect()
    }

    fn check_joint(&self, index: usize) -> Result<(), E> {
        let j = &self.joints[index];
        let name = || j.name.clone();
        for x in j.origin.p.iter().chain(j.origin.r.iter()) {
            finite("joint", &j.name, "the origin", *x)?;
        }
        let mut off = (j.origin.r.transpose() * j.origin.r - Matrix3::identity()).amax();
        if j.origin.r.determinant() < 0.0 {
            off = 1.0;
        }
        if off > ROTATION_SLACK {
            return Err(E::Rotation { joint: name(), off });
        }
        if j.kind != JointKind::Fixed {
            let n = j.axis.norm();
            if !(n > 0.0 && n.is_finite()) {
                return Err(E::Axis {
                    joint: name(),
                    x: j.axis.x,
                    y: j.axis.y,
                    z: j.axis.z,
                });
            }
        }
        if let (Some(limits), JointKind::Revolute | JointKind::Prismatic) = (&j.limits, j.kind)
            && limits.lower > limits.upper
        {
            return Err(E::Range {
                joint: name(),
                lower: limits.lower,
                upper: limits.upper,
            });
        }
        finite("joint", &j.name, "the rest position", j.rest)?;
        if let Some(mimic) = &j.mimic {
            finite("joint", &j.name, "the multiplier of <mimic>", mimic.multiplier)?;
            finite("joint", &j.name, "the offset of <mimic>", mimic.offset)?;
        }
        for (field, value) in [
            ("damping", j.damping),
            ("friction", j.friction),
            ("stiffness", j.stiffness),
            ("motor inertia", j.motor_inertia),
        ] {
            finite("joint", &j.name, field, value)?;
            if value < 0.0 {
                return Err(E::Negative {
                    what: "joint",
                    name: name(),
                    field,
                    value,
                });
            }
        }
        Ok(())
    }

    fn check_tree(&self) -> Result<(), E> {
        let mut parent: Vec<Option<usize>> = vec![None; self.links.len()];
        for (i, j) in self.joints.iter().enumerate() {
            if let Some(first) = parent[j.child] {
                return Err(E::TwoParents {
                    link: self.links[j.child].name.clone(),
                    first: self.joints[first].name.clone(),
                    second: j.name.clone(),
                });
            }
            parent[j.child] = Some(i);
        }
        for start in 0..self.links.len() {
            let mut at = start;
            for _ in 0..self.links.len() {
                match parent[at] {
                    Some(j) => at = self.joints[j].parent,
                    None => break,
                }
            }
            if let Some(j) = parent[at] {
                // more steps upward than there are links: a loop
                return Err(E::Loop {
                    link: self.links[at].name.clone(),
                    joint: self.joints[j].name.clone(),
                });
            }
        }
        let mut roots = self
            .links
            .iter()
            .zip(&parent)
            .filter(|(_, p)| p.is_none())
            .map(|(l, _)| &l.name);
        if let (Some(first), Some(second)) = (roots.next(), roots.next()) {
            return Err(E::TwoRoots {
                first: first.clone(),
                second: second.clone(),
            });
        }
        Ok(())
    }

    /// Every group of links joined by fixed joints must have at least one `<inertial>`.
    fn check_inertials(&self) -> Vec<E> {
        let mut out = Vec::new();
        let moving = |link: usize| {
            self.joints
                .iter()
                .find(|j| j.child == link && j.kind != JointKind::Fixed)
        };
        let root = self.root();
        for (i, link) in self.links.iter().enumerate() {
            let by = moving(i);
            if (by.is_some() || i == root) && !self.group_has_inertial(i) {
                let joint = by.map_or_else(|| "floating base".to_owned(), |j| j.name.clone());
                out.push(E::MissingInertial {
                    link: link.name.clone(),
                    joint,
                });
            }
        }
        out
    }

    fn group_has_inertial(&self, head: usize) -> bool {
        let mut group = vec![head];
        while let Some(link) = group.pop() {
            if self.links[link].inertia.is_some() {
                return true;
            }
            group.extend(
                self.joints
                    .iter()
                    .filter(|j| j.parent == link && j.kind == JointKind::Fixed)
                    .map(|j| j.child),
            );
        }
        // the root of a fixed-base mechanism (`world`) needs no inertia, and it is not yet known whether the base
        // floats; a base without mass is refused when a floating tree is built from it
        head == self.root() && self.links.len() > 1
    }

    /// The link without a parent. Call only on a checked tree.
    pub(super) fn root(&self) -> usize {
        (0..self.links.len())
            .find(|&i| self.joints.iter().all(|j| j.child != i))
            .unwrap_or(0)
    }
}

fn unique<'a>(what: &'static str, names: impl Iterator<Item = &'a String>, out: &mut Vec<E>) {
    let mut seen = std::collections::BTreeSet::new();
    for name in names {
        if !seen.insert(name) {
            out.push(E::DuplicateName {
                what,
                name: name.clone(),
            });
        }
    }
}

fn finite(what: &'static str, name: &str, field: &'static str, value: f64) -> Result<(), E> {
    if value.is_finite() {
        Ok(())
    } else {
        Err(E::NotFinite {
            what,
            name: name.to_owned(),
            field,
            value,
        })
    }
}

fn check_numbers(link: &str, i: &Inertia) -> Result<(), E> {
    finite("link", link, "the mass", i.mass)?;
    for x in i.com.iter() {
        finite("link", link, "the centre of mass", *x)?;
    }
    for x in i.about_com.iter() {
        finite("link", link, "the inertia", *x)?;
    }
    Ok(())
}

fn check_physics(link: &str, i: &Inertia) -> Result<(), E> {
    if i.mass < 0.0 {
        return Err(E::Negative {
            what: "link",
            name: link.to_owned(),
            field: "the mass",
            value: i.mass,
        });
    }
    let mut moments = i.about_com.symmetric_eigenvalues();
    moments.as_mut_slice().sort_by(f64::total_cmp);
    let [small, middle, large]: [f64; 3] = moments.into();
    if small < -1.0e-12 * large.abs() - INERTIA_SLACK {
        return Err(E::InertiaNotPositive {
            link: link.to_owned(),
            moment: small,
        });
    }
    if large > (small + middle) + TRIANGLE_SLACK * large + INERTIA_SLACK {
        return Err(E::Triangle {
            link: link.to_owned(),
            small,
            middle,
            large,
        });
    }
    if i.mass == 0.0 && large > INERTIA_SLACK {
        return Err(E::InertiaWithoutMass {
            link: link.to_owned(),
            moment: large,
        });
    }
    Ok(())
}
