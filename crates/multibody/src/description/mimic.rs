//! Joints that follow another: `<mimic>`, a rigid gear or linkage.

use super::{Description, DescriptionError as E, Joint, JointKind};

/// Source of a moving joint's position: `multiplier · q + offset` of the joint coordinate with that index.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct JointCoupling {
    /// Whether the coordinate belongs to the joint itself.
    pub independent: bool,
    pub coordinate: usize,
    pub multiplier: f64,
    pub offset: f64,
}

impl Description {
    /// For every moving joint, in the order of the file, the source of its position; `None` when all have their own coordinates.
    pub(super) fn joint_couplings(&self) -> Result<Option<Vec<JointCoupling>>, E> {
        if self
            .joints
            .iter()
            .all(|joint| joint.kind == JointKind::Fixed || joint.mimic.is_none())
        {
            return Ok(None);
        }
        let moving = (0..self.joints.len()).filter(|&joint| self.joints[joint].kind != JointKind::Fixed);
        moving
            .map(|joint| self.joint_coupling(joint))
            .collect::<Result<_, _>>()
            .map(Some)
    }

    /// Resolves the chain from a joint to the one with a coordinate.
    pub(super) fn joint_coupling(&self, joint: usize) -> Result<JointCoupling, E> {
        let follower = &self.joints[joint];
        let (mut at, mut multiplier, mut offset) = (joint, 1.0, 0.0);
        for _ in 0..self.joints.len() {
            let Some(mimic) = &self.joints[at].mimic else {
                let before = self.joints[..at].iter().filter(|j| j.has_coordinate());
                return Ok(JointCoupling {
                    independent: at == joint,
                    coordinate: before.count(),
                    multiplier,
                    offset,
                });
            };
            // own = multiplier (mimic.multiplier q + mimic.offset) + offset
            offset += multiplier * mimic.offset;
            multiplier *= mimic.multiplier;
            let refuse = |reason| {
                Err(E::Mimic {
                    joint: follower.name.clone(),
                    leader: mimic.joint.clone(),
                    reason,
                })
            };
            at = match self.joints.iter().position(|j| j.name == mimic.joint) {
                Some(leader) if self.joints[leader].kind == JointKind::Fixed => {
                    return refuse("which does not move; make it fixed as well");
                }
                Some(leader) => leader,
                None => return refuse("which is not there; name a moving joint, or remove <mimic>"),
            };
        }
        Err(E::Mimic {
            joint: follower.name.clone(),
            leader: follower
                .mimic
                .as_ref()
                .map_or_else(String::new, |mimic| mimic.joint.clone()),
            reason: "which follows it in turn; let one of them follow no other",
        })
    }

    /// Names and frozen positions of the joints that follow `joint` directly, when `joint` is frozen at position `at`.
    pub(super) fn followers(&self, joint: &str, at: f64) -> Vec<(String, f64)> {
        let follows = |j: &Joint| {
            let mimic = j
                .mimic
                .as_ref()
                .filter(|mimic| mimic.joint == joint && j.kind != JointKind::Fixed)?;
            Some((j.name.clone(), mimic.multiplier * at + mimic.offset))
        };
        self.joints.iter().filter_map(follows).collect()
    }
}
