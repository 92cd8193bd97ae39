//! Default model of the target: a satellite with a grapple fixture at the grasp point.

use lockstep::units;
use multibody::nalgebra::{Rotation3, Vector3};
use report::scene::{Solid, SolidKind};
use toml::Table;

use super::parameters::parameters;

/// Its solids in the target's axes; none where the plan does not give the grasp point.
pub(super) fn solids(plan: &Table) -> Vec<Solid> {
    let grasp = parameters(plan).find_map(|table| table.get("target")?.get("grasp")?.get("position")?.as_str());
    let Some(g) = grasp.and_then(|text| <[f64; 3]>::try_from(units::convert(text, "m").ok()?.0).ok()) else {
        return Vec::new();
    };
    let g = Vector3::from(g);
    if g.norm() < 1e-3 {
        return Vec::new();
    }
    let mut satellite = Satellite::with_grasp_point(g);
    satellite.add_bus();
    satellite.add_fixture();
    satellite.solids
}

struct Satellite {
    solids: Vec<Solid>,
    /// The distance of the grasp point from the origin, m: the unit of every length.
    d: f64,
    /// The axis normal to the face with the grasp point.
    axis: usize,
    /// The edges of the bus, m.
    size: [f64; 3],
    /// The rotation from a frame whose z axis is the outward normal of that face to the target's axes.
    face_to_target: Rotation3<f64>,
    rpy: [f64; 3],
}

impl Satellite {
    fn with_grasp_point(g: Vector3<f64>) -> Satellite {
        let (d, u) = (g.norm(), g.normalize());
        let axis = g.iamax();
        let (pitch, yaw) = (u.x.hypot(u.y).atan2(u.z), u.y.atan2(u.x));
        Satellite {
            solids: Vec::new(),
            size: std::array::from_fn(|i| if i == axis { 2.0 * d * 0.985 } else { 1.54 * d }),
            face_to_target: Rotation3::from_euler_angles(0.0, pitch, yaw),
            rpy: [0.0, pitch, yaw],
            axis,
            d,
        }
    }

    fn add(&mut self, kind: SolidKind, size: [f64; 3], xyz: [f64; 3], role: &'static str) {
        self.solids.push(Solid {
            kind,
            size,
            xyz,
            rpy: [0.0; 3],
            rgba: None,
            role,
        });
    }

    /// A solid on the face with the grasp point; sizes and position are multiples of the point's distance.
    fn add_on_face(&mut self, kind: SolidKind, size: [f64; 3], place: [f64; 3], role: &'static str) {
        let at = self.face_to_target * (Vector3::from(place) * self.d);
        self.add(kind, size.map(|length| length * self.d), at.into(), role);
        if let Some(solid) = self.solids.last_mut() {
            solid.rpy = self.rpy;
        }
    }

    /// The bus with rails along all edges, solar cells on its sides, and wings along the longer axis of the face.
    fn add_bus(&mut self) {
        let (d, size, axis) = (self.d, self.size, self.axis);
        self.add(SolidKind::Box, size, [0.0; 3], "silver");
        for i in 0..3 {
            for (s, r) in [(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)] {
                let (mut place, mut edges) = ([0.0; 3], [0.04 * d; 3]);
                let (j, k) = ((i + 1) % 3, (i + 2) % 3);
                edges[i] = size[i] + 0.04 * d;
                place[j] = s * size[j] / 2.0;
                place[k] = r * size[k] / 2.0;
                self.add(SolidKind::Box, edges, place, "metal");
            }
        }
        let across: Vec<usize> = (0..3).filter(|i| *i != axis).collect();
        let (a, b) = (across[0], across[1]);
        for s in [-1.0, 1.0] {
            let (mut place, mut edges) = ([0.0; 3], size.map(|x| 0.84 * x));
            place[b] = s * (size[b] / 2.0 + 0.008 * d);
            edges[b] = 0.02 * d;
            self.add(SolidKind::Box, edges, place, "cells");
            for k in 0..2 {
                let (mut place, mut edges) = ([0.0; 3], [0.0; 3]);
                place[a] = s * (size[a] / 2.0 + d * (0.62 + 0.98 * f64::from(k)));
                edges[a] = 0.94 * d;
                edges[b] = 0.035 * d;
                edges[axis] = 1.25 * d;
                self.add(SolidKind::Box, edges, place, "cells");
            }
            let (mut place, mut edges) = ([0.0; 3], [0.05 * d; 3]);
            place[a] = s * (size[a] / 2.0 + 0.09 * d);
            edges[a] = 0.18 * d;
            self.add(SolidKind::Box, edges, place, "metal");
        }
    }

    /// A launch ring at the back; at the front the grapple fixture: a ring to hold, a post in its middle, a plate with
    /// marks for the camera; next to it a nozzle and an antenna.
    fn add_fixture(&mut self) {
        use SolidKind::{Box, Cylinder, Sphere};
        self.add_on_face(Cylinder, [0.42, 0.42, 0.06], [0.0, 0.0, -1.0], "metal");
        self.add_on_face(Box, [0.62, 0.62, 0.012], [0.0, 0.0, 0.985], "dark");
        self.add_on_face(Cylinder, [0.22, 0.22, 0.022], [0.0, 0.0, 0.994], "ring");
        self.add_on_face(Cylinder, [0.185, 0.185, 0.026], [0.0, 0.0, 0.994], "dark");
        self.add_on_face(Cylinder, [0.035, 0.035, 0.05], [0.0, 0.0, 0.985], "metal");
        for (x, y) in [(-0.25, -0.25), (0.25, -0.25), (-0.25, 0.25), (0.25, 0.25)] {
            self.add_on_face(Cylinder, [0.028, 0.028, 0.016], [x, y, 0.99], "radiator");
        }
        self.add_on_face(Cylinder, [0.1, 0.13, 0.2], [0.52, 0.5, 1.05], "nozzle");
        self.add_on_face(Cylinder, [0.016, 0.016, 0.5], [-0.55, 0.5, 1.15], "metal");
        self.add_on_face(Sphere, [0.03, 0.0, 0.0], [-0.55, 0.5, 1.42], "ring");
    }
}
