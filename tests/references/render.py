#!/usr/bin/env python3
"""Renders the reference images of this folder with Mitsuba 3, from the glTF files under scenes/.

    python3 render.py [NAME…]          all images of references.json, or those named

Needs `pip install mitsuba numpy pillow OpenEXR` (made with mitsuba 3.9.1, llvm_ad_rgb) and a libLLVM that Dr.Jit finds
(DRJIT_LIBLLVM_PATH). Nothing of hotspot-render is used: files are read, placed and shaded by the code below and by
Mitsuba, so that agreement says something.

What the images mean (the definitions that both renderers follow):
* geometry: triangle lists, node hierarchies in f64, EXT_mesh_gpu_instancing written out; a mirrored node keeps the outside
  of its triangles outside; smooth normals are used as they are, for shading only;
* every surface scatters on both sides; emission leaves the front only, by the geometric normal; its textures are in the
  first set of coordinates, decoded from sRGB, then filtered, with KHR_texture_transform;
* matte (specularFactor 0): Lambert. Coat: Ashikhmin-Shirley as in pbrt-v3's SubstrateMaterial, isotropic GGX,
  alpha = max(roughness^2, 1e-3), Rs = ((ior-1)/(ior+1))^2 specularFactor specularColorFactor at most 1. Mirror
  (metallic 1, roughness 0). Rough metal: GGX, separable Smith, Schlick. In between: linear in the metallic factor.
  Glass: smooth, exact Fresnel, base colour on what is transmitted; solid with KHR_materials_volume (Beer's law), else a pane;
* KHR_lights_punctual: W/sr and W/m2; spots fall off as clamp((cos - cos outer)/(cos inner - cos outer))^2;
* environment: constant, or an equirectangular map, bilinear between texel centres, -Z in its middle, +X to the right;
* pinhole camera by yfov, box filter, independent samples; paths of up to `depth` scattering events, roulette from the eighth.

Each file holds the mean of `replicates` independent renders of `spp` samples per pixel (R, G, B, 32 bits) and the standard
deviation of that mean, from the spread of the replicates (sd.red, sd.green, sd.blue, 16 bits).
"""
import base64, io, json, math, os, sys, time
import numpy as np

HERE = os.path.dirname(os.path.abspath(__file__))


def srgb_to_linear(x):
    return np.where(x <= 0.04045, x / 12.92, ((x + 0.055) / 1.055) ** 2.4)


class Gltf:
    TYPES = {5120: 'i1', 5121: 'u1', 5122: '<i2', 5123: '<u2', 5125: '<u4', 5126: '<f4'}
    SIZES = {'SCALAR': 1, 'VEC2': 2, 'VEC3': 3, 'VEC4': 4}

    def __init__(self, path):
        self.folder = os.path.dirname(path)
        self.json = json.load(open(path))
        self.buffers = [self.bytes_of(b['uri']) for b in self.json['buffers']]

    def bytes_of(self, uri):
        if uri.startswith('data:'):
            return base64.b64decode(uri.split(',', 1)[1])
        return open(os.path.join(self.folder, uri), 'rb').read()

    def accessor(self, index):
        a = self.json['accessors'][index]
        assert 'sparse' not in a and not a.get('normalized')
        view = self.json['bufferViews'][a['bufferView']]
        dtype, n = np.dtype(self.TYPES[a['componentType']]), self.SIZES[a['type']]
        assert view.get('byteStride', dtype.itemsize * n) == dtype.itemsize * n
        start = view.get('byteOffset', 0) + a.get('byteOffset', 0)
        return np.frombuffer(self.buffers[view['buffer']], dtype, a['count'] * n, start).reshape(-1, n).astype(np.float64)

    @staticmethod
    def place(t, q, s):
        x, y, z, w = q
        m = np.eye(4)
        m[:3, :3] = np.array([
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]]) * np.asarray(s)
        m[:3, 3] = t
        return m

    def nodes(self):
        """(node, matrix) of the default scene; a node with instances comes once for each."""
        def walk(index, above):
            node = self.json['nodes'][index]
            if 'matrix' in node:
                local = np.array(node['matrix'], float).reshape(4, 4).T
            else:
                local = self.place(node.get('translation', [0] * 3), node.get('rotation', [0, 0, 0, 1]), node.get('scale', [1] * 3))
            m = above @ local
            copies = node.get('extensions', {}).get('EXT_mesh_gpu_instancing')
            if copies is None:
                yield node, m
            else:
                rows = {k: self.accessor(i) for k, i in copies['attributes'].items()}
                for i in range(len(rows['TRANSLATION'])):
                    yield node, m @ self.place(rows['TRANSLATION'][i], rows['ROTATION'][i], rows['SCALE'][i])
            for child in node.get('children', []):
                yield from walk(child, m)
        for root in self.json['scenes'][self.json.get('scene', 0)]['nodes']:
            yield from walk(root, np.eye(4))

    def image(self, index):
        """Red, green, blue as stored, alpha; 0 to 1, rows from the top."""
        from PIL import Image
        image = self.json['images'][index]
        return np.asarray(Image.open(io.BytesIO(self.bytes_of(image['uri']))).convert('RGBA'), np.float64) / 255


