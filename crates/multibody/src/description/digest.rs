//! Digest of a description's physical properties.

use super::{Description, Inertia, Placement};

/// 64-bit FNV-1a.
struct Digest(u64);

impl Digest {
    fn bytes(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.0 = (self.0 ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3);
        }
    }

    /// Hashes the length first, so that two consecutive names are distinct from their concatenation.
    fn name(&mut self, name: &str) {
        self.bytes(&(name.len() as u64).to_le_bytes());
        self.bytes(name.as_bytes());
    }

    fn numbers<'a>(&mut self, numbers: impl IntoIterator<Item = &'a f64>) {
        for number in numbers {
            // Adding zero turns −0 into +0.
            self.bytes(&(number + 0.0).to_bits().to_le_bytes());
        }
    }

    fn placement(&mut self, placement: &Placement) {
        self.numbers(placement.p.iter().chain(placement.r.iter()));
    }

    fn inertia(&mut self, inertia: Option<&Inertia>) {
        self.bytes(&[u8::from(inertia.is_some())]);
        if let Some(inertia) = inertia {
            self.numbers([&inertia.mass]);
            self.numbers(inertia.com.iter().chain(inertia.about_com.iter()));
        }
    }
}

impl Description {
    /// A hash that depends on every mass, inertia, joint, frame and limit, and on the names and the order of links and joints, and on
    /// nothing else: not on visual geometry, comments, the spelling of numbers, or the mechanism's name.
    pub fn digest(&self) -> u64 {
        let mut digest = Digest(0xcbf2_9ce4_8422_2325);
        for link in &self.links {
            digest.name(&link.name);
            digest.inertia(link.inertia.as_ref());
        }
        for joint in &self.joints {
            digest.name(&joint.name);
            digest.bytes(&[joint.kind as u8]);
            digest.name(&self.links[joint.parent].name);
            digest.name(&self.links[joint.child].name);
            digest.placement(&joint.origin);
            digest.numbers(joint.axis.iter());
            digest.bytes(&[u8::from(joint.limits.is_some())]);
            if let Some(limits) = &joint.limits {
                digest.numbers([&limits.lower, &limits.upper, &limits.velocity, &limits.effort]);
            }
            digest.numbers([
                &joint.damping,
                &joint.friction,
                &joint.stiffness,
                &joint.rest,
                &joint.motor_inertia,
            ]);
            if let Some(mimic) = &joint.mimic {
                digest.name(&mimic.joint);
                digest.numbers([&mimic.multiplier, &mimic.offset]);
            }
        }
        digest.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PENDULUM: &str = r#"<robot name="pendulum">
        <link name="base"><inertial><mass value="2"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
        <link name="bob"><inertial><origin xyz="0 0 -1"/><mass value="0.5"/>
            <inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
        <joint name="hinge" type="revolute"><parent link="base"/><child link="bob"/><origin xyz="0 0 -0.2"/><axis xyz="1 0 0"/>
            <limit lower="-1" upper="1" velocity="2" effort="3"/></joint>
        </robot>"#;

    fn digest(text: &str) -> u64 {
        Description::from_urdf(text).unwrap().digest()
    }

    #[test]
    fn digest_ignores_appearance() {
        let visual = r#"<link name="bob"><visual><geometry><sphere radius="0.1"/></geometry></visual>"#;
        for same in [
            PENDULUM.replace(r#"<link name="bob">"#, visual),
            PENDULUM.replace("</robot>", "<!-- drawn by hand --></robot>"),
            PENDULUM.replace(r#"name="pendulum""#, r#"name="clock""#),
            PENDULUM.replace(r#"value="0.5""#, r#"value="5.0e-1""#),
        ] {
            assert_ne!(same, PENDULUM);
            assert_eq!(digest(&same), digest(PENDULUM), "{same}");
        }
    }

    #[test]
    fn digest_depends_on_physics() {
        for (from, to) in [
            (r#"value="0.5""#, r#"value="0.500001""#),
            (r#"iyy="0.1""#, r#"iyy="0.11""#),
            (r#"xyz="0 0 -1""#, r#"xyz="0 0 -1.1""#),
            (r#"xyz="0 0 -0.2""#, r#"xyz="0 0.1 -0.2""#),
            (r#"xyz="1 0 0""#, r#"xyz="0 1 0""#),
            (r#"upper="1""#, r#"upper="1.5""#),
            (r#"effort="3""#, r#"effort="4""#),
            (r#"type="revolute""#, r#"type="prismatic""#),
            (r#""hinge""#, r#""pivot""#),
        ] {
            let changed = PENDULUM.replace(from, to);
            assert_ne!(changed, PENDULUM, "{from}");
            assert_ne!(digest(&changed), digest(PENDULUM), "{from}");
        }
    }
}
