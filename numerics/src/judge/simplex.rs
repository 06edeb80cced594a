//! The revised simplex method (G. Dantzig, *Linear Programming and Extensions*, 1963, chapter 9), for very many very
//! small programmes: least `c · w` over weights `w >= 0` with `A w = b`, of which `A` has K rows.
//!
//! [`programme`](super::programme) solves a programme to twelve digits in milliseconds, this one to about eight in
//! microseconds. Columns may be added to a solved programme, which goes on from there.

/// What missing an equation by a unit costs: what a coarse grid of columns cannot meet is met as nearly as possible.
const PRICE: f64 = 1e6;

/// A column enters if it makes a unit of weight cheaper by this.
const GAIN: f64 = 1e-8;

/// A pivot is not less.
const PIVOT: f64 = 1e-11;

/// Pivots after which the solution is taken as it is.
const MOST_PIVOTS: usize = 400;

/// Pivots after which the basis is inverted anew, so that rounding errors do not add up.
const FRESH: usize = 40;

/// Pivots in one run after which the first column that gains enters, instead of that which gains most: such runs do not
/// go in circles (R. Bland, 1977).
const IMPATIENT: usize = 150;

/// A row of the basis: the column in it, or what the equation misses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Member {
    Column(usize),
    Missed,
}

/// A programme and its best solution so far.
#[derive(Clone, Debug)]
pub struct Programme<const K: usize> {
    targets: [f64; K],
    columns: Vec<[f64; K]>,
    costs: Vec<f64>,
    members: [Member; K],
    /// Of the basis.
    inverse: [[f64; K]; K],
    /// The members' weights.
    weights: [f64; K],
}

impl<const K: usize> Programme<K> {
    /// Without columns: all equations are missed.
    pub fn new(targets: [f64; K]) -> Self {
        let mut inverse = [[0.0; K]; K];
        for (i, row) in inverse.iter_mut().enumerate() {
            row[i] = if targets[i] < 0.0 { -1.0 } else { 1.0 };
        }
        Self {
            targets,
            columns: Vec::new(),
            costs: Vec::new(),
            members: [Member::Missed; K],
            inverse,
            weights: targets.map(f64::abs),
        }
    }

    /// Adds columns, each with its cost, which is not negative.
    pub fn extend(&mut self, columns: impl IntoIterator<Item = ([f64; K], f64)>) {
        for (column, cost) in columns {
            self.columns.push(column);
            self.costs.push(cost);
        }
    }

    fn cost(&self, member: Member) -> f64 {
        match member {
            Member::Column(i) => self.costs[i],
            Member::Missed => PRICE,
        }
    }

    /// Finds the best weights of the columns that there are. False if that took too many pivots.
    pub fn solve(&mut self) -> bool {
        for pivots in 0..MOST_PIVOTS {
            if pivots % FRESH == FRESH - 1 {
                self.renew();
            }
            let mut prices = [0.0; K];
            for (member, row) in self.members.iter().zip(&self.inverse) {
                let cost = self.cost(*member);
                if cost != 0.0 {
                    for (price, x) in prices.iter_mut().zip(row) {
                        *price += cost * x;
                    }
                }
            }
            let mut best = -GAIN;
            let mut entering = None;
            for (i, (column, cost)) in self.columns.iter().zip(&self.costs).enumerate() {
                let mut reduced = *cost;
                for (price, x) in prices.iter().zip(column) {
                    reduced -= price * x;
                }
                if reduced < best {
                    entering = Some(i);
                    if pivots >= IMPATIENT {
                        break;
                    }
                    best = reduced;
                }
            }
            let Some(entering) = entering else {
                return true;
            };
            if !self.enter(entering) {
                return true;
            }
        }
        false
    }

    /// Puts a column into the basis; false if nothing limits its weight, which only rounding can do.
    fn enter(&mut self, column: usize) -> bool {
        let mut direction = [0.0; K];
        for (x, row) in direction.iter_mut().zip(&self.inverse) {
            *x = row
                .iter()
                .zip(&self.columns[column])
                .map(|(a, b)| a * b)
                .sum();
        }
        let mut leaving = None;
        let mut step = f64::INFINITY;
        for (i, &by) in direction.iter().enumerate() {
            if by > PIVOT {
                let limit = self.weights[i] / by;
                let is_first = leaving.is_none_or(|l: usize| direction[l] < by);
                if limit < step || (limit == step && is_first) {
                    step = limit;
                    leaving = Some(i);
                }
            }
        }
        let Some(leaving) = leaving else {
            return false;
        };
        for (weight, by) in self.weights.iter_mut().zip(direction) {
            *weight = (*weight - step * by).max(0.0);
        }
        self.weights[leaving] = step;
        self.members[leaving] = Member::Column(column);
        let pivot = self.inverse[leaving].map(|x| x / direction[leaving]);
        for (i, row) in self.inverse.iter_mut().enumerate() {
            if i == leaving {
                *row = pivot;
            } else {
                for (x, p) in row.iter_mut().zip(pivot) {
                    *x -= direction[i] * p;
                }
            }
        }
        true
    }