def define(mi, dr):
    """The materials and lights that Mitsuba does not have. All shade both sides."""
    Flags = mi.BSDFFlags

    def pow5(x):
        return x * x * x * x * x

    def ggx(alpha, cos):
        t = dr.square(cos) * (dr.square(alpha) - 1) + 1
        return dr.square(alpha) / (dr.pi * dr.square(t))

    class Constant:
        """What Mitsuba hands over as a bare number or colour."""
        def __init__(self, value):
            values = [float(x) for x in (value if hasattr(value, '__len__') else [value])]
            self.values = [dr.opaque(mi.Float, x) for x in values]

        def eval(self, si, active=True):
            return mi.Color3f(*self.values)

        def eval_1(self, si, active=True):
            return self.values[0]

    def textured(value):
        return value if isinstance(value, mi.Texture) else Constant(value)

    class Surface(mi.BSDF):
        def __init__(self, props):
            super().__init__(props)
            self.base, self.roughness = (textured(props[k]) for k in ('base', 'roughness'))
            kind = Flags.GlossyReflection | Flags.FrontSide | Flags.BackSide
            self.m_components, self.m_flags = [kind], kind

        def alpha(self, si, active):
            r = self.roughness.eval_1(si, active)
            return dr.maximum(r * r, 1e-3)

        def upright(self, si, wo):
            s = dr.mulsign(mi.Float(1), si.wi.z)
            return mi.Vector3f(si.wi.x, si.wi.y, si.wi.z * s), mi.Vector3f(wo.x, wo.y, wo.z * s)

        def eval_pdf(self, ctx, si, wo, active=True):
            wi, wo = self.upright(si, wo)
            active &= (wi.z > 0) & (wo.z > 0)
            a = self.alpha(si, active)
            h = dr.normalize(wi + wo)
            f, pdf = self.f(self.base.eval(si, active), a, wi, wo, h), self.density(a, wi, wo, h)
            return dr.select(active, f * wo.z, 0), dr.select(active, pdf, 0)

        def eval(self, ctx, si, wo, active=True):
            return self.eval_pdf(ctx, si, wo, active)[0]

        def pdf(self, ctx, si, wo, active=True):
            return self.eval_pdf(ctx, si, wo, active)[1]

        def sample(self, ctx, si, lobe, u, active=True):
            s = dr.mulsign(mi.Float(1), si.wi.z)
            wi = mi.Vector3f(si.wi.x, si.wi.y, si.wi.z * s)
            wo = self.direction(self.alpha(si, active), wi, lobe, u)
            wo = mi.Vector3f(wo.x, wo.y, wo.z * s)
            f, pdf = self.eval_pdf(ctx, si, wo, active)
            active &= pdf > 0
            bs = dr.zeros(mi.BSDFSample3f)
            bs.wo, bs.pdf, bs.eta = wo, dr.select(active, pdf, 0), 1.0
            bs.sampled_type, bs.sampled_component = +Flags.GlossyReflection, 0
            return bs, dr.select(active, f / pdf, 0)

        def traverse(self, cb):
            for name in ('base', 'roughness'):
                if isinstance(getattr(self, name), mi.Texture):
                    cb.put(name, getattr(self, name), mi.ParamFlags.Differentiable)

        def to_string(self):
            return type(self).__name__

    class Coat(Surface):
        def __init__(self, props):
            super().__init__(props)
            self.rs = mi.Color3f([dr.opaque(mi.Float, float(x)) for x in props['rs'].split(',')])

        def f(self, rd, a, wi, wo, h):
            d = dr.abs(dr.dot(wi, h))
            below = (28 / (23 * dr.pi)) * rd * (1 - self.rs) * (1 - pow5(1 - wi.z / 2)) * (1 - pow5(1 - wo.z / 2))
            return below + ggx(a, h.z) / (4 * d * dr.maximum(wi.z, wo.z)) * (self.rs + (1 - self.rs) * pow5(1 - d))

        def density(self, a, wi, wo, h):
            return 0.5 * (wo.z / dr.pi + ggx(a, h.z) * h.z / (4 * dr.abs(dr.dot(wi, h))))

        def direction(self, a, wi, lobe, u):
            # tan^2 of the half vector's angle is a^2 u/(1-u) under D cos.
            t2 = dr.square(a) * u.x / (1 - u.x)
            cos = dr.rsqrt(1 + t2)
            sin = dr.sqrt(t2) * cos
            s, c = dr.sincos(2 * dr.pi * u.y)
            h = mi.Vector3f(sin * c, sin * s, cos)
            return dr.select(lobe < 0.5, mi.warp.square_to_cosine_hemisphere(u), 2 * dr.dot(wi, h) * h - wi)

    class Metal(Surface):
        def ggx(self, a):
            return mi.MicrofacetDistribution(mi.MicrofacetType.GGX, a, True)

        def f(self, f0, a, wi, wo, h):
            fresnel = f0 + (1 - f0) * pow5(1 - dr.abs(dr.dot(wi, h)))
            return fresnel * (self.ggx(a).eval(h) * self.ggx(a).G(wi, wo, h) / (4 * wi.z * wo.z))

        def density(self, a, wi, wo, h):
            return self.ggx(a).pdf(wi, h) / (4 * dr.abs(dr.dot(wo, h)))

        def direction(self, a, wi, lobe, u):
            h, _ = self.ggx(a).sample(wi, u)
            return 2 * dr.dot(wi, h) * h - wi

    class Cut(mi.Texture):
        """1 where the nested texture reaches the cutoff, else 0."""
        def __init__(self, props):
            super().__init__(props)
            self.nested, self.cutoff = props['nested'], float(props['cutoff'])

        def eval_1(self, si, active=True):
            return dr.select(self.nested.eval_1(si, active) >= self.cutoff, mi.Float(1), mi.Float(0))

        def eval(self, si, active=True):
            return mi.Color3f(self.eval_1(si, active))

        def mean(self):
            return self.nested.mean()

        def is_spatially_varying(self):
            return True

        def traverse(self, cb):
            cb.put('nested', self.nested, mi.ParamFlags.Differentiable)

        def to_string(self):
            return 'Cut'

    class Spot(mi.Emitter):
        def __init__(self, props):
            super().__init__(props)
            numbers = [dr.opaque(mi.Float, float(x)) for x in props['numbers'].split(',')]
            self.position, self.axis, self.intensity = (mi.Vector3f(numbers[i:i + 3]) for i in (0, 3, 6))
            self.inner, self.outer = numbers[9:]
            self.m_flags = +mi.EmitterFlags.DeltaPosition

        def eval(self, si, active=True):
            return mi.Color3f(0)

        def sample_direction(self, it, sample, active=True):
            ds = dr.zeros(mi.DirectionSample3f)
            ds.p = mi.Point3f(self.position)
            d = ds.p - it.p
            ds.dist = dr.norm(d)
            ds.d = d / ds.dist
            ds.n, ds.uv, ds.pdf, ds.delta, ds.time = -ds.d, mi.Point2f(0), 1.0, True, it.time
            ds.emitter = mi.EmitterPtr(self)
            edge = dr.clip((dr.dot(-ds.d, self.axis) - self.outer) / (self.inner - self.outer), 0, 1)
            return ds, mi.Color3f(self.intensity) * (dr.square(edge) / dr.square(ds.dist))

        def eval_direction(self, it, ds, active=True):
            return mi.Color3f(0)

        def pdf_direction(self, it, ds, active=True):
            return mi.Float(0)

        def bbox(self):
            return mi.ScalarBoundingBox3f()

        def traverse(self, cb):
            pass

        def to_string(self):
            return 'Spot'

    mi.register_bsdf('own_coat', Coat)
    mi.register_bsdf('own_metal', Metal)
    mi.register_texture('own_cut', Cut)
    mi.register_emitter('own_spot', Spot)


