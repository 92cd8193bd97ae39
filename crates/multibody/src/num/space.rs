//! 3-vectors, 3×3 matrices and symmetric 3×3 matrices over any [`Real`], with the fused operations the kernels need.

use super::{Constant, Real};
use core::ops::{Add, Mul, Neg, Sub};

/// A 3-vector.
#[derive(Clone, Copy, Debug)]
pub(crate) struct V3<T> {
    pub x: T,
    pub y: T,
    pub z: T,
}

/// A 3×3 matrix by columns.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Mat3<T> {
    pub c: [V3<T>; 3],
}

/// A symmetric 3×3 matrix: its upper triangle.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sym3<T> {
    pub xx: T,
    pub xy: T,
    pub xz: T,
    pub yy: T,
    pub yz: T,
    pub zz: T,
}

impl<T: Real> Add for V3<T> {
    type Output = Self;
    #[inline(always)]
    fn add(self, o: Self) -> Self {
        Self {
            x: self.x + o.x,
            y: self.y + o.y,
            z: self.z + o.z,
        }
    }
}

impl<T: Real> Sub for V3<T> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, o: Self) -> Self {
        Self {
            x: self.x - o.x,
            y: self.y - o.y,
            z: self.z - o.z,
        }
    }
}

impl<T: Real> Neg for V3<T> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self {
            x: -self.x,
            y: -self.y,
            z: -self.z,
        }
    }
}

impl<T: Real> Mul<T> for V3<T> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, s: T) -> Self {
        Self {
            x: self.x * s,
            y: self.y * s,
            z: self.z * s,
        }
    }
}

impl<T: Real> V3<T> {
    #[inline(always)]
    pub(crate) fn new(x: T, y: T, z: T) -> Self {
        Self { x, y, z }
    }

    #[inline(always)]
    pub(crate) fn of<K: Constant<T>>(v: [K; 3]) -> Self {
        Self {
            x: v[0].lift(),
            y: v[1].lift(),
            z: v[2].lift(),
        }
    }

    #[inline(always)]
    pub(crate) fn zero() -> Self {
        Self::of([0.0_f64; 3])
    }

    /// The three elements of `s` from index `at`.
    #[inline(always)]
    pub(crate) fn read(s: &[T], at: usize) -> Self {
        Self {
            x: s[at],
            y: s[at + 1],
            z: s[at + 2],
        }
    }

    #[inline(always)]
    pub(crate) fn write(self, s: &mut [T], at: usize) {
        s[at] = self.x;
        s[at + 1] = self.y;
        s[at + 2] = self.z;
    }

    #[inline(always)]
    pub(crate) fn to_array(self) -> [T; 3] {
        [self.x, self.y, self.z]
    }

    #[inline(always)]
    pub(crate) fn dot(self, o: Self) -> T {
        self.x.mul_add(o.x, self.y.mul_add(o.y, self.z * o.z))
    }

    /// `self · o + s`.
    #[inline(always)]
    pub(crate) fn dot_add(self, o: Self, s: T) -> T {
        self.x.mul_add(o.x, self.y.mul_add(o.y, self.z.mul_add(o.z, s)))
    }

    #[inline(always)]
    pub(crate) fn cross(self, o: Self) -> Self {
        Self {
            x: self.y.mul_add(o.z, -(self.z * o.y)),
            y: self.z.mul_add(o.x, -(self.x * o.z)),
            z: self.x.mul_add(o.y, -(self.y * o.x)),
        }
    }

    /// `self × o + s`.
    #[inline(always)]
    pub(crate) fn cross_add(self, o: Self, s: Self) -> Self {
        Self {
            x: self.y.mul_add(o.z, (-self.z).mul_add(o.y, s.x)),
            y: self.z.mul_add(o.x, (-self.x).mul_add(o.z, s.y)),
            z: self.x.mul_add(o.y, (-self.y).mul_add(o.x, s.z)),
        }
    }

    /// `self * k + s`.
    #[inline(always)]
    pub(crate) fn mul_add(self, k: T, s: Self) -> Self {
        Self {
            x: self.x.mul_add(k, s.x),
            y: self.y.mul_add(k, s.y),
            z: self.z.mul_add(k, s.z),
        }
    }
}

impl<T: Real> Mat3<T> {
    #[inline(always)]
    pub(crate) fn of<K: Constant<T>>(columns: [[K; 3]; 3]) -> Self {
        // written out: `map` is not inlined for lanes
        let [a, b, c] = columns;
        Self {
            c: [V3::of(a), V3::of(b), V3::of(c)],
        }
    }

