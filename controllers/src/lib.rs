//! Control laws of a hydraulic shake table: what the computer does
