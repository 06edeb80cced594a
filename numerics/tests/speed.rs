//! A small measurement, end to end, without anything that only some machines have.

use std::path::Path;

use hankel_dsl::{Real, lit};
use hankel_numerics::families::{Family, ORDERS, Precision, Row};
use hankel_numerics::peer::{Peer, PeerError, Quantity, default_python};
use hankel_numerics::report::{Cell, Report};
use hankel_numerics::speed::count::{Counted, Operations, TOGETHER, operations_of, per_row};
use hankel_numerics::speed::{
    Options, Quantiles, Solver, Speed, SpeedError, Timing, measure, serve,
};
use hankel_numerics::stress::bounds_of;

fn small() -> Options {
    Options {
        orders: vec![1, 2],
        rows: 500,
        rounds: 2,
        error_rows: 300,
        ..Options::quick()
    }
}

#[test]
fn every_kernel_is_measured_in_every_way() {
    let mut steps = 0;
    let speed = measure(&small(), &mut |_| steps += 1).unwrap();
    assert!(steps > 8, "{steps} steps");
    assert!(speed.peer.is_none());
    let threads = speed.limits.threads;
    for (n, solvers) in [
        (1, &[Solver::Plain, Solver::Adjoint][..]),
        (2, &Solver::OWN),
    ] {
        for precision in [Precision::F32, Precision::F64] {
            for solver in solvers {
                for (path, threads) in [
                    ("scalar", 1),
                    (speed.level.as_str(), 1),
                    (speed.level.as_str(), threads),
                ] {
                    let time = speed.time(*solver, n, precision, path, threads);
                    let time = time.unwrap_or_else(|| {
                        panic!("no time of {solver:?} {n} {precision} {path} {threads}")
                    });
                    // Between a tenth of a nanosecond and a millisecond for a row.
                    assert!((0.1..1e6).contains(&time), "{solver:?} {n}: {time} ns");
                }
            }
        }
    }
    for timing in &speed.timings {
        assert!(timing.times.len() >= 2 && timing.least() <= timing.median());
    }
    counts(&speed);
    limits(&speed);
    errors(&speed);
    files(&speed);
}

/// Bytes and operations, where they are known.
fn counts(speed: &Speed) {
    let of = |solver, n| {
        speed
            .work
            .iter()
            .find(|w| (w.solver, w.n, w.precision) == (solver, n, Precision::F32))
            .unwrap()
    };
    // Moments and query in, bound out; an adjoint has one more in and as many derivatives out.
    assert_eq!(of(Solver::Plain, 1).bytes, (3 + 1 + 1) * 4);
    assert_eq!(of(Solver::Plain, 2).bytes, (5 + 1 + 1) * 4);
    assert_eq!(of(Solver::Adjoint, 2).bytes, (5 + 1 + 1 + 5 + 1) * 4);
    let operations = |solver, n| of(solver, n).operations;
    // No bound without a quotient; more moments are more work, derivatives and error terms too.
    assert!(operations(Solver::Plain, 1).quotients >= 1.0);
    let flops = |solver, n| operations(solver, n).flops();
    assert!(flops(Solver::Plain, 2) > flops(Solver::Plain, 1));
    assert!(flops(Solver::Compensated, 2) > flops(Solver::Plain, 2));
    assert!(flops(Solver::Adjoint, 2) > flops(Solver::Plain, 2));
    assert!(flops(Solver::CompensatedAdjoint, 2) > flops(Solver::Adjoint, 2));
}

/// A kernel does not beat what the machine can do. Measured limits scatter on a busy machine, and
/// 500 rows lie in a cache, so this is about arithmetic and has room.
fn limits(speed: &Speed) {
    for bandwidth in speed.limits.bandwidth {
        assert!((1e8..1e14).contains(&bandwidth.best()), "{bandwidth:?}");
    }
    for peak in &speed.limits.peaks {
        // A sum is never slower than a quotient.
        assert!(
            peak.simple > peak.divisions && peak.simple > peak.roots,
            "{peak:?}"
        );
        assert!((1e8..1e13).contains(&peak.simple), "{peak:?}");
    }
    for work in &speed.work {
        let (memory, arithmetic) = speed.least_possible(work).unwrap();
        assert!(memory > 0.0 && arithmetic > 0.0);
        let time = speed.time(work.solver, work.n, work.precision, &speed.level, 1);
        assert!(
            time.unwrap() > 0.5 * arithmetic,
            "{work:?}: {time:?} ns, at least {arithmetic}"
        );
    }
}

