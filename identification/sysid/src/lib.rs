//! Estimation from sampled signals, independent of any rig.

pub mod continuous;
pub mod frequency_response;
pub mod gauss_newton;
pub mod input_matrices;
pub mod instrumental_variables;
pub mod interpolation;
pub mod least_squares;
pub mod levenberg_marquardt;
pub mod nonlinear;
pub mod prediction;
pub mod residuals;
pub mod rounding;
pub mod spectra;
pub mod state_variable_filter;
pub mod subspace;
pub mod transfer_function;
