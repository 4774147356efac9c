//! Is the model any good? Errors of its forecasts on rows that it has not seen, beside simple forecasts.

use ndarray::Array2;
use roscausal_discovery::Result;

use crate::{
    graph::{Arrow, Graph},
    model::{Schedule, System},
};

/// The graph in which every variable drives every one at each lag from 1 on: a VAR.
///
/// # Errors
/// None for a graph that is one.
pub fn all_lagged(graph: &Graph) -> Result<Graph> {
    let n = graph.len();
    let arrows: Vec<Arrow> = (0..n)
        .flat_map(|effect| (0..n).map(move |cause| (cause, effect)))
        .flat_map(|(cause, effect)| {
            (1..=graph.largest_lag().max(1)).map(move |lag| Arrow { cause, effect, lag })
        })
        .collect();
    Graph::new(graph.names().to_vec(), graph.largest_lag().max(1), &arrows, &[])
}

/// Mean squared errors `[horizon][variable]` of forecasts without noise from every origin `first..` of each recording whose outcome
/// is known; without a system, of the last value (persistence). NaN where there is no such origin.
pub fn mean_squares(
    system: Option<&System>,
    recordings: &[Array2<f64>],
    first: usize,
    horizons: &[usize],
) -> Vec<Vec<f64>> {
    let n = recordings.first().map_or(0, Array2::ncols);
    let furthest = horizons.iter().max().copied().unwrap_or(0);
    let memory = system.map_or(1, |system| system.memory.max(1));
    let mut sums = vec![vec![(0.0, 0_usize); n]; horizons.len()];
    for recording in recordings {
        let rows: Vec<f64> = recording.iter().copied().collect();
        for origin in first.max(memory - 1)..recording.nrows().saturating_sub(1) {
            let steps = furthest.min(recording.nrows() - 1 - origin);
            let mut path = rows[(origin + 1 - memory) * n..(origin + 1) * n].to_vec();
            if let Some(system) = system {
                system.run(&mut path, &Schedule::free(n, steps), |_, _| 0.0);
            }
            for (sums, &horizon) in sums.iter_mut().zip(horizons).filter(|(_, horizon)| **horizon <= steps) {
                for (var, (sum, count)) in sums.iter_mut().enumerate() {
                    let at = if system.is_some() { memory - 1 + horizon } else { memory - 1 };
                    let error = path[at * n + var] - rows[(origin + horizon) * n + var];
                    if error.is_finite() {
                        *sum += error * error;
                        *count += 1;
                    }
                }
            }
        }
    }
    let mean = |&(sum, count): &(f64, usize)| if count > 0 { sum / count as f64 } else { f64::NAN };
    sums.iter().map(|row| row.iter().map(mean).collect()).collect()
}
