// SPDX-License-Identifier: Apache-2.0
// Materials and pictures of a glTF file. Internal to the glTF loader.
#pragma once

#include <scenegraph/io/gltf_document.h>
#include <scenegraph/scene.h>

#include <map>
#include <tuple>

namespace stipple {

// Where a texture is looked up: which TEXCOORD set, and KHR_texture_transform, which loaders bake
// into the uvs.
struct GltfUvLayer {
    int texcoord = 0;
    Vec2 offset = Vec2(0.0f);
    Vec2 scale = Vec2(1.0f);
    float rotation = 0.0f;  // radians

    Vec2 apply(Vec2 uv) const;
    bool operator==(const GltfUvLayer&) const = default;
};

struct GltfMaterial {
    uint16_t index = 0;                  // into Scene::materials
    std::vector<GltfUvLayer> uv_layers;  // what the mesh's layers of texture coordinates hold
    bool needs_tangents = false;
};

// Adds the materials that are asked for to the scene, each once.
class GltfMaterials {
public:
    GltfMaterials(const GltfDocument& document, Scene& scene)
        : document_(document), scene_(scene) {}

    // material: index in the file, -1 for glTF's default. for_points: double-sided and without
    // normal map, as the discs of a point cloud are. path: where that index stands.
    const GltfMaterial& get(int material, bool for_points, const std::string& path);

private:
    // Texture (index in the file) as Scene::textures index. is_opaque: alpha has no meaning and is
    // set to 1.
    int texture(int index, bool is_srgb, bool is_opaque, const std::string& path);
    int imageOf(int texture, const std::string& path) const;
    const Texture::Level& picture(int image);
    // Mean of a texture's texels, as linear values.
    Vec4 mean(int texture, bool is_srgb, const std::string& path);
    Material convert(const tinygltf::Material& source, bool for_points, GltfMaterial& out,
                     const std::string& path);
    // KHR_materials_specular.
    void convertSpecular(const tinygltf::Material& source, Material& m, GltfMaterial& out,
                         const std::string& path);
    // Info: a texture info with or without more. No texture where there is none.
    template <class Info>
    TextureUse use(const Info& info, bool is_srgb, bool is_opaque, GltfMaterial& out,
                   const std::string& path);

    const GltfDocument& document_;
    Scene& scene_;
    std::map<std::pair<int, bool>, GltfMaterial> materials_;  // by index and whether for points
    std::map<int, Texture::Level> pictures_;
    std::map<std::tuple<int, int, bool, bool>, int>
        textures_;  // by image, sampler and whether it is sRGB and opaque
};

}  // namespace stipple
