use super::*;

/// Six legs from a circle below to a circle of pins, in pairs.
fn hexapod() -> Platform {
    let on = |radius: f64, degrees: f64, height: f64| {
        let angle = degrees.to_radians();
        [radius * angle.cos(), radius * angle.sin(), height]
    };
    let legs = (0..6).map(|i| {
        let side = if i % 2 == 0 { -1.0 } else { 1.0 };
        let middle = f64::from(i / 2) * 120.0;
        Actuator {
            point: on(0.5, middle + side * 12.0, 0.0),
            line: Line::Pinned(on(0.8, middle + side * 48.0, -1.0)),
        }
    });
    Platform::new(legs.collect(), [true; 6]).unwrap()
}

/// A table on four vertical and two by two horizontal actuators.
fn table() -> Platform {
    let corners = [[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]];
    let vertical = corners.map(|[x, y]| Actuator {
        point: [x, y, 0.0],
        line: Line::Pinned([x, y, -1.5]),
    });
    let along = [-0.7, 0.7].map(|y| Actuator {
        point: [1.0, y, 0.0],
        line: Line::Pinned([2.5, y, 0.0]),
    });
    let across = [-0.7, 0.7].map(|x| Actuator {
        point: [x, 1.0, 0.0],
        line: Line::Pinned([x, 2.5, 0.0]),
    });
    let all = vertical.into_iter().chain(along).chain(across).collect();
    Platform::new(all, [true; 6]).unwrap()
}

/// Numbers between -1 and 1 that look random, by Weyl's sequence.
fn draw(seed: usize) -> [f64; 6] {
    std::array::from_fn(|i| {
        let turn = (seed * 6 + i + 1) as f64 * 0.618_033_988_749_894_9;
        2.0 * turn.fract() - 1.0
    })
}

/// Heave and yaw: by the law of cosines a leg has the length sqrt(R^2 + r^2 - 2 R r cos(angle) + h^2).
#[test]
fn a_hexapods_legs_are_those_of_the_law_of_cosines() {
    let platform = hexapod();
    let length = |height: f64, degrees: f64| -> f64 {
        let angle = degrees.to_radians();
        (0.64 + 0.25 - 0.8 * angle.cos() + height * height).sqrt()
    };
    let yaw = 7.0f64;
    let pose = Pose([0.0, 0.0, 0.08, 0.0, 0.0, yaw.to_radians()]);
    let strokes = platform.strokes(&pose);
    for (i, stroke) in strokes[..6].iter().enumerate() {
        let side = if i % 2 == 0 { -1.0 } else { 1.0 };
        let wanted = length(1.08, side * 36.0 - yaw) - length(1.0, 36.0);
        assert!((stroke - wanted).abs() < 1e-14, "{i} {stroke} {wanted}");
    }
    let back = platform
        .pose(&strokes, &Pose::default())
        .within(1e-12)
        .unwrap();
    assert!(
        back.0
            .iter()
            .zip(pose.0)
            .all(|(a, b)| (a - b).abs() < 1e-12),
        "{back:?}"
    );
}

#[test]
fn poses_come_back_from_their_strokes() {
    for platform in [hexapod(), table()] {
        for seed in 0..200 {
            let drawn = draw(seed);
            let pose = Pose(std::array::from_fn(
                |i| if i < 3 { 0.15 } else { 0.2 } * drawn[i],
            ));
            let found = platform.pose(&platform.strokes(&pose), &Pose::default());
            let back = found.within(1e-11).unwrap();
            for (a, b) in back.0.iter().zip(pose.0) {
                assert!((a - b).abs() < 1e-10, "{seed}: {found:?}");
            }
            assert!(found.iterations <= 12, "{}", found.iterations);
        }
    }
}

