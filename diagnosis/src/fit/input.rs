//! Inputs of a model, block by block: each one, and the sum of all.

/// The effect of an input over each block, from the state at the block's start.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Input {
    /// Acceleration held over each block, rad/s² or m/s² per unit.
    Held(Vec<f64>),
    /// Change of velocity and position over the block and of the block's mean position.
    Rows { dv: Vec<f64>, dq: Vec<f64>, dz: Vec<f64> },
    /// Travel that the encoder reads in addition to the position.
    Sensor(Vec<f64>),
}

impl Input {
    /// The same input with each block scaled.
    pub(crate) fn scaled(&self, by: &[f64]) -> Self {
        let times = |a: &[f64]| a.iter().zip(by).map(|(a, b)| a * b).collect();
        match self {
            Self::Held(a) => Self::Held(times(a)),
            Self::Rows { dv, dq, dz } => Self::Rows { dv: times(dv), dq: times(dq), dz: times(dz) },
            Self::Sensor(a) => Self::Sensor(times(a)),
        }
    }
}

/// The sum of all inputs of a model.
#[derive(Debug, Clone)]
pub(crate) struct Total {
    pub(crate) dv: Vec<f64>,
    pub(crate) dq: Vec<f64>,
    pub(crate) dz: Vec<f64>,
}

impl Total {
    pub(crate) fn zero(n: usize) -> Self {
        Self { dv: vec![0.0; n], dq: vec![0.0; n], dz: vec![0.0; n] }
    }
}
