//! Random numbers and distributions of depths.

use fastrand::Rng;

use super::Depths;

/// A point of a distribution and its weight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    pub depth: f64,
    pub weight: f64,
}

/// Random numbers of one row.
pub struct Source(Rng);

impl Source {
    /// The same numbers for the same arguments, on every machine.
    pub fn new(family: &str, n: usize, seed: u64, index: u64) -> Self {
        // FNV-1a over everything that tells rows apart; the generator's own seeding mixes it.
        let bytes = family
            .bytes()
            .chain((n as u64).to_le_bytes())
            .chain(seed.to_le_bytes())
            .chain(index.to_le_bytes());
        let hash = bytes.fold(0xcbf2_9ce4_8422_2325_u64, |h, b| {
            (h ^ u64::from(b)).wrapping_mul(0x0100_0000_01b3)
        });
        Self(Rng::with_seed(hash))
    }

    /// In [0, 1).
    pub fn unit(&mut self) -> f64 {
        self.0.f64()
    }

    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// From 10^low to 10^high, every order of magnitude alike.
    pub fn magnitude(&mut self, low: f64, high: f64) -> f64 {
        10.0_f64.powf(self.between(low, high))
    }

    /// A whole number, both ends included.
    pub fn count(&mut self, low: usize, high: usize) -> usize {
        self.0.usize(low..=high)
    }

    pub fn sign(&mut self) -> f64 {
        if self.0.bool() { 1.0 } else { -1.0 }
    }

    /// Standard normal (Box and Muller).
    pub fn normal(&mut self) -> f64 {
        // 1 - [0, 1) is never 0.
        let radius = (-2.0 * (1.0 - self.unit()).ln()).sqrt();
        radius * (std::f64::consts::TAU * self.unit()).cos()
    }

    pub fn pick<T: Copy>(&mut self, from: &[T]) -> T {
        from[self.0.usize(..from.len())]
    }

    /// Depths anywhere in a range.
    pub fn scattered(&mut self, depths: Depths, count: usize) -> Vec<Point> {
        let (low, high) = depths.ends();
        (0..count)
            .map(|_| Point {
                depth: self.between(low, high),
                weight: self.between(0.05, 1.0),
            })
            .collect()
    }

    /// A surface of `count` texels about `centre`, the farthest two `spread` apart at most.
    pub fn surface(&mut self, centre: f64, spread: f64, count: usize, share: f64) -> Vec<Point> {
        let weights: Vec<f64> = (0..count).map(|_| self.between(0.2, 1.0)).collect();
        let total: f64 = weights.iter().sum();
        weights
            .iter()
            .map(|w| Point {
                depth: centre + spread * self.between(-0.5, 0.5),
                weight: w / total * share,
            })
            .collect()
    }

    /// Two surfaces of spread 1e-4 to 1e-2, and a query near, in or between them.
    pub fn silhouettes(&mut self, depths: Depths, n: usize) -> (Vec<Point>, f64) {
        let (low, high) = depths.ends();
        let length = high - low;
        let inside = |s: &mut Self| s.between(low + 0.02 * length, high - 0.02 * length);
        let (mut near, mut far) = (inside(self), inside(self));
        while (far - near).abs() < 0.05 * length {
            far = inside(self);
        }
        if far < near {
            std::mem::swap(&mut near, &mut far);
        }
        let share = self.between(0.05, 0.95);
        let spread = [self.magnitude(-4.0, -2.0), self.magnitude(-4.0, -2.0)];
        let counts = [self.count(n, 4 * n), self.count(n, 4 * n)];
        let mut points = self.surface(near, spread[0], counts[0], share);
        points.extend(self.surface(far, spread[1], counts[1], 1.0 - share));
        let side = self.count(0, 1);
        let centre = [near, far][side];
        let query = match self.count(0, 2) {
            0 => centre + self.sign() * spread[side] * self.between(0.5, 10.0),
            1 => centre + spread[side] * self.between(-0.5, 0.5),
            _ => self.between(near, far),
        };
        (points, query)
    }

    /// One surface of spread 1e-3 to 3e-2, and a query within it.
    pub fn own_surface(&mut self, depths: Depths, n: usize) -> (Vec<Point>, f64) {
        let (low, high) = depths.ends();
        let spread = self.magnitude(-3.0, 3e-2_f64.log10());
        let centre = self.between(low + spread, high - spread);
        let count = self.count(n + 1, 6 * n);
        let points = self.surface(centre, spread, count, 1.0);
        (points, centre + spread * self.between(-0.5, 0.5))
    }
}
