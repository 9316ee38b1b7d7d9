//! What must hold of the tachometer whatever it is given.

mod approach;
mod flicker;
mod folding;
mod hostile_events;
mod late;
mod losses;
mod properties;
mod still;
mod thinned;
mod to_and_fro;
