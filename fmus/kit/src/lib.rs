//! The FMI 2.0 and 3.0 C interfaces, once, for every component
