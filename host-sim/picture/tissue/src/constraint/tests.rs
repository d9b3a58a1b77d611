//! Each constraint against its equation.

use super::*;

const CORNERS: [Vector; 4] = [[0.1, 0.0, 0.2], [1.0, 0.2, -0.1], [0.4, 1.1, 0.3], [0.5, -0.9, 0.7]];

/// The gradients against differences of the angle itself.
#[test]
fn the_gradient_of_the_bending_angle_is_its_slope() {
    let (_, gradients) = angle(CORNERS).expect("they have areas");
    for corner in 0..4 {
        for axis in 0..3 {
            let moved = |by: f32| {
                let mut p = CORNERS;
                p[corner][axis] += by;
                bending_angle(p)
            };
            let slope = (moved(1e-2) - moved(-1e-2)) / 2e-2;
            let given = gradients[corner][axis];
            assert!((slope - given).abs() < 5e-3, "corner {corner}, axis {axis}: {given} against {slope}");
        }
    }
}

#[test]
fn a_flat_pair_has_angle_zero_and_a_right_fold_a_quarter_turn() {
    let flat = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0]];
    assert!(bending_angle(flat).abs() < 1e-6);
    let folded = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    assert!((bending_angle(folded).abs() - std::f32::consts::FRAC_PI_2).abs() < 1e-5);
}

/// With λ kept, a spring under a steady load settles at load × compliance however many iterations
/// there are.
#[test]
fn compliance_is_what_it_says_whatever_the_iterations() {
    let spring = Distance { ends: [0, 1], rest: 1.0, compliance: 2e-3 };
    // 100 µN on 1 g: 100 mm/s².
    let (dt, load) = (1e-3_f32, 100.0_f32);
    for iterations in [1, 4, 20] {
        let mut points = [[0.0, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 1.0]];
        let mut speed = 0.0_f32;
        for _ in 0..4_000 {
            let before = points[1][0];
            speed = (speed + load * dt) * 0.98;
            points[1][0] += speed * dt;
            let mut lambda = 0.0;
            for _ in 0..iterations {
                spring.project(&mut points, &mut lambda, 1.0 / (dt * dt));
            }
            speed = (points[1][0] - before) / dt;
        }
        let stretch = points[1][0] - 1.0;
        assert!((stretch - 0.2).abs() < 2e-2, "{iterations} iterations: {stretch} mm");
    }
}

/// Pairs of three particles solved together: more iterations come nearer to the exact solution of
/// the linear system.
#[test]
fn a_projection_restores_a_volume_and_keeps_the_centre_of_mass() {
    let mut points = CORNERS.map(|p| [p[0], p[1], p[2], 1.0]);
    let rest = 2.0 * volume(CORNERS).abs();
    let corners = if volume(CORNERS) > 0.0 { [0, 1, 2, 3] } else { [0, 2, 1, 3] };
    let constraint = Volume { corners, rest, compliance: 0.0 };
    let centre = |points: &[Point; 4]| points.iter().fold([0.0; 3], |sum, p| add(sum, place(p)));
    let before = centre(&points);
    for _ in 0..20 {
        constraint.project(&mut points, &mut 0.0, 1.0);
    }
    assert!((constraint.violation(&points).0 / rest).abs() < 1e-4);
    assert!(length(sub(centre(&points), before)) < 1e-4);
}
