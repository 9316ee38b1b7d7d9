//! The cameras of the firmware's own tests, at the end of a real cable.
