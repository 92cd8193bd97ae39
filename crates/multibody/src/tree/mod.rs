//! [`Tree`]: a description converted to constants of static size, and the algorithms on it.

mod constants;
mod total;

pub(crate) use constants::Constants;
use constants::find_frame;
pub use constants::{FrameId, TreeError, UnknownFrame};
pub use total::Momentum;
pub(crate) use total::{matrix, vector};

use crate::description::{Description, Inertia, Placement};
use crate::kernel::jacobian::FrameConsts;
use crate::kernel::poses::{BodyPose, Rates, body_poses, push_body_poses, push_rates};
use crate::kernel::{BASE, Link, Model, Rigid, aba, inertia, jacobian, momentum, newton_euler};
use crate::num::{Computation, Constant, Fixed, Lanes, List, Real, Static, V3};
use crate::state::State;
use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

/// A tree of `N` moving joints with `V` velocity coordinates: `V = N + 6` on a floating base, `V = N` on a fixed one
/// (then the base is posed once and for all by the state, and the generalised velocity is the joint rates alone).
///
/// Generalised velocity: `[ω_NB (B axes, rad/s); v_NB (velocity of B's origin, B axes, m/s); joint rates]`; generalised
/// force: `[torque about B's origin (B axes, N m); force (B axes, N); joint torques or forces]`. Joint order is the
/// order of the joints in the description. All methods take and return SI units and radians. None of them allocates.
#[derive(Clone, Debug)]
pub struct Tree<const N: usize, const V: usize> {
    pub(crate) base: Rigid,
    pub(crate) bodies: [Link; N],
    pub(crate) frames: Vec<FrameConsts>,
    frame_names: Vec<String>,
    joint_names: Vec<String>,
    pub(crate) gravity: Vector3<f64>,
}

/// Poses and rates of every body at one state, shared by the algorithms that need them. Base axes, no base pose.
#[derive(Clone, Debug)]
pub struct Kinematics<const N: usize, const V: usize, T: Real = f64> {
    pub(crate) poses: Fixed<BodyPose<T>, N>,
    pub(crate) rates: Fixed<Rates<T>, N>,
    pub(crate) nu: [T; V],
}

impl<const N: usize, const V: usize, T: Real> Kinematics<N, V, T> {
    #[inline(always)]
    pub(crate) fn at<K: Constant<T>>(model: Model<K>, q: &[T; N], nu: &[T; V]) -> Self {
        // the lists are filled where they stay: in lanes they are kilobytes
        let mut out = Self {
            poses: Fixed::with_capacity(N + 1),
            rates: Fixed::with_capacity(N + 1),
            nu: *nu,
        };
        push_body_poses::<Static<N>, T, K>(model, q, &mut out.poses);
        push_rates::<Static<N>, T, K>(model, &out.poses, nu, &mut out.rates);
        out
    }
}

impl<const N: usize, const V: usize> Tree<N, V> {
    pub(crate) const FLOATING: bool = {
        assert!(
            V == N + 6 || (V == N && N > 0),
            "Tree<N, V>: V is N + 6 (floating base) or N (fixed base)"
        );
        V == N + 6
    };

    /// Builds the tree: merges fixed joints, rotates every axis to +z, and rejects a mechanism with a part that moves no
    /// inertia in any configuration.
    pub fn new(description: &Description) -> Result<Self, TreeError> {
        let constants = Constants::new(description)?;
        if constants.couplings.is_some()
            && let Some((joint, mimic)) = description.joints.iter().find_map(|j| Some((j, j.mimic.as_ref()?)))
        {
            return Err(TreeError::Mimic {
                joint: joint.name.clone(),
                leader: mimic.joint.clone(),
            });
        }
        let found = constants.bodies.len();
        let joints = || {
            constants
                .body_names
                .iter()
                .map(|b| b.0.as_str())
                .collect::<Vec<_>>()
                .join(", ")
        };
        let mut names = vec![String::new(); found];
        for (link, (joint, _)) in constants.bodies.iter().zip(&constants.body_names) {
            names[link.coordinate] = joint.clone();
        }
        crate::dynamic::check_inertia(&constants, Self::FLOATING)?;
        let bodies = match <[Link; N]>::try_from(constants.bodies.clone()) {
            Ok(bodies) => bodies,
            Err(_) => {
                return Err(TreeError::Count {
                    name: description.name.clone(),
                    found,
                    expected: N,
                    joints: joints(),
                });
            }
        };
        Ok(Self {
            base: constants.base,
            bodies,
            frames: constants.frames,
            frame_names: constants.frame_names,
            joint_names: names,
            gravity: Vector3::zeros(),
        })
    }

