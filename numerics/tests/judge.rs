//! The linear programme, its functions of depth, and its simplex method.

use std::fs;

use hankel_moments::{Moments4, hamburger_4, hausdorff_4, variance_2};
use proptest::prelude::*;

use hankel_numerics::judge::{
    DepthFunction, Judge, JudgeError, Judged, Range, Region, evaluate, regions, table,
};

/// Private to the library, and compiled once more for their own tests.
#[path = "../src/judge/candidates.rs"]
#[allow(dead_code, reason = "not everything is tested here")]
mod candidates;
#[path = "../src/judge/simplex.rs"]
#[allow(dead_code, reason = "not everything is tested here")]
mod simplex;

/// Depths with weights.
type Distribution = Vec<(f64, f64)>;

/// One to `most` depths in [0, 1], with weights that add up to 1.
fn distribution(most: usize) -> impl Strategy<Value = Distribution> {
    prop::collection::vec((0.0..=1.0_f64, 0.05..=1.0_f64), 1..=most).prop_map(|points| {
        let total: f64 = points.iter().map(|p| p.1).sum();
        points.into_iter().map(|(z, w)| (z, w / total)).collect()
    })
}

fn moments(d: &[(f64, f64)], functions: &[DepthFunction]) -> Vec<f64> {
    let mean = |f: &dyn Fn(f64) -> f64| -> f64 { d.iter().map(|(z, w)| w * f(*z)).sum() };
    std::iter::once(mean(&|_| 1.0))
        .chain(functions.iter().map(|f| mean(&|z| f.eval(z))))
        .collect()
}

fn powers(count: usize, range: Range) -> (Vec<DepthFunction>, Judge) {
    let functions = DepthFunction::powers(count).unwrap();
    let judge = Judge::new(&functions, range).unwrap();
    (functions, judge)
}

/// The weight strictly below, and the weight at or below.
fn below(d: &[(f64, f64)], z: f64) -> (f64, f64) {
    let sum = |f: &dyn Fn(f64) -> bool| d.iter().filter(|p| f(p.0)).map(|p| p.1).sum();
    (sum(&|x| x < z), sum(&|x| x <= z))
}

