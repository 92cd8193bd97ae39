//! Momentum of every single body, from the recorded motion and the plant's model in the plan.

use lockstep::port::Field;
use lockstep::units::{Inertia, Mass, PerAxis, Quantity, read};
use multibody::nalgebra::Vector3;
use multibody::{BodyInfo, Description, DynState, DynTree, Quaternion, UrdfOptions};
use serde::Deserialize;

use super::table::{ARM_ANGLES, MomentumQuantity, Names, SLOSH_ANGLES};
use tape::StreamSpec;

/// The required parameters of the target.
#[derive(Deserialize)]
struct Target {
    mass: Quantity<Mass>,
    inertia: PerAxis<Inertia, 3>,
}

/// The fields of the plant's truth.
struct Fields {
    p_nb: Field,
    quat_nb: Field,
    omega_nb: Field,
    v_nb: Field,
    q: Field,
    qdot: Field,
    slosh: Field,
    slosh_rate: Field,
    wheels: Field,
    p_nt: Field,
    quat_nt: Field,
    v_nt: Field,
    omega_nt: Field,
}

/// A bob on a ball joint, which replaces the last joints of the tree.
struct Bob {
    direction: Field,
    /// From the base's origin, base axes, m.
    hinge: Vector3<f64>,
    length: f64,
    /// About its centre of mass, perpendicular to the rod, kg m².
    inertia: f64,
}

/// The state of a body at an instant, world axes.
struct Body {
    mass: f64,
    /// Of its centre of mass.
    p: Vector3<f64>,
    linear: Vector3<f64>,
    /// About its own centre of mass.
    spin: Vector3<f64>,
}

/// The field of `spec` under one of its names, with at least `least` elements.
fn find(spec: &StreamSpec, names: Names, least: usize) -> Option<&Field> {
    let mut found = names.iter().filter_map(|name| spec.descriptor.field(name));
    found.find(|field| field.len() >= least)
}

/// Servicer, wheels and target of a plant.
pub(super) struct Momenta {
    tree: DynTree,
    fields: Fields,
    bob: Option<Bob>,
    target: (f64, Vector3<f64>),
    /// Names of the bodies that have mass, in the order in which their curves are drawn: the fastest-moving bodies first.
    names: Vec<String>,
    /// Their indices among the bodies with mass of the tree, followed by the target.
    order: Vec<usize>,
    /// The number of them that precede the wheels and the sum.
    leading: usize,
}

impl Momenta {
    /// Creates it for the stream `spec`, if that contains the whole motion and the plan has the model of the participant
    /// that publishes it.
    pub(super) fn of(spec: &StreamSpec, plan: &toml::Table) -> Option<Momenta> {
        let vector = |names: Names| find(spec, names, 3).cloned();
        let quaternion = |names: Names| find(spec, names, 4).cloned();
        let any = |names: Names| find(spec, names, 1).cloned();
        let fields = Fields {
            p_nb: vector(&["p_NB_N"])?,
            quat_nb: quaternion(&["quat_NB"])?,
            omega_nb: vector(&["omega_NB_B"])?,
            v_nb: vector(&["v_NB_B"])?,
            q: any(ARM_ANGLES)?,
            qdot: any(&["qdot"])?,
            slosh: any(SLOSH_ANGLES)?,
            slosh_rate: any(&["slosh_rate"])?,
            wheels: vector(&["wheel_momentum_B"])?,
            p_nt: vector(&["p_NT_N"])?,
            quat_nt: quaternion(&["quat_NT"])?,
            v_nt: vector(&["v_NT_N"])?,
            omega_nt: vector(&["omega_NT_T"])?,
        };
        let participant = plan.get("participants")?.get(&spec.participant)?;
        let parameters = participant.get("parameters")?.as_table()?;
        let description = Description::read_urdf(
            parameters.get("urdf")?.as_str()?,
            UrdfOptions { allow_unphysical: true },
        )
        .ok()?
        .description;
        let tree = DynTree::new(&description, true).ok()?;
        let coordinates = fields.q.len() + fields.slosh.len();
        if tree.joints() != coordinates
            || fields.qdot.len() != fields.q.len()
            || fields.slosh_rate.len() != fields.slosh.len()
        {
            return None;
        }
        let target: Target = read(parameters.get("target")?.as_table()?).ok()?;
        let spherical = parameters.get("slosh").and_then(toml::Value::as_str) == Some("spherical");
        let bob = match spherical {
            true => Some(bob(&tree, &description, vector(&["slosh_direction_B"])?)?),
            false => None,
        };
        let with_mass: Vec<BodyInfo> = tree.bodies().into_iter().filter(|body| body.mass > 0.0).collect();
        let is_arm = |at: &usize| {
            let coordinate = with_mass.get(*at).and_then(|body| body.coordinate);
            coordinate.is_some_and(|coordinate| coordinate < fields.q.len())
        };
        let (arm, others): (Vec<usize>, Vec<usize>) = (0..with_mass.len()).partition(is_arm);
        let leading = others.len() + 1;
        let order = [others, vec![with_mass.len()], arm].concat();
        let name = |at: &usize| {
            with_mass
                .get(*at)
                .map_or("target".into(), |body| body.link.replace('_', " "))
        };
        Some(Momenta {
            names: order.iter().map(name).collect(),
            leading,
            order,
            tree,
            fields,
            bob,
            target: (target.mass.si(), target.inertia.si().into()),
        })
    }

