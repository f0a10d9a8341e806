// SPDX-License-Identifier: Apache-2.0
#include <scenegraph/io/gltf_material.h>

#include <core/image.h>
#include <scenegraph/io/picture.h>

#include <algorithm>
#include <limits>

namespace stipple {

namespace {

const tinygltf::Value* extension(const tinygltf::ExtensionMap& extensions, const char* name) {
    const auto it = extensions.find(name);
    return it == extensions.end() ? nullptr : &it->second;
}

double numberOf(const tinygltf::Value& object, const char* key, double fallback) {
    return object.Has(key) ? object.Get(key).GetNumberAsDouble() : fallback;
}

Vec2 pairOf(const tinygltf::Value& object, const char* key, Vec2 fallback) {
    if (!object.Has(key)) return fallback;
    const tinygltf::Value& pair = object.Get(key);
    return Vec2(pair.Get(0).GetNumberAsDouble(), pair.Get(1).GetNumberAsDouble());
}

// TextureInfo or NormalTextureInfo.
template <class Info>
GltfUvLayer uvLayer(const Info& info) {
    GltfUvLayer layer;
    layer.texcoord = info.texCoord;
    if (const tinygltf::Value* transform = extension(info.extensions, "KHR_texture_transform")) {
        layer.offset = pairOf(*transform, "offset", layer.offset);
        layer.scale = pairOf(*transform, "scale", layer.scale);
        layer.rotation = float(numberOf(*transform, "rotation", 0.0));
        if (transform->Has("texCoord"))
            layer.texcoord = transform->Get("texCoord").GetNumberAsInt();
    }
    return layer;
}

// The number of the layer among the material's, added if it is new.
int layerIndex(const GltfUvLayer& layer, std::vector<GltfUvLayer>& layers) {
    const auto it = std::find(layers.begin(), layers.end(), layer);
    if (it != layers.end()) return int(it - layers.begin());
    layers.push_back(layer);
    return int(layers.size()) - 1;
}

Wrap wrapOf(int gl_wrap) {
    if (gl_wrap == TINYGLTF_TEXTURE_WRAP_CLAMP_TO_EDGE) return Wrap::kClamp;
    return gl_wrap == TINYGLTF_TEXTURE_WRAP_MIRRORED_REPEAT ? Wrap::kMirror : Wrap::kRepeat;
}

}  // namespace

Vec2 GltfUvLayer::apply(Vec2 uv) const {
    // Counter-clockwise as the picture is seen, v pointing down.
    const Vec2 p = uv * scale;
    const float c = std::cos(rotation), s = std::sin(rotation);
    return offset + Vec2(c * p.x + s * p.y, c * p.y - s * p.x);
}

const GltfMaterial& GltfMaterials::get(int material, bool for_points, const std::string& path) {
    const auto key = std::make_pair(material, for_points);
    if (const auto it = materials_.find(key); it != materials_.end()) return it->second;
    Material converted;
    GltfMaterial result;
    if (material < 0) {
        converted.name = "default";
    } else {
        document_.checkIndex(material, document_.model.materials.size(), path, "materials");
        converted = convert(document_.model.materials[material], for_points, result,
                            "materials[" + std::to_string(material) + "]");
    }
    converted.double_sided |= for_points;
    if (scene_.materials.size() > std::numeric_limits<uint16_t>::max()) {
        document_.fail(ErrorCode::kUnsupported, path, "the scene has more than 65536 materials");
    }
    result.index = uint16_t(scene_.materials.size());
    scene_.materials.push_back(std::move(converted));
    return materials_.emplace(key, std::move(result)).first->second;
}

Vec3 GltfMaterials::dielectricSpecular(const tinygltf::Material& source, const std::string& path) {
    constexpr float kUsual = 0.04f;
    const tinygltf::Value* specular = extension(source.extensions, "KHR_materials_specular");
    if (!specular) return Vec3(kUsual);
    const std::string place = path + ".extensions.KHR_materials_specular.";
    const auto meanOf = [&](const char* key, bool is_srgb) {
        if (!specular->Has(key)) return Vec4(1.0f);
        return mean(specular->Get(key).Get("index").GetNumberAsInt(), is_srgb, place + key);
    };
    float factor = float(numberOf(*specular, "specularFactor", 1.0));
    factor *= meanOf("specularTexture", false).a;
    Vec3 color = Vec3(meanOf("specularColorTexture", true));
    if (specular->Has("specularColorFactor")) {
        const tinygltf::Value& rgb = specular->Get("specularColorFactor");
        for (int c = 0; c < 3; ++c) color[c] *= float(rgb.Get(c).GetNumberAsDouble());
    }
    return glm::min(kUsual * color, Vec3(1.0f)) * factor;
}

Material GltfMaterials::convert(const tinygltf::Material& source, bool for_points,
                                GltfMaterial& use, const std::string& path) {
    const tinygltf::PbrMetallicRoughness& pbr = source.pbrMetallicRoughness;
    Material m;
    m.name = source.name;
    m.alpha_mode = source.alphaMode == "MASK"    ? AlphaMode::kMask
                   : source.alphaMode == "BLEND" ? AlphaMode::kBlend
                                                 : AlphaMode::kOpaque;
    m.alpha_cutoff = float(source.alphaCutoff);
    m.double_sided = source.doubleSided;
    m.unlit = extension(source.extensions, "KHR_materials_unlit") != nullptr;
    if (const auto* through = extension(source.extensions, "KHR_materials_diffuse_transmission")) {
        m.translucency = float(numberOf(*through, "diffuseTransmissionFactor", 0.0));
        if (through->Has("diffuseTransmissionTexture")) {
            const std::string place = path +
                                      ".extensions.KHR_materials_diffuse_transmission."
                                      "diffuseTransmissionTexture";
            const int index =
                through->Get("diffuseTransmissionTexture").Get("index").GetNumberAsInt();
            m.translucency *= mean(index, false, place).a;
        }
    }

    m.base_color = Vec3(pbr.baseColorFactor[0], pbr.baseColorFactor[1], pbr.baseColorFactor[2]);
    Vec3 mean_base = m.base_color;
    m.alpha = m.alpha_mode == AlphaMode::kOpaque ? 1.0f : float(pbr.baseColorFactor[3]);
    if (pbr.baseColorTexture.index >= 0) {
        const std::string texture_path = path + ".pbrMetallicRoughness.baseColorTexture.index";
        m.base_texture = texture(pbr.baseColorTexture.index, true,
                                 m.alpha_mode == AlphaMode::kOpaque, texture_path);
        mean_base *= Vec3(mean(pbr.baseColorTexture.index, true, texture_path));
        layerIndex(uvLayer(pbr.baseColorTexture), use.uv_layers);  // the first: Mesh::uvs
    }
    if (m.unlit) return m;

    float metallic = float(pbr.metallicFactor), roughness = float(pbr.roughnessFactor);
    if (pbr.metallicRoughnessTexture.index >= 0) {
        const int index = pbr.metallicRoughnessTexture.index;
        const std::string texture_path =
            path + ".pbrMetallicRoughness.metallicRoughnessTexture.index";
        const Vec4 texel = mean(index, false, texture_path);
        if (metallic > 0.0f && texel.b > 0.0f) {
            m.metallic_map = {texture(index, false, true, texture_path),
                              layerIndex(uvLayer(pbr.metallicRoughnessTexture), use.uv_layers)};
            m.metallic = metallic;
        }
        roughness *= texel.g;
        metallic *= texel.b;
    }
    // Metallic-roughness as diffuse and a Phong lobe: a metal mirrors in its colour. What it
    // mirrors of its surroundings is not drawn, but the rougher it is the more that looks like
    // scattered light, and is counted as such. A microfacet lobe of width alpha = roughness^2 is
    // about as wide as a Phong lobe of exponent 2 / alpha^2 - 2. Of what is mirrored, the textures'
    // means count.
    const float smooth = 1.0f - roughness * roughness;
    metallic *= smooth, m.metallic *= smooth;
    if (m.metallic_map.texture == kNoTexture) m.base_color *= 1.0f - metallic;
    m.specular = glm::mix(dielectricSpecular(source, path), mean_base, metallic);
    const float r4 = roughness * roughness * roughness * roughness;
    m.shininess = std::clamp(2.0f / std::max(r4, 1e-6f) - 2.0f, 1.0f, 1000.0f);

    if (source.normalTexture.index >= 0 && !for_points) {
        m.normal_map = {
            texture(source.normalTexture.index, false, true, path + ".normalTexture.index"),
            layerIndex(uvLayer(source.normalTexture), use.uv_layers)};
        m.normal_scale = float(source.normalTexture.scale);
        use.needs_tangents = true;
    }

    m.emissive = Vec3(source.emissiveFactor[0], source.emissiveFactor[1], source.emissiveFactor[2]);
    if (const tinygltf::Value* strength =
            extension(source.extensions, "KHR_materials_emissive_strength")) {
        m.emissive *= float(numberOf(*strength, "emissiveStrength", 1.0));
    }
    if (source.emissiveTexture.index >= 0 && m.emissive != Vec3(0.0f)) {
        m.emissive *=
            Vec3(mean(source.emissiveTexture.index, true, path + ".emissiveTexture.index"));
        document_.context.warnOnce(document_.name,
                                   "emissive textures are replaced by their mean colour");
    }
    return m;
}

int GltfMaterials::imageOf(int texture, const std::string& path) const {
    document_.checkIndex(texture, document_.model.textures.size(), path, "textures");
    const tinygltf::Texture& t = document_.model.textures[texture];
    const std::string texture_path = "textures[" + std::to_string(texture) + "]";
    int source = t.source;
    if (const tinygltf::Value* webp = extension(t.extensions, "EXT_texture_webp"))
        source = webp->Get("source").GetNumberAsInt();
    if (source < 0)
        document_.fail(ErrorCode::kUnsupported, texture_path, "has no source that is known");
    document_.checkIndex(source, document_.images.size(), texture_path + ".source", "images");
    return source;
}

const Texture::Level& GltfMaterials::picture(int image) {
    if (const auto it = pictures_.find(image); it != pictures_.end()) return it->second;
    document_.context.throwIfCancelled();
    const std::string where = document_.where("images[" + std::to_string(image) + "]");
    Texture::Level level =
        decodePicture(imageBytes(document_, image), document_.context.budget, where);
    document_.context.budget.take(double(level.rgba.size()), where, "the picture's texels");
    return pictures_.emplace(image, std::move(level)).first->second;
}

Vec4 GltfMaterials::mean(int texture, bool is_srgb, const std::string& path) {
    const Texture::Level& level = picture(imageOf(texture, path));
    uint64_t histogram[4][256] = {};
    const size_t n = level.rgba.size() / 4;
    for (size_t i = 0; i < n; ++i) {
        for (int c = 0; c < 4; ++c) ++histogram[c][level.rgba[i * 4 + c]];
    }
    Vec4 result(0.0f);
    for (int c = 0; c < 4; ++c) {
        double sum = 0.0;
        for (int v = 0; v < 256; ++v) {
            const float value = float(v) / 255.0f;
            sum += double(histogram[c][v]) * (is_srgb && c < 3 ? linearFromSrgb(value) : value);
        }
        result[c] = float(sum / double(n));
    }
    return result;
}

int GltfMaterials::texture(int index, bool is_srgb, bool is_opaque, const std::string& path) {
    const int image = imageOf(index, path);
    const tinygltf::Texture& source = document_.model.textures[index];
    const std::string sampler_path = "textures[" + std::to_string(index) + "].sampler";
    if (source.sampler >= 0)
        document_.checkIndex(source.sampler, document_.model.samplers.size(), sampler_path,
                             "samplers");
    const auto key = std::make_tuple(image, source.sampler, is_srgb, is_opaque);
    if (const auto it = textures_.find(key); it != textures_.end()) return it->second;

    Texture result;
    result.name = source.name;
    result.srgb = is_srgb;
    if (source.sampler >= 0) {
        const tinygltf::Sampler& sampler = document_.model.samplers[source.sampler];
        result.wrap_u = wrapOf(sampler.wrapS);
        result.wrap_v = wrapOf(sampler.wrapT);
        result.nearest = sampler.magFilter == TINYGLTF_TEXTURE_FILTER_NEAREST;
    }
    result.levels.push_back(picture(image));
    document_.context.budget.take(double(result.levels[0].rgba.size()) * 3.0, document_.where(path),
                                  "the texture's texels");
    if (is_opaque) {
        for (size_t i = 3; i < result.levels[0].rgba.size(); i += 4) result.levels[0].rgba[i] = 255;
    }
    buildMipmaps(result);
    const int n = int(scene_.textures.size());
    scene_.textures.push_back(std::move(result));
    textures_.emplace(key, n);
    return n;
}

}  // namespace stipple
