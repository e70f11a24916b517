//! A motion that the table can be asked for.

/// A motion sampled as the controllers are, SI units, all three histories of equal length.
#[derive(Debug, Clone, PartialEq)]
pub struct Motion {
    /// Short name, for tables and file names' sake the stem of the file.
    pub name: String,
    /// Sample time, s.
    pub dt: f64,
    /// Displacement, m.
    pub displacement: Vec<f64>,
    /// Velocity, m/s.
    pub velocity: Vec<f64>,
    /// Acceleration, m/s^2.
    pub acceleration: Vec<f64>,
    /// What was done to the record, one line a step, for people.
    pub notes: Vec<String>,
    /// The seed, when the motion was generated.
    pub seed: Option<u64>,
    /// The motion along a second axis at the same time, as long as this one.
    pub across: Option<Box<Motion>>,
}

impl Motion {
    /// Number of samples.
    #[must_use]
    pub fn len(&self) -> usize {
        self.displacement.len()
    }

    /// Whether there is no sample at all.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.displacement.is_empty()
    }

    /// Time from the first to the last sample, s.
    #[must_use]
    pub fn duration(&self) -> f64 {
        self.len().saturating_sub(1) as f64 * self.dt
    }

    /// Largest absolute acceleration, m/s^2.
    #[must_use]
    pub fn peak_acceleration(&self) -> f64 {
        peak(&self.acceleration)
    }

    /// The motion with `across` along a second axis; the shorter of the two rests at its end.
    #[must_use]
    pub fn along_two_axes(mut self, mut across: Self) -> Self {
        let samples = self.len().max(across.len());
        self.rest_until(samples);
        across.rest_until(samples);
        self.across = Some(Box::new(across));
        self
    }

    /// Nothing but rest, as long as this motion.
    #[must_use]
    pub fn at_rest(&self) -> Self {
        let rest = || vec![0.0; self.len()];
        Self {
            name: "rest".to_string(),
            dt: self.dt,
            displacement: rest(),
            velocity: rest(),
            acceleration: rest(),
            notes: Vec::new(),
            seed: None,
            across: None,
        }
    }

    /// Rests from its end until it has so many samples, along both axes.
    pub fn rest_until(&mut self, samples: usize) {
        let last = self.displacement.last().copied().unwrap_or(0.0);
        self.displacement.resize(samples, last);
        self.velocity.resize(samples, 0.0);
        self.acceleration.resize(samples, 0.0);
        if let Some(across) = &mut self.across {
            across.rest_until(samples);
        }
    }

    /// Largest absolute velocity, m/s.
    #[must_use]
    pub fn peak_velocity(&self) -> f64 {
        peak(&self.velocity)
    }

    /// Largest absolute displacement, m.
    #[must_use]
    pub fn peak_displacement(&self) -> f64 {
        peak(&self.displacement)
    }
}

/// Largest absolute value, 0 for none.
pub fn peak(values: &[f64]) -> f64 {
    values
        .iter()
        .fold(0.0, |largest, value| value.abs().max(largest))
}
