//! The portable part of the handheld tachometer.
#![no_std]
