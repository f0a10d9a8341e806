// SPDX-License-Identifier: Apache-2.0
#include <scenegraph/io/surfel_file.h>

#include <scenegraph/io/hybrid_file.h>
#include <scenegraph/io/model.h>
#include <scenegraph/io/model_stream.h>

#include <algorithm>

namespace stipple {

namespace {

template <class Stream>
void transferModel(Stream& stream, SurfelModel& model, uint32_t version) {
    stream.string(model.kind);
    stream.string(model.source);
    stream.value(model.bounds.min);
    stream.value(model.bounds.max);
    stream.value(model.area);
    transferFinishes(stream, model.finishes);
    transferLevels(stream, model.levels, version);
}

// The oldest that has all of the model.
uint32_t versionOf(const SurfelModel& model) {
    uint32_t version = kSurfelVersion;
    for (const SurfelLevel& level : model.levels) {
        if (!level.shapes.empty()) version = std::max(version, kShapeVersion);
        if (!level.bends.empty()) version = std::max(version, kBendVersion);
    }
    return version;
}

}  // namespace

std::string surfelFileText(const SurfelModel& model) {
    SurfelModel copy = model;
    ModelWriter writer;
    const uint32_t version = versionOf(model);
    transferModel(writer, copy, version);
    return modelFileText(version, writer.text);
}

namespace {

SurfelModel parseSurfelBody(const ModelBody& body, MemoryBudget& budget, const std::string& where) {
    if (body.version == kHybridVersion)
        throw Error(ErrorCode::kParse, where, "holds no model of surfels alone");
    SurfelModel model;
    ModelReader reader(body.data, body.size, budget, where);
    transferModel(reader, model, body.version);
    if (!reader.isAtEnd()) throw Error(ErrorCode::kParse, where, "has bytes behind its end");
    checkSurfelModel(model, where);
    return model;
}

}  // namespace

SurfelModel parseSurfelFile(const std::string& text, MemoryBudget& budget,
                            const std::string& where) {
    return parseSurfelBody(modelBody(text, where), budget, where);
}

namespace {

// Which of a level's discs are left out: of those smaller than `whole`, all but n_kept of n_small,
// evenly; these are the larger for it.
struct Thinning {
    int whole = 0;  // as SurfelLevel::radius
    uint64_t n_small = 0, n_kept = 0;