    /// Inverts the basis by elimination, and takes the weights from there. One that cannot be inverted stays.
    fn renew(&mut self) {
        let mut basis = [[0.0; K]; K];
        let mut inverse = [[0.0; K]; K];
        for (i, member) in self.members.iter().enumerate() {
            match member {
                Member::Column(c) => {
                    for (row, x) in basis.iter_mut().zip(self.columns[*c]) {
                        row[i] = x;
                    }
                }
                Member::Missed => basis[i][i] = if self.targets[i] < 0.0 { -1.0 } else { 1.0 },
            }
            inverse[i][i] = 1.0;
        }
        for k in 0..K {
            let largest = (k..K).max_by(|a, b| basis[*a][k].abs().total_cmp(&basis[*b][k].abs()));
            let largest = largest.unwrap_or(k);
            if basis[largest][k].abs() < PIVOT {
                return;
            }
            basis.swap(k, largest);
            inverse.swap(k, largest);
            let per_pivot = 1.0 / basis[k][k];
            basis[k] = basis[k].map(|x| x * per_pivot);
            inverse[k] = inverse[k].map(|x| x * per_pivot);
            let (row, its_inverse) = (basis[k], inverse[k]);
            for i in (0..K).filter(|i| *i != k) {
                let by = basis[i][k];
                for (x, r) in basis[i].iter_mut().zip(row) {
                    *x -= by * r;
                }
                for (x, r) in inverse[i].iter_mut().zip(its_inverse) {
                    *x -= by * r;
                }
            }
        }
        self.inverse = inverse;
        for (weight, row) in self.weights.iter_mut().zip(&inverse) {
            let sum: f64 = row.iter().zip(self.targets).map(|(a, b)| a * b).sum();
            *weight = sum.max(0.0);
        }
    }

    /// The cost of the columns' weights.
    pub fn value(&self) -> f64 {
        self.support()
            .map(|(i, weight)| self.costs[i] * weight)
            .sum()
    }

    /// How far the equations are from being met: the sum.
    #[cfg(test)]
    pub fn missed(&self) -> f64 {
        let members = self.members.iter().zip(&self.weights);
        let missed = members.filter(|(member, _)| **member == Member::Missed);
        missed.map(|(_, weight)| weight).sum()
    }

    /// The columns with weight.
    pub fn support(&self) -> impl Iterator<Item = (usize, f64)> {
        let members = self.members.iter().zip(self.weights);
        members.filter_map(|(member, weight)| match member {
            Member::Column(i) if weight > 0.0 => Some((*i, weight)),
            _ => None,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Weights of 0, 1 and 2 with total 1 and mean 0.6, least where 1 is dear: none of it.
    #[test]
    fn the_cheapest_weights_are_found() {
        let mut programme = Programme::new([1.0, 0.6]);
        let columns = [([1.0, 0.0], 0.25), ([1.0, 1.0], 1.0), ([1.0, 2.0], 0.5)];
        programme.extend(columns);
        assert!(programme.solve());
        assert!((programme.value() - (0.7 * 0.25 + 0.3 * 0.5)).abs() < 1e-12);
        assert!(programme.missed() < 1e-12);
        // A cheaper column is found from there.
        programme.extend([([1.0, 0.6], 0.1)]);
        assert!(programme.solve());
        assert!((programme.value() - 0.1).abs() < 1e-12);
        assert_eq!(programme.support().count(), 1);
    }

    #[test]
    fn a_renewed_basis_is_the_same() {
        let mut programme = Programme::new([1.0, 0.6, -0.3]);
        let columns = (0..40).map(|i| {
            let z = f64::from(i) / 39.0;
            ([1.0, z, z * z - 0.8], (5.0 * z).sin() + 1.0)
        });
        programme.extend(columns);
        assert!(programme.solve());
        let before = programme.clone();
        programme.renew();
        assert!((programme.value() - before.value()).abs() < 1e-12);
        for (new, old) in programme
            .inverse
            .iter()
            .flatten()
            .zip(before.inverse.iter().flatten())
        {
            assert!((new - old).abs() < 1e-8 * (1.0 + old.abs()), "{new} {old}");
        }
        let weights: f64 = programme.support().map(|(_, weight)| weight).sum();
        assert!((weights - 1.0).abs() < 1e-12 && programme.missed() < 1e-12);
    }

    #[test]
    fn equations_that_cannot_be_met_are_missed_by_the_least() {
        let mut programme = Programme::new([1.0, -0.5]);
        programme.extend([([1.0, 0.25], 0.0), ([1.0, 1.0], 0.0)]);
        assert!(programme.solve());
        assert!((programme.missed() - 0.75).abs() < 1e-9, "{programme:?}");
    }
}
