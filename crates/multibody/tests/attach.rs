//! A body welded to an existing tree gives the same dynamics as one included in the description.

use multibody::{Description, Inertia, Joint, JointKind, Link, Placement, State, Tree};
use nalgebra::{Matrix3, SVector, Vector3};

const URDF: &str = include_str!("../../../models/servicer.urdf");

#[test]
fn an_attached_body_is_part_of_the_mechanism() {
    let mut description = Description::from_urdf(URDF).unwrap();
    let mut tree = Tree::<9, 15>::new(&description).unwrap();
    let frame = tree.frame("end_effector").unwrap();
    let inertia = Inertia {
        mass: 150.0,
        com: Vector3::new(0.1, -0.2, 0.05),
        about_com: Matrix3::from_diagonal(&Vector3::new(33.6, 30.0, 25.0)),
    };
    let payload = Placement {
        p: Vector3::new(0.01, 0.02, 0.65),
        r: multibody::rotation::roll_pitch_yaw(0.1, -0.4, 0.7),
    };
    tree.attach(frame, &payload, &inertia);

    let parent = description
        .links
        .iter()
        .position(|link| link.name == "end_effector")
        .unwrap();
    description.links.push(Link {
        name: "payload".to_owned(),
        inertia: Some(inertia),
    });
    description.joints.push(Joint {
        name: "weld".to_owned(),
        kind: JointKind::Fixed,
        parent,
        child: description.links.len() - 1,
        origin: payload,
        axis: Vector3::z(),
        limits: None,
        damping: 0.0,
        friction: 0.0,
        stiffness: 0.0,
        rest: 0.0,
        motor_inertia: 0.0,
        mimic: None,
    });
    let whole = Tree::<9, 15>::new(&description).unwrap();

    let mut state = State::<9, 15>::rest();
    for i in 0..9 {
        state.q[i] = 0.3 * i as f64 - 1.0;
    }
    for i in 0..15 {
        state.nu[i] = 0.05 * i as f64 - 0.3;
    }
    let tau = SVector::<f64, 15>::from_fn(|i, _| 0.7 - 0.1 * i as f64);
    let (one, other) = (
        tree.forward_dynamics(&state, &tau),
        whole.forward_dynamics(&state, &tau),
    );
    assert!((one - other).amax() < 1e-12 * other.amax().max(1.0), "{one}{other}");
    let (one, other) = (tree.mass_matrix(&state.q), whole.mass_matrix(&state.q));
    assert!((one - other).amax() < 1e-12 * other.amax());
}
