//! A drawing as a picture of pixels.

/// Whether this takt was built with the feature `png`.
pub const IS_BUILT_IN: bool = cfg!(feature = "png");

/// What is said where it was not.
pub const ABSENT: &str = "this takt was built without pictures: build it with the cargo feature png \
                          (cargo install takt --features png), or write --svg FILE.svg in place of --png";

/// Pixels for each unit of the drawing, which is 900 units wide: sharp on a page of a document and on a dense screen.
#[cfg(feature = "png")]
const SCALE: f32 = 2.0;

/// Makes the picture. Its letters come from the font that is built in, never from the computer: the same drawing is the
/// same picture everywhere.
#[cfg(feature = "png")]
pub fn render(svg: &str) -> Result<Vec<u8>, String> {
    use resvg::{tiny_skia, usvg};

    let mut options = usvg::Options::default();
    let fonts = options.fontdb_mut();
    fonts.load_font_data(dejavu::sans::regular().to_vec());
    fonts.set_sans_serif_family("DejaVu Sans");
    let words = |error: &dyn std::error::Error| format!("the drawing cannot be made a picture: {error}");
    let tree = usvg::Tree::from_str(svg, &options).map_err(|error| words(&error))?;
    let size = tree.size().to_int_size().scale_by(SCALE);
    let pixels = size.and_then(|size| tiny_skia::Pixmap::new(size.width(), size.height()));
    let mut pixels = pixels.ok_or("the drawing cannot be made a picture: it is too large")?;
    resvg::render(&tree, tiny_skia::Transform::from_scale(SCALE, SCALE), &mut pixels.as_mut());
    pixels.encode_png().map_err(|error| words(&error))
}

/// Refuses: see [`ABSENT`].
#[cfg(not(feature = "png"))]
pub fn render(_: &str) -> Result<Vec<u8>, String> {
    Err(ABSENT.to_owned())
}
