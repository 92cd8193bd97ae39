//! SIMD integration of several servicers and targets, one per lane, bit-identical to integrating each alone.

use multibody::{Flow, Lanes, Momentum, Placement, State, Tree, Trees};
use nalgebra::{Matrix3, SVector, Vector3};

use super::flow::{Acting, MotionRate};
use super::{Bob, Bodies, COORDINATES, Forces, Model, Motion, Target, VELOCITIES};
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
pub struct Under<'a> {
    /// Its mechanism.
    pub model: &'a Model,
    /// Actuator forces on it.
    pub forces: &'a Forces,
    /// Its motion at the start of the step, then at the end.
    pub motion: &'a mut Motion,
    /// The same for its target.
    pub target: &'a mut Target,
    /// Whether its truth message is written at the end of the step.
    pub told: bool,
    /// Quantities of the servicer's bodies for that message.
    pub bodies: &'a mut Option<Bodies>,
}

impl<T: Lanes> Models<T> {
    /// Packs the models of `all`; reuses `known` when the versions match.
    ///
    /// `None` when the plants cannot be packed into lanes.
    pub fn of(known: Option<Box<Self>>, all: &[Under]) -> Option<Box<Self>> {
        let first = all.first()?.model.end_effector;
        if all.iter().any(|one| one.model.end_effector != first) {
            return None;
        }
        let versions = all.iter().map(|one| one.model.version);
        match known {
            Some(known) if known.versions.iter().copied().eq(versions.clone()) => Some(known),
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
    pub fn step(&self, all: &mut [Under], h: f64, substeps: u32, free: bool) {
        let forces = gathered(all);
        let mechanics = Mechanics { trees: &self.trees };
        let mut motion = Motion::gather(all);
        let mut target = State::gather(&padded::<T, Target>(all, |one| &*one.target)[..T::WIDTH]);
        let none = SVector::repeat(T::of(0.0));
        for _ in 0..substeps {
            motion = multibody::rk4(&mechanics, &motion, &forces, h);
            if free {
                target = multibody::rk4(&self.targets, &target, &none, h);
            }
        }
        let bodies = all.iter().any(|one| one.told).then(|| self.bodies(all, &motion));
        for (lane, one) in all.iter_mut().enumerate() {
            *one.bodies = bodies.as_ref().map(|bodies| bodies.lane(lane));
            *one.motion = motion.lane(lane);
            if free {
                *one.target = target.lane(lane);
            }
        }
    }
}

/// [`Bodies`] of several servicers.
struct Sight<T> {
    p: Vector3<T>,
    r: [Vector3<T>; 3],
    twist: SVector<T, 6>,
    momentum: Momentum<T>,
    energy: T,
}

impl<T: Lanes> Models<T> {
    #[inline(never)]
    fn bodies(&self, all: &[Under], motion: &Motion<T>) -> Sight<T> {
        let end_effector = all[0].model.end_effector;
        let kinematics = self.trees.kinematics(&motion.servicer);
        let (p, r) = self.trees.placement(&kinematics, end_effector);
        let twist = self.trees.jacobian(&kinematics, end_effector) * motion.servicer.nu;
        let (momentum, energy) = self.trees.momentum_and_energy(&kinematics);
        Sight {
            p,
            r,
            twist,
            momentum,
            energy,
        }
    }
}

impl<T: Lanes> Sight<T> {
    fn lane(&self, lane: usize) -> Bodies {
        let own = |all: &Vector3<T>| all.map(|x| x.lane(lane));
        let twist = self.twist.map(|x| x.lane(lane));
        Bodies {
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
const MOST: usize = 4;

/// One item per lane; surplus lanes repeat the last item.
fn padded<'a, T: Lanes, X>(all: &'a [Under], of: impl Fn(&'a Under) -> &'a X) -> [&'a X; MOST] {
    const { assert!(T::WIDTH <= MOST) };
    core::array::from_fn(|lane| of(&all[lane.min(all.len() - 1)]))
}

#[inline(always)]
fn vectors<T: Lanes>(of: impl Fn(usize) -> Vector3<f64>) -> Vector3<T> {
    let one = |i: usize| T::gather(|lane| of(lane)[i]);
    Vector3::new(one(0), one(1), one(2))
}

fn gathered<T: Lanes>(all: &[Under]) -> Forces<T> {
    let each = padded::<T, Forces>(all, |one| one.forces);
    Forces {
        wheel_torque: vectors(|lane| each[lane].wheel_torque),
        compensated: each[0].compensated,
        thruster_force: vectors(|lane| each[lane].thruster_force),
        thruster_torque: vectors(|lane| each[lane].thruster_torque),
        // reported only: it does not enter the equations of motion
        thrust: [T::of(0.0); THRUSTERS],
        joint_torque: core::array::from_fn(|joint| T::gather(|lane| each[lane].joint_torque[joint])),
        braked: each[0].braked,
    }
}

impl<T: Lanes> Motion<T> {
    fn gather(all: &[Under]) -> Self {
        let each = padded::<T, Motion>(all, |one| &*one.motion);
        Self {
            servicer: State::gather(&each.map(|motion| &motion.servicer)[..T::WIDTH]),
            bob: Bob {
                d: vectors(|lane| each[lane].bob.d),
                w: vectors(|lane| each[lane].bob.w),
            },
            wheel_momentum: vectors(|lane| each[lane].wheel_momentum),
            impulse: vectors(|lane| each[lane].impulse),
            angular_impulse: vectors(|lane| each[lane].angular_impulse),
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

impl<T: Lanes> Flow for Mechanics<'_, T> {
    type State = Motion<T>;
    type Rate = MotionRate<T>;
    type Force = Forces<T>;

    // Large, and called once per stage.
    #[inline(never)]
    fn rate(&self, motion: &Motion<T>, forces: &Forces<T>) -> MotionRate<T> {
        let acting = Acting::of(motion, forces);
        let nu_dot = self.trees.forward_dynamics(&motion.servicer, &acting.generalised);
        let nothing = Vector3::repeat(T::of(0.0));
        let bob = Bob { d: nothing, w: nothing };
        acting.rates(
            motion,
            forces,
            (nu_dot, bob, self.trees.damper_power(&motion.servicer.nu)),
        )
    }

    #[inline]
    fn moved(&self, motion: &Motion<T>, by: &[(f64, &MotionRate<T>)]) -> Motion<T> {
        motion.moved(by, false)
    }

    #[inline]
    fn restored(&self, motion: Motion<T>) -> Motion<T> {
        Motion {
            servicer: motion.servicer.restored(),
            ..motion
        }
    }
}
