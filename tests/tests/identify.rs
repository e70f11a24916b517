//! Chapter 2 as a tool: the rig's parameters from noisy data taken in closed loop.

mod identify_data;

use identification::rig::{Options, identify};
use identify_data::Test;

#[test]
fn explore() {
    let recording = Test::default().record();
    let started = std::time::Instant::now();
    let found = identify(&[recording], Options::default());
    println!("{:?}", started.elapsed());
    let found = found.unwrap();
    let rig = plant::shake_table::ShakeTable::default();
    let (d, b, e) = (rig.actuator.denominator, rig.actuator.voltage_to_force, rig.actuator.velocity_to_force);
    let s = plant::specimen::LinearSpecimen::appendix_a();
    let truth = [d[0], d[1], d[2], b[0], b[1], b[2], e[0], e[1], e[2], rig.table.mass, rig.table.damping, rig.table.stiffness, s.mass, s.damping, s.stiffness, 0.0];
    for i in 0..16 {
        println!("{:20} {:12.5e} {:12.5e} rel {:9.2e} sigmas {:6.2} relse {:9.2e}", identification::rig_model::PHYSICAL_NAMES[i], truth[i], found.physical[i],
            found.physical[i]/truth[i]-1.0, (found.physical[i]-truth[i])/found.standard_error[i], found.standard_error[i]/truth[i].abs());
    }
    println!("{} iterations {:?}", found.iterations, found.warnings);
    for f in &found.fits { println!("{} {} sim {:.2} pred {:.2}", f.recording, f.channel, f.simulated, f.predicted); }
    println!("{:?}", found.response_error(&[0.1, 1.0, 10.0, 30.0]));
    println!("sv {:?}", found.singular_values.as_slice());
}
