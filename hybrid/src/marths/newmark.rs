//! Newmark's method of constant average acceleration for a structure, massless freedoms among them.

use nalgebra::DMatrix;
use plant::ModelError;

use super::{Freedom, PERIOD, Structure};

/// A structure in motion. A step is made in two halves: [`Newmark::propose`] without the force on its
/// interface, [`Newmark::accept`] with it.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub struct Newmark {
    mass: Vec<f64>,
    loaded: Vec<f64>,
    /// Columns one behind the other.
    damping: Vec<f64>,
    flexibility: Vec<f64>,
    displacement: Vec<f64>,
    velocity: Vec<f64>,
    acceleration: Vec<f64>,
    proposed: Vec<f64>,
    right: Vec<f64>,
}

impl Newmark {
    /// At rest.
    ///
    /// # Errors
    /// A structure whose effective stiffness is singular.
    pub fn new(structure: &Structure) -> Result<Self, ModelError> {
        let n = structure.mass.len();
        let effective = &structure.stiffness
            + DMatrix::from_diagonal(&structure.mass) * (4.0 / (PERIOD * PERIOD))
            + &structure.damping * (2.0 / PERIOD);
        let flexibility = effective
            .try_inverse()
            .filter(|inverse| inverse.iter().all(|v| v.is_finite()))
            .ok_or(ModelError::NotForSimulation {
                model: "structure",
                reason: "its effective stiffness is singular: a freedom with neither mass nor \
                         stiffness"
                    .into(),
            })?;
        let loaded = structure.mass.component_mul(&structure.influence);
        Ok(Self {
            mass: structure.mass.as_slice().to_vec(),
            loaded: loaded.as_slice().to_vec(),
            damping: structure.damping.as_slice().to_vec(),
            flexibility: flexibility.as_slice().to_vec(),
            displacement: vec![0.0; n],
            velocity: vec![0.0; n],
            acceleration: vec![0.0; n],
            proposed: vec![0.0; n],
            right: vec![0.0; n],
        })
    }

    /// Displacement of a freedom, m or rad.
    #[must_use]
    pub fn displacement(&self, freedom: Freedom) -> f64 {
        self.displacement[freedom as usize]
    }

    /// What the displacements of the next sample are without a force on the interface, under the
    /// ground's acceleration of that sample, m/s^2.
    pub fn propose(&mut self, ground: f64) {
        let (by, by_square) = (2.0 / PERIOD, 4.0 / (PERIOD * PERIOD));
        let n = self.mass.len();
        for i in 0..n {
            let inertia = by_square * self.displacement[i]
                + 2.0 * by * self.velocity[i]
                + self.acceleration[i];
            self.right[i] = self.mass[i] * inertia - self.loaded[i] * ground;
        }
        for (j, column) in self.damping.chunks_exact(n).enumerate() {
            let rate = by * self.displacement[j] + self.velocity[j];
            for (right, c) in self.right.iter_mut().zip(column) {
                *right += c * rate;
            }
        }
        self.proposed.fill(0.0);
        for (right, column) in self.right.iter().zip(self.flexibility.chunks_exact(n)) {
            for (moved, f) in self.proposed.iter_mut().zip(column) {
                *moved += f * right;
            }
        }
    }

    /// The proposed displacement of a freedom, m or rad.
    #[must_use]
    pub fn proposed(&self, freedom: Freedom) -> f64 {
        self.proposed[freedom as usize]
    }

    /// How much a unit of force on freedom `of` takes from the proposed displacement of freedom `on`.
    #[must_use]
    pub fn influence(&self, on: Freedom, of: Freedom) -> f64 {
        self.flexibility[of as usize * self.mass.len() + on as usize]
    }

    /// Makes the step under forces (N, N m) on freedoms.
    pub fn accept(&mut self, forces: [(Freedom, f64); 3]) {
        let n = self.mass.len();
        for (freedom, force) in forces {
            let column = &self.flexibility[freedom as usize * n..][..n];
            for (moved, f) in self.proposed.iter_mut().zip(column) {
                *moved -= f * force;
            }
        }
        let by = 2.0 / PERIOD;
        for i in 0..n {
            let (p, v, w) = (self.displacement[i], self.velocity[i], self.acceleration[i]);
            let acceleration = by * by * (self.proposed[i] - p) - 2.0 * by * v - w;
            self.velocity[i] = v + 0.5 * PERIOD * (acceleration + w);
            self.acceleration[i] = acceleration;
            self.displacement[i] = self.proposed[i];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DVector;

    /// One mass on a spring under a constant ground acceleration: `-a (1 - cos w t) / w^2`.
    #[test]
    fn an_oscillator_moves_as_its_solution() {
        let frequency = 14.0f64;
        let mut structure = Structure::reference();
        structure.mass = DVector::from_element(29, 1.0);
        structure.damping.fill(0.0);
        structure.stiffness = DMatrix::identity(29, 29) * frequency.powi(2);
        let mut newmark = Newmark::new(&structure).unwrap();
        let mut largest = 0.0f64;
        for k in 0..2048 {
            // The method starts from rest before the load: half a sample late, to first order.
            let t = (k as f64 + 0.5) * PERIOD;
            newmark.propose(2.0);
            newmark.accept([(Freedom::Interface, 0.0); 3]);
            let exact = -2.0 * (1.0 - (frequency * t).cos()) / frequency.powi(2);
            largest = largest.max((newmark.displacement(Freedom::Storey3) - exact).abs());
        }
        assert!(largest < 2e-5, "{largest}");
    }

    #[test]
    fn a_freedom_without_mass_and_stiffness_is_refused() {
        let mut structure = Structure::reference();
        for i in 0..29 {
            structure.stiffness[(20, i)] = 0.0;
            structure.damping[(20, i)] = 0.0;
        }
        let error = Newmark::new(&structure).unwrap_err().to_string();
        assert!(error.contains("singular"), "{error}");
    }
}
