//! Random numbers that are the same on every machine.

/// A linear congruential generator (Knuth's MMIX multiplier), used by its upper bits.
#[derive(Clone, Debug)]
pub struct Draws(u64);

impl Draws {
    /// The sequence that belongs to `seed`.
    pub fn seeded(seed: u64) -> Self {
        let mut draws = Self(seed);
        // The first state is the seed nearly unmixed.
        draws.bits();
        draws
    }

    fn bits(&mut self) -> u64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        self.0
    }

    /// Uniform in [-1, 1), a multiple of 2^-23: exact in `f32` and `f64`.
    pub fn symmetric(&mut self) -> f32 {
        let upper = (self.bits() >> 40) as u32;
        upper as f32 * (1.0 / 8_388_608.0) - 1.0
    }
}