/// What additions of shares round off.
const ROUNDED: f64 = 1e-14;

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, failure_persistence: None, ..ProptestConfig::default() })]

    /// Two moments: Cantelli's inequality, for any total weight.
    #[test]
    fn two_moments_give_cantelli(
        mean in -10.0..10.0_f64,
        deviation in 0.01..10.0_f64,
        z in -30.0..30.0_f64,
        mass in prop::sample::select(vec![1e-30, 0.5, 1.0, 1e30]),
    ) {
        let (_, judge) = powers(2, Range::Line);
        let m = [mass, mass * mean, mass * (mean * mean + deviation * deviation)];
        let judged = judge.bounds(&m, z).unwrap();
        let d = z - mean;
        let far = deviation * deviation / (deviation * deviation + d * d);
        let (lower, upper) = if d > 0.0 { (1.0 - far, 1.0) } else { (0.0, far) };
        prop_assert!((judged.lower - mass * lower).abs() <= judged.margin, "{judged:?}");
        prop_assert!((judged.upper - mass * upper).abs() <= judged.margin, "{judged:?}");
        prop_assert!(judged.margin < 1e-6 * mass, "{judged:?}");
    }

    /// The bounds hold for the distribution that the moments are of.
    #[test]
    fn bounds_enclose_the_distribution(
        d in distribution(8),
        z in 0.0..=1.0_f64,
        n in 1..=6_usize,
        is_line in any::<bool>(),
    ) {
        let range = if is_line { Range::Line } else { Range::UNIT };
        let (functions, judge) = powers(2 * n, range);
        // On the line a narrow distribution's moments are nothing but rounding.
        match judge.bounds(&moments(&d, &functions), z) {
            Ok(judged) => {
                let (below, at) = below(&d, z);
                prop_assert!(judged.lower <= below + ROUNDED, "{judged:?} {below}");
                prop_assert!(judged.upper >= at - ROUNDED, "{judged:?} {at}");
            }
            Err(error) => prop_assert!(is_line && error == JudgeError::EvenMoment, "{error}"),
        }
    }

    /// The kernels' closed forms for four moments and two, by a road that shares nothing with them.
    /// They lift nearly singular Hankel matrices, which costs at most the square root of what is
    /// added, 4e-8, over the distance of the depths.
    #[test]
    fn closed_forms_agree(d in distribution(6), z in 0.0..=1.0_f64) {
        const LIFTED: f64 = 1e-6;
        let (functions, judge) = powers(4, Range::UNIT);
        let m = moments(&d, &functions);
        let unit = judge.bounds(&m, z).unwrap();
        let line = Judge::new(&functions, Range::Line).unwrap().bounds(&m, z).unwrap();
        let two = Judge::new(&functions[..2], Range::Line).unwrap().bounds(&m[..3], z).unwrap();
        let b = Moments4 { b1: m[1], b2: m[2], b3: m[3], b4: m[4] };
        let error = |a: f64, judged: &Judged| (a - judged.lower).abs() - judged.margin;
        prop_assert!(error(hausdorff_4(b, z), &unit) <= LIFTED, "{unit:?}");
        prop_assert!(error(hamburger_4(b, z), &line) <= LIFTED, "{line:?}");
        prop_assert!(error(variance_2(m[1], m[2], z, 0.0), &two) <= LIFTED, "{two:?}");
        // More knowledge, tighter bounds.
        prop_assert!(two.lower <= line.lower + line.margin && line.lower <= unit.lower + unit.margin);
        prop_assert!(unit.upper <= line.upper + unit.margin && line.upper <= two.upper + line.margin);
    }

    /// The margin says what is lost with the paper's three rounds.
    #[test]
    fn margins_hold_early(d in distribution(8), z in 0.0..=1.0_f64, count in 1..=8_usize) {
        let (functions, judge) = powers(count, Range::UNIT);
        let m = moments(&d, &functions);
        let exact = judge.bounds(&m, z).unwrap();
        for rounds in 1..=3 {
            let early = judge.clone().rounds(rounds).bounds(&m, z).unwrap();
            let allowed = early.margin + exact.margin;
            prop_assert!((early.lower - exact.lower).abs() <= allowed, "{early:?} {exact:?}");
            prop_assert!((early.upper - exact.upper).abs() <= allowed, "{early:?} {exact:?}");
        }
    }
}

/// A distribution of at most n depths is the only one with its 2n moments: the bounds are its
/// weights strictly below and at or below, on its depths as well.
#[test]
fn few_depths_are_known_exactly() {
    let d = vec![(0.2, 0.25), (0.55, 0.5), (0.8, 0.25)];
    for range in [Range::UNIT, Range::Line] {
        let (functions, judge) = powers(6, range);
        let m = moments(&d, &functions);
        for z in [0.05, 0.3, 0.45, 0.7, 0.9, 1.0] {
            let judged = judge.bounds(&m, z).unwrap();
            let (below, at) = below(&d, z);
            assert!(
                (judged.lower - below).abs() < 1e-6,
                "{range:?} {z} {judged:?}"
            );
            assert!((judged.upper - at).abs() < 1e-6, "{range:?} {z} {judged:?}");
        }
    }
    // One depth, with its moments exactly in f64, and the query on it.
    for range in [Range::UNIT, Range::Line] {
        let (_, judge) = powers(2, range);
        let judged = judge.bounds(&[1.0, 0.5, 0.25], 0.5).unwrap();
        assert!(
            judged.lower < 1e-6 && judged.upper > 1.0 - 1e-6,
            "{judged:?}"
        );
    }
}

