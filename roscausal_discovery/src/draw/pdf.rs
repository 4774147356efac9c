//! From SVG to PDF, with text as text.

use svg2pdf::{ConversionOptions, PageOptions, to_pdf};

use super::raster::{fault, parsed};
use crate::types::Result;

/// The SVG document as a PDF file of one page, as large as the picture at 96 units per inch. Its text can be selected, in the
/// embedded font.
///
/// # Errors
/// If the document is not SVG.
pub fn pdf(svg: &str) -> Result<Vec<u8>> {
    let page = PageOptions { dpi: 96.0 };
    let file = to_pdf(&parsed(svg)?, ConversionOptions::default(), page).map_err(|e| fault(&e))?;
    Ok(with_sorted_resources(&file))
}

/// The library writes the resources of a page in the random order of a hash map, one to a line. In sorted order a picture has the
/// same bytes each time. No length changes, so the file's table of offsets stays true.
fn with_sorted_resources(file: &[u8]) -> Vec<u8> {
    let mut lines: Vec<&[u8]> = file.split_inclusive(|byte| *byte == b'\n').collect();
    lines.chunk_by_mut(|one, next| is_resource(one) && is_resource(next)).for_each(|run| run.sort_unstable());
    lines.concat()
}

/// A line like `  /gs3 10 0 R`.
fn is_resource(line: &[u8]) -> bool {
    let words = std::str::from_utf8(line).unwrap_or_default().split_ascii_whitespace();
    matches!(words.collect::<Vec<_>>().as_slice(), [name, _, "0", "R"] if name.starts_with('/'))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{draw, model::example};

    #[test]
    fn a_pdf_has_one_page_and_the_same_bytes_each_time() {
        let svg = draw::dag(&example());
        let (one, two) = (pdf(&svg).expect("is SVG"), pdf(&svg).expect("is SVG"));
        assert!(one.starts_with(b"%PDF-1.") && one == two);
        let text = String::from_utf8_lossy(&one);
        assert!(text.contains("/Count 1") && text.contains("/FontFile2"), "{text}");
    }

    #[test]
    fn what_is_not_svg_is_refused_in_a_sentence() {
        let error = pdf("<html>").expect_err("is not SVG").to_string();
        assert!(error.starts_with("the picture cannot be drawn"), "{error}");
    }
}
