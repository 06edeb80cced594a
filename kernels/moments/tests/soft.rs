//! What soft shadows stand on: the blockers that moments tell of, and means from summed-area tables.

use hankel_moments::{
    Blockers, Fixed4, Fixed6, FixedPoint, Moments4, Moments6, Quantized4, Quantized6, Region, Span,
    blockers_2, blockers_4, blockers_6, hamburger_4, hamburger_6, variance_2,
};
use proptest::prelude::*;

fn moment(points: &[(f64, f64)], n: i32) -> f64 {
    points.iter().map(|(z, w)| w * z.powi(n)).sum()
}

fn moments(points: &[(f64, f64)]) -> Moments4<f64> {
    Moments4 {
        b1: moment(points, 1),
        b2: moment(points, 2),
        b3: moment(points, 3),
        b4: moment(points, 4),
    }
}

fn six(points: &[(f64, f64)]) -> Moments6<f64> {
    Moments6 {
        b1: moment(points, 1),
        b2: moment(points, 2),
        b3: moment(points, 3),
        b4: moment(points, 4),
        b5: moment(points, 5),
        b6: moment(points, 6),
    }
}

/// Some depths in [-1, 1], at least 0.1 apart, with shares of at least 1/40.
fn apart(count: usize) -> impl Strategy<Value = Vec<(f64, f64)>> {
    let width = 2.0 / count as f64;
    let one = (0.0..=width - 0.1, 0.1..=1.0_f64);
    prop::collection::vec(one, count).prop_map(move |points| {
        let total: f64 = points.iter().map(|(_, w)| w).sum();
        let place = |i: usize| -1.0 + i as f64 * width;
        let points = points.into_iter().enumerate();
        points
            .map(|(i, (z, w))| (place(i) + z, w / total))
            .collect()
    })
}

fn single(m: Moments4<f64>) -> Moments4<f32> {
    Moments4 {
        b1: m.b1 as f32,
        b2: m.b2 as f32,
        b3: m.b3 as f32,
        b4: m.b4 as f32,
    }
}

/// What is nearer than `z`, by definition.
fn nearer(points: &[(f64, f64)], z: f64) -> Blockers<f64> {
    let nearer = points.iter().filter(|(depth, _)| *depth < z);
    Blockers {
        share: nearer.clone().map(|(_, w)| w).sum(),
        moment: nearer.map(|(depth, w)| w * (z - depth)).sum(),
    }
}

proptest! {
    /// Four moments and one of three depths tell the other two.
    #[test]
    fn three_depths_are_found_from_each_of_them(points in apart(3)) {
        for (z, _) in &points {
            let (found, expected) = (blockers_4(moments(&points), *z), nearer(&points, *z));
            prop_assert!((found.share - expected.share).abs() < 1e-8, "{found:?} {expected:?}");
            prop_assert!((found.moment - expected.moment).abs() < 1e-8, "{found:?} {expected:?}");
            let m = single(moments(&points));
            let found = blockers_4(m, *z as f32);
            // Distances of 0.1 and shares of 1/40 lose three digits of seven.
            prop_assert!((f64::from(found.share) - expected.share).abs() < 1e-2);
            prop_assert!((f64::from(found.moment) - expected.moment).abs() < 1e-2);
        }
    }

    /// Six moments and one of four depths tell the other three.
    #[test]
    fn four_depths_are_found_from_each_of_them(points in apart(4)) {
        for (z, _) in &points {
            let (found, expected) = (blockers_6(six(&points), *z), nearer(&points, *z));
            prop_assert!((found.share - expected.share).abs() < 1e-6, "{found:?} {expected:?}");
            prop_assert!((found.moment - expected.moment).abs() < 1e-6, "{found:?} {expected:?}");
        }
    }

    /// Whatever the moments are, the share is the bound, and the distance is one within the range.
    #[test]
    fn blockers_lie_before_the_receiver(
        points in prop::collection::vec((-1.0..=1.0_f64, 0.05..=1.0_f64), 1..6),
        spread in -6.0..=0.0_f64,
        z in -1.0..=1.0_f64,
    ) {
        let total = moment(&points, 0);
        let spread = 10.0_f64.powf(spread);
        let points: Vec<_> = points.iter().map(|(z, w)| (z * spread, w / total)).collect();
        let (m, six) = (single(moments(&points)), six(&points));
        for z in [z, points[0].0] {
            let found = blockers_4(m, z as f32);
            prop_assert_eq!(found.share, hamburger_4(m, z as f32));
            let distance = f64::from(found.distance(1e-3));
            prop_assert!(found.moment >= 0.0 && distance <= z + 1.0 + 1e-6, "{found:?}");
            let found = blockers_6(six, z);
            prop_assert_eq!(found.share, hamburger_6(six, z).lower);
            let distance = found.distance(1e-3);
            prop_assert!(found.moment >= 0.0 && distance <= z + 1.0 + 1e-12, "{found:?}");
        }
    }

    /// Mean and variance tell a blocker before a receiver that is all of the rest.
    #[test]
    fn two_moments_find_one_blocker(z in -0.9..=1.0_f64, before in 0.05..=1.0_f64, share in 0.05..=0.95_f64) {
        let blocker = z - before * (z + 1.0);
        let points = [(blocker, share), (z, 1.0 - share)];
        let m = moments(&points);
        let (found, expected) = (blockers_2(m.b1, m.b2, z, 0.0), nearer(&points, z));
        prop_assert!((found.share - expected.share).abs() < 1e-9);
        prop_assert!((found.moment - expected.moment).abs() < 1e-9);
        prop_assert_eq!(found.share, variance_2(m.b1, m.b2, z, 0.0));
    }
}

