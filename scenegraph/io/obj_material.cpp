// SPDX-License-Identifier: Apache-2.0
#include <scenegraph/io/obj_material.h>

#include <core/image.h>
#include <scenegraph/io/json.h>
#include <scenegraph/io/picture.h>

#include <tiny_obj_loader.h>
#include <limits>
#include <sstream>
#include <tuple>

namespace stipple {

namespace {

Vec3 colorOf(const tinyobj::real_t (&rgb)[3]) {
    Vec3 color;
    for (int c = 0; c < 3; ++c)
        color[c] = rgb[c] > 0.0f && rgb[c] <= 1e6f ? float(rgb[c]) : 0.0f;  // NaN: 0
    return color;
}

Vec3 linearColor(const Vec3& srgb) {
    Vec3 color;
    for (int c = 0; c < 3; ++c) color[c] = linearFromSrgb(std::min(srgb[c], 1.0f));
    return color;
}

// Loads the textures of one MTL file.
class MtlTextures {
public:
    MtlTextures(std::filesystem::path folder, Scene& scene, LoadContext& context,
                const std::string& where)
        : folder_(std::move(folder)), scene_(scene), context_(context), where_(where) {}

    // The texture of one picture; kNoTexture, with a warning, if it cannot be had.
    int load(const std::string& name, const tinyobj::texture_option_t& options, bool is_srgb,
             bool is_opaque) {
        if (name.empty()) return kNoTexture;
        const auto key = std::make_tuple(name, std::string(), is_srgb, is_opaque);
        if (const auto it = loaded_.find(key); it != loaded_.end()) return it->second;
        const int index = tryLoad(name, options, is_srgb, is_opaque);
        return loaded_[key] = index;
    }

    // The texture of a picture of colours (may be empty) and one of opacities. If they are two, the
    // latter's red is the opacity.
    int loadWithAlpha(const std::string& name, const std::string& alpha_name,
                      const tinyobj::texture_option_t& options) {
        if (alpha_name.empty() || alpha_name == name)
            return load(name, options, true, alpha_name.empty());
        const auto key = std::make_tuple(name, alpha_name, true, false);
        if (const auto it = loaded_.find(key); it != loaded_.end()) return it->second;
        const int alpha = tryLoad(alpha_name, options, false, true);
        if (alpha == kNoTexture) return loaded_[key] = load(name, options, true, true);
        const int color = name.empty() ? kNoTexture : tryLoad(name, options, true, true);
        Texture& opacities = scene_.textures[alpha];
        if (color == kNoTexture) {
            setAlpha(opacities, opacities.levels[0]);
            std::vector<uint8_t>& rgba = opacities.levels[0].rgba;
            for (size_t i = 0; i < rgba.size(); ++i) rgba[i] = i % 4 == 3 ? rgba[i] : 255;
            buildMipmaps(opacities);
            return loaded_[key] = alpha;
        }
        setAlpha(scene_.textures[color], opacities.levels[0]);
        buildMipmaps(scene_.textures[color]);
        opacities.levels.clear();  // not needed on its own; indices of textures must stay
        return loaded_[key] = color;
    }

private:
    int tryLoad(std::string file, const tinyobj::texture_option_t& options, bool is_srgb,
                bool is_opaque) {
        for (char& c : file) c = c == '\\' ? '/' : c;
        try {
            const int index =
                addTexture(scene_, resolvePath(context_, folder_, file, where_), is_srgb, is_opaque,
                           context_, where_ + ": " + inQuotes(file));
            Texture& texture = scene_.textures[index];
            if (options.clamp) texture.wrap_u = texture.wrap_v = Wrap::kClamp;
            return index;
        } catch (const Error& error) {
            if (error.code() != ErrorCode::kFileNotFound && error.code() != ErrorCode::kParse &&
                error.code() != ErrorCode::kUnsupported)
                throw;
            context_.warnOnce("", std::string(error.what()) + "; drawn without it");
            return kNoTexture;
        }
    }

    static void setAlpha(Texture& texture, const Texture::Level& from) {
        Texture::Level& to = texture.levels[0];
        for (int y = 0; y < to.height; ++y) {
            for (int x = 0; x < to.width; ++x) {
                const size_t fx = size_t(x) * size_t(from.width) / size_t(to.width),
                             fy = size_t(y) * size_t(from.height) / size_t(to.height);
                to.rgba[(size_t(y) * size_t(to.width) + size_t(x)) * 4 + 3] =
                    from.rgba[(fy * size_t(from.width) + fx) * 4];
            }
        }
    }

    std::filesystem::path folder_;
    Scene& scene_;
    LoadContext& context_;
    const std::string& where_;
    std::map<std::tuple<std::string, std::string, bool, bool>, int> loaded_;
};

Material convert(const tinyobj::material_t& source, MtlTextures& textures) {
    Material m;
    m.name = oneLine(source.name);
    m.double_sided = true;
    m.base_color = linearColor(colorOf(source.diffuse));
    m.emissive = colorOf(source.emission);
    const float shininess = std::clamp(float(source.shininess), 1.0f, 1000.0f);
    // MTL's highlight is Ks cos^Ns of the half angle, of which a microfacet lobe of width a with
    // Ns = 2 / a^2 - 2 has the shape, and with this reflectance the height.
    if (source.illum != 1) {
        m.specular = glm::min(colorOf(source.specular), Vec3(1.0f)) *
                     std::min(8.0f / (shininess + 2.0f), 1.0f);
    }
    m.roughness = std::pow(2.0f / (shininess + 2.0f), 0.25f);
    m.alpha = source.dissolve >= 0.0f && source.dissolve < 1.0f ? float(source.dissolve) : 1.0f;
    // A picture's alpha counts where the file says so.
    if (m.alpha < 1.0f || !source.alpha_texname.empty()) m.alpha_mode = AlphaMode::kBlend;
    m.base_texture =
        textures.loadWithAlpha(source.diffuse_texname, source.alpha_texname, source.diffuse_texopt);
    // A texture is multiplied with Kd, which many files set to black where there is one.
    if (m.base_texture != kNoTexture && m.base_color == Vec3(0.0f)) m.base_color = Vec3(1.0f);
    m.normal_map.texture = textures.load(source.normal_texname, source.normal_texopt, false, true);
    return m;
}

}  // namespace

void readMtl(const std::filesystem::path& folder, const std::string& file, Scene& scene,
             LoadContext& context, const std::string& where, ObjMaterials& out) {
    const std::filesystem::path path = resolvePath(context, folder, file, where);
    const std::string place = where + ": " + inQuotes(file);
    const std::string text = readFile(path, context.budget, place);
    context.budget.require(20.0 * double(text.size()), place, "its materials");
    std::istringstream stream(text);
    std::map<std::string, int> names;
    std::vector<tinyobj::material_t> materials;
    std::string warning, error;
    tinyobj::LoadMtl(&names, &materials, &stream, &warning, &error);
    MtlTextures textures(path.parent_path(), scene, context, place);
    for (const auto& [name, index] : names) {
        if (index < 0 || size_t(index) >= materials.size()) continue;
        if (out.materials.size() > std::numeric_limits<uint16_t>::max())
            throw Error(ErrorCode::kUnsupported, place, "more than 65535 materials");
        out.by_name[name] = uint16_t(out.materials.size());
        out.materials.push_back(convert(materials[size_t(index)], textures));
    }
}

}  // namespace stipple
