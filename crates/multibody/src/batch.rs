//! SIMD evaluation of several trees of one shape.

use crate::integrate::{OdeSystem, Rate};
use crate::kernel::jacobian::{self, FrameConsts};
use crate::kernel::{Link, Model, Rigid, aba, momentum};
use crate::num::{Lanes, Static, V3};
use crate::state::State;
use crate::tree::{FrameId, Kinematics, Momentum, Tree, vector};
use nalgebra::{SMatrix, SVector, Vector3};

/// Trees with the same topology, each with its own masses and lengths, in the lanes of `T`: every result is bit-identical, lane by
/// lane, to that of the single [`Tree`].
///
/// ```
/// use multibody::{Description, F64x4, Lanes, OdeSystem, State, Tree, Trees, rk4};
/// use nalgebra::SVector;
///
/// let pendulum = |mass: f64| {
///     let text = format!(r#"<robot name="pendulum">
///       <link name="bus"><inertial><mass value="{mass}"/>
///         <inertia ixx="10" ixy="0" ixz="0" iyy="10" iyz="0" izz="10"/></inertial></link>
///       <link name="bob"><inertial><origin xyz="0 0 -0.5"/><mass value="3"/>
///         <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial></link>
///       <joint name="hinge" type="continuous"><parent link="bus"/><child link="bob"/><axis xyz="0 1 0"/></joint>
///     </robot>"#);
///     Tree::<1, 7>::new(&Description::from_urdf(&text)?).map_err(Box::<dyn std::error::Error>::from)
/// };
/// let trees = [pendulum(80.0)?, pendulum(90.0)?, pendulum(100.0)?, pendulum(110.0)?];
/// let mut state = State::rest();
/// state.nu[6] = 0.3; // rad/s
/// let alone = rk4(&trees[2], &state, &SVector::zeros(), 1e-3);
///
/// let batch = Trees::<1, 7, F64x4>::new(&trees.each_ref()).expect("they have one shape");
/// let states = State::gather(&[&state; 4]);
/// let all = rk4(&batch, &states, &SVector::repeat(F64x4::gather(|_| 0.0)), 1e-3);
/// assert_eq!(all.lane(2), alone);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Trees<const N: usize, const V: usize, T> {
    base: Rigid<T>,
    bodies: [Link<T>; N],
    frames: Vec<FrameConsts<T>>,
}

impl<const N: usize, const V: usize, T: Lanes> Trees<N, V, T> {
    /// Lane i is tree i; surplus lanes repeat the last tree. `None` without trees, for trees of different shapes, and with
    /// gravity.
    pub fn new(trees: &[&Tree<N, V>]) -> Option<Self> {
        let first = trees.first()?;
        let one_shape = |tree: &&Tree<N, V>| {
            let shape = |link: &Link| (link.parent, link.coordinate, link.prismatic);
            tree.gravity == Vector3::zeros()
                && tree.bodies.iter().map(shape).eq(first.bodies.iter().map(shape))
                && tree
                    .frames
                    .iter()
                    .map(|f| f.body)
                    .eq(first.frames.iter().map(|f| f.body))
        };
        if trees.len() > T::WIDTH || !trees.iter().all(one_shape) {
            return None;
        }
        let tree = |lane: usize| trees[lane.min(trees.len() - 1)];
        let bodies = core::array::from_fn(|body| {
            let link = |lane: usize| &tree(lane).bodies[body];
            let one = |of: &dyn Fn(&Link) -> f64| T::gather(|lane| of(link(lane)));
            Link {
                parent: first.bodies[body].parent,
                coordinate: first.bodies[body].coordinate,
                prismatic: first.bodies[body].prismatic,
                e: core::array::from_fn(|c| core::array::from_fn(|r| one(&|link| link.e[c][r]))),
                p: core::array::from_fn(|i| one(&|link| link.p[i])),
                rigid: rigid(|lane| &link(lane).rigid),
                motor_inertia: one(&|link| link.motor_inertia),
                damping: one(&|link| link.damping),
                stiffness: one(&|link| link.stiffness),
                rest: one(&|link| link.rest),
            }
        });
        let frames = first.frames.iter().enumerate().map(|(at, frame)| FrameConsts {
            body: frame.body,
            r: core::array::from_fn(|c| core::array::from_fn(|r| T::gather(|lane| tree(lane).frames[at].r[c][r]))),
            p: core::array::from_fn(|i| T::gather(|lane| tree(lane).frames[at].p[i])),
        });
        Some(Self {
            base: rigid(|lane| &tree(lane).base),
            bodies,
            frames: frames.collect(),
        })
    }

