// SPDX-License-Identifier: Apache-2.0
// What a surface looks like, and the pictures on it.
#pragma once

#include <core/math.h>

#include <array>
#include <cstdint>
#include <string>
#include <vector>

namespace stipple {

enum class AlphaMode : uint8_t { kOpaque, kMask, kBlend };
enum class Wrap : uint8_t { kRepeat, kMirror, kClamp };

// 8-bit RGBA texels with a mip chain (level 0 first, each level half the size, rounded up).
struct Texture {
    std::string name;
    bool srgb = true;  // colour textures are sRGB-encoded, all else is linear
    Wrap wrap_u = Wrap::kRepeat;
    Wrap wrap_v = Wrap::kRepeat;
    bool nearest = false;    // no interpolation between texels
    bool is_opaque = false;  // no texel has an alpha below 1; buildMipmaps() finds out
    struct Level {
        int width = 0;
        int height = 0;
        std::vector<uint8_t> rgba;  // width * height * 4
    };
    std::vector<Level> levels;

    size_t bytes() const;
};

// Fills levels 1.. from level 0 (box filter on linear values, colour weighted by alpha).
void buildMipmaps(Texture& texture);

// Linear RGB and alpha at uv (glTF convention: v = 0 is the top row). footprint_uv: diameter of the
// area that the lookup stands for, in uv units; 0 reads level 0. Trilinear.
Vec4 sampleTexture(const Texture& texture, Vec2 uv, float footprint_uv);
// The same over the parallelogram of those two sides (in uv) about uv: a row of up to
// kMostTextureTaps trilinear lookups along the longer one.
Vec4 sampleTexture(const Texture& texture, Vec2 uv, Vec2 side_a, Vec2 side_b);
inline constexpr int kMostTextureTaps = 8;

inline constexpr int kNoTexture = -1;

// A texture and the texture coordinates it is looked up with.
struct TextureUse {
    int texture = kNoTexture;  // index into Scene::textures
    int uv_layer = 0;          // 0: Mesh::uvs, n: Mesh::more_uvs[n - 1]
};

// Metallic-roughness as glTF 2.0 has it, and light that comes through from behind. Textures are
// multiplied with the values they stand beside.
struct Material {
    std::string name;
    Vec3 base_color = Vec3(0.8f);   // linear, multiplied with texture and vertex colour
    float alpha = 1.0f;             // multiplied with the texture's and the vertex' alpha
    int base_texture = kNoTexture;  // index into Scene::textures, looked up with Mesh::uvs
    AlphaMode alpha_mode = AlphaMode::kOpaque;
    float alpha_cutoff = 0.5f;     // kMask: below it there is no surface
    bool double_sided = false;     // single-sided surfaces are not there when seen from behind
    float metallic = 0.0f;         // 1: base_color is what is mirrored, nothing is diffuse
    float roughness = 1.0f;        // of what is mirrored; its square is the microfacets' width
    Vec3 specular = Vec3(0.0f);    // what is no metal: reflectance at normal incidence; 0: none
    float specular_weight = 1.0f;  // times the reflectance, at grazing incidence too
    float translucency =
        0.0f;  // share of the diffuse light that comes through from behind (leaves)
    Vec3 emissive = Vec3(0.0f);  // linear radiance
    bool unlit = false;          // base colour as it is

    TextureUse normal_map;      // tangent space: RGB in [0, 1] stands for x, y, z in [-1, 1]
    float normal_scale = 1.0f;  // of the map's x and y
    TextureUse metallic_roughness_map;  // green: roughness, blue: metallic
    TextureUse specular_map;            // alpha: specular_weight
    TextureUse specular_color_map;      // RGB: specular
    TextureUse emissive_map;            // RGB

    // Whether anything but vertex colours varies over the surface.
    bool isTextured() const {
        return base_texture != kNoTexture || normal_map.texture != kNoTexture ||
               metallic_roughness_map.texture != kNoTexture || specular_map.texture != kNoTexture ||
               specular_color_map.texture != kNoTexture || emissive_map.texture != kNoTexture;
    }
};

// Every index into Scene::textures that a material holds, kNoTexture or not.
inline std::array<int*, 6> textureIndices(Material& m) {
    return {
        &m.base_texture,         &m.normal_map.texture,         &m.metallic_roughness_map.texture,
        &m.specular_map.texture, &m.specular_color_map.texture, &m.emissive_map.texture};
}

}  // namespace stipple