    /// Welds a rigid body to the body that carries `frame`; `payload` is its pose in the frame. Used for a grasp during a
    /// run. Does not allocate; the inertia is not checked.
    pub fn attach(&mut self, frame: FrameId, payload: &Placement, inertia: &Inertia) {
        let frame = &self.frames[frame.0];
        let at = Placement {
            p: Vector3::from(frame.p),
            r: Matrix3::from_columns(&frame.r.map(Vector3::from)),
        }
        .then(payload);
        let rigid = Rigid::new(&Inertia {
            mass: inertia.mass,
            com: at.p + at.r * inertia.com,
            about_com: at.r * inertia.about_com * at.r.transpose(),
        });
        match frame.body {
            BASE => self.base.weld(&rigid),
            place => self.bodies[place - 1].rigid.weld(&rigid),
        }
    }

    /// The same tree in a uniform gravity field (world axes, m/s²). Without this call there is no gravity. Gravity acts only
    /// in the methods that take a [`State`].
    pub fn with_gravity(mut self, g_n: Vector3<f64>) -> Self {
        self.gravity = g_n;
        self
    }

    /// Names of the joints, in coordinate order.
    pub fn joint_names(&self) -> &[String] {
        &self.joint_names
    }

    /// Finds a frame: every link of the description keeps its name as a frame.
    pub fn frame(&self, name: &str) -> Result<FrameId, UnknownFrame> {
        find_frame(&self.frame_names, name)
    }

