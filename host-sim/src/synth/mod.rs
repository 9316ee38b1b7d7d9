//! Recordings with known truth, made from a scene.