    #[inline(always)]
    fn model(&self) -> Model<'_, T> {
        Model {
            base: &self.base,
            bodies: &self.bodies,
            floating: Tree::<N, V>::FLOATING,
        }
    }

    /// Forward dynamics, as [`Tree::forward_dynamics`].
    #[inline(always)]
    pub fn forward_dynamics(&self, state: &State<N, V, T>, tau: &SVector<T, V>) -> SVector<T, V> {
        let mut out = SVector::repeat(T::of(0.0));
        let (q, nu, tau) = (&state.q.data.0[0], &state.nu.data.0[0], &tau.data.0[0]);
        aba::aba::<Static<N>, T, T>(self.model(), q, nu, tau, V3::zero(), None, &mut out.data.0[0]);
        out
    }

    /// Poses and rates of every body, as [`Tree::kinematics`].
    #[inline(always)]
    pub fn kinematics(&self, state: &State<N, V, T>) -> Kinematics<N, V, T> {
        Kinematics::at(self.model(), &state.q.data.0[0], &state.nu.data.0[0])
    }

    /// Pose of a frame in the base: (`p_BE`, columns of `R_BE`).
    #[inline(always)]
    pub fn placement(&self, k: &Kinematics<N, V, T>, frame: FrameId) -> (Vector3<T>, [Vector3<T>; 3]) {
        let (r, p) = jacobian::frame_at(&self.frames[frame.0], &k.poses, &k.rates);
        (vector(p), r.c.map(vector))
    }

    /// Body Jacobian of a frame, as [`Tree::jacobian`].
    #[inline(always)]
    pub fn jacobian(&self, k: &Kinematics<N, V, T>, frame: FrameId) -> SMatrix<T, 6, V> {
        let mut out = SMatrix::<T, 6, V>::zeros();
        let frame = &self.frames[frame.0];
        jacobian::jacobian::<T, T, false>(self.model(), &k.poses, &k.rates, k.omega(), frame, out.as_mut_slice());
        out
    }

    /// Momentum and kinetic energy, as [`Tree::momentum_and_energy`].
    #[inline(always)]
    pub fn momentum_and_energy(&self, k: &Kinematics<N, V, T>) -> (Momentum<T>, T) {
        let sums = momentum::sums(self.model(), &k.poses, &k.rates, &k.nu);
        let v = self.model().base_part(&k.nu).1;
        (Momentum::of(&sums, v), sums.energy_at(v))
    }

    /// Power the joint dampers take out, as [`Tree::damper_power`].
    pub fn damper_power(&self, nu: &SVector<T, V>) -> T {
        let each = self.bodies.iter().map(|b| {
            let rate = nu[V - N + b.coordinate];
            -b.damping * rate * rate
        });
        // the initial value of a floating-point sum
        each.fold(T::of(-0.0), |sum, one| sum + one)
    }
}

fn rigid<'a, T: Lanes>(of: impl Fn(usize) -> &'a Rigid) -> Rigid<T> {
    Rigid {
        mass: T::gather(|lane| of(lane).mass),
        h: core::array::from_fn(|i| T::gather(|lane| of(lane).h[i])),
        j: core::array::from_fn(|i| T::gather(|lane| of(lane).j[i])),
        sigma: core::array::from_fn(|i| T::gather(|lane| of(lane).sigma[i])),
    }
}

impl<const N: usize, const V: usize, T: Lanes> OdeSystem for Trees<N, V, T> {
    type State = State<N, V, T>;
    type Rate = Rate<N, V, T>;
    type Force = SVector<T, V>;

    #[inline(always)]
    fn rate(&self, s: &Self::State, tau: &Self::Force) -> Self::Rate {
        Rate::of(s, self.forward_dynamics(s, tau))
    }

    #[inline(always)]
    fn plus_rates(&self, s: &Self::State, by: &[(f64, &Self::Rate)]) -> Self::State {
        s.plus_rates(by)
    }

    #[inline(always)]
    fn projected(&self, s: Self::State) -> Self::State {
        s.projected()
    }
}

impl<const N: usize, const V: usize, T: Lanes> State<N, V, T> {
    /// Lane i is state i; surplus lanes repeat the last state.
    ///
    /// # Panics
    /// Without states.
    pub fn gather(states: &[&State<N, V>]) -> Self {
        #[inline(always)]
        fn one<T: Lanes, X>(states: &[&X], of: impl Fn(&X) -> f64) -> T {
            T::gather(|lane| of(states[lane.min(states.len() - 1)]))
        }
        let mut out = Self {
            p_nb: Vector3::zeros(),
            quat_nb: crate::Quaternion {
                w: one(states, |s| s.quat_nb.w),
                x: one(states, |s| s.quat_nb.x),
                y: one(states, |s| s.quat_nb.y),
                z: one(states, |s| s.quat_nb.z),
            },
            q: SVector::zeros(),
            nu: SVector::zeros(),
        };
        for i in 0..3 {
            out.p_nb[i] = one(states, |s| s.p_nb[i]);
        }
        for i in 0..N {
            out.q[i] = one(states, |s| s.q[i]);
        }
        for i in 0..V {
            out.nu[i] = one(states, |s| s.nu[i]);
        }
        out
    }

    /// The state in lane `i`.
    ///
    /// # Panics
    /// When there is no such lane.
    #[inline(always)]
    pub fn lane(&self, i: usize) -> State<N, V> {
        State {
            p_nb: self.p_nb.map(|x| x.lane(i)),
            quat_nb: crate::Quaternion {
                w: self.quat_nb.w.lane(i),
                x: self.quat_nb.x.lane(i),
                y: self.quat_nb.y.lane(i),
                z: self.quat_nb.z.lane(i),
            },
            q: self.q.map(|x| x.lane(i)),
            nu: self.nu.map(|x| x.lane(i)),
        }
    }
}