/// Errors are those of a working kernel.
fn errors(speed: &Speed) {
    assert_eq!(speed.errors.len(), 2 * 2 * (2 + 2));
    for e in &speed.errors {
        assert_eq!(e.not_finite, 0, "{e:?}");
        assert!(e.rows > 250, "{e:?}");
        let q = e.quantiles;
        assert!(q.median <= q.ninety && q.ninety <= q.ninety_nine && q.ninety_nine <= q.greatest);
        if e.family == "paper" {
            let epsilon = match e.precision {
                Precision::F32 => f64::from(f32::EPSILON),
                Precision::F64 => f64::EPSILON,
            };
            assert!(
                q.median < 2.0 * epsilon && q.ninety < 20.0 * epsilon,
                "{e:?}"
            );
        }
    }
}

fn files(speed: &Speed) {
    let folder = tempfile::tempdir().unwrap();
    let report = speed.report("hankel bench bounds --quick");
    let paths = report.write(folder.path(), "bounds", &[]).unwrap();
    let read = |name: &str| std::fs::read_to_string(folder.path().join(name)).unwrap();
    assert!(paths.iter().all(|p| p.is_file()));
    let json: Report = serde_json::from_str(&read("bounds.json")).unwrap();
    assert_eq!(json.command, "hankel bench bounds --quick");
    for table in ["times", "calls", "limits", "machine", "errors", "pareto"] {
        let table = json
            .table(table)
            .unwrap_or_else(|| panic!("no table {table}"));
        assert!(!table.rows.is_empty(), "{}", table.id);
        let text = read(&format!("bounds-{}.csv", table.id));
        let mut csv = csv::Reader::from_reader(text.as_bytes());
        assert_eq!(csv.headers().unwrap().len(), table.columns.len());
        assert_eq!(csv.records().map(Result::unwrap).count(), table.rows.len());
    }
    // Without a rival there is nothing to be faster than, and the report says so.
    assert!(json.table("against-diffmoments").is_none());
    assert!(
        json.notes
            .iter()
            .any(|n| n.contains("--against diffmoments"))
    );
    assert!(read("bounds.html").matches("<svg").count() == 3);
    // Every order has a front, of lanes in both precisions at least.
    let pareto = json.table("pareto").unwrap();
    for n in [1_u64, 2] {
        assert!(pareto.rows.iter().any(|row| row[1] == Cell::Count(n)));
    }
}

#[test]
fn medians_of_few() {
    let timing = |times: &[f64]| Timing {
        solver: Solver::Plain,
        n: 1,
        precision: Precision::F32,
        path: "scalar".into(),
        threads: 1,
        times: times.to_vec(),
    };
    assert_eq!(timing(&[3.0, 1.0, 2.0]).median(), 2.0);
    assert_eq!(timing(&[4.0, 1.0, 2.0, 3.0]).median(), 2.5);
    assert_eq!(timing(&[4.0, 1.0]).least(), 1.0);
    assert!(timing(&[]).median().is_nan());
}

#[test]
fn options_that_make_no_sense() {
    let fail = |change: fn(&mut Options)| {
        let mut options = small();
        change(&mut options);
        measure(&options, &mut |_| {}).unwrap_err()
    };
    assert!(matches!(fail(|o| o.orders = vec![7]), SpeedError::Order(7)));
    assert!(matches!(fail(|o| o.rows = 3), SpeedError::Rows(3)));
    assert!(matches!(fail(|o| o.rounds = 0), SpeedError::Rounds));
    let error = fail(|o| o.python = Some("/nonexistent/python".into()));
    assert!(matches!(error, SpeedError::Peer(PeerError::Start { .. })));
    assert!(error.to_string().contains("--python"), "{error}");
}

