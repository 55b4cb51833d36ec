//! Stats of a number per frame.

use serde::Serialize;

/// Mean, median and extremes of a number that every frame has; all are 0 if there are no frames.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Samples {
    /// The number of frames.
    pub n: usize,
    /// The average, which the paper prints.
    pub mean: f64,
    /// The median.
    pub median: f64,
    /// The smallest.
    pub min: f64,
    /// The largest.
    pub max: f64,
}

impl Samples {
    /// The statistics of these values; none may be NaN.
    pub fn of(values: impl IntoIterator<Item = f64>) -> Self {
        let mut sorted: Vec<f64> = values.into_iter().collect();
        sorted.sort_unstable_by(f64::total_cmp);
        let n = sorted.len();
        let (Some(&min), Some(&max)) = (sorted.first(), sorted.last()) else {
            return Samples::default();
        };
        Samples {
            n,
            mean: sorted.iter().sum::<f64>() / n as f64,
            median: 0.5 * (sorted[(n - 1) / 2] + sorted[n / 2]),
            min,
            max,
        }
    }

    /// The statistics of counts.
    pub fn of_counts(counts: impl IntoIterator<Item = u64>) -> Self {
        // Counts here are far below 2^53.
        Samples::of(counts.into_iter().map(|count| count as f64))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_few_and_of_none() {
        assert_eq!(Samples::of([]), Samples::default());
        let samples = Samples::of([4.0, 1.0, 2.0, 9.0]);
        assert_eq!((samples.n, samples.mean, samples.median), (4, 4.0, 3.0));
        assert_eq!((samples.min, samples.max), (1.0, 9.0));
        assert_eq!(Samples::of_counts([3, 1, 2]).median, 2.0);
    }
}
