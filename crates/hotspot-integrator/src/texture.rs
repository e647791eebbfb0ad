//! Texture look-ups: bilinear, texels decoded first.

use crate::geometry::Attributes;
use glam::{Vec2, Vec3};
use hotspot_probe::Probe;
use hotspot_scene::{Channel, Color, NormalMap, Scalar, TextureRef, Wrap};
use std::sync::{Arc, OnceLock};

/// An image with its decoding table.
#[derive(Clone, Debug)]
pub(crate) struct Texture {
    width: u32,
    height: u32,
    rgba: Arc<[u8]>,
    linear: &'static [f32; 256],
}

/// sRGB to linear (IEC 61966-2-1), for all 8-bit values. `libm::pow` rather than the platform's, so that every machine
/// has the same table.
fn srgb_table() -> &'static [f32; 256] {
    static TABLE: OnceLock<[f32; 256]> = OnceLock::new();
    TABLE.get_or_init(|| {
        core::array::from_fn(|i| {
            let c = i as f64 / 255.0;
            (if c <= 0.04045 { c / 12.92 } else { libm::pow((c + 0.055) / 1.055, 2.4) }) as f32
        })
    })
}

impl Texture {
    /// `None` when the texels do not fill the image.
    pub(crate) fn new(texture: &hotspot_scene::Texture) -> Option<Self> {
        let texels = (texture.width as usize).checked_mul(texture.height as usize)?.checked_mul(4)?;
        (texels > 0 && texture.rgba.len() == texels).then(|| Self {
            width: texture.width,
            height: texture.height,
            rgba: texture.rgba.clone(),
            linear: srgb_table(),
        })
    }

    pub(crate) fn memory(&self) -> u64 {
        self.rgba.len() as u64
    }

    /// Mean linear colour, for choosing lights.
    pub(crate) fn mean_color(&self) -> Vec3 {
        let mut sum = [0.0f64; 3];
        for texel in self.rgba.chunks_exact(4) {
            for (s, &c) in sum.iter_mut().zip(texel) {
                *s += f64::from(self.linear[c as usize]);
            }
        }
        let count = (self.rgba.len() / 4) as f64;
        Vec3::from_array(sum.map(|s| (s / count) as f32))
    }

    #[inline(always)]
    fn texel(&self, x: u32, y: u32) -> [u8; 4] {
        let at = (y as usize * self.width as usize + x as usize) * 4;
        [self.rgba[at], self.rgba[at + 1], self.rgba[at + 2], self.rgba[at + 3]]
    }

    /// Interpolates `decode(texel)`; texel centres are at (i + 0.5)/n. Returns the value and the texels read.
    #[inline(always)]
    fn interpolate(&self, at: &TextureRef, uv: Vec2, decode: impl Fn([u8; 4]) -> Vec3) -> (Vec3, u32) {
        let [[a, b, c], [d, e, f]] = at.transform;
        let x = (a * uv.x + b * uv.y + c) * self.width as f32;
        let y = (d * uv.x + e * uv.y + f) * self.height as f32;
        if at.nearest {
            let texel = self.texel(
                wrap(at.wrap[0], x.floor() as i64, self.width),
                wrap(at.wrap[1], y.floor() as i64, self.height),
            );
            return (decode(texel), 1);
        }
        let (x, y) = (x - 0.5, y - 0.5);
        let (x0, y0) = (x.floor(), y.floor());
        let (fx, fy) = (x - x0, y - y0);
        // Float to integer saturates, so that wild coordinates wrap somewhere instead of overflowing.
        let (x0, y0) = (x0 as i64, y0 as i64);
        let columns = [x0, x0.saturating_add(1)].map(|x| wrap(at.wrap[0], x, self.width));
        let rows = [y0, y0.saturating_add(1)].map(|y| wrap(at.wrap[1], y, self.height));
        let sample = |column: usize, row: usize| decode(self.texel(columns[column], rows[row]));
        let top = sample(0, 0) * (1.0 - fx) + sample(1, 0) * fx;
        let bottom = sample(0, 1) * (1.0 - fx) + sample(1, 1) * fx;
        (top * (1.0 - fy) + bottom * fy, 4)
    }

    #[inline(always)]
    fn color<P: Probe>(&self, at: &TextureRef, uv: Vec2, probe: &mut P) -> Vec3 {
        let linear = self.linear;
        let decode =
            |t: [u8; 4]| Vec3::new(linear[t[0] as usize], linear[t[1] as usize], linear[t[2] as usize]);
        let (value, texels) = self.interpolate(at, uv, decode);
        probe.texture(1, 4 * texels);
        value
    }

    #[inline(always)]
    fn scalar<P: Probe>(&self, at: &TextureRef, channel: Channel, uv: Vec2, probe: &mut P) -> f32 {
        let (value, texels) = self.channel(at, channel, uv);
        probe.texture(1, 4 * texels);
        value
    }

    /// One channel, not decoded, and the texels read.
    #[inline(always)]
    fn channel(&self, at: &TextureRef, channel: Channel, uv: Vec2) -> (f32, u32) {
        let index = match channel {
            Channel::R => 0,
            Channel::G => 1,
            Channel::B => 2,
            Channel::A => 3,
        };
        let (value, texels) = self.interpolate(at, uv, |t| Vec3::splat(f32::from(t[index]) * (1.0 / 255.0)));
        (value.x, texels)
    }
}