/// The protocol of the process that measures another instruction set.
#[test]
fn a_worker_answers_and_survives_nonsense() {
    let folder = tempfile::tempdir().unwrap();
    let elements = folder.path().join("elements");
    // One row of order 1: m0, m1, m2, eta.
    let numbers: Vec<u8> = [1.0_f32, 0.0, 1.0, 0.5]
        .iter()
        .flat_map(|x| x.to_ne_bytes())
        .collect();
    std::fs::write(&elements, numbers).unwrap();
    let load = |rows: usize| {
        serde_json::json!({"load": {
            "function": "moment_bound_n1", "precision": "f32", "rows": rows, "elements": elements,
        }})
    };
    let requests = format!(
        "{}\n{}\nnonsense\n{}\n{}\n\"clear\"\n{}\n",
        serde_json::json!({"time": 0}),
        load(1),
        serde_json::json!({"time": 0}),
        load(7),
        serde_json::json!({"time": 0}),
    );
    let mut answers = Vec::new();
    serve(requests.as_bytes(), &mut answers).unwrap();
    let answers = String::from_utf8(answers).unwrap();
    let answers: Vec<serde_json::Value> = answers
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    assert_eq!(answers.len(), 7);
    assert!(answers[0]["failed"].is_string());
    assert_eq!(answers[1], "done");
    assert!(answers[2]["failed"].is_string());
    assert!(answers[3]["seconds"].as_f64().unwrap() > 0.0);
    assert!(answers[4]["failed"].as_str().unwrap().contains("16 bytes"));
    assert_eq!(answers[5], "done");
    assert!(answers[6]["failed"].is_string());
}

/// Where a Python has `diffmoments`, it computes the bounds that this project computes; where none
/// has, the error says what to do.
#[test]
fn the_peer_agrees_or_says_what_it_lacks() {
    let python = default_python();
    let mut peer = match Peer::start(&python) {
        Ok(peer) => peer,
        Err(error @ (PeerError::NoPackage { .. } | PeerError::Start { .. })) => {
            let text = error.to_string();
            assert!(text.contains("HANKEL_PYTHON"), "{text}");
            return;
        }
        Err(error) => panic!("{error}"),
    };
    assert!(matches!(
        peer.time(Quantity::Bound, false),
        Err(PeerError::Failed(_))
    ));
    let family = Family::named("paper").unwrap();
    for n in ORDERS {
        let rows: Vec<Row<f64>> = (0..64).map(|i| family.row(n, 1, i)).collect();
        peer.load(n, &rows).unwrap();
        assert!(peer.time(Quantity::Gradient, true).unwrap() >= 0.0);
        let bounds = peer.bounds().unwrap();
        let gradients = peer.gradients().unwrap();
        assert_eq!((bounds.len(), gradients.len()), (64, 64));
        for (row, (bound, gradient)) in rows.iter().zip(bounds.iter().zip(&gradients)) {
            assert_eq!(gradient.len(), 2 * n + 2);
            let own = bounds_of(n, row.m, row.eta);
            assert!((own.lower - bound).abs() < 1e-6 * row.m[0], "{n} {row:?}");
            // The bound scales with the moments (Euler): its derivatives say so.
            let scaled: f64 = row
                .m
                .iter()
                .zip(&gradient[..=2 * n])
                .map(|(m, d)| m * d)
                .sum();
            assert!((scaled - bound).abs() < 1e-4 * row.m[0], "{n} {row:?}");
        }
    }
}

/// An interpreter without the package is told apart from one that is not there.
#[cfg(unix)]
#[test]
fn a_python_without_the_package() {
    use std::os::unix::fs::PermissionsExt;
    let folder = tempfile::tempdir().unwrap();
    let script = |name: &str, text: &str| {
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o755)).unwrap();
        path
    };
    let without = script(
        "without",
        "#!/bin/sh\necho '{\"missing\": \"diffmoments_ext\"}'\n",
    );
    let error = Peer::start(&without).err().unwrap();
    assert!(matches!(&error, PeerError::NoPackage { package, .. } if package == "diffmoments"));
    assert!(
        error
            .to_string()
            .contains("-m pip install diffmoments numpy")
    );
    let broken = script("broken", "#!/bin/sh\necho 'no such thing' >&2\n");
    let error = Peer::start(Path::new(&broken)).err().unwrap();
    assert!(
        matches!(&error, PeerError::Gone(why) if why == "no such thing"),
        "{error}"
    );
}

fn horner<R: Real>(x: R) -> R {
    let root = (x * x + lit!(1.0)).sqrt();
    R::select(x.lt(root), -x, x.max(root) / root)
}