/// A little of the receiver's own depth draws the mean towards it, and keeps it finite.
#[test]
fn few_blockers_are_near() {
    let of = |share: f64| Blockers {
        share,
        moment: share * 0.5,
    };
    assert_eq!(of(0.0).distance(1e-3), 0.0);
    assert_eq!(of(1e-3).distance(1e-3), 0.25);
    assert!((of(1.0).distance(1e-3) - 0.5).abs() < 1e-3);
    assert_eq!(of(0.0).distance(0.0), 0.0);
}

fn region(middle: [f32; 2], reach: [f32; 2], size: [u32; 2]) -> Region {
    Region {
        x: Span::around(middle[0], reach[0], size[0]),
        y: Span::around(middle[1], reach[1], size[1]),
    }
}

/// Texels of a table, and the exact mean over a rectangle of them.
struct Texels {
    size: [u32; 2],
    values: Vec<f32>,
}

impl Texels {
    /// Numbers from 0 to 1 without any order.
    fn of(size: [u32; 2], seed: u32) -> Self {
        let value = |i: u32| ((i * 7919 + seed) % 4099 * 2_654 % 1009) as f32 / 1008.0;
        Self {
            size,
            values: (0..size[0] * size[1]).map(value).collect(),
        }
    }

    /// The sum modulo 2^32 over so many columns and rows.
    fn before(&self, columns: u32, rows: u32, of: impl Fn(f32) -> u32) -> u32 {
        let mut sum = 0_u32;
        for y in 0..rows {
            for x in 0..columns {
                sum = sum.wrapping_add(of(self.values[(y * self.size[0] + x) as usize]));
            }
        }
        sum
    }

    /// In double precision, texel by texel; what is beyond counts as `beyond`.
    fn mean(&self, middle: [f64; 2], reach: [f64; 2], beyond: f64) -> f64 {
        let part = |i: u32, axis: usize| {
            let from = f64::max(f64::from(i), middle[axis] - reach[axis]);
            (f64::min(f64::from(i + 1), middle[axis] + reach[axis]) - from).max(0.0)
        };
        let (mut sum, mut inside) = (0.0, 0.0);
        for y in 0..self.size[1] {
            for x in 0..self.size[0] {
                let area = part(x, 0) * part(y, 1);
                sum += area * f64::from(self.values[(y * self.size[0] + x) as usize]);
                inside += area;
            }
        }
        let all = 4.0 * reach[0] * reach[1];
        (sum + (all - inside) * beyond) / all
    }
}