#[test]
fn supports_have_the_moments() {
    let d = vec![(0.1, 0.3), (0.35, 0.2), (0.6, 0.1), (0.9, 0.4)];
    for (functions, range) in [
        (DepthFunction::powers(4).unwrap(), Range::UNIT),
        (DepthFunction::powers(4).unwrap(), Range::Line),
        (DepthFunction::trigonometric(2).unwrap(), Range::UNIT),
    ] {
        let judge = Judge::new(&functions, range).unwrap();
        let m = moments(&d, &functions);
        let judged = judge.bounds(&m, 0.5).unwrap();
        for support in [&judged.lower_support, &judged.upper_support] {
            let points: Distribution = support.iter().map(|p| (p.depth, p.weight)).collect();
            for (a, b) in moments(&points, &functions).iter().zip(&m) {
                assert!((a - b).abs() < 1e-6, "{range:?} {support:?}");
            }
        }
        let weight: f64 = judged
            .lower_support
            .iter()
            .filter(|p| p.depth < 0.5)
            .map(|p| p.weight)
            .sum();
        assert!((weight - judged.lower).abs() < 1e-6, "{judged:?}");
    }
}

/// Any one of the candidates, and pairs of different kinds.
#[test]
fn every_candidate_can_be_judged() {
    let d = vec![(0.15, 0.25), (0.4, 0.25), (0.75, 0.5)];
    for (i, function) in DepthFunction::ALL.into_iter().enumerate() {
        let other = DepthFunction::ALL[(i + 9) % 37];
        for functions in [vec![function], vec![function, other]] {
            let judge = Judge::new(&functions, Range::UNIT).unwrap();
            let m = moments(&d, &functions);
            for z in [0.3, 0.6] {
                let judged = judge.bounds(&m, z).unwrap();
                let (below, at) = below(&d, z);
                assert!(judged.lower <= below + ROUNDED, "{functions:?} {judged:?}");
                assert!(judged.upper >= at - ROUNDED, "{functions:?} {judged:?}");
                assert!(judged.margin < 1e-6, "{functions:?} {judged:?}");
            }
        }
    }
}

/// A mean alone, on an interval: Markov's inequality.
#[test]
fn one_moment_gives_markov() {
    let (_, judge) = powers(1, Range::UNIT);
    for (mean, z) in [(0.25, 0.5), (0.25, 0.2), (0.7, 0.9), (0.7, 0.3)] {
        let judged = judge.bounds(&[2.0, 2.0 * mean], z).unwrap();
        let lower = 2.0 * (1.0 - mean / z).max(0.0);
        let upper = 2.0 * ((1.0 - mean) / (1.0 - z)).min(1.0);
        assert!(
            (judged.lower - lower).abs() <= judged.margin,
            "{judged:?} {lower}"
        );
        assert!(
            (judged.upper - upper).abs() <= judged.margin,
            "{judged:?} {upper}"
        );
        assert!(judged.margin < 1e-9, "{judged:?}");
    }
}

/// Four surfaces near an end of the range, a thousandth of it apart and less: the solver misses their moments by so much
/// that an estimate of the margin is too small. What is said to be proved must hold; of those in the middle of the range
/// all is proved.
#[test]
fn margins_are_proved_where_the_moments_are_met() {
    let (functions, judge) = powers(4, Range::UNIT);
    for (offset, scale, z, expected) in [
        (0.0, 1.0, 0.008, 0.516_948_863_5),
        (0.0, 1e-1, 8e-4, 0.516_948_863_5),
        (0.5, 1.0, 0.508, 0.516_948_863_5),
        (0.0, 1e-4, 5e-7, 0.360_18),
        (0.0, 1e-4, 1.3e-6, 0.967_63),
    ] {
        let points = [0.001, 0.003, 0.006, 0.01].map(|x| (offset + scale * x, 0.25));
        let judged = judge.bounds(&moments(&points, &functions), z).unwrap();
        let error = (judged.lower - expected).abs();
        assert!(
            judged.residual > 0.0 || error <= judged.margin + 1e-5,
            "{z}: {expected} {judged:?}"
        );
    }
    let points = [0.1, 0.3, 0.6, 0.9].map(|x| (x, 0.25));
    for z in [0.2, 0.5, 0.8] {
        let judged = judge.bounds(&moments(&points, &functions), z).unwrap();
        assert!(judged.residual == 0.0 && judged.margin < 1e-6, "{judged:?}");
    }
}

