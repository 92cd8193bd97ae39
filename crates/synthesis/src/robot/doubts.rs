//! What a specification says of its robot that is possible, but probably a mistake.

use super::linearise::Robot;
use super::spec::Spec;

impl Robot {
    /// Doubts about a specification: joint angles outside the limits of the description, and moving masses that are in no group and
    /// therefore count as exactly known.
    pub fn doubts(&self, spec: &Spec) -> Vec<String> {
        let mut doubts = Vec::new();
        for model in &spec.models {
            let key = format!("models: {:?}: joints_deg", model.name);
            let angles: Vec<[f64; 1]> = model.joints_deg.iter().map(|angle| [*angle]).collect();
            self.beyond_limits(&key, &angles, &mut doubts);
        }
        // This range is symmetric about zero.
        let ranges: Vec<[f64; 2]> = spec
            .validation
            .joints_deg
            .iter()
            .map(|range| [*range, -range])
            .collect();
        self.beyond_limits("validation.joints_deg", &ranges, &mut doubts);
        self.in_no_group(&mut doubts);
        doubts
    }

    /// For each joint of the loop, angles in degrees that belong to it.
    fn beyond_limits<const N: usize>(&self, key: &str, angles: &[[f64; N]], doubts: &mut Vec<String>) {
        /// Of an angle that was rounded where the description was written.
        const ROUNDING_DEG: f64 = 1e-4;
        let joints = self.description.moving_joints();
        let joints = joints.filter(|joint| !self.spec.frozen.contains_key(&joint.name));
        for (joint, own) in joints.zip(angles) {
            let Some(limits) = joint.limits else { continue };
            let (lower, upper) = (limits.lower.to_degrees(), limits.upper.to_degrees());
            let beyond = |angle: &&f64| **angle < lower - ROUNDING_DEG || **angle > upper + ROUNDING_DEG;
            if let Some(angle) = own.iter().find(beyond) {
                doubts.push(format!(
                    "{key} has {angle} for the joint `{}`, whose limits in the robot description are {lower:.2} and {upper:.2} deg; \
                     correct one of the two",
                    joint.name
                ));
            }
        }
    }

    /// Links with a mass that a joint moves, and that are not listed.
    fn in_no_group(&self, doubts: &mut Vec<String>) {
        let d = &self.description;
        let mut moved = vec![false; d.links.len()];
        // A link is moved if the joint to its parent moves, or its parent is moved; parents may come later in the file.
        for _ in 0..d.joints.len() {
            for joint in &d.joints {
                moved[joint.child] |= moved[joint.parent] || joint.has_coordinate() || joint.mimic.is_some();
            }
        }
        let named = |name: &String| {
            let lists = [&self.spec.arm_links, &self.spec.propellant_links];
            *name == self.spec.base_link || lists.iter().any(|list| list.contains(name))
        };
        for (link, _) in d
            .links
            .iter()
            .zip(&moved)
            .filter(|(link, moved)| **moved && !named(&link.name))
        {
            let mass = link.inertia.as_ref().map_or(0.0, |inertia| inertia.mass);
            if mass > 0.0 {
                doubts.push(format!(
                    "the link `{}` ({mass} kg) moves with the joints, but is in none of robot.base_link, robot.arm_links and \
                     robot.propellant_links: its mass counts as exactly known in the margins; add it to robot.arm_links",
                    link.name
                ));
            }
        }
    }
}
