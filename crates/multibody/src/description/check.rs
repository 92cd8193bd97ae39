//! What makes a description a mechanism.

use super::{Description, DescriptionError as E, Inertia, JointKind};
use nalgebra::Matrix3;

/// Published inertias are rounded to a few digits, so a flat body may miss the triangle inequality by that much.
const TRIANGLE_SLACK: f64 = 1.0e-6;
const ROTATION_SLACK: f64 = 1.0e-9;

impl Description {
    /// Checks that this is one tree of physically possible links and joints with unique names.
    pub fn validate(&self) -> Result<(), E> {
        if self.links.is_empty() {
            return Err(E::Empty);
        }
        unique("link", self.links.iter().map(|l| &l.name))?;
        unique("joint", self.joints.iter().map(|j| &j.name))?;
        for link in &self.links {
            if let Some(inertia) = &link.inertia {
                check_inertia(&link.name, inertia)?;
            }
        }
        for joint in 0..self.joints.len() {
            self.check_joint(joint)?;
        }
        self.check_tree()?;
        self.check_inertials()
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
        finite("joint", &j.name, "the rest position", j.rest)?;
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
                // more steps upward than there are links: we are going round
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
    fn check_inertials(&self) -> Result<(), E> {
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
                return Err(E::MissingInertial {
                    link: link.name.clone(),
                    joint,
                });
            }
        }
        Ok(())
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

fn unique<'a>(what: &'static str, names: impl Iterator<Item = &'a String>) -> Result<(), E> {
    let mut seen = std::collections::BTreeSet::new();
    for name in names {
        if !seen.insert(name) {
            return Err(E::DuplicateName {
                what,
                name: name.clone(),
            });
        }
    }
    Ok(())
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

fn check_inertia(link: &str, i: &Inertia) -> Result<(), E> {
    finite("link", link, "the mass", i.mass)?;
    for x in i.com.iter() {
        finite("link", link, "the centre of mass", *x)?;
    }
    for x in i.about_com.iter() {
        finite("link", link, "the inertia", *x)?;
    }
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
    if small < -1.0e-12 * large.abs() || large < 0.0 {
        return Err(E::InertiaNotPositive {
            link: link.to_owned(),
            moment: small,
        });
    }
    if large > (small + middle) + TRIANGLE_SLACK * large {
        return Err(E::Triangle {
            link: link.to_owned(),
            small,
            middle,
            large,
        });
    }
    Ok(())
}
