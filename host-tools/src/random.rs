//! Seeded random numbers, the same on every machine.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

/// A stream of random numbers. Streams of different `purpose` are independent of each other,
/// so that one more draw here does not change what is drawn there.
pub struct Random {
    bits: ChaCha8Rng,
    spare: Option<f64>,
}

impl Random {
    /// Numbers of `seed` for one purpose.
    pub fn new(seed: u64, purpose: u64) -> Self {
        let mut bits = ChaCha8Rng::seed_from_u64(seed);
        bits.set_stream(purpose);
        Self { bits, spare: None }
    }

    /// Uniform in [0, 1).
    pub fn unit(&mut self) -> f64 {
        // 53 bits, every one of them exact in f64.
        (self.bits.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Uniform in [low, high).
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// One of 0 .. count; 0 for none.
    pub fn below(&mut self, count: usize) -> usize {
        ((self.unit() * count as f64) as usize).min(count.saturating_sub(1))
    }

    /// -1 or +1.
    pub fn sign(&mut self) -> f64 {
        if self.unit() < 0.5 { -1.0 } else { 1.0 }
    }

    /// Standard normal (Marsaglia's polar method).
    pub fn normal(&mut self) -> f64 {
        if let Some(spare) = self.spare.take() {
            return spare;
        }
        loop {
            let (u, v) = (self.between(-1.0, 1.0), self.between(-1.0, 1.0));
            let s = u * u + v * v;
            if s > 0.0 && s < 1.0 {
                let factor = libm::sqrt(-2.0 * libm::log(s) / s);
                self.spare = Some(v * factor);
                return u * factor;
            }
        }
    }

    /// Normal with deviation `sigma`, drawn again beyond three of them.
    pub fn deviation(&mut self, sigma: f64) -> f64 {
        loop {
            let x = self.normal();
            if x.abs() < 3.0 {
                return sigma * x;
            }
        }
    }

    /// Student's t with `freedom` degrees of freedom, scaled to unit variance where it has
    /// one (more than two).
    pub fn student(&mut self, freedom: u32) -> f64 {
        let x = self.normal();
        let squares: f64 = (0..freedom).map(|_| self.normal()).map(|y| y * y).sum();
        let nu = f64::from(freedom);
        let spread = if freedom > 2 { (nu - 2.0) / nu } else { 1.0 };
        x * libm::sqrt(spread * nu / squares.max(f64::MIN_POSITIVE))
    }

    /// A direction in space, unit.
    pub fn direction(&mut self) -> [f64; 3] {
        loop {
            let v = [self.normal(), self.normal(), self.normal()];
            let norm = libm::sqrt(v.iter().map(|x| x * x).sum());
            if norm > 0.1 {
                return v.map(|x| x / norm);
            }
        }
    }
}
