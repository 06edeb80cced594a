//! What the tests of the examples ask of a picture.

use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use crate::{Drawn, SIZE};

/// The picture is the one in a PNG file, but for a few pixels where drivers see another surface.
///
/// # Panics
///
/// It is not.
pub fn picture(drawn: &Drawn, path: &Path) {
    let name = path.display();
    let file = File::open(path).unwrap_or_else(|e| panic!("{name}: {e}"));
    let mut reader = png::Decoder::new(BufReader::new(file))
        .read_info()
        .unwrap_or_else(|e| panic!("{name}: {e}"));
    let mut shown = vec![0; reader.output_buffer_size().expect("its size is known")];
    reader
        .next_frame(&mut shown)
        .unwrap_or_else(|e| panic!("{name}: {e}"));
    assert_eq!(drawn.picture.len(), shown.len(), "{name} has another size");
    let pixels = drawn.picture.chunks_exact(4).zip(shown.chunks_exact(4));
    let other = pixels
        .filter(|(a, b)| a.iter().zip(*b).any(|(a, b)| a.abs_diff(*b) > 2))
        .count();
    assert!(
        other * 1000 <= shown.len() / 4,
        "{other} pixels differ from {name}; if the example changed, run it to draw that anew"
    );
}

/// The shadows are those of rays, away from edges, which the map's filter blurs. A lower bound may be
/// brighter than the truth where the map's texels have several depths: of dark pixels, more may differ.
///
/// # Panics
///
/// They are not.
pub fn shadows(drawn: &Drawn) {
    let [width, height] = SIZE.map(|n| n as usize);
    let mut count = [0; 2];
    let mut wrong = [0; 2];
    for y in EDGE..height - EDGE {
        for x in EDGE..width - EDGE {
            let at = |x: usize, y: usize| drawn.truth[y * width + x];
            let truth = at(x, y);
            let mut around =
                (y - EDGE..=y + EDGE).flat_map(|y| (x - EDGE..=x + EDGE).map(move |x| at(x, y)));
            if truth == 0.5 || around.any(|t| t != truth) {
                continue;
            }
            let shadow = drawn.shadows[y * width + x];
            let kind = truth as usize;
            count[kind] += 1;
            wrong[kind] += usize::from((shadow - truth).abs() > 0.1);
        }
    }
    let [lit, dark] = count;
    assert!(
        lit > 20_000 && dark > 1_000,
        "{lit} lit, {dark} dark pixels"
    );
    assert!(
        wrong[0] * 200 <= lit && wrong[1] * 20 <= dark,
        "{} of {lit} lit pixels and {} of {dark} dark ones are not as rays say",
        wrong[0],
        wrong[1]
    );
}

/// Pixels to each side of an edge that are not looked at. The map's filter reaches 2.5 texels, and Bevy moves
/// receivers by 1.8 texels: together 0.24 of the world's units, of which the nearest shadow has 50 pixels.
const EDGE: usize = 12;