    /// The labels of the curves of a figure, in the order of [`Momenta::values`].
    pub(super) fn labels(&self, quantity: MomentumQuantity) -> Vec<String> {
        let (leading, arm) = self.names.split_at(self.leading);
        let with = |others: &[&str]| {
            let others = others.iter().map(|other| (*other).to_owned());
            leading
                .iter()
                .cloned()
                .chain(others)
                .chain(arm.iter().cloned())
                .collect()
        };
        match quantity {
            MomentumQuantity::Linear(_) => with(&["sum"]),
            MomentumQuantity::Angular(_) => with(&["wheels", "sum"]),
            MomentumQuantity::Centre => ["x", "y", "z"].map(String::from).into(),
        }
    }

    /// The curves of a figure in one record.
    pub(super) fn values(&self, quantity: MomentumQuantity, payload: &[u8], out: &mut [f64]) {
        let bodies = self.bodies(payload);
        let wheels = self.base(payload).rotate(&vector(&self.fields.wheels, payload));
        let mass: f64 = bodies.iter().map(|body| body.mass).sum();
        let centre = bodies.iter().map(|body| body.p * body.mass).sum::<Vector3<f64>>() / mass;
        let linear: Vector3<f64> = bodies.iter().map(|body| body.linear).sum();
        let about_centre =
            |body: &Body| body.spin + (body.p - centre).cross(&(body.linear - linear * (body.mass / mass)));
        let angular: Vec<Vector3<f64>> = bodies.iter().map(about_centre).collect();
        let total = angular.iter().sum::<Vector3<f64>>() + wheels;
        let (leading, arm) = self.order.split_at(self.leading);
        let mut slots = out.iter_mut();
        let mut put = |y: f64| slots.next().into_iter().for_each(|slot| *slot = y);
        match quantity {
            MomentumQuantity::Linear(axis) => {
                leading.iter().for_each(|at| put(bodies[*at].linear[axis]));
                put(linear[axis]);
                arm.iter().for_each(|at| put(bodies[*at].linear[axis]));
            }
            MomentumQuantity::Angular(axis) => {
                leading.iter().for_each(|at| put(angular[*at][axis]));
                put(wheels[axis]);
                put(total[axis]);
                arm.iter().for_each(|at| put(angular[*at][axis]));
            }
            MomentumQuantity::Centre => centre.iter().for_each(|x| put(*x)),
        }
    }

    fn base(&self, payload: &[u8]) -> Quaternion {
        Quaternion::from_wxyz(std::array::from_fn(|i| self.fields.quat_nb.value(payload, i)))
    }

