//! From TOML to a checked scene.

use std::fmt::{self, Display};
use std::marker::PhantomData;
use std::ops::{Range, RangeInclusive};
use std::path::{Path, PathBuf};

use hankel_dsl::glam::Vec3;
use hankel_system::fields::Table;
use serde::de::value::MapAccessDeserializer;
use serde::de::{Error as _, MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer};
use toml::Spanned;

use super::error::{Place, Result, SceneError};
use super::{
    Area, AreaShape, Camera, DepthRange, FAR_OFF, Fit, Geometry, Light, Medium, Procedural, Scene,
    Shadow, Source, Spot,
};
use crate::graph::ImagePasses;
use crate::scattering::{self, Scattering};
use crate::techniques::{self, DepthBias, Map, Technique};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    geometry: Spanned<Table<GeometryText>>,
    camera: Table<CameraText>,
    light: Spanned<Lights>,
    medium: Option<Table<MediumText>>,
    #[serde(default)]
    shadow: Table<ShadowText>,
    #[serde(default)]
    output: Table<OutputText>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct GeometryText {
    model: Option<Spanned<PathBuf>>,
    procedural: Option<Procedural>,
    ground: Option<Spanned<f32>>,
    opacity: Option<Spanned<f32>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CameraText {
    eye: Three,
    target: Three,
    up: Option<Three>,
    fov: Option<Spanned<f32>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct LightText {
    direction: Three,
    position: Option<Three>,
    angle: Option<Spanned<f32>>,
    inner: Option<Spanned<f32>>,
    strength: Option<Spanned<f32>>,
    colour: Option<Three>,
    radius: Option<Spanned<f32>>,
    shape: Option<Spanned<AreaShape>>,
}

/// A point, a direction or a colour.
type Three = Spanned<Exactly<f32, 3>>;

/// As many numbers as its type says. An array of serde's own passes over those beyond its end.
struct Exactly<T, const N: usize>([T; N]);

impl<'de, T: Deserialize<'de>, const N: usize> Deserialize<'de> for Exactly<T, N> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> std::result::Result<Self, D::Error> {
        struct Numbers<T, const N: usize>(PhantomData<T>);

        impl<'de, T: Deserialize<'de>, const N: usize> Visitor<'de> for Numbers<T, N> {
            type Value = Exactly<T, N>;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(f, "{N} numbers")
            }

            fn visit_seq<A: SeqAccess<'de>>(
                self,
                mut seq: A,
            ) -> std::result::Result<Self::Value, A::Error> {
                let mut given: Vec<T> = Vec::with_capacity(N);
                while let Some(number) = seq.next_element()? {
                    given.push(number);
                }
                let count = given.len();
                let all = <[T; N]>::try_from(given).map(Exactly);
                all.map_err(|_| A::Error::custom(format!("{N} numbers are wanted, not {count}")))
            }
        }

        deserializer.deserialize_seq(Numbers(PhantomData))
    }
}

/// One table `[light]`, or several `[[light]]`.
struct Lights(Vec<LightText>);

impl<'de> Deserialize<'de> for Lights {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> std::result::Result<Self, D::Error> {
        struct Tables;

        impl<'de> Visitor<'de> for Tables {
            type Value = Lights;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a table `[light]`, or several `[[light]]`")
            }

            fn visit_map<A: MapAccess<'de>>(
                self,
                map: A,
            ) -> std::result::Result<Self::Value, A::Error> {
                let light = LightText::deserialize(MapAccessDeserializer::new(map))?;
                Ok(Lights(vec![light]))
            }

