//! A sample of what the built-in library has none of: structures and matrices at interfaces, methods of vectors, branches,
//! bits, and what the host looks up.
#![allow(
    clippy::neg_cmp_op_on_partial_ord,
    reason = "the functions are what is translated, as somebody may write them"
)]

use hankel_codegen::functions;
use hankel_codegen::functions::ir::Library;
use hankel_codegen::functions::source::CrateText;
use hankel_dsl::glam::{Mat3, Mat4, UVec2, UVec4, Vec2, Vec3, Vec3Swizzles, Vec4};
use hankel_dsl::native::describe::Type;
use hankel_dsl::native::function::{Function, Words};
use hankel_dsl::{Real, function, to_i32};

use super::written;

/// Functions, and their source.
macro_rules! both {
    ($($tokens:tt)*) => {
        $($tokens)*
        const SOURCE: &str = stringify!($($tokens)*);
    };
}

both! {
    /// Two numbers.
    #[derive(Clone, Copy)]
    pub struct Pair {
        /// The smaller one.
        pub low: f32,
        /// The larger one.
        pub high: f32,
    }

    /// A pair in order.
    #[function]
    pub fn ordered(a: f32, b: f32) -> Pair {
        Pair { low: Real::min(a, b), high: Real::max(a, b) }
    }

    /// A pair's middle, and how far it is from an end.
    #[function]
    pub fn middle(pair: Pair) -> Vec2 {
        Vec2::new((pair.low + pair.high) * 0.5, (pair.high - pair.low) * 0.5)
    }

    /// Structures that functions give and take.
    #[function]
    pub fn structures(a: f32, b: f32) -> Vec2 {
        let pair = ordered(a, -b);
        middle(Pair { low: pair.low, high: pair.high + 1.0 }) - middle(pair) * 3.0
    }

    /// Branches with statements and without, and a loop whose count is not known.
    #[function]
    pub fn branches(x: f32, y: f32, turns: u32) -> f32 {
        let mut sign = 1.0;
        let size = if x < y {
            sign = -1.0;
            let d = y - x;
            d * d
        } else {
            x - y
        };
        let is_odd = (x > 0.5) & !(y > 0.5) | (x < -0.5 && y < -0.5 || x == y);
        let kind = if is_odd { 3_u32 } else { 5 };
        let mut sum = size * sign + kind as f32;
        let mut i = 0_u32;
        while i < turns & 15 {
            sum = sum * 0.5 + i as f32;
            i += 1;
        }
        sum
    }

    /// Loops with `for`: over what is known and what is not, left and continued, within each other.
    #[function]
    pub fn counted(x: f32, turns: u32) -> f32 {
        const WEIGHTS: [f32; 6] = [0.5, 0.25, 0.125, 0.0625, 0.03125, 0.03125];
        let mut sum = 0.0;
        for (i, weight) in WEIGHTS.iter().enumerate() {
            sum += (x + i as f32) * weight;
        }
        for row in -3..=3 {
            if row == 0 {
                continue;
            }
            for i in 0..turns & 7 {
                sum = sum * 0.5 + (row * 2) as f32;
                if sum > 4.0 {
                    break;
                }
                sum -= i as f32;
            }
        }
        let mut steps = 0;
        for _ in 0..20 {
            if sum * sum < 2.0 {
                break;
            } else {
                sum *= 0.5;
            }
            steps += 1;
        }
        sum + steps as f32
    }

    /// Ends before the last line, and numbers that are told apart.
    #[function]
    pub fn ended(x: f32, kind: u32) -> f32 {
        if !(x.abs() < 1e6) {
            return -1.0;
        }
        let scale = match kind & 15 {
            0 => 1.0,
            1 | 2 => x,
            3..=5 => {
                if x < 0.0 {
                    return x * 0.25;
                }
                x + 1.0
            }
            n if n > 12 => n as f32,
            _ => 0.5,
        };
        let mut y = x * scale;
        if y > 1.0 {
            y -= 1.0;
            if y > 1.0 {
                return 1.0;
            }
        } else if y < -1.0 {
            return y + scale;
        }
        y * y
    }

    /// Conversions, and components in another order.
    #[function]
    pub fn converted(x0: f32, word: u32) -> UVec4 {
        let v = Vec3::new(x0, x0 * 1e10, -x0).zyx();
        let whole = (x0 * 3.5) as i32;
        let far = v.as_uvec3();
        UVec4::new(v.y as u32, whole as u32, far.x ^ far.z, u32::from(x0 < 0.5) + (word < 7) as u32)
    }

    /// Bits and whole numbers.
    #[function]
    pub fn bits(word: u32, x: f32) -> UVec2 {
        let whole = to_i32(Real::clamp(x, -100.0, 100.0));
        let low = (word & 0xff) << 3 | word >> 29;
        let mixed = word.wrapping_mul(747_796_405).wrapping_add(whole as u32) ^ !low;
        UVec2::new(low | mixed & 0xf0f0, if whole < 1 { mixed } else { x.to_bits() })
    }

    /// A place in the world in a light's map.
    #[function]
    pub fn in_map(map_from_world: Mat4, world: Vec3) -> Vec3 {
        map_from_world.project_point3(world)
    }

    /// Two turns, one after the other, the other way round.
    #[function]
    pub fn turned_back(first: Mat3, second: Mat3) -> Mat3 {
        (second * first).transpose()
    }

    /// A matrix that a function takes.
    #[function]
    pub fn projected(x: Vec4, y: Vec4, z: Vec3, place: Vec3) -> Vec4 {
        let map = Mat4::from_cols(x, y, z.extend(0.5), Vec4::new(0.25, 0.5, 0.75, 16.0));
        in_map(map, place).extend(map.x_axis.y)
    }

    /// Matrices that functions take and give.
    #[function]
    pub fn turned(x: Vec3, y: Vec3, z: Vec3) -> Vec3 {
        // What is far off would overflow.
        let (least, most) = (Vec3::splat(-1000.0), Vec3::splat(1000.0));
        let (x, y, z) = (x.clamp(least, most), y.clamp(least, most), z.clamp(least, most));
        let turn = turned_back(Mat3::from_cols(x, y, z), Mat3::from_cols(z, x, y));
        turn * z + turn.y_axis
    }

    /// What matrices have.
    #[function]
    pub fn matrices(x: Vec4, y: Vec4, place: Vec3) -> Vec4 {
        let (least, most) = (Vec4::splat(-1000.0), Vec4::splat(1000.0));
        let (x, y) = (x.clamp(least, most), y.clamp(least, most));
        let place = place.clamp(Vec3::splat(-1000.0), Vec3::splat(1000.0));
        let map = Mat4::from_cols(x, y, x * 0.5, Vec4::new(0.25, 0.5, 0.75, 1.0));
        let corner = (map * 2.0).transform_point3(place) - map.transform_vector3(place);
        (map + map.transpose()) * corner.extend(place.x)
    }

    /// What vectors have.
    #[function]
    pub fn vectors(a: Vec3, b: Vec3, share: f32) -> Vec4 {
        let normal = (a + Vec3::splat(2.5)).normalize();
        let c = normal.cross(b).lerp(a, share);
        let c = c.clamp(Vec3::splat(-2.0), Vec3::splat(2.0));
        let d = c.abs().min(b).max(-normal) + (c * 4.0).floor();
        d.extend(a.distance(b) + b.length() * c.dot(b) - d.length_squared())
    }

    /// The mean of what is looked up.
    #[function]
    pub fn mean(count: u32, depth_at: impl Fn(u32) -> f32) -> f32 {
        let mut sum = depth_at(0);
        let mut i = 1;
        while i < count {
            sum += depth_at(i);
            i += 1;
        }
        sum / count as f32
    }
}