    bool keeps(uint64_t i) const { return (i + 1) * n_kept / n_small != i * n_kept / n_small; }
    float enlarged() const { return n_kept > 0 ? std::sqrt(float(n_small) / float(n_kept)) : 1.0f; }
};

// To `most` discs. Half of these are the largest, which would show, if there are such.
Thinning thinnedTo(const SurfelLevel& level, size_t most) {
    Thinning thinning;
    if (level.size() <= most) return thinning;
    std::array<size_t, 257> n_from = {};  // discs of that code and larger
    for (const uint8_t code : level.radius) ++n_from[code];
    for (int code = 255; code >= 0; --code) n_from[size_t(code)] += n_from[size_t(code) + 1];
    thinning.whole = 256;
    while (!level.radius.empty() && n_from[size_t(thinning.whole) - 1] <= most / 2)
        --thinning.whole;
    const size_t n_whole = n_from[size_t(thinning.whole)];
    thinning.n_small = level.size() - n_whole;
    thinning.n_kept = most - n_whole;
    return thinning;
}

// Squares or polygons with sides of that many spacings; materials: finishes.
Mesh polygonsOf(const SurfelLevel& level, float side, const Thinning& thinning) {
    Mesh mesh;
    std::array<Vec3, kMostDiscCorners> corners;
    uint64_t n_seen = 0;  // small ones
    for (const SurfelBlock& block : level.blocks) {
        for (uint32_t i = block.first; i < block.first + block.count; ++i) {
            const bool is_small = (level.radius.empty() ? 0 : level.radius[i]) < thinning.whole;
            if (is_small && !thinning.keeps(n_seen++)) continue;
            const Surfel s = unpackSurfel(level, block, i);
            const float scale = side * (is_small ? thinning.enlarged() : 1.0f);
            const int n = discPolygon(level, s, level.spacing * s.radius_share * scale, corners);
            const uint32_t first = uint32_t(mesh.positions.size());
            for (int k = 0; k < n; ++k) {
                const Vec3& corner = corners[size_t(k)];
                mesh.positions.push_back(s.position + corner);
                mesh.normals.push_back(level.bends.empty() ? s.normal
                                                           : bentNormal(level, s, side, corner));
                mesh.colors.emplace_back(s.albedo, 1.0f);
            }
            for (int k = 2; k < n; ++k) {
                mesh.triangles.emplace_back(first, first + uint32_t(k) - 1, first + uint32_t(k));
                mesh.triangle_material.push_back(s.finish);
            }
        }
    }
    return mesh;
}

}  // namespace

Mesh discPolygons(const SurfelModel& model, const SurfelLevel& level, float side) {
    Mesh mesh = polygonsOf(level, side, Thinning());
    for (Vec3& p : mesh.positions) p = glm::clamp(p, model.bounds.min, model.bounds.max);
    return mesh;
}

namespace {

constexpr size_t kMostStandIns = 40000;

// The finest that is not too large, or the coarsest.
const SurfelLevel& standInLevel(const SurfelModel& model) {
    for (const SurfelLevel& level : model.levels) {
        if (level.size() <= kMostStandIns) return level;
    }
    return model.levels.back();
}

// What building the mesh below takes.
double standInBytes(const SurfelModel& model) {
    const SurfelLevel& level = standInLevel(model);
    const double count = double(std::min(level.size(), kMostStandIns));
    const double corners =
        level.shapes.empty() ? 4.0 : 6.0 + double(level.cuts.size()) / double(level.size());
    return count * (corners * kBytesPerVertex + (corners - 2.0) * kBytesPerTriangle);
}

Mesh standInMesh(const SurfelModel& model) {
    const SurfelLevel& level = standInLevel(model);
    const Thinning thinning = thinnedTo(level, kMostStandIns);
    // Splats are as large as it takes to close the surface.
    if (!level.radius.empty()) return polygonsOf(level, model.discSide(), thinning);
    // Others are alike, and together as large as the surface.
    const double area = double(level.size()) * double(level.spacing) * double(level.spacing);
    const double side = model.area > 0.0 ? std::sqrt(model.area / area) : 1.0;
    Mesh mesh = polygonsOf(level, float(side), thinning);
    for (Vec3& p : mesh.positions) p = glm::clamp(p, model.bounds.min, model.bounds.max);
    return mesh;
}

}  // namespace

ChildRef addSurfelModel(Scene& scene, SurfelModel model, const std::string& name) {
    measureDiscs(model);
    Mesh mesh = standInMesh(model);
    mesh.name = name;
    mesh.first_finish = uint32_t(scene.materials.size());
    std::vector<Material> materials;
    for (const SurfelFinish& finish : model.finishes) {
        materials.push_back(finish.material);
        materials.back().base_color = Vec3(1.0f);
    }
    mesh.surfels = std::make_shared<SurfelModel>(std::move(model));
    return addModel(scene, std::move(mesh), std::move(materials), name);
}

ChildRef loadSurfelModel(const std::filesystem::path& path, const std::string& name, Scene& scene,
                         LoadContext& context) {
    const std::string text = readFile(path, context.budget, name);
    const ModelBody body = modelBody(text, name);
    if (body.version == kHybridVersion)
        return addHybridModel(scene, parseHybridBody(body, context.budget, name), name);
    SurfelModel model = parseSurfelBody(body, context.budget, name);
    context.budget.take(
        standInBytes(model), name,
        "the mesh that stands for " + std::to_string(model.levels[0].size()) + " points or splats");
    return addSurfelModel(scene, std::move(model), name);
}

}  // namespace stipple
