//! Closures, functions and structures that hold textures, samplers and buffers; closures that call much.

use hankel_dsl::glam::{UVec2, UVec4, Vec2, Vec4};
use hankel_dsl::{Buffer, Sampler, Texture2d, kernel, math};

/// Sums, products and counts of what portable functions give: rustc inlines them only if it looks far enough for calls
/// that end in themselves.
#[kernel(
    compute,
    threads(64),
    parity(
        non_finite,
        ulp = 64,
        why = "exponentials overflow, and drivers may reorder sums within them and of them"
    )
)]
pub fn of_functions(
    #[element]
    #[range(-4.0..=4.0)]
    x: Vec4,
) -> Vec4 {
    let numbers = x.to_array();
    let sum: f32 = numbers.iter().map(|a| math::exp(*a)).sum();
    let product: f32 = numbers.iter().map(|a| math::exp(*a)).product();
    let large = numbers.iter().filter(|a| math::exp(**a) > 1.5).count();
    let mut powers = [0.0; 4];
    for (power, a) in powers.iter_mut().zip(&numbers) {
        *power = math::exp2(*a);
    }
    Vec4::new(sum, product, large as f32, powers.iter().copied().sum())
}

/// Elements of a buffer, which a closure in an iterator by value holds. A parameter has a keyword's name.
#[kernel(compute, threads(64))]
pub fn gathered(
    #[element] r#in: UVec4,
    #[storage]
    #[length(37)]
    numbers: Buffer<'_, UVec4>,
) -> UVec4 {
    r#in.to_array()
        .into_iter()
        .map(|i| numbers.get(i % 37))
        .fold(r#in, |sum, it| {
            let [a, b] = [sum.to_array(), it.to_array()];
            UVec4::new(
                a[0].wrapping_mul(3).wrapping_add(b[0]),
                a[1] ^ b[1],
                a[2].wrapping_add(b[2]),
                a[3].rotate_left(5) ^ b[3],
            )
        })
}

/// A texture between texels, in a function of its own.
fn tap(texture: Texture2d<'_>, sampler: Sampler, uv: Vec2) -> f32 {
    texture.sample_level(sampler, uv, 0.0).x
}

/// A texture and how it is read.
struct Reader<'a> {
    texture: Texture2d<'a>,
    sampler: Sampler,
}

impl Reader<'_> {
    fn at(&self, uv: Vec2) -> f32 {
        self.texture.sample_level(self.sampler, uv, 0.0).y
    }
}

/// A texture and a sampler as a function's arguments, in a structure with a method, and in closures of iterators.
#[kernel(compute, threads(64))]
pub fn handed_on(
    #[element]
    #[range(0.0..=1.0)]
    uv: Vec2,
    #[texture]
    #[size(16, 16)]
    texture: Texture2d<'_>,
    #[sampler] sampler: Sampler,
) -> Vec4 {
    let reader = Reader { texture, sampler };
    let column: f32 = (0..4_u32)
        .map(|y| texture.load(UVec2::new(3, y)).x)
        .filter(|x| *x > 0.25)
        .take(2)
        .sum();
    let mut square = 0.0;
    for x in (0..2_u32)
        .flat_map(|y| (0..2_u32).map(move |x| UVec2::new(x, y)))
        .map(|at| texture.load(at).z)
    {
        square += x;
    }
    Vec4::new(tap(texture, sampler, uv), reader.at(uv), column, square)
}
