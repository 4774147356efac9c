//! From SVG to pixels and PNG.

use std::sync::{Arc, OnceLock};

use resvg::{
    tiny_skia::{Pixmap, Transform},
    usvg::{Options, Tree, fontdb},
};

use crate::types::{Error, Result};

/// A subset of DejaVu Sans, so that text looks the same on every machine.
const FONT: &[u8] = include_bytes!("font/DejaVuSans-subset.ttf");

/// Most pixels of a picture; one that needs more gets fewer per unit.
const MOST_PIXELS: f64 = 4e7;

/// A picture as pixels.
pub struct Image {
    /// Pixels per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `width * height` pixels of 3 bytes (red, green, blue).
    pub rgb: Vec<u8>,
    /// The same picture as a PNG file.
    pub png: Vec<u8>,
}

/// Renders an SVG document at `scale` pixels per unit, using only the embedded font.
///
/// # Errors
/// If the document is not SVG or too large to render.
pub fn rasterise(svg: &str, scale: f32) -> Result<Image> {
    let tree = parsed(svg)?;
    let area = f64::from(tree.size().width()) * f64::from(tree.size().height());
    let scale = scale.min((MOST_PIXELS / area.max(1.0)).sqrt() as f32);
    let size = tree.size().to_int_size().scale_by(scale).ok_or_else(|| fault(&"its size is zero"))?;
    let mut pixels = Pixmap::new(size.width(), size.height()).ok_or_else(|| fault(&"it is too large"))?;
    resvg::render(&tree, Transform::from_scale(scale, scale), &mut pixels.as_mut());
    // The background is opaque white, so premultiplied colours are plain colours.
    let rgb: Vec<u8> =
        pixels.data().chunks_exact(4).flat_map(|pixel| [pixel[0], pixel[1], pixel[2]]).collect();
    let png = encoded(size.width(), size.height(), &rgb).map_err(|e| fault(&e))?;
    Ok(Image { width: size.width(), height: size.height(), rgb, png })
}

/// A PNG file, compressed well: a node writes two for each batch.
fn encoded(width: u32, height: u32, rgb: &[u8]) -> std::result::Result<Vec<u8>, png::EncodingError> {
    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(&mut file, width, height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::Default);
    encoder.set_filter(png::FilterType::NoFilter);
    let mut writer = encoder.write_header()?;
    writer.write_image_data(rgb)?;
    writer.finish()?;
    Ok(file)
}

/// An SVG document with the embedded font and no other.
pub(super) fn parsed(svg: &str) -> Result<Tree> {
    static FONTS: OnceLock<Arc<fontdb::Database>> = OnceLock::new();
    let fonts = FONTS.get_or_init(|| {
        let mut fonts = fontdb::Database::new();
        fonts.load_font_data(FONT.to_vec());
        fonts.set_sans_serif_family("DejaVu Sans");
        Arc::new(fonts)
    });
    let options = Options { fontdb: fonts.clone(), font_family: "DejaVu Sans".into(), ..Options::default() };
    Tree::from_str(svg, &options).map_err(|e| fault(&e))
}

pub(super) fn fault(reason: &dyn std::fmt::Display) -> Error {
    Error::Data(format!("the picture cannot be drawn: {reason}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{draw, model::example};

    #[test]
    fn a_picture_has_ink_and_is_the_same_each_time() {
        let svg = draw::dag(&example());
        let (one, two) = (rasterise(&svg, 1.0).expect("renders"), rasterise(&svg, 1.0).expect("renders"));
        assert_eq!(one.png, two.png);
        assert_eq!(one.rgb.len(), (one.width * one.height * 3) as usize);
        assert!(one.rgb.chunks_exact(3).filter(|p| p[0] < 128).count() > 500);
    }

    #[test]
    fn a_picture_of_a_small_graph_is_a_bounded() {
        let image = rasterise(&draw::dag(&example()), 3.0).expect("renders");
        assert!(image.png.len() < image.rgb.len() / 50, "{} bytes for {}", image.png.len(), image.rgb.len());
    }
}
