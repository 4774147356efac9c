//! numpy's arrays as a data frame.

use std::sync::Arc;

use numpy::{PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;
use roscausal_discovery::{
    DataFrame, Result,
    confidence::{Resampling, Scheme, data_of_resample},
};

use crate::errors::raised;

/// The data of an analysis: recordings (T, N) of the same variables, each with a mask if there are masks.
#[pyclass(frozen, module = "roscausal._native")]
pub(crate) struct Frame {
    /// The data frame, shared with a thread.
    pub(crate) data: Arc<DataFrame>,
}

#[pymethods]
impl Frame {
    #[new]
    #[pyo3(signature = (recordings, names, masks=None, mask_type="", remove_missing_upto_maxlag=false, reference_points=None, vectors=vec![]))]
    fn new(
        recordings: Vec<PyReadonlyArray2<'_, f64>>,
        names: Vec<String>,
        masks: Option<Vec<PyReadonlyArray2<'_, bool>>>,
        mask_type: &str,
        remove_missing_upto_maxlag: bool,
        reference_points: Option<Vec<PyReadonlyArray1<'_, bool>>>,
        vectors: Vec<(String, Vec<usize>)>,
    ) -> PyResult<Self> {
        let recordings = recordings.iter().map(|recording| recording.as_array().to_owned()).collect();
        let mut data = DataFrame::new(recordings, names).map_err(raised)?;
        if !vectors.is_empty() {
            data = data.with_vectors(&vectors).map_err(raised)?;
        }
        if let Some(masks) = masks {
            let masks = masks.iter().map(|mask| mask.as_array().to_owned()).collect();
            data = data.with_mask(masks, mask_type.parse().map_err(raised)?).map_err(raised)?;
        }
        data = data.with_remove_missing_upto_maxlag(remove_missing_upto_maxlag);
        if let Some(points) = reference_points {
            let points = points.iter().map(|of| of.as_array().to_vec()).collect();
            data = data.with_reference_points(points).map_err(raised)?;
        }
        Ok(Self { data: Arc::new(data) })
    }

    /// Resample `number` of `seed`: as many times as there are from `first` on, drawn with replacement in blocks of `block` rows
    /// (a number, or `cube_root`), as the reference draws them.
    fn bootstrap(&self, seed: u64, number: usize, block: &str, first: usize) -> PyResult<Self> {
        let draw = || -> Result<DataFrame> {
            let scheme =
                Resampling { scheme: Scheme::Bootstrap, block: block.parse()?, ..Resampling::default() };
            data_of_resample(&self.data, &scheme, seed, number, first)
        };
        Ok(Self { data: Arc::new(draw().map_err(raised)?) })
    }
}