            fn visit_seq<A: SeqAccess<'de>>(
                self,
                mut seq: A,
            ) -> std::result::Result<Self::Value, A::Error> {
                let mut lights = Vec::new();
                while let Some(Table(light)) = seq.next_element()? {
                    lights.push(light);
                }
                Ok(Lights(lights))
            }
        }

        deserializer.deserialize_any(Tables)
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct MediumText {
    extinction: Spanned<f32>,
    scattering: Option<Spanned<f32>>,
    anisotropy: Option<Spanned<f32>>,
    technique: Option<Spanned<String>>,
    steps: Option<Spanned<i64>>,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct ShadowText {
    technique: Option<Spanned<String>>,
    size: Option<Spanned<i64>>,
    multisampling: Option<Spanned<i64>>,
    depth_range: Option<Spanned<DepthRange>>,
    format: Option<Spanned<String>>,
    filter: Option<Spanned<i64>>,
    #[serde(default)]
    fit: Fit,
    samples: Option<Exactly<Spanned<i64>, 2>>,
    moment_bias: Option<Spanned<f32>>,
    depth_bias: Option<Spanned<f32>>,
    leak_cut: Option<Spanned<f32>>,
    #[serde(default)]
    mips: bool,
    anisotropy: Option<Spanned<i64>>,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct OutputText {
    width: Option<Spanned<i64>>,
    height: Option<Spanned<i64>>,
}

pub(super) fn parse(text: &str, file: &Path) -> Result<Scene> {
    let reader = Reader { text, file };
    let f: File = toml::from_str(text).map_err(|e| SceneError::Syntax {
        place: reader.place(e.span().unwrap_or(0..0)),
        problem: reader.problem(&e),
    })?;
    reader.scene(f)
}

/// Names to choose from, each once.
fn one_of(mut names: Vec<String>) -> String {
    names.dedup();
    let names: Vec<String> = names.iter().map(|n| format!("`{n}`")).collect();
    match names.len() {
        1 => names.concat(),
        _ => format!("one of {}", names.join(", ")),
    }
}

struct Reader<'a> {
    text: &'a str,
    file: &'a Path,
}

impl Reader<'_> {
    fn place(&self, span: Range<usize>) -> Place {
        let before = self.text.get(..span.start).unwrap_or(self.text);
        let line_start = before.rfind('\n').map_or(0, |i| i + 1);
        Place {
            file: self.file.to_path_buf(),
            line: before.matches('\n').count() + 1,
            column: before[line_start..].chars().count() + 1,
        }
    }

    /// The message of a TOML error, with the field that its place belongs to.
    fn problem(&self, e: &toml::de::Error) -> String {
        let message = e.message().trim().replace('\n', ", ");
        let Some(span) = e.span().filter(|s| s.start < self.text.len()) else {
            return message;
        };
        let before = &self.text[..span.start];
        let line_start = before.rfind('\n').map_or(0, |i| i + 1);
        let line = self.text[line_start..].lines().next().unwrap_or("");
        let table = self.text[..line_start]
            .lines()
            .rev()
            .find_map(|l| l.trim().strip_prefix('[')?.split(']').next())
            // Of several lights, each has a table `[[light]]`.
            .map(|table| table.trim_start_matches('['));
        match (table, line.split_once('=')) {
            (Some(table), Some((key, _))) => format!("`{table}.{}`: {message}", key.trim()),
            (None, Some((key, _))) => format!("`{}`: {message}", key.trim()),
            (_, None) => message,
        }
    }

    fn refuse<T>(
        &self,
        span: Range<usize>,
        field: &str,
        value: impl Display,
        allowed: impl Into<String>,
    ) -> Result<T> {
        Err(SceneError::Value {
            place: self.place(span),
            field: field.into(),
            value: value.to_string(),
            allowed: allowed.into(),
        })
    }

    fn integer(
        &self,
        field: &str,
        given: Option<Spanned<i64>>,
        default: u32,
        range: RangeInclusive<u32>,
    ) -> Result<u32> {
        let Some(given) = given else {
            return Ok(default);
        };
        match u32::try_from(*given.get_ref()) {
            Ok(n) if range.contains(&n) => Ok(n),
            _ => self.refuse(
                given.span(),
                field,
                given.get_ref(),
                format!("a whole number from {} to {}", range.start(), range.end()),
            ),
        }
    }

    fn number(
        &self,
        field: &str,
        given: Option<Spanned<f32>>,
        default: f32,
        range: RangeInclusive<f32>,
    ) -> Result<f32> {
        let Some(given) = given else {
            return Ok(default);
        };
        let x = *given.get_ref();
        if range.contains(&x) {
            return Ok(x);
        }
        self.refuse(
            given.span(),
            field,
            x,
            format!("a number from {} to {}", range.start(), range.end()),
        )
    }

    fn point(&self, field: &str, given: &Three) -> Result<Vec3> {
        let p = Vec3::from_array(given.get_ref().0);
        if p.is_finite() && p.abs().max_element() <= FAR_OFF {
            return Ok(p);
        }
        self.refuse(
            given.span(),
            field,
            p,
            format!("three finite numbers from -{FAR_OFF} to {FAR_OFF}"),
        )
    }

    fn direction(&self, field: &str, given: &Three) -> Result<Vec3> {
        // In double precision, in which the square of no single one vanishes.
        let d = self.point(field, given)?.as_dvec3().try_normalize();
        d.map(|d| d.as_vec3()).map_or_else(
            || {
                self.refuse(
                    given.span(),
                    field,
                    Vec3::from_array(given.get_ref().0),
                    "a direction: not all three may be zero",
                )
            },
            Ok,
        )
    }

    fn camera(&self, c: &CameraText, fov: Option<Spanned<f32>>) -> Result<Camera> {
        let camera = Camera {
            eye: self.point("camera.eye", &c.eye)?,
            target: self.point("camera.target", &c.target)?,
            up: match &c.up {
                Some(up) => self.direction("camera.up", up)?,
                None => Vec3::Y,
            },
            fov: self.number("camera.fov", fov, 40.0, 1.0..=170.0)?,
        };
        let Some(forward) = (camera.target - camera.eye).try_normalize() else {
            return self.refuse(
                c.target.span(),
                "camera.target",
                camera.target,
                "another point than `camera.eye`",
            );
        };
        if forward.cross(camera.up).length() < 1e-3 {
            return self.refuse(
                c.up.as_ref().unwrap_or(&c.target).span(),
                "camera.up",
                camera.up,
                "a direction that is not along the view (from `camera.eye` to `camera.target`)",
            );
        }
        Ok(camera)
    }

    fn geometry(&self, given: Spanned<Table<GeometryText>>) -> Result<Geometry> {
        let span = given.span();
        let Table(g) = given.into_inner();
        match (g.model, g.procedural) {
            (Some(model), None) => {
                if model.get_ref().as_os_str().is_empty() {
                    return self.refuse(model.span(), "geometry.model", "empty", "a glTF file");
                }
                let ground = self.number("geometry.ground", g.ground, 0.0, 0.0..=1000.0)?;
                let place = g.opacity.as_ref().map_or(0..0, Spanned::span);
                let opacity = self.number("geometry.opacity", g.opacity, 1.0, 0.0..=1.0)?;
                if opacity < 1.0 && ground == 0.0 {
                    let allowed = "1, or the model on a `ground`: without it nothing opaque would show a shadow";
                    return self.refuse(place, "geometry.opacity", opacity, allowed);
                }
                Ok(Geometry::Model {
                    ground,
                    opacity,
                    file: self
                        .file
                        .parent()
                        .unwrap_or(Path::new(""))
                        .join(model.get_ref()),
                })
            }
            (None, Some(procedural)) => match (g.ground, g.opacity) {
                (Some(ground), _) => self.refuse(
                    ground.span(),
                    "geometry.ground",
                    ground.get_ref(),
                    "left out: a procedural scene has its own ground",
                ),
                (None, Some(opacity)) => self.refuse(
                    opacity.span(),
                    "geometry.opacity",
                    opacity.get_ref(),
                    "left out: a procedural scene has its own opacities",
                ),
                (None, None) => Ok(Geometry::Procedural(procedural)),
            },
            (model, _) => self.refuse(
                span,
                "geometry",
                if model.is_some() {
                    "both a model and procedural"
                } else {
                    "neither"
                },
                "either `model = \"FILE.glb\"` or `procedural = \"yard\"` (or \"box\")",
            ),
        }
    }

    /// The technique's map with the given format and range, the first one that has them.
    fn map(
        &self,
        technique: &Technique,
        format: Option<Spanned<String>>,
        range: Option<Spanned<DepthRange>>,
    ) -> Result<Map> {
        let of_format = |map: &&Map| {
            let given = format.as_ref().map(Spanned::get_ref);
            given.is_none_or(|f| f == map.format.name())
        };
        let maps: Vec<&Map> = technique.maps.iter().filter(of_format).collect();
        let found = maps.iter().find(|map| {
            let given = range.as_ref().map(Spanned::get_ref);
            given.is_none_or(|r| *r == map.depth_range)
        });
        if let Some(map) = found {
            return Ok(**map);
        }
        let of = |allowed: Vec<String>| format!("{}, for `{}`", one_of(allowed), technique.name);
        match (format, range) {
            (Some(format), _) if maps.is_empty() => {
                let names = technique.maps.iter().map(|m| m.format.name().to_owned());
                let value = format!("`{}`", format.get_ref());
                self.refuse(format.span(), "shadow.format", value, of(names.collect()))
            }
            (format, Some(range)) => {
                let names = maps.iter().map(|m| m.depth_range.name().to_owned());
                let mut allowed = of(names.collect());
                if let Some(format) = format {
                    allowed = format!("{allowed} in {}", format.get_ref());
                }
                let value = format!("`{}`", range.get_ref().name());
                self.refuse(range.span(), "shadow.depth_range", value, allowed)
            }
            // Without a format and a range any map will do, and each technique has one.
            (_, None) => Ok(technique.maps[0]),
        }
    }

    fn shadow(&self, s: ShadowText) -> Result<Shadow> {
        let technique = match &s.technique {
            Some(name) => match Technique::named(name.get_ref()) {
                Some(technique) => technique,
                None => {
                    let names = techniques::ALL.map(|t| t.name.to_owned());
                    return self.refuse(
                        name.span(),
                        "shadow.technique",
                        format!("`{}`", name.get_ref()),
                        one_of(names.into()),
                    );
                }
            },
            None => Shadow::default().technique,
        };
        let d = Shadow::of(technique, self.map(technique, s.format, s.depth_range)?);
        let filter_span = s.filter.as_ref().map_or(0..0, Spanned::span);
        let filter = self.integer("shadow.filter", s.filter, d.filter, 1..=Scene::MAX_FILTER)?;
        if filter.is_multiple_of(2) {
            return self.refuse(filter_span, "shadow.filter", filter, "odd");
        }
        let multisampling = match s.multisampling {
            Some(n) => {
                if !matches!(*n.get_ref(), 1 | 4) {
                    return self.refuse(n.span(), "shadow.multisampling", n.get_ref(), "4 or 1");
                }
                *n.get_ref() as u32
            }
            None => d.multisampling,
        };
        let samples = match s.samples {
            Some(Exactly(counts)) => {
                let [search, filter] = counts
                    .map(|n| self.integer("shadow.samples", Some(n), 0, 1..=Scene::MAX_SAMPLES));
                [search?, filter?]
            }
            None => d.samples,
        };
        if let Some(anisotropy) = s.anisotropy.as_ref().filter(|_| !s.mips) {
            return self.refuse(
                anisotropy.span(),
                "shadow.anisotropy",
                anisotropy.get_ref(),
                "left out, or with `mips = true` beside it",
            );
        }
        let most = Scene::MAX_ANISOTROPY;
        let bias = 0.0..=DepthBias::MOST;
        Ok(Shadow {
            samples,
            multisampling,
            size: self.integer("shadow.size", s.size, d.size, 16..=Scene::MAX_MAP)?,
            filter,
            fit: s.fit,
            moment_bias: self.number(
                "shadow.moment_bias",
                s.moment_bias,
                d.moment_bias,
                bias.clone(),
            )?,
            depth_bias: match s.depth_bias {
                Some(share) => {
                    let share = self.number("shadow.depth_bias", Some(share), 0.0, bias)?;
                    DepthBias::Share(share)
                }
                None => d.depth_bias,
            },
            leak_cut: self.number("shadow.leak_cut", s.leak_cut, d.leak_cut, 0.0..=0.9)?,
            mips: s.mips,
            anisotropy: self.integer("shadow.anisotropy", s.anisotropy, d.anisotropy, 1..=most)?,
            ..d
        })
    }

    fn light(&self, l: LightText) -> Result<Light> {
        let direction = self.direction("light.direction", &l.direction)?;
        if let (Some(shape), None) = (&l.shape, &l.radius) {
            let allowed = "left out: a light without a `radius` is a point";
            let name = match shape.get_ref() {
                AreaShape::Disc => "disc",
                AreaShape::Square => "square",
            };
            return self.refuse(shape.span(), "light.shape", name, allowed);
        }
        // As an angle, or as a length.
        let widest = match l.position {
            None => Area::MAX_RADIUS,
            Some(_) => FAR_OFF,
        };
        let area = Area {
            shape: l
                .shape
                .as_ref()
                .map_or_else(AreaShape::default, |s| *s.get_ref()),
            radius: self.number("light.radius", l.radius, 0.0, 0.0..=widest)?,
        };
        let source = match &l.position {
            None => {
                for (field, given) in [("light.angle", &l.angle), ("light.inner", &l.inner)] {
                    if let Some(given) = given {
                        let allowed =
                            "left out: only a spot light, which has a `position`, has a cone";
                        return self.refuse(given.span(), field, given.get_ref(), allowed);
                    }
                }
                Source::Directional { direction }
            }
            Some(position) => {
                let angle = self.number("light.angle", l.angle, 60.0, 1.0..=Spot::MAX_ANGLE)?;
                let place = l.inner.as_ref().map_or(0..0, Spanned::span);
                let inner = self.number("light.inner", l.inner, 0.8 * angle, 0.0..=angle)?;
                if inner > 0.999 * angle {
                    let allowed = format!("less than 0.999 of `light.angle`, which is {angle}");
                    return self.refuse(place, "light.inner", inner, allowed);
                }
                Source::Spot(Spot {
                    position: self.point("light.position", position)?,
                    direction,
                    angle,
                    inner,
                })
            }
        };
        let colour = match &l.colour {
            Some(given) => {
                let colour = Vec3::from_array(given.get_ref().0);
                if !colour.to_array().iter().all(|c| (0.0..=1.0).contains(c)) {
                    let allowed = "three numbers from 0 to 1: `light.strength` has no such limit";
                    return self.refuse(given.span(), "light.colour", colour, allowed);
                }
                colour
            }
            None => Vec3::ONE,
        };
        Ok(Light {
            source,
            area,
            strength: self.number("light.strength", l.strength, 1.0, 0.0..=Light::MAX_STRENGTH)?,
            colour,
        })
    }

    fn lights(&self, given: Spanned<Lights>) -> Result<Vec<Light>> {
        let span = given.span();
        let Lights(tables) = given.into_inner();
        if !(1..=Scene::MAX_LIGHTS).contains(&tables.len()) {
            let allowed = format!("1 to {} tables `[[light]]`", Scene::MAX_LIGHTS);
            return self.refuse(span, "light", tables.len(), allowed);
        }
        tables.into_iter().map(|table| self.light(table)).collect()
    }

    /// The medium, by the first technique that is for all of the scene's lights unless it names one.
    fn medium(&self, m: MediumText, lights: &[Light]) -> Result<Medium> {
        let refused = |technique: &Scattering| lights.iter().find_map(|l| l.refuses(technique));
        let d = Medium::default();
        let extinction = self.number("medium.extinction", Some(m.extinction), 0.0, 1e-6..=1e6)?;
        if let Some(scattering) = &m.scattering
            && !(0.0..=extinction).contains(scattering.get_ref())
        {
            return self.refuse(
                scattering.span(),
                "medium.scattering",
                scattering.get_ref(),
                format!("a number from 0 to `medium.extinction`, which is {extinction}"),
            );
        }
        let technique = match &m.technique {
            Some(name) => match Scattering::named(name.get_ref()) {
                Some(technique) => {
                    if let Some(instead) = refused(technique) {
                        let name_given = format!("`{}`", name.get_ref());
                        return self.refuse(name.span(), "medium.technique", name_given, instead);
                    }
                    technique
                }
                None => {
                    let names = scattering::ALL.map(|t| t.name.to_owned());
                    return self.refuse(
                        name.span(),
                        "medium.technique",
                        format!("`{}`", name.get_ref()),
                        one_of(names.into()),
                    );
                }
            },
            None => scattering::ALL
                .into_iter()
                .find(|technique| refused(technique).is_none())
                .unwrap_or(d.technique),
        };
        Ok(Medium {
            extinction,
            scattering: m.scattering.map_or(extinction, Spanned::into_inner),
            anisotropy: self.number("medium.anisotropy", m.anisotropy, d.anisotropy, -0.9..=0.9)?,
            technique,
            steps: self.integer("medium.steps", m.steps, d.steps, 1..=Scene::MAX_STEPS)?,
        })
    }

    fn scene(&self, mut f: File) -> Result<Scene> {
        let fov = f.camera.0.fov.take();
        let [width, height] = Scene::DEFAULT_OUTPUT;
        let pixels = 1..=Scene::MAX_OUTPUT;
        let shadow = self.shadow(f.shadow.0)?;
        let lights = self.lights(f.light)?;
        let medium = f
            .medium
            .map(|Table(m)| self.medium(m, &lights))
            .transpose()?;
        Ok(Scene {
            geometry: self.geometry(f.geometry)?,
            camera: self.camera(&f.camera.0, fov)?,
            lights,
            medium,
            shadow,
            width: self.integer("output.width", f.output.0.width, width, pixels.clone())?,
            height: self.integer("output.height", f.output.0.height, height, pixels)?,
            image_passes: ImagePasses::default(),
        })
    }
}
