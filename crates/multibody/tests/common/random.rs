//! Random mechanisms, states and vectors from a seed.

use multibody::{Description, DynState, Inertia, Joint, JointKind, Link, Placement, Quaternion};
use nalgebra::{Matrix3, Vector3};
use testing::random::SplitMix;

/// Draws from a seed.
pub(crate) struct Rng(SplitMix);

impl Rng {
    pub(crate) fn new(seed: u64) -> Self {
        Self(SplitMix(seed))
    }

    /// Uniform in [-1, 1).
    pub(crate) fn unit(&mut self) -> f64 {
        2.0 * self.0.uniform() - 1.0
    }

    pub(crate) fn below(&mut self, n: usize) -> usize {
        (self.0.bits() % n as u64) as usize
    }

    pub(crate) fn chance(&mut self, percent: usize) -> bool {
        self.below(100) < percent
    }

    pub(crate) fn vector(&mut self) -> Vector3<f64> {
        Vector3::new(self.unit(), self.unit(), self.unit())
    }

    pub(crate) fn list(&mut self, n: usize, scale: f64) -> Vec<f64> {
        (0..n).map(|_| scale * self.unit()).collect()
    }

    pub(crate) fn quaternion(&mut self) -> Quaternion {
        Quaternion {
            w: self.unit(),
            x: self.unit(),
            y: self.unit(),
            z: self.unit() + 1e-3,
        }
        .normalized()
    }

    pub(crate) fn rotation(&mut self) -> Matrix3<f64> {
        self.quaternion().matrix()
    }
}

/// The inertia of a random set of point masses.
pub(crate) fn inertia(rng: &mut Rng) -> Inertia {
    let points: Vec<(f64, Vector3<f64>)> = (0..5).map(|_| (1.1 + rng.unit(), rng.vector() * 0.4)).collect();
    let shift = rng.vector() * 0.3;
    let mass: f64 = points.iter().map(|p| p.0).sum();
    let com = points.iter().map(|p| p.1 * p.0).sum::<Vector3<f64>>() / mass;
    let about = |m: f64, x: Vector3<f64>| (Matrix3::identity() * x.norm_squared() - x * x.transpose()) * m;
    let about_com = points.iter().map(|p| about(p.0, p.1 - com)).sum();
    Inertia {
        mass,
        com: com + shift,
        about_com,
    }
}

/// A tree of `n` moving joints on link `base`, links `l0`…, joints `j0`…, with a frame `tip` fixed to the last link.
pub(crate) fn mechanism(rng: &mut Rng, n: usize) -> Description {
    let mut base = inertia(rng);
    base.mass *= 10.0;
    base.about_com *= 10.0;
    let link = |name: &str, inertia| Link {
        name: name.to_owned(),
        inertia,
    };
    let mut d = Description {
        name: "random".into(),
        links: vec![link("base", Some(base))],
        joints: Vec::new(),
        allow_unphysical: false,
    };
    for i in 0..n {
        // mostly chains, so that depth is tested too
        let parent = if rng.chance(70) { i } else { rng.below(i + 1) };
        // a massless body must carry a body about another axis
        let massless = i + 1 < n && rng.chance(10);
        let own = if massless { Inertia::zero() } else { inertia(rng) };
        d.links.push(link(&format!("l{i}"), Some(own)));
        let kind = match rng.below(4) {
            0 => JointKind::Prismatic,
            1 => JointKind::Continuous,
            _ => JointKind::Revolute,
        };
        d.joints.push(Joint {
            name: format!("j{i}"),
            kind,
            parent,
            child: i + 1,
            origin: Placement {
                p: rng.vector() * 0.6,
                r: rng.rotation(),
            },
            axis: rng.vector().normalize(),
            limits: None,
            damping: if rng.chance(30) { 0.1 + 0.1 * rng.unit() } else { 0.0 },
            friction: 0.0,
            stiffness: if rng.chance(30) { 2.0 + rng.unit() } else { 0.0 },
            rest: rng.unit(),
            motor_inertia: if massless || rng.chance(30) {
                0.2 + 0.1 * rng.unit()
            } else {
                0.0
            },
            mimic: None,
        });
    }
    fix(&mut d, rng, n, "tip");
    d
}

/// Adds a frame fixed to link `parent`.
pub(crate) fn fix(d: &mut Description, rng: &mut Rng, parent: usize, name: &str) {
    d.links.push(Link {
        name: name.into(),
        inertia: None,
    });
    d.joints.push(Joint {
        name: format!("{name} mount"),
        kind: JointKind::Fixed,
        parent,
        child: d.links.len() - 1,
        origin: Placement {
            p: rng.vector() * 0.3,
            r: rng.rotation(),
        },
        axis: Vector3::x(),
        limits: None,
        damping: 0.0,
        friction: 0.0,
        stiffness: 0.0,
        rest: 0.0,
        motor_inertia: 0.0,
        mimic: None,
    });
}

pub(crate) fn state(rng: &mut Rng, n: usize) -> DynState {
    DynState {
        p_nb: rng.vector() * 3.0,
        quat_nb: rng.quaternion(),
        q: rng.list(n, 3.1),
        nu: rng.list(n + 6, 1.5),
    }
}
