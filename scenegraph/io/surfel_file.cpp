// SPDX-License-Identifier: Apache-2.0
#include <scenegraph/io/surfel_file.h>

#include <scenegraph/io/hybrid_file.h>
#include <scenegraph/io/model.h>
#include <scenegraph/io/model_stream.h>

namespace stipple {

namespace {

template <class Stream>
void transferModel(Stream& stream, SurfelModel& model) {
    stream.string(model.kind);
    stream.string(model.source);
    stream.value(model.bounds.min);
    stream.value(model.bounds.max);
    stream.value(model.area);
    transferFinishes(stream, model.finishes);
    transferLevels(stream, model.levels);
}

}  // namespace

std::string surfelFileText(const SurfelModel& model) {
    SurfelModel copy = model;
    ModelWriter writer;
    transferModel(writer, copy);
    return modelFileText(kSurfelVersion, writer.text);
}

SurfelModel parseSurfelFile(const std::string& text, MemoryBudget& budget,
                            const std::string& where) {
    const ModelBody body = modelBody(text, where);
    if (body.version != kSurfelVersion)
        throw Error(ErrorCode::kParse, where, "holds no model of surfels alone");
    SurfelModel model;
    ModelReader reader(body.data, body.size, budget, where);
    transferModel(reader, model);
    if (!reader.isAtEnd()) throw Error(ErrorCode::kParse, where, "has bytes behind its end");
    checkSurfelModel(model, where);
    return model;
}

Mesh discSquares(const SurfelModel& model, const SurfelLevel& level, float side) {
    Mesh mesh;
    for (const SurfelBlock& block : level.blocks) {
        for (uint32_t i = block.first; i < block.first + block.count; ++i) {
            const Surfel s = unpackSurfel(level, block, i);
            const Vec3 other = std::abs(s.normal.x) < 0.7f ? Vec3(1, 0, 0) : Vec3(0, 1, 0);
            const float half = 0.5f * level.spacing * s.radius_share * side;
            const Vec3 a = glm::normalize(glm::cross(s.normal, other)) * half,
                       b = glm::cross(s.normal, a);
            const uint32_t first = uint32_t(mesh.positions.size());
            for (const Vec3& corner : {-a - b, a - b, a + b, b - a}) {
                // Within the source's bounds: both are looked at from the same default camera.
                mesh.positions.push_back(
                    glm::clamp(s.position + corner, model.bounds.min, model.bounds.max));
                mesh.normals.push_back(s.normal);
                mesh.colors.emplace_back(s.albedo, 1.0f);
            }
            mesh.triangles.emplace_back(first, first + 1, first + 2);
            mesh.triangles.emplace_back(first, first + 2, first + 3);
            mesh.triangle_material.insert(mesh.triangle_material.end(), 2, s.finish);
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
    return discSquares(model, *level, float(shrink));
}

}  // namespace

ChildRef loadSurfelModel(const std::filesystem::path& path, const std::string& name, Scene& scene,
                         LoadContext& context) {
    const std::string text = readFile(path, context.budget, name);
    if (modelBody(text, name).version == kHybridVersion)
        return addHybridModel(scene, parseHybridFile(text, context.budget, name), name);
    auto model = std::make_shared<SurfelModel>(parseSurfelFile(text, context.budget, name));
    Mesh mesh = standInMesh(*model);
    mesh.name = name;
    mesh.first_finish = uint32_t(scene.materials.size());
    std::vector<Material> materials;
    for (const SurfelFinish& finish : model->finishes) {
        materials.push_back(finish.material);
        materials.back().base_color = Vec3(1.0f);
    }
    mesh.surfels = std::move(model);
    return addModel(scene, std::move(mesh), std::move(materials), name);
}

}  // namespace stipple
