//! What must hold of the tachometer whatever it is given.

mod hostile_events;
mod late;
mod properties;
mod still;
mod thinned;