    #[inline(always)]
    pub(crate) fn identity() -> Self {
        Self::of([[1.0_f64, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    }

    /// The matrix of `v ×`.
    #[inline(always)]
    pub(crate) fn skew(v: V3<T>) -> Self {
        let o = T::of(0.0);
        Self {
            c: [V3::new(o, v.z, -v.y), V3::new(-v.z, o, v.x), V3::new(v.y, -v.x, o)],
        }
    }

    /// `self · v`.
    #[inline(always)]
    pub(crate) fn mul(&self, v: V3<T>) -> V3<T> {
        self.c[0].mul_add(v.x, self.c[1].mul_add(v.y, self.c[2] * v.z))
    }

    /// `self · v + s`.
    #[inline(always)]
    pub(crate) fn mul_add(&self, v: V3<T>, s: V3<T>) -> V3<T> {
        self.c[0].mul_add(v.x, self.c[1].mul_add(v.y, self.c[2].mul_add(v.z, s)))
    }

    /// `selfᵀ · v`.
    #[inline(always)]
    pub(crate) fn tmul(&self, v: V3<T>) -> V3<T> {
        V3::new(self.c[0].dot(v), self.c[1].dot(v), self.c[2].dot(v))
    }

    /// `selfᵀ · v + s`.
    #[inline(always)]
    pub(crate) fn tmul_add(&self, v: V3<T>, s: V3<T>) -> V3<T> {
        V3::new(
            self.c[0].dot_add(v, s.x),
            self.c[1].dot_add(v, s.y),
            self.c[2].dot_add(v, s.z),
        )
    }

    #[inline(always)]
    pub(crate) fn mul_mat(&self, o: &Self) -> Self {
        Self {
            c: [self.mul(o.c[0]), self.mul(o.c[1]), self.mul(o.c[2])],
        }
    }

    /// `self + a bᵀ`.
    #[inline(always)]
    pub(crate) fn add_outer(&self, a: V3<T>, b: V3<T>) -> Self {
        Self {
            c: [
                a.mul_add(b.x, self.c[0]),
                a.mul_add(b.y, self.c[1]),
                a.mul_add(b.z, self.c[2]),
            ],
        }
    }

    #[inline(always)]
    pub(crate) fn add(&self, o: &Self) -> Self {
        Self {
            c: [self.c[0] + o.c[0], self.c[1] + o.c[1], self.c[2] + o.c[2]],
        }
    }

    /// Row `i`.
    #[inline(always)]
    pub(crate) fn row(&self, i: usize) -> V3<T> {
        let pick = |v: V3<T>| v.to_array()[i];
        V3::new(pick(self.c[0]), pick(self.c[1]), pick(self.c[2]))
    }

    #[inline(always)]
    pub(crate) fn trace(&self) -> T {
        self.c[0].x + self.c[1].y + self.c[2].z
    }
}

impl<T: Real> Sym3<T> {
    /// From `[xx, xy, xz, yy, yz, zz]`.
    #[inline(always)]
    pub(crate) fn of<K: Constant<T>>(s: [K; 6]) -> Self {
        Self {
            xx: s[0].lift(),
            xy: s[1].lift(),
            xz: s[2].lift(),
            yy: s[3].lift(),
            yz: s[4].lift(),
            zz: s[5].lift(),
        }
    }

    #[inline(always)]
    pub(crate) fn scalar(s: T) -> Self {
        let o = T::of(0.0);
        Self {
            xx: s,
            xy: o,
            xz: o,
            yy: s,
            yz: o,
            zz: s,
        }
    }

    #[inline(always)]
    pub(crate) fn columns(&self) -> [V3<T>; 3] {
        [
            V3::new(self.xx, self.xy, self.xz),
            V3::new(self.xy, self.yy, self.yz),
            V3::new(self.xz, self.yz, self.zz),
        ]
    }

    #[inline(always)]
    pub(crate) fn mul(&self, v: V3<T>) -> V3<T> {
        let c = self.columns();
        c[0].mul_add(v.x, c[1].mul_add(v.y, c[2] * v.z))
    }

    #[inline(always)]
    pub(crate) fn mul_add(&self, v: V3<T>, s: V3<T>) -> V3<T> {
        let c = self.columns();
        c[0].mul_add(v.x, c[1].mul_add(v.y, c[2].mul_add(v.z, s)))
    }

    #[inline(always)]
    pub(crate) fn add(&self, o: &Self) -> Self {
        Self {
            xx: self.xx + o.xx,
            xy: self.xy + o.xy,
            xz: self.xz + o.xz,
            yy: self.yy + o.yy,
            yz: self.yz + o.yz,
            zz: self.zz + o.zz,
        }
    }

    /// `self + a bᵀ`; the caller guarantees that `a bᵀ` (or the sum of all added terms) is symmetric.
    #[inline(always)]
    pub(crate) fn add_outer(&self, a: V3<T>, b: V3<T>) -> Self {
        Self {
            xx: a.x.mul_add(b.x, self.xx),
            xy: a.x.mul_add(b.y, self.xy),
            xz: a.x.mul_add(b.z, self.xz),
            yy: a.y.mul_add(b.y, self.yy),
            yz: a.y.mul_add(b.z, self.yz),
            zz: a.z.mul_add(b.z, self.zz),
        }
    }

    #[inline(always)]
    pub(crate) fn trace(&self) -> T {
        self.xx + self.yy + self.zz
    }

    /// `R · self · Rᵀ`.
    #[inline(always)]
    pub(crate) fn rotated(&self, r: &Mat3<T>) -> Self {
        let c = self.columns();
        let t = [r.mul(c[0]), r.mul(c[1]), r.mul(c[2])]; // columns of R·S
        Self {
            xx: t[0].x.mul_add(r.c[0].x, t[1].x.mul_add(r.c[1].x, t[2].x * r.c[2].x)),
            xy: t[0].x.mul_add(r.c[0].y, t[1].x.mul_add(r.c[1].y, t[2].x * r.c[2].y)),
            xz: t[0].x.mul_add(r.c[0].z, t[1].x.mul_add(r.c[1].z, t[2].x * r.c[2].z)),
            yy: t[0].y.mul_add(r.c[0].y, t[1].y.mul_add(r.c[1].y, t[2].y * r.c[2].y)),
            yz: t[0].y.mul_add(r.c[0].z, t[1].y.mul_add(r.c[1].z, t[2].y * r.c[2].z)),
            zz: t[0].z.mul_add(r.c[0].z, t[1].z.mul_add(r.c[1].z, t[2].z * r.c[2].z)),
        }
    }
}
