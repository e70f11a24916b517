//! The loops' margins and frequency responses.

pub(crate) mod page;