/// Two parallel actuators with symmetric pins: the rotation is asin of the strokes' difference over the pins' distance.
#[test]
fn two_parallel_actuators_have_the_closed_form() {
    let platform = Platform::read("0.27 -0.13 0; 0.27 0.13 0", "", "1 0 0; 1 0 0", "x rz").unwrap();
    for (translation, rotation) in [(0.004, -0.02), (-0.03, 0.3), (0.0, 1.0)] {
        let pose = Pose([translation, 0.0, 0.0, 0.0, 0.0, rotation]);
        let strokes = platform.strokes(&pose);
        let sine: f64 = (strokes[0] - strokes[1]) / 0.26;
        assert!((sine.asin() - rotation).abs() < 1e-12);
        let back = platform
            .pose(&strokes, &Pose::default())
            .within(1e-11)
            .unwrap();
        assert!((back.0[0] - translation).abs() < 1e-11 && (back.0[5] - rotation).abs() < 1e-11);
    }
    let beyond = [0.2, -0.2, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    let error = platform
        .pose(&beyond, &Pose::default())
        .within(1e-9)
        .unwrap_err();
    assert!(error.to_string().contains("belong to no pose"), "{error}");
}

/// In the table's zero position, lifting opposite corners by d and lowering the others is no rigid motion at all:
/// the pose stays, and each corner is off by d.
#[test]
fn what_redundant_strokes_contradict_each_other_by_is_reported() {
    let platform = table();
    assert_eq!(platform.redundancy(), 2);
    let d = 1e-6;
    let warped = [d, -d, d, -d, 0.0, 0.0, 0.0, 0.0];
    let found = platform.pose(&warped, &Pose::default());
    assert!(
        found.converged && found.pose.0.iter().all(|v| v.abs() < 1e-12),
        "{found:?}"
    );
    for (residual, stroke) in found.residual.iter().zip(warped) {
        assert!((residual - stroke).abs() < 1e-12, "{found:?}");
    }
    assert!(
        found
            .within(1e-7)
            .unwrap_err()
            .to_string()
            .contains("actuator")
    );
}

#[test]
fn a_load_is_shared_without_actuators_working_against_each_other() {
    let platform = table();
    let forces = platform
        .forces(&Pose::default(), &[0.0, 0.0, -4e3, 0.0, 0.0, 0.0])
        .unwrap();
    for (i, force) in forces.iter().enumerate() {
        let wanted = if i < 4 { -1e3 } else { 0.0 };
        assert!((force - wanted).abs() < 1e-9, "{forces:?}");
    }
    let pose = Pose([0.02, -0.01, 0.03, 0.02, -0.03, 0.05]);
    for platform in [hexapod(), table()] {
        let wrench = [300.0, -200.0, 900.0, 40.0, -30.0, 70.0];
        let forces = platform.forces(&pose, &wrench).unwrap();
        for (a, b) in platform.wrench(&pose, &forces).iter().zip(wrench) {
            assert!((a - b).abs() < 1e-8);
        }
        // Work: forces times the strokes' rates are the wrench times the pose's.
        let by = 1e-6;
        let moved = Pose(std::array::from_fn(|i| {
            pose.0[i] + if i == 2 { by } else { 0.0 }
        }));
        let (before, after) = (platform.strokes(&pose), platform.strokes(&moved));
        let work: f64 = (0..MOST)
            .map(|i| forces[i] * (after[i] - before[i]) / by)
            .sum();
        assert!((work - 900.0).abs() < 0.01, "{work}");
    }
}

#[test]
fn geometries_that_determine_nothing_are_refused() {
    let refuse = |points: &str, directions: &str, free: &str| {
        Platform::read(points, "", directions, free)
            .unwrap_err()
            .to_string()
    };
    let alike = refuse("0.3 0.1 0; 0.3 0.1 0", "1 0 0; 1 0 0", "x rz");
    assert!(alike.contains("singular"), "{alike}");
    // Three vertical actuators cannot hold a horizontal motion.
    let lines = "0 0 1; 0 0 1; 0 0 1";
    let lacking = refuse("1 0 0; -1 1 0; -1 -1 0", lines, "x z rx");
    assert!(lacking.contains("along `x`"), "{lacking}");
    assert!(refuse("1 0 0", "1 0 0", "x rz").contains("1 actuators hold 2"));
    assert!(refuse("1 0; 0 1 0", "1 0 0; 1 0 0", "x rz").contains("expected 3"));
    assert!(refuse("1 0 0; 0 1 0", "1 0 0; 1 0 0", "x yaw").contains("`yaw`"));
    assert!(refuse("1 0 0; 0 1 0", "1 0 0; 0 0 0", "x rz").contains("actuator 2"));
}