#[test]
fn queries_beyond_the_range_know_everything() {
    let (_, judge) = powers(2, Range::SYMMETRIC);
    let m = [3.0, 0.6, 0.9];
    for z in [-1.5, f64::NEG_INFINITY] {
        let judged = judge.bounds(&m, z).unwrap();
        assert!(
            judged.lower == 0.0 && judged.upper <= judged.margin,
            "{judged:?}"
        );
    }
    for z in [1.5, f64::INFINITY] {
        let judged = judge.bounds(&m, z).unwrap();
        assert!(
            judged.upper == 3.0 && judged.lower >= 3.0 - judged.margin,
            "{judged:?}"
        );
    }
    // At the ends themselves a weight may lie on the query.
    let judged = judge.bounds(&m, 1.0).unwrap();
    assert!(judged.lower < 2.9 && judged.upper == 3.0, "{judged:?}");
    let judged = judge.bounds(&m, -1.0).unwrap();
    assert!(judged.lower == 0.0 && judged.upper > 0.1, "{judged:?}");
}

/// The error tells how far moments are from possible, in proportion.
#[test]
fn impossible_moments_are_at_a_distance() {
    for range in [Range::UNIT, Range::Line] {
        let (_, judge) = powers(4, range);
        let distance = |short: f64| {
            // A variance that is negative by `short`.
            match judge.bounds(&[1.0, 0.5, 0.25 - short, 0.14, 0.09], 0.4) {
                Err(JudgeError::Infeasible { distance }) => distance,
                other => panic!("{range:?} {short}: {other:?}"),
            }
        };
        assert!(distance(0.05) > 1e-3);
        assert!(distance(0.1) > 1.3 * distance(0.05));
    }
    let (_, judge) = powers(2, Range::UNIT);
    let impossible = [1.0, 1.25, 1.6];
    let early = judge.clone().rounds(3).bounds(&impossible, 0.5).unwrap();
    assert!(early.margin == 1.0 && early.residual > 1e-3, "{early:?}");
    let error = judge.bounds(&impossible, 0.5).unwrap_err().to_string();
    assert!(error.contains("away"), "{error}");
    // Depths outside of the range, though a distribution on the line has the moments.
    assert!(
        Judge::new(&DepthFunction::powers(2).unwrap(), Range::Line)
            .unwrap()
            .bounds(&impossible, 0.5)
            .is_ok()
    );
}

#[test]
fn misuse_is_explained() {
    use DepthFunction as F;
    let new = |f: &[F], range| Judge::new(f, range).map(|_| ()).unwrap_err().to_string();
    let interval = |low, high| Range::Interval { low, high };
    for (error, words) in [
        (new(&[], Range::UNIT), "1 to 16"),
        (new(&[F::Power(2)], Range::Line), "even power"),
        (new(&[F::Power(1)], Range::Line), "even power"),
        (
            new(&[F::Root(2)], Range::SYMMETRIC),
            "z^(1/2) has no finite value at depth -1",
        ),
        (new(&[F::Reciprocal(1)], Range::SYMMETRIC), "1/(z+1)"),
        (new(&[F::Power(1)], interval(1.0, 0.0)), "no range"),
        (new(&[F::Power(1)], interval(f64::NAN, 0.0)), "no range"),
        (
            new(&[F::Sine(1), F::Sine(1)], Range::UNIT),
            "sin(2pi*z) is a combination",
        ),
        (
            new(
                &[F::Exponential(1), F::HyperbolicSine, F::HyperbolicCosine],
                Range::UNIT,
            ),
            "cosh(z) is a combination",
        ),
    ] {
        assert!(error.contains(words), "{error}");
    }
    let (_, judge) = powers(2, Range::UNIT);
    for (m, z, words) in [
        (&[1.0, 0.5][..], 0.5, "3 are wanted"),
        (&[1.0, f64::NAN, 0.3], 0.5, "m1 = NaN"),
        (&[0.0, 0.0, 0.0], 0.5, "m0 = 0"),
        (&[-1.0, 0.5, 0.3], 0.5, "m0 = -1"),
        (&[1.0, 0.5, 0.3], f64::NAN, "z = NaN"),
    ] {
        let error = judge.bounds(m, z).unwrap_err().to_string();
        assert!(error.contains(words), "{error}");
    }
}

