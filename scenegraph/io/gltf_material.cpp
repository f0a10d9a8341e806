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

// A texture info within an extension, which tinygltf leaves as it is.
tinygltf::TextureInfo textureInfo(const tinygltf::Value& object) {
    tinygltf::TextureInfo info;
    info.index = object.Get("index").GetNumberAsInt();
    if (object.Has("texCoord")) info.texCoord = object.Get("texCoord").GetNumberAsInt();
    if (object.Has("extensions")) {
        const tinygltf::Value& extensions = object.Get("extensions");
        for (const std::string& key : extensions.Keys()) info.extensions[key] = extensions.Get(key);
    }
    return info;
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

template <class Info>
TextureUse GltfMaterials::use(const Info& info, bool is_srgb, bool is_opaque, GltfMaterial& out,
                              const std::string& path) {
    if (info.index < 0) return {};
    return {texture(info.index, is_srgb, is_opaque, path + ".index"),
            layerIndex(uvLayer(info), out.uv_layers)};
}

void GltfMaterials::convertSpecular(const tinygltf::Material& source, Material& m,
                                    GltfMaterial& out, const std::string& path) {
    m.specular = Vec3(0.04f);
    const tinygltf::Value* specular = extension(source.extensions, "KHR_materials_specular");
    if (!specular) return;
    m.specular_weight = float(numberOf(*specular, "specularFactor", 1.0));
    if (specular->Has("specularColorFactor")) {
        const tinygltf::Value& rgb = specular->Get("specularColorFactor");
        for (int c = 0; c < 3; ++c) m.specular[c] *= float(rgb.Get(c).GetNumberAsDouble());
    }
    const std::string place = path + ".extensions.KHR_materials_specular.";
    const auto textureOf = [&](const char* key, bool is_srgb) -> TextureUse {
        if (!specular->Has(key)) return {};
        return use(textureInfo(specular->Get(key)), is_srgb, is_srgb, out, place + key);
    };
    m.specular_map = textureOf("specularTexture", false);
    m.specular_color_map = textureOf("specularColorTexture", true);
}

Material GltfMaterials::convert(const tinygltf::Material& source, bool for_points,
                                GltfMaterial& out, const std::string& path) {
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
    m.alpha = m.alpha_mode == AlphaMode::kOpaque ? 1.0f : float(pbr.baseColorFactor[3]);
    // The first layer is Mesh::uvs.
    m.base_texture = use(pbr.baseColorTexture, true, m.alpha_mode == AlphaMode::kOpaque, out,
                         path + ".pbrMetallicRoughness.baseColorTexture")
                         .texture;
    if (m.unlit) return m;

    m.metallic = float(pbr.metallicFactor);
    m.roughness = float(pbr.roughnessFactor);
    m.metallic_roughness_map = use(pbr.metallicRoughnessTexture, false, true, out,
                                   path + ".pbrMetallicRoughness.metallicRoughnessTexture");
    convertSpecular(source, m, out, path);

    if (source.normalTexture.index >= 0 && !for_points) {
        m.normal_map = use(source.normalTexture, false, true, out, path + ".normalTexture");
        m.normal_scale = float(source.normalTexture.scale);
        out.needs_tangents = true;
    }

    m.emissive = Vec3(source.emissiveFactor[0], source.emissiveFactor[1], source.emissiveFactor[2]);
    if (const tinygltf::Value* strength =
            extension(source.extensions, "KHR_materials_emissive_strength")) {
        m.emissive *= float(numberOf(*strength, "emissiveStrength", 1.0));
    }
    if (m.emissive != Vec3(0.0f))
        m.emissive_map = use(source.emissiveTexture, true, true, out, path + ".emissiveTexture");
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
