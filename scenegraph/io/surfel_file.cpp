// SPDX-License-Identifier: Apache-2.0
#include <scenegraph/io/surfel_file.h>

#include <scenegraph/io/hybrid_file.h>
#include <scenegraph/io/model.h>
#include <scenegraph/io/model_stream.h>

#include <algorithm>

namespace stipple {

namespace {

template <class Stream>
void transferModel(Stream& stream, SurfelModel& model, bool with_shapes) {
    stream.string(model.kind);
    stream.string(model.source);
    stream.value(model.bounds.min);
    stream.value(model.bounds.max);
    stream.value(model.area);
    transferFinishes(stream, model.finishes);
    transferLevels(stream, model.levels, with_shapes);
}

bool hasShapes(const SurfelModel& model) {
    return std::any_of(model.levels.begin(), model.levels.end(),
                       [](const SurfelLevel& level) { return !level.shapes.empty(); });
}

}  // namespace

std::string surfelFileText(const SurfelModel& model) {
    SurfelModel copy = model;
    ModelWriter writer;
    const bool with_shapes = hasShapes(model);
    transferModel(writer, copy, with_shapes);
    return modelFileText(with_shapes ? kShapeVersion : kSurfelVersion, writer.text);
}

namespace {

SurfelModel parseSurfelBody(const ModelBody& body, MemoryBudget& budget, const std::string& where) {
    if (body.version != kSurfelVersion && body.version != kShapeVersion)
        throw Error(ErrorCode::kParse, where, "holds no model of surfels alone");
    SurfelModel model;
    ModelReader reader(body.data, body.size, budget, where);
    transferModel(reader, model, body.version == kShapeVersion);
    if (!reader.isAtEnd()) throw Error(ErrorCode::kParse, where, "has bytes behind its end");
    checkSurfelModel(model, where);
    return model;
}

}  // namespace

SurfelModel parseSurfelFile(const std::string& text, MemoryBudget& budget,
                            const std::string& where) {
    return parseSurfelBody(modelBody(text, where), budget, where);
}

Mesh discPolygons(const SurfelModel& model, const SurfelLevel& level, float side) {
    Mesh mesh;
    std::array<Vec3, kMostDiscCorners> corners;
    for (const SurfelBlock& block : level.blocks) {
        for (uint32_t i = block.first; i < block.first + block.count; ++i) {
            const Surfel s = unpackSurfel(level, block, i);
            const int n = discPolygon(level, s, level.spacing * s.radius_share * side, corners);
            const uint32_t first = uint32_t(mesh.positions.size());
            for (int k = 0; k < n; ++k) {
                // Within the source's bounds: both are looked at from the same default camera.
                mesh.positions.push_back(glm::clamp(s.position + corners[size_t(k)],
                                                    model.bounds.min, model.bounds.max));
                mesh.normals.push_back(s.normal);
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

namespace {

// Squares in place of surfels, of the area that their surface has, from the finest level that is
// not too large.
Mesh standInMesh(const SurfelModel& model) {
    constexpr size_t kMostSquares = 40000;
    const SurfelLevel* level = &model.levels.back();
    for (const SurfelLevel& l : model.levels) {
        if (l.size() <= kMostSquares) {
            level = &l;
            break;
        }
    }
    double area = 0.0;  // of all squares with a side of the spacing
    for (uint32_t i = 0; i < level->size(); ++i) {
        const double share = level->radius.empty() ? 1.0 : double(surfelRadius(level->radius[i]));
        area += share * share * double(level->spacing) * double(level->spacing);
    }
    const double shrink = area > 0.0 && model.area > 0.0 ? std::sqrt(model.area / area) : 1.0;
    return discPolygons(model, *level, float(shrink));
}

}  // namespace

ChildRef addSurfelModel(Scene& scene, SurfelModel model, const std::string& name) {
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
    return addSurfelModel(scene, parseSurfelBody(body, context.budget, name), name);
}

}  // namespace stipple
    measureDiscs(model);
