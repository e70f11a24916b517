//! Linear systems: state space, transfer functions, sampling, frequency response, Riccati
//! equations.

mod frequency_response;
mod linear_step;
pub mod margins;
mod riccati;
mod state_space;
mod transfer_function;

pub use frequency_response::{FrequencyResponse, log_space};
pub use linear_step::matrix_of;
pub use riccati::{
    continuous_riccati, continuous_riccati_residual, discrete_riccati, discrete_riccati_residual,
};
pub use state_space::{DiscreteStateSpace, StateSpace, zero_order_hold};
pub use transfer_function::TransferFunction;
pub(crate) use transfer_function::{characteristic_polynomial, numerator_polynomial};
