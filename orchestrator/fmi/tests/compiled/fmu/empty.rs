//! A library without a function of the standard.