proptest! {
    /// Three by three rectangles of wrapped sums are the mean that they should be, within the table, at its
    /// edges and beyond, of fewer than one texel's width and of more than all.
    #[test]
    fn a_region_has_its_mean(
        size in [1..13_u32, 1..13_u32],
        middle in [-4.0..=16.0_f32, -4.0..=16.0_f32],
        reach in [0.5..=9.0_f32, 0.5..=9.0_f32],
        seed in 0..1000_u32,
    ) {
        let texels = Texels::of(size, seed);
        // The largest rectangle has 19 x 19 texels: of more, sums would wrap.
        let point = FixedPoint::for_kernel(19 * 19);
        let region = region(middle, reach, size);
        let wide = |p: [f32; 2]| p.map(f64::from);
        // Each channel has other values, and so have the six.
        let factors = [1.0_f32, 0.5, 0.25, 0.125, 0.75, 0.375];
        let sum = |channel: usize, columns, rows| {
            texels.before(columns, rows, |x| point.to_fixed(x * factors[channel]))
        };
        let beyond = 0.625_f32;
        let four = region.mean_4(
            point,
            Quantized4 { r: beyond, g: beyond, b: beyond, a: beyond },
            |c, r| Fixed4 { r: sum(0, c, r), g: sum(1, c, r), b: sum(2, c, r), a: sum(3, c, r) },
        );
        let six = region.mean_6(
            point,
            Quantized6 { r0: beyond, g0: beyond, b0: beyond, r1: beyond, g1: beyond, b1: beyond },
            |c, r| Fixed6 {
                r0: sum(0, c, r), g0: sum(1, c, r), b0: sum(2, c, r),
                r1: sum(3, c, r), g1: sum(4, c, r), b1: sum(5, c, r),
            },
        );
        let found = [four.r, four.g, four.b, four.a];
        let also = [six.r0, six.g0, six.b0, six.r1, six.g1, six.b1];
        let most = 0.5 / f64::from(point.one) + 2e-6;
        for (channel, factor) in factors.into_iter().enumerate() {
            let scaled = Texels { size, values: texels.values.iter().map(|x| x * factor).collect() };
            let expected = scaled.mean(wide(middle), wide(reach), f64::from(beyond));
            let off = (f64::from(also[channel]) - expected).abs();
            prop_assert!(off < most, "{channel}: {also:?} {expected}");
            if channel < 4 {
                prop_assert_eq!(found[channel], also[channel]);
            }
        }
    }

    /// From a quarter of the entries: the mean of all texels that a region touches, with what is beyond the table as in
    /// the region itself.
    #[test]
    fn all_texels_that_a_region_touches_count_alike(
        size in [1..13_u32, 1..13_u32],
        middle in [-4.0..=16.0_f32, -4.0..=16.0_f32],
        reach in [0.5..=9.0_f32, 0.5..=9.0_f32],
        seed in 0..1000_u32,
    ) {
        let texels = Texels::of(size, seed);
        let point = FixedPoint::for_kernel(20 * 20);
        let beyond = 0.625_f32;
        let region = region(middle, reach, size);
        let sum = |columns, rows, factor| texels.before(columns, rows, |x| point.to_fixed(x * factor));
        let four = region.mean_touched_4(
            point,
            Quantized4 { r: beyond, g: beyond, b: beyond, a: beyond },
            |c, r| Fixed4 { r: sum(c, r, 1.0), g: sum(c, r, 0.5), b: sum(c, r, 0.25), a: sum(c, r, 0.125) },
        );
        let six = region.mean_touched_6(
            point,
            Quantized6 { r0: beyond, g0: beyond, b0: beyond, r1: beyond, g1: beyond, b1: beyond },
            |c, r| Fixed6 {
                r0: sum(c, r, 1.0), g0: sum(c, r, 0.5), b0: sum(c, r, 0.25),
                r1: sum(c, r, 0.125), g1: sum(c, r, 0.75), b1: sum(c, r, 0.375),
            },
        );
        let touched = |axis: usize| {
            let edge = size[axis] as f32;
            let on = |x: f32| x.clamp(0.0, edge);
            let (from, to) = (on(middle[axis] - reach[axis]), on(middle[axis] + reach[axis]));
            let share = f64::from(to - from) / (2.0 * f64::from(reach[axis]));
            let first = from.floor().min(edge - 1.0) as u32;
            (first..((to.floor() + 1.0).min(edge) as u32).max(first + 1), share)
        };
        let ((columns, along_x), (rows, along_y)) = (touched(0), touched(1));
        let count = f64::from(columns.end - columns.start) * f64::from(rows.end - rows.start);
        let total: f64 = rows
            .flat_map(|y| columns.clone().map(move |x| (x, y)))
            .map(|(x, y)| f64::from(texels.values[(y * size[0] + x) as usize]))
            .sum();
        let inside = along_x * along_y;
        let most = 0.5 / f64::from(point.one) + 2e-6;
        let found = [four.r, four.g, four.b, four.a, six.g1, six.b1];
        for (found, factor) in found.into_iter().zip([1.0, 0.5, 0.25, 0.125, 0.75, 0.375]) {
            let expected = inside * factor * total / count + (1.0 - inside) * f64::from(beyond);
            prop_assert!((f64::from(found) - expected).abs() < most, "{found} {expected}");
        }
        prop_assert_eq!([four.r, four.g, four.b, four.a], [six.r0, six.g0, six.b0, six.r1]);
    }

    /// No numbers make an index beyond the table.
    #[test]
    fn a_span_stays_on_its_table(middle in any::<f32>(), reach in any::<f32>(), size in 1..=65536_u32) {
        let span = Span::around(middle, reach, size);
        prop_assert!(span.first < span.whole && span.whole <= span.last && span.last <= span.end);
        prop_assert!(span.end <= size, "{span:?}");
        prop_assert!((0.0..=1.0).contains(&span.first_share) && (0.0..=1.0).contains(&span.last_share));
        // A texel at least, but for what is rounded so far off.
        prop_assert!(span.length >= 0.96 && span.inside >= 0.0 && span.inside <= span.length);
    }

    /// Weights have the sum 1 wherever the region is: in a map of 4096 texels its ends are rounded by up to a
    /// 4096th of a texel, and moments of one depth must remain those of one depth.
    #[test]
    fn a_region_of_one_depth_has_its_moments(
        middle in [0.0..=4096.0_f32, 0.0..=4096.0_f32],
        reach in [0.5..=16.0_f32, 0.5..=16.0_f32],
        value in 0.0..=1.0_f32,
    ) {
        let point = FixedPoint::for_kernel(34 * 34);
        let region = region(middle, reach, [4096; 2]);
        let fixed = point.to_fixed(value);
        let all = |n: u32| Fixed4 { r: n, g: n, b: n, a: n };
        let beyond = Quantized4 { r: value, g: value, b: value, a: value };
        let mean = region.mean_4(point, beyond, |columns, rows| {
            all(columns.wrapping_mul(rows).wrapping_mul(fixed))
        });
        let most = 0.5 / f64::from(point.one) + 3e-7;
        prop_assert!((f64::from(mean.r) - f64::from(value)).abs() < most, "{mean:?} {value}");
    }
}
