//! Inputs that the kernels are for: they hold moments of distributions.

use hankel_dsl::native::inputs::{Request, Value};
use hankel_shadows::inputs::{rows_1, rows_2, rows_3, rows_5};

/// The smallest eigenvalue's sign by the pivots of the Hankel matrix of moments 0 to 2 n.
fn is_nearly_positive(m: &[f64], n: usize) -> bool {
    let mut a: Vec<Vec<f64>> = (0..=n)
        .map(|i| (0..=n).map(|j| m[i + j]).collect())
        .collect();
    for k in 0..=n {
        if a[k][k] < -1e-9 {
            return false;
        }
        if a[k][k] < 1e-12 {
            return true;
        }
        let (pivots, below) = a.split_at_mut(k + 1);
        for row in below {
            let factor = row[k] / pivots[k][k];
            for (x, pivot) in row[k..].iter_mut().zip(&pivots[k][k..]) {
                *x -= factor * pivot;
            }
        }
    }
    true
}

#[test]
fn rows_hold_moments_of_distributions() {
    let request = Request {
        seed: 3,
        constants: Vec::new(),
        multisampled: Vec::new(),
    };
    for (n, given) in [
        (1, rows_1::<f64>(&request)),
        (3, rows_3::<f64>(&request)),
        (5, rows_5::<f64>(&request)),
    ] {
        assert_eq!(given.len(), 4);
        for run in &given {
            let (_, Value::Bytes(bytes)) = &run.args[1] else {
                panic!("rows are bytes");
            };
            let numbers: Vec<f64> = bytes
                .chunks_exact(8)
                .filter_map(|b| b.first_chunk().map(|b| f64::from_le_bytes(*b)))
                .collect();
            for row in numbers.chunks(2 * n + 2) {
                let scaled: Vec<f64> = row.iter().map(|x| x / row[0]).collect();
                assert!(row[0] > 0.0);
                assert!(is_nearly_positive(&scaled, n), "{}: {row:?}", run.what);
            }
        }
    }
    assert_eq!(rows_2::<f32>(&request), rows_2::<f32>(&request));
}