class Builder:
    WRAP = {10497: 'repeat', 33071: 'clamp', 33648: 'mirror'}

    def __init__(self, mi, gltf):
        self.mi, self.gltf = mi, gltf
        self.materials = {}
        self.attenuates = False

    def texture(self, info, pick):
        """A texture of `pick(rgba)`, an array of one or three channels."""
        mi, g = self.mi, self.gltf
        assert info.get('texCoord', 0) == 0
        t = g.json['textures'][info['index']]
        s = g.json['samplers'][t['sampler']] if 'sampler' in t else {}
        array = pick(g.image(t['source']))
        wrap = [self.WRAP[s.get(k, 10497)] for k in ('wrapS', 'wrapT')]
        # Of a place in the file's coordinates, in Mitsuba's order of application: scale, rotation, offset.
        m = np.eye(3)
        if (x := info.get('extensions', {}).get('KHR_texture_transform')) is not None:
            r, (ox, oy), (sx, sy) = x.get('rotation', 0.0), x.get('offset', [0, 0]), x.get('scale', [1, 1])
            c, n = math.cos(r), math.sin(r)
            m = np.array([[1, 0, ox], [0, 1, oy], [0, 0, 1]]) @ np.array([[c, n, 0], [-n, c, 0], [0, 0, 1]]) @ np.diag([sx, sy, 1])
        if wrap[0] != wrap[1]:
            # Mitsuba wraps both ways alike: the picture is written out over coordinates from -4 to 5.
            for axis, mode in enumerate(wrap):
                n = array.shape[1 - axis]
                i = np.arange(-4 * n, 5 * n)
                i = {'repeat': i % n, 'clamp': np.clip(i, 0, n - 1),
                     'mirror': np.where(i // n % 2 == 0, i % n, n - 1 - i % n)}[mode]
                array = np.take(array, i, 1 - axis)
            wrap[0] = 'clamp'
            m = np.array([[1 / 9, 0, 4 / 9], [0, 1 / 9, 4 / 9], [0, 0, 1]]) @ m
        return {'type': 'bitmap', 'data': mi.TensorXf(np.ascontiguousarray(array, np.float32)), 'raw': True,
                'format': 'variant', 'filter_type': 'nearest' if s.get('magFilter') == 9728 else 'bilinear',
                'wrap_mode': wrap[0], 'to_uv': mi.ScalarTransform3f(m)}

    def color(self, info, factor):
        if info is None:
            return {'type': 'rgb', 'value': [float(x) for x in factor]}
        return self.texture(info, lambda rgba: srgb_to_linear(rgba[..., :3]) * np.asarray(factor))

    def number(self, info, factor, channel):
        if info is None:
            return {'type': 'uniform', 'value': float(factor)}
        return self.texture(info, lambda rgba: rgba[..., channel:channel + 1] * factor)

    def material(self, index):
        if index not in self.materials:
            self.materials[index] = self.mi.load_dict(self.material_dict(self.gltf.json['materials'][index]))
        return self.materials[index]

    def material_dict(self, m):
        p, e = m.get('pbrMetallicRoughness', {}), m.get('extensions', {})
        unknown = set(e) - {'KHR_materials_' + x for x in ('specular', 'ior', 'transmission', 'volume', 'emissive_strength')}
        assert not unknown and 'normalTexture' not in m, unknown
        factor, metallic, roughness = p.get('baseColorFactor', [1] * 4), p.get('metallicFactor', 1), p.get('roughnessFactor', 1)
        base = self.color(p.get('baseColorTexture'), factor[:3])
        orm = p.get('metallicRoughnessTexture')
        ior = e.get('KHR_materials_ior', {}).get('ior', 1.5)
        specular = e.get('KHR_materials_specular', {})
        rough = self.number(orm, roughness, 1)
        two = lambda nested: {'type': 'twosided', 'nested': nested}
        if (share := e.get('KHR_materials_transmission', {}).get('transmissionFactor', 0)) > 0:
            assert share == 1 and roughness == 0
            solid = 'KHR_materials_volume' in e
            return {'type': 'dielectric' if solid else 'thindielectric', 'int_ior': ior, 'ext_ior': 1.0, 'specular_transmittance': base}
        if specular.get('specularFactor', 1) == 0:
            coat = two({'type': 'diffuse', 'reflectance': base})
        else:
            f0 = ((ior - 1) / (ior + 1)) ** 2 * specular.get('specularFactor', 1)
            rs = [min(f0 * c, 1.0) for c in specular.get('specularColorFactor', [1] * 3)]
            coat = {'type': 'own_coat', 'base': base, 'roughness': rough, 'rs': ','.join(map(repr, rs))}
        if roughness == 0 and metallic > 0:
            assert metallic == 1
            metal = two({'type': 'conductor', 'material': 'none', 'specular_reflectance': base})
        else:
            metal = {'type': 'own_metal', 'base': base, 'roughness': rough}
        if metallic == 0:
            d = coat
        elif metallic == 1 and orm is None:
            d = metal
        else:
            d = {'type': 'blendbsdf', 'weight': self.number(orm, metallic, 2), 'bsdf_0': coat, 'bsdf_1': metal}
        mode = m.get('alphaMode', 'OPAQUE')
        if mode != 'OPAQUE':
            alpha = self.number(p.get('baseColorTexture'), factor[3], 3)
            if mode == 'MASK':
                alpha = {'type': 'own_cut', 'nested': alpha, 'cutoff': m.get('alphaCutoff', 0.5)}
            d = {'type': 'mask', 'opacity': alpha, 'nested': d}
        return d

    def meshes(self):
        mi, g = self.mi, self.gltf
        scene = {}
        for node, m in g.nodes():
            if 'mesh' not in node:
                continue
            normals_by = np.linalg.inv(m[:3, :3])
            for primitive in g.json['meshes'][node['mesh']]['primitives']:
                assert primitive.get('mode', 4) == 4
                at = primitive['attributes']
                assert 'COLOR_0' not in at
                material = g.json['materials'][primitive['material']]
                positions = g.accessor(at['POSITION']) @ m[:3, :3].T + m[:3, 3]
                faces = g.accessor(primitive['indices']).astype(np.uint32).reshape(-1, 3)
                if np.linalg.det(m[:3, :3]) < 0:
                    faces = faces[:, ::-1]
                extensions = material.get('extensions', {})
                emission = np.array(material.get('emissiveFactor', [0] * 3), float)
                emission *= extensions.get('KHR_materials_emissive_strength', {}).get('emissiveStrength', 1)
                shines = emission.max() > 0
                assert not (shines and material.get('doubleSided')), 'emission from both sides'
                smooth, uvs = 'NORMAL' in at and not shines, 'TEXCOORD_0' in at
                props = mi.Properties()
                props['bsdf'] = self.material(primitive['material'])
                if shines:
                    radiance = self.color(material.get('emissiveTexture'), emission)
                    props['emitter'] = mi.load_dict({'type': 'area', 'radiance': radiance})
                volume = extensions.get('KHR_materials_volume', {})
                if 'attenuationDistance' in volume:
                    sigma = [-math.log(c) / volume['attenuationDistance'] for c in volume['attenuationColor']]
                    props['interior'] = mi.load_dict({
                        'type': 'homogeneous', 'albedo': {'type': 'rgb', 'value': [0.0] * 3}, 'scale': max(sigma),
                        'sigma_t': {'type': 'rgb', 'value': [x / max(sigma) for x in sigma]}})
                    self.attenuates = True
                name = f'mesh{len(scene):04}'
                mesh = mi.Mesh(name, len(positions), len(faces), has_vertex_normals=smooth, has_vertex_texcoords=uvs, props=props)
                values = mi.traverse(mesh)
                values['vertex_positions'] = np.ascontiguousarray(positions, np.float32).ravel()
                values['faces'] = np.ascontiguousarray(faces).ravel()
                if smooth:
                    normals = g.accessor(at['NORMAL']) @ normals_by
                    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
                    values['vertex_normals'] = np.ascontiguousarray(normals, np.float32).ravel()
                if uvs:
                    values['vertex_texcoords'] = np.ascontiguousarray(g.accessor(at['TEXCOORD_0']), np.float32).ravel()
                values.update()
                scene[name] = mesh
        return scene

    def lights(self):
        scene = {}
        listed = self.gltf.json.get('extensions', {}).get('KHR_lights_punctual', {}).get('lights', [])
        for node, m in self.gltf.nodes():
            index = node.get('extensions', {}).get('KHR_lights_punctual', {}).get('light')
            if index is None:
                continue
            light = listed[index]
            intensity = (np.array(light.get('color', [1] * 3), float) * light.get('intensity', 1)).tolist()
            axis = (-m[:3, 2] / np.linalg.norm(m[:3, 2])).tolist()
            value = {'type': 'rgb', 'value': intensity}
            if light['type'] == 'point':
                d = {'type': 'point', 'position': m[:3, 3].tolist(), 'intensity': value}
            elif light['type'] == 'directional':
                d = {'type': 'directional', 'direction': axis, 'irradiance': value}
            else:
                cone = [math.cos(light['spot'].get(k, v)) for k, v in (('innerConeAngle', 0), ('outerConeAngle', math.pi / 4))]
                d = {'type': 'own_spot', 'numbers': ','.join(map(repr, map(float, [*m[:3, 3], *axis, *intensity, *cone])))}
            scene[f'light{len(scene)}'] = d
        return scene

    def environment(self, settings):
        mi, g = self.mi, self.gltf
        if 'environment' not in settings:
            radiance = g.json['scenes'][g.json.get('scene', 0)].get('extras', {}).get('environment', {}).get('constant')
            return {} if radiance is None else {'env': {'type': 'constant', 'radiance': {'type': 'rgb', 'value': radiance}}}
        texels = read_hdr(os.path.join(HERE, settings['environment']))
        # Mitsuba's own convention between rows is another one, so it gets a fine picture of the interpolation defined
        # above: rows from pole to pole inclusive; column centres from -Z, which is its left edge, by way of +X. It has
        # rows and columns where the texels' centres are, so that nothing is lost (if it is turned by whole texels).
        height, width = 32 * texels.shape[0] + 1, 31 * texels.shape[1]
        turn = settings.get('environment_rotation', 0.0)
        assert (turn / 360 * texels.shape[1]).is_integer()
        row = np.arange(height) / (height - 1) * texels.shape[0] - 0.5
        column = ((np.arange(width) + 0.5) / width + 0.5 + turn / 360) * texels.shape[1] - 0.5
        y, x = np.floor(row).astype(int), np.floor(column).astype(int)
        fy, fx = (row - y)[:, None, None], (column - x)[None, :, None]
        at = lambda dy, dx: texels[np.clip(y + dy, 0, texels.shape[0] - 1)][:, (x + dx) % texels.shape[1]]
        fine = (at(0, 0) * (1 - fx) + at(0, 1) * fx) * (1 - fy) + (at(1, 0) * (1 - fx) + at(1, 1) * fx) * fy
        bitmap = mi.Bitmap(np.ascontiguousarray(fine, np.float32))
        return {'env': {'type': 'envmap', 'bitmap': bitmap}}

    def sensor(self, width, height):
        mi, g = self.mi, self.gltf
        for node, m in g.nodes():
            if 'camera' in node:
                camera = g.json['cameras'][node['camera']]['perspective']
                pose = m.copy()
                pose[:3, :3] /= np.linalg.norm(pose[:3, :3], axis=0)
                # glTF looks along -Z with +X to the right, Mitsuba along +Z with +X to the left.
                pose = pose @ np.diag([-1.0, 1.0, -1.0, 1.0])
                return {'type': 'perspective', 'fov': math.degrees(camera['yfov']), 'fov_axis': 'y', 'near_clip': 1e-3, 'far_clip': 1e5,
                        'to_world': mi.ScalarTransform4f(pose), 'sampler': {'type': 'independent', 'sample_count': 1},
                        'film': {'type': 'hdrfilm', 'width': width, 'height': height, 'pixel_format': 'rgb',
                                 'component_format': 'float32', 'rfilter': {'type': 'box'}}}
        raise ValueError('the file has no camera')


def read_hdr(path):
    """A Radiance picture without run lengths, as the generator writes it."""
    head, size, pixels = open(path, 'rb').read().split(b'\n', 5)[3:]
    height, width = int(size.split()[1]), int(size.split()[3])
    assert head == b''
    rgbe = np.frombuffer(pixels, np.uint8, width * height * 4).reshape(height, width, 4).astype(np.float64)
    return rgbe[..., :3] * np.exp2(rgbe[..., 3:] - 136)


def render(mi, settings):
    import OpenEXR
    gltf = Gltf(os.path.normpath(os.path.join(HERE, settings['scene'])))
    builder = Builder(mi, gltf)
    width, height = settings['size']
    scene = {'type': 'scene', 'sensor': builder.sensor(width, height), **builder.meshes(), **builder.lights(), **builder.environment(settings)}
    kind = 'volpath' if builder.attenuates else 'path'
    scene['integrator'] = {'type': kind, 'max_depth': settings['depth'] + 1, 'rr_depth': 8}
    scene = mi.load_dict(scene)
    start, images = time.time(), []
    for replicate in range(settings['replicates']):
        image = np.array(mi.render(scene, spp=settings['spp'], seed=1 + replicate), np.float64)[..., :3]
        assert np.isfinite(image).all()
        images.append(image)
    images = np.stack(images)
    mean, sd = images.mean(0), images.std(0, ddof=1) / math.sqrt(len(images))
    channels = {name: np.ascontiguousarray(mean[..., i], np.float32) for i, name in enumerate('RGB')}
    channels |= {f'sd.{name}': np.ascontiguousarray(sd[..., i], np.float16) for i, name in enumerate(('red', 'green', 'blue'))}
    header = {'compression': OpenEXR.ZIP_COMPRESSION, 'type': OpenEXR.scanlineimage,
              'comments': f'Mitsuba {mi.__version__}: ' + json.dumps(settings)}
    OpenEXR.File(header, channels).write(os.path.join(HERE, settings['name'] + '.exr'))
    error = float(np.sqrt((sd ** 2).sum()) / mean.sum())
    print(f"{settings['name']}: {time.time() - start:.0f} s, mean {mean.mean((0, 1))} ± {100 * error:.3f} %, noisiest pixel "
          f"{sd.max():.3g}", flush=True)


def main():
    import mitsuba as mi
    mi.set_variant('llvm_ad_rgb')
    import drjit as dr
    define(mi, dr)
    images = json.load(open(os.path.join(HERE, 'references.json')))['images']
    names = sys.argv[1:]
    unknown = set(names) - {i['name'] for i in images}
    if unknown:
        sys.exit(f'render.py: no such image in references.json: {", ".join(sorted(unknown))}')
    for settings in images:
        if not names or settings['name'] in names:
            render(mi, settings)


if __name__ == '__main__':
    main()
