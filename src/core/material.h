// SPDX-License-Identifier: Apache-2.0
// What a surface looks like, and the pictures on it.
#pragma once

#include <core/math.h>

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
    bool nearest = false;  // no interpolation between texels
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

inline constexpr int kNoTexture = -1;

// Diffuse plus a Phong lobe; glTF's metallic-roughness is mapped to it when loaded.
struct Material {
    std::string name;
    Vec3 base_color = Vec3(0.8f);   // linear, multiplied with texture and vertex colour
    float alpha = 1.0f;             // multiplied with the texture's and the vertex' alpha
    int base_texture = kNoTexture;  // index into Scene::textures
    AlphaMode alpha_mode = AlphaMode::kOpaque;
    float alpha_cutoff = 0.5f;   // kMask: below it there is no surface
    bool double_sided = false;   // single-sided surfaces are not there when seen from behind
    Vec3 specular = Vec3(0.0f);  // Phong lobe, reflectance at normal incidence
    float shininess = 20.0f;     // Phong exponent
    float translucency =
        0.0f;  // share of the diffuse light that comes through from behind (leaves)
    Vec3 emissive = Vec3(0.0f);  // linear radiance
    bool unlit = false;          // base colour as it is
};

}  // namespace stipple
