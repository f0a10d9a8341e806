// SPDX-License-Identifier: Apache-2.0
#include <scenegraph/io/hybrid_file.h>

#include <scenegraph/io/model_stream.h>

namespace stipple {

namespace {

constexpr const char* kKind = "hybrid";

template <class Stream>
void transferMaterial(Stream& stream, Material& m) {
    uint8_t flags = uint8_t(m.double_sided | m.unlit << 1);
    stream.string(m.name);
    for (Vec3* v : {&m.base_color, &m.specular, &m.emissive}) stream.value(*v);
    for (float* v : {&m.alpha, &m.alpha_cutoff, &m.metallic, &m.roughness, &m.specular_weight,
                     &m.translucency, &m.normal_scale})
        stream.value(*v);
    stream.value(m.base_texture);
    for (TextureUse* use : {&m.normal_map, &m.metallic_roughness_map, &m.specular_map,
                            &m.specular_color_map, &m.emissive_map}) {
        stream.value(use->texture);
        stream.value(use->uv_layer);
    }
    stream.value(m.alpha_mode);
    stream.value(flags);
    m.double_sided = flags & 1;
    m.unlit = flags >> 1 & 1;
}

template <class Stream>
void transferTexture(Stream& stream, Texture& t) {
    t.levels.resize(1);
    uint8_t flags = uint8_t(t.srgb | t.nearest << 1);
    stream.string(t.name);
    stream.value(t.levels[0].width);
    stream.value(t.levels[0].height);
    stream.value(t.wrap_u);
    stream.value(t.wrap_v);
    stream.value(flags);
    stream.array(t.levels[0].rgba);
    t.srgb = flags & 1;
    t.nearest = flags >> 1 & 1;
}

template <class Stream>
void transferModel(Stream& stream, std::string& kind, HybridModel& model) {
    constexpr size_t kLeastLayer = 8, kLeastMaterial = 114, kLeastTexture = 23, kLeastPatch = 16,
                     kLeastTriangles = 20;
    Mesh& mesh = model.mesh;
    stream.string(kind);
    stream.string(model.source);
    stream.array(mesh.positions);
    stream.array(mesh.normals);
    stream.array(mesh.uvs);
    stream.list(mesh.more_uvs, kLeastLayer, [&](std::vector<Vec2>& uvs) { stream.array(uvs); });
    stream.array(mesh.tangents);
    stream.array(mesh.colors);
    stream.list(model.materials, kLeastMaterial, [&](Material& m) { transferMaterial(stream, m); });
    stream.list(model.textures, kLeastTexture, [&](Texture& t) { transferTexture(stream, t); });
    transferFinishes(stream, model.finishes);
    stream.array(model.triangles);
    stream.array(model.triangle_material);
    stream.list(model.patches, kLeastPatch, [&](HybridPatch& patch) {
        stream.list(patch.triangles, kLeastTriangles, [&](TriangleLevel& level) {
            stream.value(level.error);
            stream.array(level.triangles);
            stream.array(level.material);
        });
        transferLevels(stream, patch.surfels, kHybridVersion);
    });
}

// What building the whole surface takes, and each patch's levels, which are meshes of their own
// with copies of their vertices.
double builtBytes(const HybridModel& model) {
    const Mesh& mesh = model.mesh;
    const double layer_bytes = double(mesh.more_uvs.size()) * sizeof(Vec2);
    const double vertex_bytes = kBytesPerVertex + layer_bytes;
    const double mesh_bytes = sizeof(Mesh) + sizeof(MeshNode) + sizeof(Stratum) +
                              double(mesh.more_uvs.size()) * sizeof(std::vector<Vec2>);
    const double finish_bytes = double(model.finishes.size()) * sizeof(SurfelFinish);
    double bytes = double(model.triangles.size()) * kBytesPerTriangle +
                   double(mesh.positions.size()) * kBytesPerVertex;
    std::vector<uint32_t> seen_by(mesh.positions.size(), 0);  // the last level that has the vertex
    uint32_t n_levels = 0;
    for (const HybridPatch& patch : model.patches) {
        bytes += sizeof(MeshPatch) + double(patch.triangles.size()) * sizeof(MeshPatch::Triangles);
        for (const TriangleLevel& level : patch.triangles) {
            ++n_levels;
            size_t vertices = 0;
            for (const UVec3& t : level.triangles) {
                for (int k = 0; k < 3; ++k) {
                    vertices += seen_by[t[k]] != n_levels;
                    seen_by[t[k]] = n_levels;
                }
            }
            bytes += mesh_bytes + double(level.triangles.size()) * kBytesPerTriangle +
                     double(vertices) * vertex_bytes;
        }
        if (!patch.surfels.empty()) bytes += mesh_bytes + sizeof(SurfelModel) + finish_bytes;
    }
    return bytes;
}

}  // namespace

std::string hybridFileText(const HybridModel& model) {
    HybridModel copy = model;
    std::string kind = kKind;
    ModelWriter writer;
    transferModel(writer, kind, copy);
    return modelFileText(kHybridVersion, writer.text);
}

HybridModel parseHybridFile(const std::string& text, MemoryBudget& budget,
                            const std::string& where) {
    return parseHybridBody(modelBody(text, where), budget, where);
}

HybridModel parseHybridBody(const ModelBody& body, MemoryBudget& budget, const std::string& where) {
    if (body.version != kHybridVersion)
        throw Error(ErrorCode::kParse, where, "holds no hybrid model");
    HybridModel model;
    std::string kind;
    ModelReader reader(body.data, body.size, budget, where);
    transferModel(reader, kind, model);
    if (kind != kKind) throw Error(ErrorCode::kParse, where, "is a model of an unknown kind");
    if (!reader.isAtEnd()) throw Error(ErrorCode::kParse, where, "has bytes behind its end");
    checkHybridModel(model, where);
    budget.take(builtBytes(model), where,
                std::to_string(model.triangles.size()) + " triangles and " +
                    std::to_string(model.patches.size()) + " patches");
    return model;
}

}  // namespace stipple