/// An index wrapped into 0..size.
#[inline(always)]
fn wrap(mode: Wrap, index: i64, size: u32) -> u32 {
    let size = i64::from(size);
    let wrapped = match mode {
        Wrap::Repeat => index.rem_euclid(size),
        Wrap::Clamp => index.clamp(0, size - 1),
        Wrap::Mirror => {
            let period = index.rem_euclid(2 * size);
            if period < size { period } else { 2 * size - 1 - period }
        }
    };
    wrapped as u32
}

/// The coordinates that a texture reads.
#[inline(always)]
fn uv(at: &TextureRef, point: &Attributes) -> Vec2 {
    if at.second_uvs { point.second_uv } else { point.uv }
}

/// The value of a colour at a point.
#[inline(always)]
pub(crate) fn color<P: Probe>(
    textures: &[Texture],
    color: &Color,
    point: &Attributes,
    probe: &mut P,
) -> Vec3 {
    let factor = Vec3::from_array(color.factor);
    match &color.texture {
        None => factor,
        Some(at) => factor * textures[at.texture as usize].color(at, uv(at, point), probe),
    }
}

/// The value of a number at a point.
#[inline(always)]
pub(crate) fn scalar<P: Probe>(
    textures: &[Texture],
    scalar: &Scalar,
    point: &Attributes,
    probe: &mut P,
) -> f32 {
    match &scalar.texture {
        None => scalar.factor,
        Some((at, channel)) => {
            scalar.factor * textures[at.texture as usize].scalar(at, *channel, uv(at, point), probe)
        }
    }
}

/// A number at a point, for whoever counts look-ups himself: the value, the look-ups and the bytes of texels read.
#[inline(always)]
pub(crate) fn scalar_counted(textures: &[Texture], scalar: &Scalar, point: &Attributes) -> (f32, u32, u32) {
    match &scalar.texture {
        None => (scalar.factor, 0, 0),
        Some((at, channel)) => {
            let (value, texels) = textures[at.texture as usize].channel(at, *channel, uv(at, point));
            (scalar.factor * value, 1, 4 * texels)
        }
    }
}

/// The normal that a map holds at a point, in the frame of tangent, bitangent and normal; not of unit length.
#[inline(always)]
pub(crate) fn mapped_normal<P: Probe>(
    textures: &[Texture],
    map: &NormalMap,
    point: &Attributes,
    probe: &mut P,
) -> Vec3 {
    let at = &map.texture;
    let decode = |t: [u8; 4]| Vec3::new(f32::from(t[0]), f32::from(t[1]), f32::from(t[2]));
    let (texel, texels) = textures[at.texture as usize].interpolate(at, uv(at, point), decode);
    probe.texture(1, 4 * texels);
    let n = texel * (2.0 / 255.0) - Vec3::ONE;
    Vec3::new(n.x * map.scale, n.y * map.scale, n.z)
}

#[cfg(test)]
mod tests {
    use super::*;
    use hotspot_probe::NoProbe;

    fn checker() -> Texture {
        let rgba: Vec<u8> = vec![255, 0, 0, 255, 0, 255, 0, 128, 0, 0, 255, 0, 255, 255, 255, 64];
        Texture::new(&hotspot_scene::Texture { name: String::new(), width: 2, height: 2, rgba: rgba.into() })
            .expect("a full image")
    }

    fn at(wrap: Wrap, nearest: bool) -> TextureRef {
        TextureRef {
            texture: 0,
            wrap: [wrap; 2],
            nearest,
            transform: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
            second_uvs: false,
        }
    }

    #[test]
    fn centres_give_texels_and_middles_give_means() {
        let t = checker();
        let look = |u, v, wrap| t.color(&at(wrap, false), Vec2::new(u, v), &mut NoProbe);
        assert_eq!(look(0.25, 0.25, Wrap::Repeat), Vec3::new(1.0, 0.0, 0.0));
        assert_eq!(look(0.75, 0.25, Wrap::Repeat), Vec3::new(0.0, 1.0, 0.0));
        assert_eq!(look(0.5, 0.25, Wrap::Repeat), Vec3::new(0.5, 0.5, 0.0));
        // At the left edge, repetition mixes with the right column, clamping does not.
        assert_eq!(look(0.0, 0.25, Wrap::Repeat), Vec3::new(0.5, 0.5, 0.0));
        assert_eq!(look(0.0, 0.25, Wrap::Clamp), Vec3::new(1.0, 0.0, 0.0));
        assert_eq!(look(1.25, 0.25, Wrap::Mirror), Vec3::new(0.0, 1.0, 0.0));
    }

    #[test]
    fn wild_coordinates_do_not_panic() {
        let t = checker();
        for u in [f32::NAN, f32::INFINITY, -f32::INFINITY, 1e30, -1e30] {
            for wrap in [Wrap::Repeat, Wrap::Clamp, Wrap::Mirror] {
                for nearest in [false, true] {
                    t.color(&at(wrap, nearest), Vec2::new(u, u), &mut NoProbe);
                }
            }
        }
    }

    #[test]
    fn alpha_is_not_decoded() {
        let t = checker();
        let alpha = t.scalar(&at(Wrap::Repeat, true), Channel::A, Vec2::new(0.75, 0.25), &mut NoProbe);
        assert!((alpha - 128.0 / 255.0).abs() < 1e-6);
    }
}
