// SPDX-License-Identifier: Apache-2.0
#include <core/image.h>
#include <scenegraph/io/model.h>
#include <scenegraph/io/number_picture.h>
#include <scenegraph/io/picture.h>
#include <scenegraph/io/scene_reader.h>
#include <scenegraph/procedural/uv_grid.h>

namespace stipple {

namespace {

// The file's numbers: low where it is 0, high where it is 1; a grey one's for all of x, y, z.
GridTable readTable(SceneReader& reader, const std::filesystem::path& file, double low, double high,
                    const JsonPath& path) {
    const NumberPicture picture =
        readNumberPicture(file, reader.context.budget, reader.where(path));
    const size_t n = size_t(picture.width) * size_t(picture.height);
    // A third more for the mip levels.
    reader.context.budget.take(double(n) * 1.34 * sizeof(Vec3), reader.where(path),
                               "a table of " + std::to_string(n) + " texels");
    std::vector<Vec3> texels(n);
    for (int y = 0; y < picture.height; ++y) {
        for (int x = 0; x < picture.width; ++x) {
            Vec3& texel = texels[size_t(y) * size_t(picture.width) + size_t(x)];
            for (int c = 0; c < 3; ++c) {
                const double value =
                    low +
                    (high - low) * double(picture.at(x, y, std::min(c, picture.channels - 1)));
                if (!(std::abs(value) <= 1e7)) {
                    reader.fail(path, "the number at pixel " + std::to_string(x) + ", " +
                                          std::to_string(y) + " is not within 10^7");
                }
                texel[c] = float(value);
            }
        }
    }
    return makeGridTable(picture.width, picture.height, std::move(texels));
}

GridDisplacement readDisplacement(SceneReader& reader, const Json& source, DVec2 repeat,
                                  const JsonPath& path) {
    GridDisplacement d;
    std::string along = "normal";
    double low = 0.0, high = 1.0;
    readMember(source, "along", along);
    readMember(source, "low", low);
    readMember(source, "high", high);
    d.repeat = repeat;
    readVector(source, "repeat", d.repeat);
    if (along == "surface") d.along = GridDisplacement::Along::kSurface;
    if (along == "object") d.along = GridDisplacement::Along::kObject;
    const JsonPath file_path = joined(path, {"file"});
    d.table = readTable(reader, reader.file(source["file"], file_path), low, high, file_path);
    return d;
}

UvGridParams readParams(SceneReader& reader, const Json& asset, const JsonPath& path) {
    UvGridParams params;
    GridShape& shape = params.shape;
    readMember(asset, "surface", shape.surface);
    const std::vector<std::string>& keys = gridSurface(shape.surface).keys;
    for (const char* key : {"size", "radius", "top_radius", "waist", "tube", "height", "turns"}) {
        if (asset.contains(key) && std::find(keys.begin(), keys.end(), key) == keys.end())
            reader.fail(joined(path, {key}), "means nothing for a " + shape.surface);
    }
    readVector(asset, "size", shape.size);
    readMember(asset, "radius", shape.radius);
    readMember(asset, "top_radius", shape.top_radius);
    readMember(asset, "waist", shape.waist);
    readMember(asset, "tube", shape.tube);
    readMember(asset, "height", shape.height);
    readMember(asset, "turns", shape.turns);
    readVector(asset, "repeat", params.texture_repeat);
    if (const auto it = asset.find("resolution"); it != asset.end()) {
        params.cells_u = (it->is_array() ? (*it)[0] : *it).get<int>();
        params.cells_v = (it->is_array() ? (*it)[1] : *it).get<int>();
    }
    readMember(asset, "refine", params.refine);
    params.has_normal_map = asset.contains("normal_map");
    params.reserve = [&reader, where = reader.where(path)](double triangles) {
        reader.context.throwIfCancelled();
        reader.context.budget.take(triangles * (kBytesPerTriangle + 0.5 * kBytesPerVertex), where,
                                   std::to_string(uint64_t(triangles)) + " triangles");
    };
    const auto it = asset.find("displacement");
    if (it == asset.end()) return params;
    const JsonPath place = joined(path, {"displacement"});
    if (!it->is_array()) {
        params.displacements.push_back(readDisplacement(reader, *it, params.texture_repeat, place));
        return params;
    }
    for (size_t i = 0; i < it->size(); ++i) {
        params.displacements.push_back(readDisplacement(reader, (*it)[i], params.texture_repeat,
                                                        joined(place, {std::to_string(i)})));
    }
    return params;
}

// Along which sides pictures repeat: where the surface closes on itself they do.
struct Repeats {
    bool u, v;
    Repeats(const UvGridParams& params) {
        const GridSurfaceInfo& info = gridSurface(params.shape.surface);
        u = info.is_closed_u || params.texture_repeat.x != 1.0;
        v = info.is_closed_v || params.texture_repeat.y != 1.0;
    }
    void applyTo(Texture& texture) const {
        texture.wrap_u = u ? Wrap::kRepeat : Wrap::kClamp;
        texture.wrap_v = v ? Wrap::kRepeat : Wrap::kClamp;
    }
};

int readTexture(SceneReader& reader, const Json& asset, const char* key, bool is_srgb,
                const Repeats& repeats, const JsonPath& path) {
    const JsonPath file_path = joined(path, {key});
    const int index = addTexture(reader.scene, reader.file(asset[key], file_path), is_srgb, false,
                                 reader.context, reader.where(file_path));
    repeats.applyTo(reader.scene.textures[size_t(index)]);
    return index;
}

// Multiplies the texture's alpha with the table's, at the finer of both resolutions.
void multiplyAlpha(SceneReader& reader, Texture& texture, const GridTable& alpha,
                   const Repeats& repeats, const std::string& where) {
    const GridTable::Level& finest = alpha.levels[0];
    Texture::Level level{std::max(texture.levels[0].width, finest.width),
                         std::max(texture.levels[0].height, finest.height),
                         {}};
    const size_t n = size_t(level.width) * size_t(level.height);
    reader.context.budget.take(double(n) * 4.0 * 1.34, where, "the texture's texels");
    level.rgba.reserve(n * 4);
    const auto toByte = [](float x) { return uint8_t(std::clamp(x, 0.0f, 1.0f) * 255.0f + 0.5f); };
    for (int y = 0; y < level.height; ++y) {
        for (int x = 0; x < level.width; ++x) {
            const DVec2 place((x + 0.5) / level.width, (y + 0.5) / level.height);
            const Vec4 color = sampleTexture(texture, Vec2(place), 0.0f);
            for (int c = 0; c < 3; ++c) level.rgba.push_back(toByte(srgbFromLinear(color[c])));
            level.rgba.push_back(
                toByte(color.a * float(alpha.at(place, DVec2(0.0), repeats.u, repeats.v).x)));
        }
    }
    texture.levels = {std::move(level)};
    buildMipmaps(texture);
}

Material readMaterial(SceneReader& reader, const Json& asset, const UvGridParams& params,
                      const JsonPath& path) {
    const GridSurfaceInfo& info = gridSurface(params.shape.surface);
    Material material;
    material.name = "grid";
    material.base_color = Vec3(asset.contains("texture") ? 1.0f : 0.8f);
    readVector(asset, "color", material.base_color);
    readMember(asset, "roughness", material.roughness);
    float specular = 0.0f;
    readMember(asset, "specular", specular);
    material.specular = Vec3(specular);
    readMember(asset, "alpha", material.alpha);
    // What has no outside, or is seen through.
    material.double_sided =
        info.name == "helicoid" || info.name == "mobius" || material.alpha < 1.0f;
    readMember(asset, "double_sided", material.double_sided);
    const Repeats repeats(params);
    if (asset.contains("texture"))
        material.base_texture = readTexture(reader, asset, "texture", true, repeats, path);
    if (asset.contains("alpha_map")) {
        const JsonPath alpha_path = joined(path, {"alpha_map"});
        const GridTable alpha =
            readTable(reader, reader.file(asset["alpha_map"], alpha_path), 0.0, 1.0, alpha_path);
        if (material.base_texture == kNoTexture) {
            Texture white;
            white.name = "alpha";
            white.levels.push_back({1, 1, {255, 255, 255, 255}});
            repeats.applyTo(white);
            material.base_texture = int(reader.scene.textures.size());
            reader.scene.textures.push_back(std::move(white));
        }
        multiplyAlpha(reader, reader.scene.textures[size_t(material.base_texture)], alpha, repeats,
                      reader.where(alpha_path));
    }
    bool is_opaque = material.alpha == 1.0f;
    if (material.base_texture != kNoTexture) {
        const std::vector<uint8_t>& rgba =
            reader.scene.textures[size_t(material.base_texture)].levels[0].rgba;
        for (size_t i = 3; i < rgba.size() && is_opaque; i += 4) is_opaque = rgba[i] == 255;
    }
    if (!is_opaque) {
        material.alpha_mode = asset.contains("alpha_cutoff") ? AlphaMode::kMask : AlphaMode::kBlend;
    }
    readMember(asset, "alpha_cutoff", material.alpha_cutoff);
    if (asset.contains("normal_map")) {
        material.normal_map.texture =
            readTexture(reader, asset, "normal_map", false, repeats, path);
        readMember(asset, "normal_scale", material.normal_scale);
    }
    return material;
}

std::string shortNumber(double value, const char* format) {
    char text[32];
    std::snprintf(text, sizeof(text), format, value);
    return text;
}

void warnOfGrid(SceneReader& reader, const UvGrid& grid, bool is_given, const JsonPath& path) {
    const auto cells = [](int u, int v) { return std::to_string(u) + " x " + std::to_string(v); };
    if (!is_given && (grid.cells_u < grid.table_cells_u || grid.cells_v < grid.table_cells_v)) {
        reader.context.diagnostics.warn(
            reader.where(path), "the tables have " + cells(grid.table_cells_u, grid.table_cells_v) +
                                    " texels and the grid only " +
                                    cells(grid.cells_u, grid.cells_v) +
                                    " cells: what is finer is seen by its normals alone, unless "
                                    "\"resolution\" or \"refine\" ask for more");
    }
    const GridStretch& stretch = grid.stretch;
    if (!(stretch.most > kMostStretch)) return;
    reader.context.diagnostics.warn(
        reader.where(path),
        "the displaced surface pulls apart: at u " + shortNumber(stretch.u, "%.3f") + ", v " +
            shortNumber(stretch.v, "%.3f") + " it is stretched " +
            shortNumber(stretch.most, "%.3g") + " times as much as beside, and at " +
            shortNumber(100.0 * stretch.share, "%.2g") + " % of the grid's edges more than " +
            shortNumber(kMostStretch, "%.0f") + " times" +
            "; \"refine\", a larger \"resolution\" or a smoother table help");
}

}  // namespace

ChildRef readGrid(SceneReader& reader, const std::string& name, const Json& asset,
                  const JsonPath& path) {
    const UvGridParams params = readParams(reader, asset, path);
    UvGrid grid = makeUvGrid(params, reader.pool);
    warnOfGrid(reader, grid, asset.contains("resolution"), path);
    Material material = readMaterial(reader, asset, params, path);
    if (!params.has_normal_map && grid.isCoarserThanTables()) {
        const glm::ivec2 size = detailSize(grid);
        reader.context.budget.take(double(size.x) * size.y * 4.0 * 1.34, reader.where(path),
                                   "the texels of a normal map");
        material.normal_map = {int(reader.scene.textures.size()), 1};
        reader.scene.textures.push_back(makeDetailNormals(params, grid, reader.pool));
    }
    grid.mesh.name = oneLine(name);
    return addModel(reader.scene, std::move(grid.mesh), {std::move(material)}, reader.where(path));
}

}  // namespace stipple
