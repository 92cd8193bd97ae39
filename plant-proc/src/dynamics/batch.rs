//! SIMD integration of several servicers and targets, one per lane, bit-identical to integrating each alone.

use std::fmt::Debug;

use multibody::{
    Computation, ForLanes, FrameId, Lanes, Momentum, OdeSystem, Placement, State, Tree, Trees, with_lanes,
};
use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

use super::mechanics::{AppliedForces, MotionRate};
use super::{Bob, BodyQuantities, COORDINATES, Forces, Model, Motion, Target, VELOCITIES};
use crate::actuators::THRUSTERS;

/// The mechanisms of several plants, packed into lanes.
#[derive(Debug)]
struct Models<T> {
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

/// [`Models`] with any number of lanes.
pub trait PackedModels: Debug {
    /// Whether these are the models of `all`.
    fn are_of(&self, all: &[SteppedPlant]) -> bool;

    /// `substeps` steps of `h` seconds of the classical Runge-Kutta method. The plants have one shape: two-hinge pendulum, no brakes, the
    /// same axes compensated. `free`: whether the targets are free-flying.
    fn step(&self, all: &mut [SteppedPlant], h: f64, substeps: u32, free: bool);
}

/// Packs the models of `all` into lanes, as many as [`lanes_max`](multibody::lanes_max) at most; `None` when that is impossible.
pub fn pack_models(all: &[SteppedPlant]) -> Option<Box<dyn PackedModels>> {
    struct Pack<'a>(&'a [SteppedPlant<'a>]);

    impl ForLanes for Pack<'_> {
        type Output = Option<Box<dyn PackedModels>>;

        fn run<T: Lanes>(self) -> Self::Output {
            Some(Box::new(Models::<T>::of(self.0)?))
        }
    }

    with_lanes(all.len(), Pack(all))
}

impl<T: Lanes> Models<T> {
    fn of(all: &[SteppedPlant]) -> Option<Self> {
        let first = all.first()?.model.end_effector;
        if all.iter().any(|one| one.model.end_effector != first) {
            return None;
        }
        let trees: Vec<&super::Tree> = all.iter().map(|one| &one.model.tree).collect();
        let targets: Vec<&Tree<0, 6>> = all.iter().map(|one| &one.model.target).collect();
        Some(Self {
            versions: all.iter().map(|one| one.model.version).collect(),
            trees: Trees::new(&trees)?,
            targets: Trees::new(&targets)?,
        })
    }
}

impl<T: Lanes> PackedModels for Models<T> {
    fn are_of(&self, all: &[SteppedPlant]) -> bool {
        self.versions
            .iter()
            .copied()
            .eq(all.iter().map(|one| one.model.version))
    }

    fn step(&self, all: &mut [SteppedPlant], h: f64, substeps: u32, free: bool) {
        T::compute(PackedStep {
            models: self,
            all,
            h,
            substeps,
            free,
        });
    }
}

/// A step of several plants.
struct PackedStep<'a, 'b, T> {
    models: &'a Models<T>,
    all: &'a mut [SteppedPlant<'b>],
    h: f64,
    substeps: u32,
    free: bool,
}

impl<T: Lanes> Computation for PackedStep<'_, '_, T> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self {
            models, all, h, free, ..
        } = self;
        let mechanics = Mechanics { trees: &models.trees };
        let forces = gather_forces(all);
        let mut motion = Motion::gather(all);
        let mut target = State::gather(&items_per_lane::<T, Target>(all, |one| &*one.target)[..T::WIDTH]);
        let none = SVector::repeat(T::of(0.0));
        for _ in 0..self.substeps {
            motion = multibody::rk4(&mechanics, &motion, &forces, h);
            if free {
                target = multibody::rk4(&models.targets, &target, &none, h);
            }
        }
        let bodies = all
            .iter()
            .any(|one| one.truth_requested)
            .then(|| models.bodies(all, &motion));
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
        T::compute(BodiesAt {
            trees: &self.trees,
            end_effector: all[0].model.end_effector,
            motion,
        })
    }
}

/// The [`PackedBodies`] at a motion.
struct BodiesAt<'a, T> {
    trees: &'a Trees<COORDINATES, VELOCITIES, T>,
    end_effector: FrameId,
    motion: &'a Motion<T>,
}

impl<T: Lanes> Computation for BodiesAt<'_, T> {
    type Output = PackedBodies<T>;

    #[inline(always)]
    fn run(self) -> PackedBodies<T> {
        let kinematics = self.trees.kinematics(&self.motion.servicer);
        let (p, r) = self.trees.placement(&kinematics, self.end_effector);
        let jacobian = self.trees.jacobian(&kinematics, self.end_effector);
        let (momentum, energy) = self.trees.momentum_and_energy(&kinematics);
        PackedBodies {
            p,
            r,
            twist: twist(&jacobian, &self.motion.servicer.nu),
            momentum,
            energy,
        }
    }
}

/// `jacobian · nu`, with the operations of the product of nalgebra in its order.
#[inline(always)]
fn twist<T: Lanes>(jacobian: &SMatrix<T, 6, VELOCITIES>, nu: &SVector<T, VELOCITIES>) -> SVector<T, 6> {
    let mut out = SVector::<T, 6>::repeat(T::of(0.0));
    for row in 0..6 {
        out[row] = jacobian[(row, 0)] * nu[0];
        for column in 1..VELOCITIES {
            out[row] = jacobian[(row, column)] * nu[column] + out[row];
        }
    }
    out
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

/// Largest number of lanes of any processor.
const LANES_MAX: usize = 8;

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
        T::compute(RateAt {
            trees: self.trees,
            motion,
            forces,
        })
    }

    #[inline(always)]
    fn plus_rates(&self, motion: &Motion<T>, by: &[(f64, &MotionRate<T>)]) -> Motion<T> {
        motion.plus_rates(by, false)
    }

    #[inline(always)]
    fn projected(&self, motion: Motion<T>) -> Motion<T> {
        Motion {
            servicer: motion.servicer.projected(),
            ..motion
        }
    }
}

/// The rates of several servicers.
struct RateAt<'a, T> {
    trees: &'a Trees<COORDINATES, VELOCITIES, T>,
    motion: &'a Motion<T>,
    forces: &'a Forces<T>,
}

impl<T: Lanes> Computation for RateAt<'_, T> {
    type Output = MotionRate<T>;

    #[inline(always)]
    fn run(self) -> MotionRate<T> {
        let Self { trees, motion, forces } = self;
        let applied = AppliedForces::of(motion, forces);
        let nu_dot = trees.forward_dynamics(&motion.servicer, &applied.generalised);
        let zero = Vector3::repeat(T::of(0.0));
        let bob = Bob { d: zero, w: zero };
        applied.rates(motion, forces, (nu_dot, bob, trees.damper_power(&motion.servicer.nu)))
    }
}