/// What the paper says of its ranking, on other regions: four power moments are close to the best,
/// the trigonometric ones have an "excellent error", and with their frequencies doubled they have
/// the "largest measured error". It has the bound as always zero up to 3/4; what is certain is 1/2, as
/// each depth has the values of another one, half the range further.
#[test]
fn candidates_rank_as_in_the_paper() {
    let regions = regions(60, 7);
    let evaluated = |names: &[&str]| {
        let functions: Vec<DepthFunction> = names.iter().map(|n| n.parse().unwrap()).collect();
        let evaluation = evaluate(&functions, &regions).unwrap();
        assert!(evaluation.margin < 1e-3, "{names:?} {evaluation:?}");
        evaluation.mean
    };
    let hamburger = evaluated(&["z", "z^2", "z^3", "z^4"]);
    let trigonometric = evaluated(&["cos(2pi*z)", "sin(2pi*z)", "cos(4pi*z)", "sin(4pi*z)"]);
    let variance = evaluated(&["z", "z^2"]);
    let one = evaluated(&["z"]);
    let doubled = ["sin(4pi*z)", "cos(4pi*z)", "sin(8pi*z)", "cos(8pi*z)"];
    let worst = evaluated(&doubled);
    assert!(2.0 * hamburger.max(trigonometric) < variance);
    assert!(2.0 * variance < one && one < worst);

    let functions = doubled.map(|n| n.parse().unwrap());
    let judge = Judge::new(&functions, Range::UNIT).unwrap();
    for region in regions.iter().filter(|r| r.receiver <= 0.5) {
        let judged = judge.bounds(&region.moments(&functions), region.receiver);
        let lower = judged.unwrap().lower;
        assert!(lower < 1e-6, "{region:?} {lower}");
    }
}

#[test]
fn regions_are_the_seeds() {
    assert_eq!(regions(5, 1), regions(5, 1));
    assert_ne!(regions(5, 1), regions(5, 2));
    for region in regions(200, 3) {
        let total: f64 = region.depths.iter().map(|p| p.weight).sum();
        assert!((total - 1.0).abs() < 1e-12);
        assert!(region.depths.iter().all(|p| (0.0..=1.0).contains(&p.depth)));
        assert!((0.0..=1.0).contains(&region.shadow()));
    }
}

#[test]
fn tables_are_judged_row_by_row() {
    let folder = tempfile::tempdir().unwrap();
    let input = folder.path().join("rows.csv");
    let output = folder.path().join("out.csv");
    let (_, judge) = powers(2, Range::Line);
    fs::write(&input, "z,m0,m1,m2\n0.9,1,0.5,0.34\n0.1,2,1,0.68\n").unwrap();
    let mut last = 0;
    let rows = table(&judge, &input, &output, &mut |rows| last = rows).unwrap();
    assert_eq!((rows, last), (2, 2));
    let text = fs::read_to_string(&output).unwrap();
    let lines: Vec<Vec<f64>> = text
        .lines()
        .skip(1)
        .map(|line| line.split(',').map(|x| x.parse().unwrap()).collect())
        .collect();
    assert_eq!(text.lines().next(), Some("lower,upper,margin,residual"));
    for (line, (lower, upper)) in lines.iter().zip([(0.64, 1.0), (0.0, 0.72)]) {
        assert!(
            (line[0] - lower).abs() <= line[2] && (line[1] - upper).abs() <= line[2],
            "{text}"
        );
    }
}

