//! SIMD integration of several servicers and targets, one per lane, bit-identical to integrating each alone.

use multibody::{Lanes, Momentum, OdeSystem, Placement, State, Tree, Trees};
use nalgebra::{Matrix3, SVector, Vector3};

use super::mechanics::{AppliedForces, MotionRate};
use super::{Bob, BodyQuantities, COORDINATES, Forces, Model, Motion, Target, VELOCITIES};
use crate::actuators::THRUSTERS;

/// The mechanisms of several plants, packed into lanes.
#[derive(Debug)]
pub struct Models<T> {
    /// The packed models, by [`Model::version`].
    versions: Vec<u64>,
    trees: Trees<COORDINATES, VELOCITIES, T>,
    targets: Trees<0, 6, T>,
}

/// Equations of motion of several servicers.
struct Mechanics<'a, T> {
    trees: &'a Trees<COORDINATES, VELOCITIES, T>,
}

/// A plant during a step.
pub struct SteppedPlant<'a> {
    /// Its mechanism.
    pub model: &'a Model,
    /// Actuator forces on it.
    pub forces: &'a Forces,
    /// Its motion at the start of the step, then at the end.
    pub motion: &'a mut Motion,
    /// The same for its target.
    pub target: &'a mut Target,
    /// Whether its truth message is written at the end of the step.
    pub truth_requested: bool,
    /// Quantities of the servicer's bodies for that message.
    pub bodies: &'a mut Option<BodyQuantities>,
}

impl<T: Lanes> Models<T> {
    /// Packs the models of `all`; reuses `packed` when the versions match.
    ///
    /// `None` when the plants cannot be packed into lanes.
    pub fn of(packed: Option<Box<Self>>, all: &[SteppedPlant]) -> Option<Box<Self>> {
        let first = all.first()?.model.end_effector;
        if all.iter().any(|one| one.model.end_effector != first) {
            return None;
        }
        let versions = all.iter().map(|one| one.model.version);
        match packed {
            Some(packed) if packed.versions.iter().copied().eq(versions.clone()) => Some(packed),
            _ => {
                let trees: Vec<&super::Tree> = all.iter().map(|one| &one.model.tree).collect();
                let targets: Vec<&Tree<0, 6>> = all.iter().map(|one| &one.model.target).collect();
                Some(Box::new(Self {
                    versions: versions.collect(),
                    trees: Trees::new(&trees)?,
                    targets: Trees::new(&targets)?,
                }))
            }
        }
    }

    /// `substeps` steps of `h` seconds of the classical Runge-Kutta method. The plants have one shape: two-hinge pendulum, no brakes, the
    /// same axes compensated. `free`: whether the targets are free-flying.
    pub fn step(&self, all: &mut [SteppedPlant], h: f64, substeps: u32, free: bool) {
        let forces = gather_forces(all);
        let mechanics = Mechanics { trees: &self.trees };
        let mut motion = Motion::gather(all);
        let mut target = State::gather(&items_per_lane::<T, Target>(all, |one| &*one.target)[..T::WIDTH]);
        let none = SVector::repeat(T::of(0.0));
        for _ in 0..substeps {
            motion = multibody::rk4(&mechanics, &motion, &forces, h);
            if free {
                target = multibody::rk4(&self.targets, &target, &none, h);
            }
        }
        let bodies = all
            .iter()
            .any(|one| one.truth_requested)
            .then(|| self.bodies(all, &motion));
        for (lane, one) in all.iter_mut().enumerate() {
            *one.bodies = bodies.as_ref().map(|bodies| bodies.lane(lane));
            *one.motion = motion.lane(lane);
            if free {
                *one.target = target.lane(lane);
            }
        }
    }
}

/// [`BodyQuantities`] of several servicers.
struct PackedBodies<T> {
    p: Vector3<T>,
    r: [Vector3<T>; 3],
    twist: SVector<T, 6>,
    momentum: Momentum<T>,
    energy: T,
}

impl<T: Lanes> Models<T> {
    #[inline(never)]
    fn bodies(&self, all: &[SteppedPlant], motion: &Motion<T>) -> PackedBodies<T> {
        let end_effector = all[0].model.end_effector;
        let kinematics = self.trees.kinematics(&motion.servicer);
        let (p, r) = self.trees.placement(&kinematics, end_effector);
        let twist = self.trees.jacobian(&kinematics, end_effector) * motion.servicer.nu;
        let (momentum, energy) = self.trees.momentum_and_energy(&kinematics);
        PackedBodies {
            p,
            r,
            twist,
            momentum,
            energy,
        }
    }
}