#[test]
fn every_operation_is_counted_once() {
    let counted = operations_of(|| {
        let y = horner(Counted::input(2.0_f64));
        assert_eq!(y.values()[0], -2.0);
        [y]
    });
    let expected = Operations {
        sums: 1.0,
        products: 1.0,
        quotients: 1.0,
        roots: 1.0,
        comparisons: 2.0,
        selections: 1.0,
        others: 1.0,
        fused: 0.0,
    };
    assert_eq!(counted, expected);
    assert_eq!(counted.simple(), 6.0);
    assert_eq!(counted.flops(), 4.0);
}

#[test]
fn what_a_compiler_drops_is_not_counted() {
    let counted = operations_of(|| {
        let (x, y) = (Counted::input(3.0_f32), Counted::input(5.0_f32));
        let one: Counted<f32> = lit!(1.0);
        let four = (one + one) * lit!(2.0);
        let unused = x / y;
        assert_eq!(unused.values()[0], 0.6);
        // x y twice, a product with 1, a quotient by 4, a choice that is known.
        let sum = x * y + (y * x) * one;
        let known = Real::select(one.lt(four), sum - lit!(0.0), unused);
        [known / four]
    });
    let expected = Operations {
        sums: 1.0,
        products: 2.0,
        ..Operations::default()
    };
    assert_eq!(counted, expected);
}

#[test]
fn inputs_are_not_constants() {
    let counted = operations_of(|| {
        let (x, y) = (Counted::input(1.0_f32), Counted::input(1.0_f32));
        [x * y, x + y]
    });
    assert_eq!((counted.products, counted.sums), (1.0, 1.0));
}

#[test]
fn error_terms_count_as_what_they_take() {
    let counted = operations_of(|| {
        let (a, b) = (Counted::input(1.0_f32), Counted::input(1e-9_f32));
        let (sum, error) = a.two_sum(b);
        assert_eq!((sum.values()[0], error.values()[0]), (1.0, 1e-9));
        let (product, rest) = a.two_product(b);
        assert_eq!((product.values()[0], rest.values()[0]), (1e-9, 0.0));
        [sum, error, product, rest]
    });
    assert_eq!(counted.sums, 6.0);
    assert_eq!((counted.products, counted.fused), (1.0, 1.0));
    assert_eq!(counted.flops(), 9.0);
}

/// Of four moments a row takes the same operations as any other; of more, loops for roots turn more or less often, and in
/// lanes as often as the slowest row needs.
#[test]
fn kernels_are_traced_through_their_entry_points() {
    let rows = |n| {
        let family = Family::named("paper").unwrap();
        (0..TOGETHER as u64)
            .map(|i| family.row(n, 1, i))
            .collect::<Vec<_>>()
    };
    let few = per_row("moment_bound_n2", 2, &rows(2)[..1], true).unwrap();
    let more = per_row("moment_bound_n2", 2, &rows(2), false).unwrap();
    assert_eq!(few, more, "no early exits");
    assert!(few.quotients >= 1.0 && few.products > 10.0, "{few:?}");
    let alone: Vec<f64> = rows(3)
        .chunks(1)
        .map(|row| per_row("moment_bound_n3", 3, row, true).unwrap().roots)
        .collect();
    let together = per_row("moment_bound_n3", 3, &rows(3), false)
        .unwrap()
        .roots;
    assert!(alone.iter().any(|roots| *roots < together), "{alone:?}");
    assert_eq!(alone.iter().copied().fold(0.0, f64::max), together);
    assert_eq!(per_row("moment_bound_n2", 3, &rows(3), true), None);
    assert_eq!(per_row("blur", 2, &rows(2), true), None);
}

#[test]
fn quantiles_are_errors_that_occur() {
    let errors: Vec<f64> = (0..=100).rev().map(f64::from).collect();
    let q = Quantiles::of(errors);
    assert_eq!(
        (q.median, q.ninety, q.ninety_nine, q.greatest),
        (50.0, 90.0, 99.0, 100.0)
    );
    assert_eq!(Quantiles::of(vec![3.0]).median, 3.0);
    assert_eq!(Quantiles::of(Vec::new()).greatest, 0.0);
    // Not a number is the worst of all.
    assert!(Quantiles::of(vec![f64::NAN, 1.0]).greatest.is_nan());
}
