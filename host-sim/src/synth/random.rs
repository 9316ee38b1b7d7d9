//! Random numbers that depend on the seed and the place they are used in, never on the order of the threads.

use rand::SeedableRng as _;
use rand_distr::{Distribution as _, StandardNormal};
use rand_pcg::Pcg64Mcg;

/// What a stream of random numbers is for: different purposes never share numbers.
#[derive(Clone, Copy, Debug)]
pub enum Purpose {
    /// Phases and frequencies of all motion.
    Motion = 1,
    /// The fixed properties of one pixel.
    Pixel = 2,
    /// Jitter, losses and noise of one pixel.
    Events = 3,
    /// Texture behind the rotors.
    Texture = 4,
    /// Which pixels are hot.
    Hot = 5,
    /// Noise of the gyro.
    Gyro = 6,
    /// The clock's error.
    Clock = 7,
    /// Where a rotor's blades sit.
    Blades = 8,
}

/// The stream for a purpose and a place (a pixel's number, for one).
pub fn stream(seed: u64, purpose: Purpose, place: u64) -> Pcg64Mcg {
    // SplitMix64's finaliser: neighbouring places get unrelated streams.
    let mut z = seed
        .wrapping_mul(0x9e37_79b9_7f4a_7c15)
        .wrapping_add((purpose as u64) << 56)
        .wrapping_add(place.wrapping_mul(0xd134_2543_de82_ef95));
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    Pcg64Mcg::seed_from_u64(z ^ (z >> 31))
}

/// A draw from the standard normal distribution.
pub fn normal(rng: &mut Pcg64Mcg) -> f64 {
    StandardNormal.sample(rng)
}