impl<T: Lanes> PackedBodies<T> {
    fn lane(&self, lane: usize) -> BodyQuantities {
        let own = |all: &Vector3<T>| all.map(|x| x.lane(lane));
        let twist = self.twist.map(|x| x.lane(lane));
        BodyQuantities {
            end_effector: Placement {
                p: own(&self.p),
                r: Matrix3::from_columns(&self.r.each_ref().map(own)),
            },
            twist: (twist.fixed_rows::<3>(0).into(), twist.fixed_rows::<3>(3).into()),
            momentum: (
                Momentum {
                    mass: self.momentum.mass.lane(lane),
                    p_bc: own(&self.momentum.p_bc),
                    linear_b: own(&self.momentum.linear_b),
                    angular_b: own(&self.momentum.angular_b),
                },
                self.energy.lane(lane),
            ),
        }
    }
}

/// Largest number of lanes.
const LANES_MAX: usize = 4;

/// One item per lane; surplus lanes repeat the last item.
fn items_per_lane<'a, T: Lanes, X>(
    all: &'a [SteppedPlant],
    of: impl Fn(&'a SteppedPlant) -> &'a X,
) -> [&'a X; LANES_MAX] {
    const { assert!(T::WIDTH <= LANES_MAX) };
    core::array::from_fn(|lane| of(&all[lane.min(all.len() - 1)]))
}

#[inline(always)]
fn gather_vectors<T: Lanes>(of: impl Fn(usize) -> Vector3<f64>) -> Vector3<T> {
    let one = |i: usize| T::gather(|lane| of(lane)[i]);
    Vector3::new(one(0), one(1), one(2))
}

fn gather_forces<T: Lanes>(all: &[SteppedPlant]) -> Forces<T> {
    let each = items_per_lane::<T, Forces>(all, |one| one.forces);
    Forces {
        wheel_torque: gather_vectors(|lane| each[lane].wheel_torque),
        compensated: each[0].compensated,
        thruster_force: gather_vectors(|lane| each[lane].thruster_force),
        thruster_torque: gather_vectors(|lane| each[lane].thruster_torque),
        // reported only: it does not enter the equations of motion
        thrust: [T::of(0.0); THRUSTERS],
        joint_torque: core::array::from_fn(|joint| T::gather(|lane| each[lane].joint_torque[joint])),
        braked: each[0].braked,
    }
}

impl<T: Lanes> Motion<T> {
    fn gather(all: &[SteppedPlant]) -> Self {
        let each = items_per_lane::<T, Motion>(all, |one| &*one.motion);
        Self {
            servicer: State::gather(&each.map(|motion| &motion.servicer)[..T::WIDTH]),
            bob: Bob {
                d: gather_vectors(|lane| each[lane].bob.d),
                w: gather_vectors(|lane| each[lane].bob.w),
            },
            wheel_momentum: gather_vectors(|lane| each[lane].wheel_momentum),
            impulse: gather_vectors(|lane| each[lane].impulse),
            angular_impulse: gather_vectors(|lane| each[lane].angular_impulse),
            work: T::gather(|lane| each[lane].work),
            loss: T::gather(|lane| each[lane].loss),
        }
    }

    fn lane(&self, lane: usize) -> Motion {
        let own = |all: &Vector3<T>| all.map(|x| x.lane(lane));
        Motion {
            servicer: self.servicer.lane(lane),
            bob: Bob {
                d: own(&self.bob.d),
                w: own(&self.bob.w),
            },
            wheel_momentum: own(&self.wheel_momentum),
            impulse: own(&self.impulse),
            angular_impulse: own(&self.angular_impulse),
            work: self.work.lane(lane),
            loss: self.loss.lane(lane),
        }
    }
}

impl<T: Lanes> OdeSystem for Mechanics<'_, T> {
    type State = Motion<T>;
    type Rate = MotionRate<T>;
    type Force = Forces<T>;

    // Large, and called once per stage.
    #[inline(never)]
    fn rate(&self, motion: &Motion<T>, forces: &Forces<T>) -> MotionRate<T> {
        let applied = AppliedForces::of(motion, forces);
        let nu_dot = self.trees.forward_dynamics(&motion.servicer, &applied.generalised);
        let zero = Vector3::repeat(T::of(0.0));
        let bob = Bob { d: zero, w: zero };
        applied.rates(
            motion,
            forces,
            (nu_dot, bob, self.trees.damper_power(&motion.servicer.nu)),
        )
    }

    #[inline]
    fn plus_rates(&self, motion: &Motion<T>, by: &[(f64, &MotionRate<T>)]) -> Motion<T> {
        motion.plus_rates(by, false)
    }

    #[inline]
    fn projected(&self, motion: Motion<T>) -> Motion<T> {
        Motion {
            servicer: motion.servicer.projected(),
            ..motion
        }
    }
}