    #[inline(always)]
    fn model(&self) -> Model<'_> {
        Model {
            base: &self.base,
            bodies: &self.bodies,
            floating: Self::FLOATING,
        }
    }

    #[inline(always)]
    fn gravity_b(&self, state: &State<N, V>) -> V3<f64> {
        if self.gravity == Vector3::zeros() {
            V3::zero()
        } else {
            V3::of(state.quat_nb.rotate_back(&self.gravity).into())
        }
    }

    // ---- kinematics -------------------------------------------------------------------------------------------

    /// Poses and rates of every body, for the methods below.
    #[inline]
    pub fn kinematics(&self, q: &SVector<f64, N>, nu: &SVector<f64, V>) -> Kinematics<N, V> {
        self.kinematics_in(&q.data.0[0], &nu.data.0[0])
    }

    /// [`kinematics`](Self::kinematics) over any scalar.
    #[inline]
    pub fn kinematics_in<T: Real>(&self, q: &[T; N], nu: &[T; V]) -> Kinematics<N, V, T> {
        Kinematics::at(self.model(), q, nu)
    }

    /// Pose of frame E in B: (`p_BE`, `R_BE`).
    #[inline]
    pub fn placement(&self, k: &Kinematics<N, V>, frame: FrameId) -> Placement {
        let (r, p) = jacobian::frame_at(&self.frames[frame.0], &k.poses, &k.rates);
        Placement {
            p: vector(p),
            r: matrix(&r),
        }
    }

    /// Pose of frame E in the world: (`p_NE`, `R_NE`).
    #[inline]
    pub fn placement_in_world(&self, state: &State<N, V>, frame: FrameId) -> Placement {
        let k = self.kinematics(&state.q, &state.nu);
        state.base().then(&self.placement(&k, frame))
    }

    /// Body Jacobian `J_v` of frame E: `J_v ν = [ω_NE; v_NE]` in E axes (6 × V).
    #[inline]
    pub fn jacobian(&self, k: &Kinematics<N, V>, frame: FrameId) -> SMatrix<f64, 6, V> {
        let mut out = SMatrix::<f64, 6, V>::zeros();
        let frame = &self.frames[frame.0];
        jacobian::jacobian::<f64, f64, false>(self.model(), &k.poses, &k.rates, k.omega(), frame, out.as_mut_slice());
        out
    }

    /// Time derivative of the body Jacobian along the motion: `d/dt (J_v ν) = J_v ν̇ + J̇_v ν`.
    #[inline]
    pub fn jacobian_rate(&self, k: &Kinematics<N, V>, frame: FrameId) -> SMatrix<f64, 6, V> {
        let mut out = SMatrix::<f64, 6, V>::zeros();
        let frame = &self.frames[frame.0];
        jacobian::jacobian::<f64, f64, true>(self.model(), &k.poses, &k.rates, k.omega(), frame, out.as_mut_slice());
        out
    }

    /// Origin and axes of frame E in B over any scalar: (`p_BE`, columns of `R_BE`).
    pub fn placement_in<T: Real>(&self, k: &Kinematics<N, V, T>, frame: FrameId) -> ([T; 3], [[T; 3]; 3]) {
        let (r, p) = jacobian::frame_at(&self.frames[frame.0], &k.poses, &k.rates);
        (p.to_array(), r.c.map(V3::to_array))
    }

    // ---- inertia ----------------------------------------------------------------------------------------------

    /// Mass matrix M(q), motor inertia included (composite-rigid-body algorithm).
    #[inline]
    pub fn mass_matrix(&self, q: &SVector<f64, N>) -> SMatrix<f64, V, V> {
        let poses = body_poses::<Static<N>, f64, _>(self.model(), &q.data.0[0]);
        let mut m = SMatrix::<f64, V, V>::zeros();
        inertia::mass_and_coriolis::<Static<N>, f64, false>(
            self.model(),
            &poses,
            &[],
            V3::zero(),
            m.as_mut_slice(),
            &mut [],
        );
        m
    }

    /// M(q) and the Coriolis matrix C(q, ν) in the Christoffel-consistent factorisation: C ν is the bias force and
    /// Ṁ − 2C is skew.
    #[inline]
    pub fn mass_and_coriolis(&self, k: &Kinematics<N, V>) -> (SMatrix<f64, V, V>, SMatrix<f64, V, V>) {
        let (mut m, mut c) = (SMatrix::<f64, V, V>::zeros(), SMatrix::<f64, V, V>::zeros());
        inertia::mass_and_coriolis::<Static<N>, f64, true>(
            self.model(),
            &k.poses,
            &k.rates,
            k.omega(),
            m.as_mut_slice(),
            c.as_mut_slice(),
        );
        (m, c)
    }

    /// M over any scalar, column by column.
    pub fn mass_matrix_in<T: Real>(&self, q: &[T; N]) -> [[T; V]; V] {
        let poses = body_poses::<Static<N>, T, _>(self.model(), q);
        let mut m = [[T::of(0.0); V]; V];
        let omega = V3::zero();
        inertia::mass_and_coriolis::<Static<N>, T, false>(
            self.model(),
            &poses,
            &[],
            omega,
            m.as_flattened_mut(),
            &mut [],
        );
        m
    }

    // ---- dynamics ---------------------------------------------------------------------------------------------

    /// Forward dynamics (articulated bodies): ν̇ from the generalised force `tau`, with joint dampers and springs and
    /// the tree's gravity.
    #[inline]
    pub fn forward_dynamics(&self, state: &State<N, V>, tau: &SVector<f64, V>) -> SVector<f64, V> {
        let mut out = SVector::zeros();
        let g = self.gravity_b(state);
        self.aba_into::<f64>(
            &state.q.data.0[0],
            &state.nu.data.0[0],
            &tau.data.0[0],
            g,
            None,
            &mut out.data.0[0],
        );
        out
    }

    /// Forward dynamics without gravity; independent of the base pose.
    #[inline]
    pub fn aba(&self, q: &SVector<f64, N>, nu: &SVector<f64, V>, tau: &SVector<f64, V>) -> SVector<f64, V> {
        let mut out = SVector::zeros();
        self.aba_into::<f64>(
            &q.data.0[0],
            &nu.data.0[0],
            &tau.data.0[0],
            V3::zero(),
            None,
            &mut out.data.0[0],
        );
        out
    }

    /// [`aba`](Self::aba) over any scalar.
    #[inline]
    pub fn aba_in<T: Real>(&self, q: &[T; N], nu: &[T; V], tau: &[T; V]) -> [T; V] {
        let mut out = [T::of(0.0); V];
        self.aba_into(q, nu, tau, V3::zero(), None, &mut out);
        out
    }

    /// Several states at once: lane i of the result is bit-identical to [`aba`](Self::aba) on lane i of the arguments.
    #[inline(never)]
    pub fn aba_in_lanes<T: Lanes>(&self, q: &[T; N], nu: &[T; V], tau: &[T; V]) -> [T; V] {
        T::compute(AbaInLanes { tree: self, q, nu, tau })
    }

    #[inline(always)]
    pub(crate) fn aba_into<T: Real>(
        &self,
        q: &[T; N],
        nu: &[T; V],
        tau: &[T; V],
        gravity: V3<T>,
        load: Option<&aba::Articulated<T>>,
        out: &mut [T; V],
    ) {
        aba::aba::<Static<N>, T, _>(self.model(), q, nu, tau, gravity, load, out);
    }

    /// Inverse dynamics (recursive Newton-Euler): `M ν̇ + C ν + gravity force`. Dampers and springs are not included, see
    /// [`passive_force`](Self::passive_force).
    #[inline]
    pub fn inverse_dynamics(&self, state: &State<N, V>, nu_dot: &SVector<f64, V>) -> SVector<f64, V> {
        let mut out = SVector::zeros();
        let g = self.gravity_b(state);
        let (q, nu, a) = (&state.q.data.0[0], &state.nu.data.0[0], &nu_dot.data.0[0]);
        newton_euler::newton_euler::<Static<N>, f64, true>(self.model(), q, nu, a, nu, g, &mut out.data.0[0]);
        out
    }

    /// `M(q) ν̇ + C(q, ν) ν` without gravity; independent of the base pose.
    #[inline]
    pub fn rnea(&self, q: &SVector<f64, N>, nu: &SVector<f64, V>, nu_dot: &SVector<f64, V>) -> SVector<f64, V> {
        let mut out = SVector::zeros();
        out.data.0[0] = self.rnea_in(&q.data.0[0], &nu.data.0[0], &nu_dot.data.0[0]);
        out
    }

    /// [`rnea`](Self::rnea) over any scalar.
    #[inline]
    pub fn rnea_in<T: Real>(&self, q: &[T; N], nu: &[T; V], nu_dot: &[T; V]) -> [T; V] {
        let mut out = [T::of(0.0); V];
        newton_euler::newton_euler::<Static<N>, T, true>(self.model(), q, nu, nu_dot, nu, V3::zero(), &mut out);
        out
    }

    /// The bias force `C(q, ν) ν`.
    #[inline]
    pub fn bias(&self, q: &SVector<f64, N>, nu: &SVector<f64, V>) -> SVector<f64, V> {
        self.rnea(q, nu, &SVector::zeros())
    }

    /// `M(q) a + C(q, ν) ν_r` in one Newton-Euler pass, with the same C as
    /// [`mass_and_coriolis`](Self::mass_and_coriolis): for passivity-based laws, without forming M or C.
    #[inline]
    pub fn mass_coriolis_product(
        &self,
        q: &SVector<f64, N>,
        nu: &SVector<f64, V>,
        a: &SVector<f64, V>,
        nu_r: &SVector<f64, V>,
    ) -> SVector<f64, V> {
        let mut out = SVector::zeros();
        let (q, nu, a, r) = (&q.data.0[0], &nu.data.0[0], &a.data.0[0], &nu_r.data.0[0]);
        newton_euler::newton_euler::<Static<N>, f64, false>(self.model(), q, nu, a, r, V3::zero(), &mut out.data.0[0]);
        out
    }

    /// Force of the joint dampers and springs, as a generalised force.
    pub fn passive_force(&self, q: &SVector<f64, N>, nu: &SVector<f64, V>) -> SVector<f64, V> {
        let mut out = SVector::zeros();
        for b in &self.bodies {
            let k = V - N + b.coordinate;
            out[k] = -b.damping * nu[k] - b.stiffness * (q[b.coordinate] - b.rest);
        }
        out
    }

    // ---- momentum and energy ----------------------------------------------------------------------------------

    /// Mass, centre of mass and momentum, in B axes. On a fixed base B does not move.
    pub fn momentum(&self, k: &Kinematics<N, V>) -> Momentum {
        Momentum::of(
            &momentum::sums(self.model(), &k.poses, &k.rates, &k.nu),
            self.model().base_part(&k.nu).1,
        )
    }

    /// Centre of mass in the world, `p_NC` (m).
    pub fn com_in_world(&self, state: &State<N, V>) -> Vector3<f64> {
        let m = self.momentum(&self.kinematics(&state.q, &state.nu));
        state.p_nb + state.quat_nb.rotate(&m.p_bc)
    }

    /// Kinetic energy ½ νᵀ M ν, motors included (J).
    pub fn kinetic_energy(&self, k: &Kinematics<N, V>) -> f64 {
        momentum::sums(self.model(), &k.poses, &k.rates, &k.nu).energy_at(self.model().base_part(&k.nu).1)
    }

    /// [`momentum`](Self::momentum) and [`kinetic_energy`](Self::kinetic_energy) in one pass.
    pub fn momentum_and_energy(&self, k: &Kinematics<N, V>) -> (Momentum, f64) {
        let sums = momentum::sums(self.model(), &k.poses, &k.rates, &k.nu);
        let v = self.model().base_part(&k.nu).1;
        (Momentum::of(&sums, v), sums.energy_at(v))
    }

    /// Energy of the joint springs and of the gravity field, zero with all masses at the world's origin (J).
    pub fn potential_energy(&self, state: &State<N, V>) -> f64 {
        let springs: f64 = self
            .bodies
            .iter()
            .map(|b| {
                let x = state.q[b.coordinate] - b.rest;
                0.5 * b.stiffness * x * x
            })
            .sum();
        if self.gravity == Vector3::zeros() {
            return springs;
        }
        let m = self.momentum(&self.kinematics(&state.q, &state.nu));
        let p_nc = state.p_nb + state.quat_nb.rotate(&m.p_bc);
        springs - m.mass * self.gravity.dot(&p_nc)
    }

    /// Power of the joint dampers, `−Σ damping · rate²` (W, never positive).
    pub fn damper_power(&self, nu: &SVector<f64, V>) -> f64 {
        self.bodies
            .iter()
            .map(|b| {
                let rate = nu[V - N + b.coordinate];
                -b.damping * rate * rate
            })
            .sum()
    }
}

impl<const N: usize, const V: usize, T: Real> Kinematics<N, V, T> {
    #[inline(always)]
    pub(crate) fn omega(&self) -> V3<T> {
        if V == N { V3::zero() } else { V3::read(&self.nu, 0) }
    }
}

/// [`Tree::aba_in_lanes`].
struct AbaInLanes<'a, const N: usize, const V: usize, T> {
    tree: &'a Tree<N, V>,
    q: &'a [T; N],
    nu: &'a [T; V],
    tau: &'a [T; V],
}

impl<const N: usize, const V: usize, T: Lanes> Computation for AbaInLanes<'_, N, V, T> {
    type Output = [T; V];

    #[inline(always)]
    fn run(self) -> [T; V] {
        let mut out = [T::of(0.0); V];
        self.tree
            .aba_into(self.q, self.nu, self.tau, V3::zero(), None, &mut out);
        out
    }
}
