//! Shake table, actuator, specimen and sensors: what the world does