#[test]
fn bad_tables_are_explained_and_nothing_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let input = folder.path().join("rows.csv");
    let output = folder.path().join("out.csv");
    let (_, judge) = powers(2, Range::Line);
    for (text, words) in [
        ("", "no header"),
        ("m0,m1,z\n1,0.5,0.5\n", "`m2`"),
        ("m0,m1,m2,z,m3\n1,0.5,0.3,0.5,1\n", "`m3`"),
        ("m0,m1,m1,m2,z\n", "two columns `m1`"),
        (
            "m0,m1,m2,z\n1,0.5,0.3,0.5\n1,0.5,x,0.5\n",
            "row 2 (line 3), column `m2`: `x`",
        ),
        ("m0,m1,m2,z\n1,0.5,inf,0.5\n", "not finite"),
        ("m0,m1,m2,z\n1,0.5,,0.5\n", "empty"),
        ("m0,m1,m2,z\n1,0.5\n", "2 cells"),
        ("m0,m1,m2,z\n1,0.5,0.3,0.5\n1,0.5,0.2,0.5\n", "row 2"),
    ] {
        fs::write(&input, text).unwrap();
        let error = table(&judge, &input, &output, &mut |_| {})
            .unwrap_err()
            .to_string();
        assert!(error.contains(words), "{text}: {error}");
        assert!(!output.exists());
    }
    let nowhere = folder.path().join("nowhere.csv");
    let error = table(&judge, &nowhere, &output, &mut |_| {}).unwrap_err();
    assert!(error.to_string().contains("nowhere.csv"), "{error}");
    let error = table(&judge, &input, folder.path(), &mut |_| {}).unwrap_err();
    assert!(error.to_string().contains("folder"), "{error}");
}

#[test]
fn names_are_distinct_and_read_back() {
    for (i, function) in DepthFunction::ALL.into_iter().enumerate() {
        let name = function.to_string();
        assert_eq!(name.parse::<DepthFunction>().unwrap(), function);
        assert!(
            DepthFunction::ALL[..i]
                .iter()
                .all(|f| f.to_string() != name),
            "{name}"
        );
    }
    assert_eq!(
        " asin( 2z - 1 )".parse::<DepthFunction>().unwrap(),
        DepthFunction::ArcsineOfUnit
    );
    assert_eq!(
        "z^10".parse::<DepthFunction>().unwrap(),
        DepthFunction::Power(10)
    );
    let error = "z^17".parse::<DepthFunction>().unwrap_err().to_string();
    assert!(error.contains("z^17") && error.contains("z^16"), "{error}");
}

/// Every candidate is continuous on the paper's range of depths.
#[test]
fn candidates_are_finite_on_the_unit_interval() {
    for function in DepthFunction::ALL {
        for i in 0..=100 {
            let z = f64::from(i) / 100.0;
            assert!(function.is_defined(z), "{function} at {z}");
            assert!(function.eval(z).is_finite(), "{function} at {z}");
        }
    }
}

#[test]
fn values_are_those_of_the_formulas() {
    for (name, z, value) in [
        ("z^8", 0.5, 1.0 / 256.0),
        ("z^(1/2)", 0.25, 0.5),
        ("z^(1/3)", 0.125, 0.5),
        ("z^(1/4)", 0.0625, 0.5),
        ("1/(z+1)", 0.25, 0.8),
        ("1/(z+1)^4", 1.0, 1.0 / 16.0),
        ("exp(4z)", 0.25, std::f64::consts::E),
        ("log(z+1)", 1.0, std::f64::consts::LN_2),
        ("log(z+3)", 1.0, 2.0 * std::f64::consts::LN_2),
        ("sin(8pi*z)", 1.0 / 16.0, 1.0),
        ("cos(2pi*z)", 0.5, -1.0),
        ("cosh(z)", 0.0, 1.0),
        ("sinh(z)", 1.0, 1.175_201_193_643_801_5),
        ("asin(z)", 1.0, std::f64::consts::FRAC_PI_2),
        ("asin(2z-1)", 0.0, -std::f64::consts::FRAC_PI_2),
        ("atan(z)", 1.0, std::f64::consts::FRAC_PI_4),
        ("exp(-z^2)", 1.0, (-1.0_f64).exp()),
    ] {
        let found = name.parse::<DepthFunction>().unwrap().eval(z);
        assert!((found - value).abs() < 1e-14, "{name}: {found}");
    }
}
