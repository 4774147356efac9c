//! Variables of several columns, such as a position.
//!
//! Example: `x` and `y` of a robot become the variable `place`. A method asks of `place` what it asks of any variable; a test that
//! knows vectors looks at both columns.

use std::sync::Arc;

use ndarray::{Array2, Axis};

use super::{
    dataframe::DataFrame,
    error::{Error, Result},
    names,
    node::Node,
    samples::Samples,
    vectors::Vectors,
};

/// The lagged rows of one test of vectors, without the samples in which a component of a node is missing.
#[derive(Clone, Debug, Default)]
pub(crate) struct Components {
    /// One row of samples for each component of X, of Y, and of all nodes of Z.
    pub(crate) x: Vec<Vec<f64>>,
    pub(crate) y: Vec<Vec<f64>>,
    pub(crate) z: Vec<Vec<f64>>,
    pub(crate) n_samples: usize,
    pub(crate) n_lost: usize,
}

/// Variables of several columns: the name of each, and the names of its columns.
pub type VectorNames = Vec<(String, Vec<String>)>;

/// Reads which columns belong together.
///
/// ```
/// use roscausal_discovery::vectors_of;
///
/// assert_eq!(vectors_of(&["place=x+y"])?, [("place".to_owned(), vec!["x".to_owned(), "y".to_owned()])]);
/// assert!(vectors_of(&["=x+y"]).is_err());
/// # Ok::<(), roscausal_discovery::Error>(())
/// ```
///
/// # Errors
/// A text that is not `NAME=COLUMN+COLUMN`.
pub fn vectors_of(texts: &[impl AsRef<str>]) -> Result<VectorNames> {
    let group = |text: &str| match text.split_once('=') {
        Some((name, columns)) if !name.trim().is_empty() => {
            let columns = columns.split('+').map(|column| column.trim().to_owned());
            Ok((name.trim().to_owned(), columns.collect()))
        }
        _ => Err(Error::param("vectors", format!("'{text}' is not a vector; write it like place=x+y"))),
    };
    texts.iter().map(|text| group(text.as_ref())).collect()
}

impl DataFrame {
    /// As [`DataFrame::with_vectors`], with the names of the columns.
    ///
    /// # Errors
    /// A column that does not exist, and those of [`DataFrame::with_vectors`].
    pub fn with_named_vectors(self, vectors: &[(String, Vec<String>)]) -> Result<Self> {
        if vectors.is_empty() {
            return Ok(self);
        }
        let place = |column: &String| {
            names::position(self.var_names(), column).ok_or_else(|| {
                let all = self.var_names().join(", ");
                Error::param("vectors", format!("there is no column '{column}' (columns: {all})"))
            })
        };
        let group = |(name, columns): &(String, Vec<String>)| {
            Ok((name.clone(), columns.iter().map(place).collect::<Result<Vec<usize>>>()?))
        };
        let groups = vectors.iter().map(group).collect::<Result<Vec<_>>>()?;
        self.with_vectors(&groups)
    }

    /// The data in which each of `groups`, a name and columns, is one variable of several components. It stands where its first
    /// column was.
    ///
    /// A method takes it for any variable; the test must know vectors, as
    /// [`ParCorrVector`](crate::independence_tests::ParCorrVector) does.
    ///
    /// ```
    /// use roscausal_discovery::DataFrame;
    ///
    /// let values = ndarray::array![[0.0, 1.0, 5.0], [0.5, 0.8, 4.0]];
    /// let data = DataFrame::new(vec![values], ["x", "y", "risk"].map(String::from).to_vec())?;
    /// let data = data.with_vectors(&[("place".to_owned(), vec![0, 1])])?;
    /// assert_eq!(data.var_names(), ["place", "risk"]);
    /// # Ok::<(), roscausal_discovery::Error>(())
    /// ```
    ///
    /// # Errors
    /// A vector without columns, a column that does not exist or is named twice, a name that another variable has, or data that have
    /// masks or vectors already.
    pub fn with_vectors(self, groups: &[(String, Vec<usize>)]) -> Result<Self> {
        let fail = |reason: String| Err(Error::param("vectors", reason));
        if self.is_masked() || self.vectors().is_some() {
            return fail("give vectors once, and before masks".to_owned());
        }
        let mut taken = vec![None; self.n_vars()];
        for (group, (name, columns)) in groups.iter().enumerate() {
            if columns.is_empty() {
                return fail(format!("'{name}' has no columns"));
            }
            for &column in columns {
                match taken.get_mut(column) {
                    None => return fail(format!("'{name}': column {column} does not exist")),
                    Some(Some(_)) => {
                        return fail(format!(
                            "'{name}': column '{}' is named twice",
                            self.var_names()[column]
                        ));
                    }
                    Some(free) => *free = Some(group),
                }
            }
        }
        let is_first = |var: usize| taken[var].is_none_or(|group| groups[group].1[0] == var);
        let firsts: Vec<usize> = (0..self.n_vars()).filter(|&var| is_first(var)).collect();
        let further: Vec<usize> = groups.iter().flat_map(|(_, columns)| columns[1..].to_vec()).collect();
        let place = |column: &usize| further.iter().position(|other| other == column);
        let of = firsts.iter().map(|&var| match taken[var] {
            Some(group) => groups[group].1[1..].iter().filter_map(place).collect(),
            None => Vec::new(),
        });
        let name = |&var: &usize| taken[var].map_or(&self.var_names()[var], |group| &groups[group].0).clone();
        let names: Vec<String> = firsts.iter().map(name).collect();
        if let Some(twice) = names.iter().enumerate().find(|(k, name)| names[..*k].contains(name)) {
            return fail(format!("there are two variables '{}'", twice.1));
        }
        let columns = self.recordings().iter().map(|recording| recording.select(Axis(1), &further)).collect();
        let vectors = Vectors { columns: Arc::new(columns), of: of.collect() };
        Ok(self.select(&firsts).of_vectors(names, vectors))
    }

