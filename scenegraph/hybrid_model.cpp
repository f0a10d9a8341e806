// SPDX-License-Identifier: Apache-2.0
#include <scenegraph/hybrid_model.h>

#include <limits>
#include <unordered_map>

namespace stipple {

namespace {

void check(bool condition, const std::string& where, const char* what) {
    if (!condition) throw Error(ErrorCode::kParse, where, what);
}

void checkTriangles(const HybridModel& model, const std::vector<UVec3>& triangles,
                    const std::vector<uint16_t>& material, const std::string& where) {
    check(!triangles.empty(), where, "has a level without triangles");
    check(triangles.size() == material.size(), where, "has arrays of different lengths");
    const uint32_t n = uint32_t(model.mesh.positions.size());
    for (const UVec3& t : triangles)
        check(t.x < n && t.y < n && t.z < n, where, "has a triangle without a vertex");
    for (const uint16_t m : material)
        check(m < model.materials.size(), where, "has a triangle without a material");
}

void checkMaterials(const HybridModel& model, const std::string& where) {
    for (Material m : model.materials) {
        checkMaterialNumbers(m, where);
        check(m.alpha_mode <= AlphaMode::kBlend, where, "has a material that makes no sense");
        for (const float v : {m.base_color.x, m.base_color.y, m.base_color.z, m.alpha_cutoff})
            check(v >= 0.0f && v < 1e15f, where, "has a material that is no number");
        check(std::abs(m.normal_scale) < 1e15f, where, "has a material that is no number");
        for (const TextureUse* use : {&m.normal_map, &m.metallic_roughness_map, &m.specular_map,
                                      &m.specular_color_map, &m.emissive_map})
            check(use->uv_layer >= 0, where, "has a texture without coordinates");
        for (const int* texture : textureIndices(m)) {
            check(*texture >= kNoTexture && *texture < int(model.textures.size()), where,
                  "has a material without its texture");
        }
    }
    for (const Texture& t : model.textures) {
        const Texture::Level& level = t.levels.at(0);
        constexpr int kMostTexels = 1 << 16;  // along a side
        check(level.width > 0 && level.height > 0 && level.width <= kMostTexels &&
                  level.height <= kMostTexels &&
                  level.rgba.size() == size_t(level.width) * size_t(level.height) * 4 &&
                  t.wrap_u <= Wrap::kClamp && t.wrap_v <= Wrap::kClamp,
              where, "has a texture that makes no sense");
    }
}

}  // namespace

void checkHybridModel(const HybridModel& model, const std::string& where) {
    const Mesh& mesh = model.mesh;
    const auto checkLength = [&](const auto& values) {
        check(values.empty() || values.size() == mesh.positions.size(), where,
              "has arrays of different lengths");
    };
    checkLength(mesh.normals);
    checkLength(mesh.uvs);
    checkLength(mesh.tangents);
    checkLength(mesh.colors);
    // A material has six textures at most.
    constexpr size_t kMostLayers = 8;
    check(mesh.more_uvs.size() <= kMostLayers, where,
          "has more than 8 further layers of texture coordinates");
    for (const auto& layer : mesh.more_uvs) checkLength(layer);
    check(!model.patches.empty(), where, "has no patches");
    checkMaterials(model, where);
    checkSurfelFinishes(model.finishes, where);
    checkTriangles(model, model.triangles, model.triangle_material, where);
    for (const HybridPatch& patch : model.patches) {
        check(!patch.triangles.empty() || !patch.surfels.empty(), where, "has an empty patch");
        float error = 0.0f;
        for (const TriangleLevel& level : patch.triangles) {
            check(level.error >= error && level.error < 1e15f, where,
                  "has an error that is no length");
            error = level.error;
            checkTriangles(model, level.triangles, level.material, where);
        }
        checkSurfelLevels(patch.surfels, model.finishes.size(), where);
    }
}

namespace {

// Some triangles of the model, with the vertices they use.
Mesh partOf(const HybridModel& model, const TriangleLevel& level) {
    const Mesh& all = model.mesh;
    Mesh part;
    part.is_patch = true;
    part.more_uvs.resize(all.more_uvs.size());
    std::unordered_map<uint32_t, uint32_t> index_of;
    const auto copy = [](auto& to, const auto& from, uint32_t v) {
        if (!from.empty()) to.push_back(from[v]);
    };
    for (const UVec3& t : level.triangles) {
        UVec3 triangle;
        for (int k = 0; k < 3; ++k) {
            const uint32_t v = t[k];
            const auto [at, is_new] = index_of.emplace(v, uint32_t(part.positions.size()));
            triangle[k] = at->second;
            if (!is_new) continue;
            copy(part.positions, all.positions, v);
            copy(part.normals, all.normals, v);
            copy(part.uvs, all.uvs, v);
            copy(part.tangents, all.tangents, v);
            copy(part.colors, all.colors, v);
            for (size_t l = 0; l < all.more_uvs.size(); ++l)
                copy(part.more_uvs[l], all.more_uvs[l], v);
        }
        part.triangles.push_back(triangle);
    }
    part.triangle_material = level.material;
    return part;
}

// The mesh that holds a patch's surfels.
Mesh surfelsOf(std::vector<SurfelLevel> levels, const std::vector<SurfelFinish>& finishes) {
    auto surfels = std::make_shared<SurfelModel>();
    surfels->kind = "hybrid";
    surfels->finishes = finishes;
    for (const SurfelBlock& block : levels[0].blocks) {
        surfels->bounds.extend(block.bounds.min);
        surfels->bounds.extend(block.bounds.max);
    }
    surfels->area = double(levels[0].size()) * double(levels[0].spacing * levels[0].spacing);
    surfels->levels = std::move(levels);
    surfels->leaves_no_holes = false;
    measureDiscs(*surfels);
    Mesh mesh;
    mesh.is_patch = true;
    mesh.surfels = std::move(surfels);
    return mesh;
}

}  // namespace

ChildRef addHybridModel(Scene& scene, HybridModel model, const std::string& name) {
    const size_t first_material = scene.materials.size(),
                 first_finish = first_material + model.materials.size();
    if (first_finish + model.finishes.size() > size_t(std::numeric_limits<uint16_t>::max()) + 1)
        throw Error(ErrorCode::kUnsupported, name, "the scene has more than 65536 materials");
    for (Material& material : model.materials) {
        for (int* texture : textureIndices(material)) {
            if (*texture != kNoTexture) *texture += int(scene.textures.size());
        }
        scene.materials.push_back(std::move(material));
    }
    for (Texture& texture : model.textures) {
        buildMipmaps(texture);
        scene.textures.push_back(std::move(texture));
    }
    for (const SurfelFinish& finish : model.finishes) {
        scene.materials.push_back(finish.material);
        scene.materials.back().base_color = Vec3(1.0f);
    }
    const auto add = [&](Mesh mesh) {
        mesh.name = name;
        mesh.first_finish = uint32_t(first_finish);
        for (uint16_t& m : mesh.triangle_material) m = uint16_t(m + first_material);
        scene.meshes.push_back(std::move(mesh));
        return uint32_t(scene.meshes.size() - 1);
    };
    std::vector<MeshPatch> patches;
    for (HybridPatch& from : model.patches) {
        MeshPatch patch;
        for (const TriangleLevel& level : from.triangles) {
            for (const uint16_t m : level.material)
                patch.is_textured =
                    patch.is_textured || scene.materials[first_material + m].isTextured();
            Mesh part = partOf(model, level);
            for (const Vec3& p : part.positions) patch.bounds.extend(p);
            patch.triangles.push_back({add(std::move(part)), level.error});
        }
        if (!from.surfels.empty()) {
            Mesh surfels = surfelsOf(std::move(from.surfels), model.finishes);
            patch.bounds.extend(surfels.surfels->drawn_bounds.min);
            patch.bounds.extend(surfels.surfels->drawn_bounds.max);
            patch.surfels = add(std::move(surfels));
        }
        patches.push_back(std::move(patch));
    }
    Mesh whole = std::move(model.mesh);
    whole.triangles = std::move(model.triangles);
    whole.triangle_material = std::move(model.triangle_material);
    whole.patches = std::move(patches);
    whole.patches_source = std::move(model.source);
    return ChildRef::mesh(add(std::move(whole)));
}

}  // namespace stipple
