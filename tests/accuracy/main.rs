//! Speeds against their truth, and refusals where there is none to tell.

mod bound;
mod clock;
mod contrast;
mod gyro;
mod lamplit;
mod lapses;
mod layouts;
mod mistaken;
mod neighbours;
mod readout;
mod recordings;
mod series;
mod settling;
mod synthetic;
