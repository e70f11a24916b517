//! The FMUs: what is packed, what is published, and what importers make of them.

mod corpus;
mod importers;
mod model_descriptions;
mod packing;
mod ssp;
mod terminals;