hankel_dsl::library!(sample {
    api: 1,
    functions: [
        structures, branches, counted, ended, converted, bits, projected, turned, matrices,
        vectors, mean
    ]
});

/// The same as in `HOST`.
pub fn mean_of(x: f32, turns: u32) -> f32 {
    let i = x + 1.0;
    let inner = |k: u32| mean(2, |l| k as f32 * i + l as f32);
    mean(4, |k| k as f32 * i) + mean(1 << (turns & 3), inner)
}

impl Words for Pair {
    const COUNT: usize = 2;

    fn describe() -> Type {
        panic!("a structure is not at the interface of a stub")
    }

    fn read(words: &[u32]) -> Self {
        Self {
            low: f32::read(words),
            high: f32::read(&words[1..]),
        }
    }

    fn write(self, words: &mut Vec<u32>) {
        self.low.write(words);
        self.high.write(words);
    }
}

/// Those that look nothing up.
pub fn functions() -> Vec<Function> {
    sample_library::functions()
}

/// Whether a function is one of them.
pub fn has(function: &Function) -> bool {
    functions().iter().any(|f| f.name == function.name)
}

/// The sample, translated.
pub fn library() -> Library {
    let list = "hankel_dsl::library!(sample { api: 1, functions: [structures, branches, counted, ended, converted, bits, projected, turned, \
                matrices, vectors, mean] });";
    let krate = CrateText {
        name: "sample".into(),
        version: "1.0.0".into(),
        licence: "MIT".into(),
        files: [("src/lib.rs".to_owned(), format!("{SOURCE}\n{list}"))].into(),
    };
    let mut libraries = functions::read(&[krate]).unwrap_or_else(|e| panic!("{e}"));
    libraries.remove(0)
}

/// Its text in a form.
pub fn text(form: &str) -> String {
    written(&library(), form)
}
