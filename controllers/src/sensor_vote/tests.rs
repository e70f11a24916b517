use super::*;

const H: f64 = 0.002;

/// A sine of 2 Hz and 0.2 g, with sensor noise of `noise` standard deviations of the laboratory's.
fn healthy(k: u32, noise: f64) -> VoteInput {
    let w = TAU * 2.0;
    let (s, c) = (w * H * f64::from(k)).sin_cos();
    let amplitude = 0.2 * G / (w * w);
    // Two sines of incommensurable phases as noise of the same RMS, from sample to sample unlike.
    let grain = |n: f64| (f64::from(k) * f64::from(k) * n).sin() * 2.0_f64.sqrt();
    VoteInput {
        measured: Motion {
            displacement: amplitude * s + noise * 5e-4 * INCH * grain(0.7391),
            velocity: amplitude * w * c,
            acceleration: -amplitude * w * w * s + noise * 1.5 * INCH * grain(1.3173),
        },
        measured_force: 100.0 * c,
        valid: true,
    }
}

fn run(count: u32, noise: f64, disturb: impl Fn(u32, &mut VoteInput)) -> Vec<Voted> {
    let mut vote = SensorVote::laboratory();
    vote.validate().unwrap();
    (0..count)
        .map(|k| {
            let mut input = healthy(k, noise);
            disturb(k, &mut input);
            vote.step(&input, H)
        })
        .collect()
}

#[test]
fn healthy_sensors_pass_to_the_bit_at_four_times_the_noise() {
    for (k, voted) in run(5000, 4.0, |_, _| ()).into_iter().enumerate() {
        let input = healthy(k as u32, 4.0);
        assert_eq!(voted.motion, input.measured, "{k}");
        assert_eq!(voted.doubt, Doubt::None, "{k}");
        assert!(voted.valid && !voted.disagree && !voted.jumped);
    }
}

#[test]
fn wrong_samples_are_replaced_and_forgotten() {
    let wrong = |k: u32, input: &mut VoteInput| match k {
        1000 => input.measured.displacement += 0.5 * INCH,
        1100..1105 => input.measured.acceleration -= 3.0 * G,
        1200 => input.valid = false,
        1300 => input.measured.displacement = f64::NAN,
        _ => {}
    };
    for (k, voted) in run(2000, 1.0, wrong).into_iter().enumerate() {
        let truth = healthy(k as u32, 0.0).measured;
        let off = voted.motion.displacement - truth.displacement;
        assert!(off.abs() < 3e-3 * INCH, "{k}: {} in", off / INCH);
        assert!((voted.motion.acceleration - truth.acceleration).abs() < 0.05 * G);
        assert!((voted.motion.velocity - truth.velocity).abs() < 0.2 * INCH);
        let doubt = match k {
            1000 => Doubt::Displacement,
            1100..1105 => Doubt::Acceleration,
            1200 | 1300 => Doubt::NotFinite,
            _ => Doubt::None,
        };
        assert_eq!(voted.doubt, doubt, "{k}");
        assert!(voted.valid && !voted.disagree && !voted.jumped);
    }
}

#[test]
fn lasting_faults_are_noticed_in_time() {
    let first = |voted: &[Voted], what: fn(&Voted) -> bool| {
        let found = voted.iter().position(what);
        found.map_or(f64::INFINITY, |k| H * k as f64 - 2.0)
    };
    type Disturb = fn(&mut Motion);
    let cases: [(&str, Disturb, f64); 5] = [
        ("reversed", |m| m.acceleration = -m.acceleration, 0.25),
        ("dead", |m| m.acceleration = 0.001 * G, 0.35),
        ("offset", |m| m.acceleration += 0.05 * G, 0.35),
        ("tripled", |m| m.acceleration *= 3.0, 0.25),
        ("frozen", |m| m.acceleration = 0.15 * G, 0.35),
    ];
    for (name, disturb, within) in cases {
        let voted = run(2000, 1.0, |k, input| {
            if k >= 1000 {
                disturb(&mut input.measured);
            }
        });
        let noticed = first(&voted, |v| v.disagree);
        println!("{name}: {noticed} s");
        assert!((0.0..=within).contains(&noticed), "{name}: {noticed} s");
    }
    let jumped = run(2000, 1.0, |k, input| {
        if k >= 1000 {
            input.measured.displacement += 0.2 * INCH;
        }
    });
    let noticed = first(&jumped, |v| v.jumped);
    assert!((0.012..0.0161).contains(&noticed), "{noticed}");
    let lost = run(2000, 1.0, |k, input| input.valid = k < 1000);
    let noticed = first(&lost, |v| !v.valid);
    assert!((0.012..0.0161).contains(&noticed), "{noticed}");
}

#[test]
fn a_scale_that_is_a_fifth_off_and_a_small_offset_are_tolerated() {
    for voted in run(3000, 1.0, |_, input| {
        input.measured.acceleration = 1.2 * input.measured.acceleration + 0.01 * G;
    }) {
        assert!(!voted.disagree);
    }
}

#[test]
fn an_acceleration_that_jumps_from_sample_to_sample_is_not_a_contradiction() {
    // A loop that chatters: 3 g one way and the other, with the half period's displacement of 1 um.
    let chatter = |k: u32, input: &mut VoteInput| {
        let sign = if k.is_multiple_of(2) { 1.0 } else { -1.0 };
        if k >= 200 {
            input.measured.acceleration += sign * 3.0 * G;
            input.measured.displacement -= sign * 1e-6;
        }
    };
    assert!(run(1000, 1.0, chatter).iter().all(|voted| !voted.disagree));
    // Once it is over, a reversed accelerometer is noticed.
    let then_reversed = |k: u32, input: &mut VoteInput| {
        if k < 600 {
            chatter(k, input);
        } else {
            input.measured.acceleration *= -1.0;
        }
    };
    let all = run(1500, 1.0, then_reversed);
    assert!(all[..600].iter().all(|voted| !voted.disagree));
    assert!(all[600..].iter().any(|voted| voted.disagree));
}