    /// Whether a variable has several components.
    pub fn has_vectors(&self) -> bool {
        self.vectors().is_some_and(|vectors| vectors.of.iter().any(|of| !of.is_empty()))
    }

    /// The data, if each variable is one column, as `who` needs it.
    pub(crate) fn of_scalars(&self, who: &str) -> Result<&Self> {
        let vector = self.vectors().and_then(|vectors| vectors.of.iter().position(|of| !of.is_empty()));
        match vector {
            None => Ok(self),
            Some(var) => Err(Error::param(
                "vectors",
                format!(
                    "{who} takes each variable for one column, and '{}' has several; take the test parcorrmult with a method that asks a \
                     test, such as pcmci",
                    self.var_names()[var]
                ),
            )),
        }
    }
}

impl Samples<'_> {
    /// As [`Samples::arrays`], with all components of each node.
    pub(crate) fn components(&self, x: Node, y: Node, z: &[Node]) -> Components {
        let (data, mut places) = (self.data(), Vec::with_capacity(self.len()));
        let n_lost = self.placed(x, y, z, |recording, t| places.push((recording, t))).n_lost;
        let row_of = |node: Node, from: &[Array2<f64>], column: usize| -> Vec<f64> {
            places.iter().map(|&(recording, t)| from[recording][[t - node.lag, column]]).collect()
        };
        let rows = |node: Node| {
            let further = data.vectors().map_or_else(Vec::new, |vectors| {
                vectors.of[node.var].iter().map(|&column| row_of(node, &vectors.columns, column)).collect()
            });
            [row_of(node, data.recordings(), node.var)].into_iter().chain(further).collect::<Vec<_>>()
        };
        Components {
            x: rows(x),
            y: rows(y),
            z: z.iter().flat_map(|&node| rows(node)).collect(),
            n_samples: places.len(),
            n_lost,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn data() -> DataFrame {
        let mut values = Array2::from_shape_fn((6, 4), |(t, v)| (10 * v + t) as f64);
        values[[3, 2]] = f64::NAN;
        DataFrame::new(vec![values], ["a", "b", "c", "d"].map(String::from).to_vec()).unwrap()
    }

    #[test]
    fn a_sample_in_which_any_component_is_missing_is_left_out() {
        let data = data().with_vectors(&[("v".into(), vec![3, 2])]).unwrap();
        assert_eq!(data.var_names(), ["a", "b", "v"]);
        assert!(data.is_incomplete() && data.has_vectors());
        let samples = Samples::new(&data, 1);
        let of = samples.components(Node::new(0, 0), Node::new(2, 1), &[Node::new(1, 0)]);
        assert_eq!((of.n_samples, of.n_lost), (4, 1));
        assert_eq!(of.x, [vec![1.0, 2.0, 3.0, 5.0]]);
        assert_eq!(of.y, [vec![30.0, 31.0, 32.0, 34.0], vec![20.0, 21.0, 22.0, 24.0]]);
        // Without the vector nothing is missing.
        let without = data.select(&[0, 1]);
        assert!(!without.is_incomplete() && !without.has_vectors());
        assert!(without.of_scalars("granger").is_ok());
        let error = data.of_scalars("granger").unwrap_err().to_string();
        assert!(error.contains("'v' has several") && error.contains("parcorrmult"), "{error}");
    }

    #[test]
    fn vectors_that_cannot_be_are_one_sentence() {
        for (groups, says) in [
            (vec![("v", vec![])], "no columns"),
            (vec![("v", vec![0, 9])], "column 9 does not exist"),
            (vec![("v", vec![0, 1]), ("w", vec![1, 2])], "column 'b' is named twice"),
            (vec![("b", vec![2, 3])], "two variables 'b'"),
        ] {
            let groups: Vec<_> =
                groups.into_iter().map(|(name, columns)| (name.to_owned(), columns)).collect();
            let error = data().with_vectors(&groups).unwrap_err().to_string();
            assert!(error.contains(says), "{error}");
        }
        assert!(data().with_vectors(&[("v".into(), vec![0, 1])]).unwrap().with_vectors(&[]).is_err());
    }
}