    /// The bodies of the servicer that have mass, and the target.
    fn bodies(&self, payload: &[u8]) -> Vec<Body> {
        let f = &self.fields;
        let all = |field: &Field| (0..field.len()).map(|i| field.value(payload, i)).collect::<Vec<f64>>();
        let (omega, v) = (vector(&f.omega_nb, payload), vector(&f.v_nb, payload));
        let hinges = |field: &Field| match self.bob {
            None => all(field),
            Some(_) => vec![0.0; field.len()],
        };
        let state = DynState {
            p_nb: vector(&f.p_nb, payload),
            quat_nb: self.base(payload),
            q: [all(&f.q), hinges(&f.slosh)].concat(),
            nu: [omega.as_slice(), v.as_slice(), &all(&f.qdot), &hinges(&f.slosh_rate)].concat(),
        };
        let with_mass = self
            .tree
            .body_momenta(&state)
            .into_iter()
            .filter(|body| body.mass > 0.0);
        let mut bodies: Vec<Body> = with_mass
            .map(|body| Body {
                mass: body.mass,
                p: body.p_bc,
                linear: body.linear_b,
                spin: body.angular_b,
            })
            .collect();
        if let (Some(bob), Some(last)) = (&self.bob, bodies.last_mut()) {
            *last = self.bob_at(bob, last.mass, payload, omega, v);
        }
        for body in &mut bodies {
            body.p = state.p_nb + state.quat_nb.rotate(&body.p);
            body.linear = state.quat_nb.rotate(&body.linear);
            body.spin = state.quat_nb.rotate(&body.spin);
        }
        let (mass, inertia) = self.target;
        let turn = Quaternion::from_wxyz(std::array::from_fn(|i| f.quat_nt.value(payload, i)));
        bodies.push(Body {
            mass,
            p: vector(&f.p_nt, payload),
            linear: vector(&f.v_nt, payload) * mass,
            spin: turn.rotate(&inertia.component_mul(&vector(&f.omega_nt, payload))),
        });
        bodies
    }

    /// The bob on its ball joint, base axes. The tape has the x and y components of its angular velocity w; the rest
    /// follows from w ⟂ d, except where the bob is perpendicular to base z.
    fn bob_at(&self, bob: &Bob, mass: f64, payload: &[u8], omega: Vector3<f64>, v: Vector3<f64>) -> Body {
        let d = vector(&bob.direction, payload);
        let [y, x] = [0, 1].map(|i| self.fields.slosh_rate.value(payload, i));
        let w = Vector3::new(x, y, -(x * d.x + y * d.y) / d.z);
        let across = omega - d * d.dot(&omega) + w;
        Body {
            mass,
            p: bob.hinge + d * bob.length,
            linear: (v + omega.cross(&bob.hinge) + across.cross(&d) * bob.length) * mass,
            spin: across * bob.inertia,
        }
    }
}

/// The bob of the tree's last body, which hangs along base -z at zero angles.
fn bob(tree: &DynTree, description: &Description, direction: Field) -> Option<Bob> {
    let rest = DynState {
        p_nb: Vector3::zeros(),
        quat_nb: Quaternion::IDENTITY,
        q: vec![0.0; tree.joints()],
        nu: vec![0.0; tree.joints() + 6],
    };
    let last = tree.bodies().pop()?;
    let hinge = tree.placement_in_world(&rest, tree.frame(&last.link).ok()?).p;
    let link = description.links.iter().find(|link| link.name == last.link)?;
    let about = link.inertia?.about_com;
    Some(Bob {
        direction,
        hinge,
        length: (tree.body_momenta(&rest).pop()?.p_bc - hinge).norm(),
        inertia: 0.5 * (about.m11 + about.m22),
    })
}

fn vector(field: &Field, payload: &[u8]) -> Vector3<f64> {
    Vector3::from_fn(|i, _| field.value(payload, i))
}
