// SPDX-License-Identifier: Apache-2.0
// Mip chains and lookups. Colours are averaged as linear light and weighted by alpha, so that what
// is cut away (often black or white) does not bleed into leaves.
#include <core/image.h>
#include <core/material.h>

#include <array>

namespace stipple {

namespace {

// Linear RGB multiplied with alpha, and alpha. Where all is transparent the plain colour is kept
// aside.
struct Weighted {
    Vec4 premultiplied = Vec4(0.0f);
    Vec3 plain = Vec3(0.0f);

    void add(const Vec4& texel, float weight) {
        premultiplied += Vec4(Vec3(texel) * texel.a, texel.a) * weight;
        plain += Vec3(texel) * weight;
    }
    Vec4 color() const {
        const float a = premultiplied.a;
        return a > 1e-6f ? Vec4(Vec3(premultiplied) / a, a) : Vec4(plain, 0.0f);
    }
};

const std::array<float, 256>& byteToLinear(bool srgb) {
    static const auto tables = [] {
        std::array<std::array<float, 256>, 2> t;
        for (int i = 0; i < 256; ++i)
            t[0][i] = float(i) / 255.0f, t[1][i] = linearFromSrgb(float(i) / 255.0f);
        return t;
    }();
    return tables[srgb];
}

Vec4 readTexel(const Texture::Level& level, const std::array<float, 256>& linear, int x, int y) {
    const uint8_t* t = level.rgba.data() + (size_t(y) * level.width + x) * 4;
    return Vec4(linear[t[0]], linear[t[1]], linear[t[2]], float(t[3]) / 255.0f);
}

uint8_t toByte(float value) { return uint8_t(std::clamp(value, 0.0f, 1.0f) * 255.0f + 0.5f); }

// The source texels that texel i of a level of n_target covers, of n_source, and their shares of
// it.
struct Taps {
    int first = 0;
    int count = 0;
    std::array<float, 3> weight{};
};

Taps boxTaps(int i, int n_source, int n_target) {
    const double lo = double(i) * n_source / n_target, hi = double(i + 1) * n_source / n_target;
    Taps taps;
    taps.first = int(lo);
    for (int x = taps.first; x < std::min(n_source, int(std::ceil(hi))) && taps.count < 3; ++x) {
        taps.weight[taps.count++] =
            float((std::min(hi, x + 1.0) - std::max(lo, double(x))) / (hi - lo));
    }
    return taps;
}

// Half the size, rounded up. read(x, y): a texel of the source, linear.
template <class Read>
std::vector<Vec4> halve(int source_width, int source_height, int width, int height,
                        const Read& read) {
    std::vector<Vec4> result(size_t(width) * height);
    for (int y = 0; y < height; ++y) {
        const Taps rows = boxTaps(y, source_height, height);
        for (int x = 0; x < width; ++x) {
            const Taps columns = boxTaps(x, source_width, width);
            Weighted sum;
            for (int j = 0; j < rows.count; ++j) {
                for (int i = 0; i < columns.count; ++i) {
                    sum.add(read(columns.first + i, rows.first + j),
                            columns.weight[i] * rows.weight[j]);
                }
            }
            result[size_t(y) * width + x] = sum.color();
        }
    }
    return result;
}

// Brings one coordinate into [0, 1].
float wrapCoordinate(float u, Wrap wrap) {
    if (!std::isfinite(u)) return 0.0f;
    if (wrap == Wrap::kClamp) return std::clamp(u, 0.0f, 1.0f);
    if (wrap == Wrap::kRepeat) return u - std::floor(u);
    const float turn = u - 2.0f * std::floor(u * 0.5f);
    return turn > 1.0f ? 2.0f - turn : turn;
}

int wrapTexel(int i, int n, Wrap wrap) {
    // Beyond the border of a mirrored picture lies the border's texel again, as for a clamped one.
    if (wrap == Wrap::kRepeat) return i < 0 ? i + n : i >= n ? i - n : i;
    return std::clamp(i, 0, n - 1);
}

Vec4 sampleLevel(const Texture& texture, const Texture::Level& level, float u, float v) {
    const auto& linear = byteToLinear(texture.srgb);
    if (texture.nearest) {
        return readTexel(level, linear, std::min(int(u * level.width), level.width - 1),
                         std::min(int(v * level.height), level.height - 1));
    }
    const float x = u * level.width - 0.5f, y = v * level.height - 0.5f;
    const int x0 = int(std::floor(x)), y0 = int(std::floor(y));
    const float fx = x - x0, fy = y - y0;
    const int rows[2] = {wrapTexel(y0, level.height, texture.wrap_v),
                         wrapTexel(y0 + 1, level.height, texture.wrap_v)},
              columns[2] = {wrapTexel(x0, level.width, texture.wrap_u),
                            wrapTexel(x0 + 1, level.width, texture.wrap_u)};
    if (texture.is_opaque) {
        const auto texel = [&](int i, int j) {
            const uint8_t* t = level.rgba.data() + (size_t(rows[j]) * level.width + columns[i]) * 4;
            return Vec3(linear[t[0]], linear[t[1]], linear[t[2]]);
        };
        return Vec4(glm::mix(glm::mix(texel(0, 0), texel(1, 0), fx),
                             glm::mix(texel(0, 1), texel(1, 1), fx), fy),
                    1.0f);
    }
    Weighted sum;
    for (int j = 0; j < 2; ++j) {
        for (int i = 0; i < 2; ++i) {
            sum.add(readTexel(level, linear, columns[i], rows[j]),
                    (i ? fx : 1.0f - fx) * (j ? fy : 1.0f - fy));
        }
    }
    return sum.color();
}

}  // namespace

size_t Texture::bytes() const {
    size_t sum = levels.capacity() * sizeof(Level);
    for (const Level& level : levels) sum += level.rgba.capacity();
    return sum;
}

void buildMipmaps(Texture& texture) {
    if (texture.levels.empty()) return;
    texture.levels.resize(1);
    const std::vector<uint8_t>& rgba = texture.levels[0].rgba;
    texture.is_opaque = true;
    for (size_t i = 3; i < rgba.size(); i += 4) texture.is_opaque &= rgba[i] == 255;
    int width = texture.levels[0].width, height = texture.levels[0].height;
    std::vector<Vec4> finer;  // the level before, unrounded; empty for level 0
    while (width > 1 || height > 1) {
        const int w = (width + 1) / 2, h = (height + 1) / 2;
        std::vector<Vec4> texels =
            finer.empty() ? halve(width, height, w, h,
                                  [&, &linear = byteToLinear(texture.srgb)](int x, int y) {
                                      return readTexel(texture.levels[0], linear, x, y);
                                  })
                          : halve(width, height, w, h,
                                  [&](int x, int y) { return finer[size_t(y) * width + x]; });
        Texture::Level level{w, h, std::vector<uint8_t>(texels.size() * 4)};
        for (size_t i = 0; i < texels.size(); ++i) {
            for (int c = 0; c < 3; ++c) {
                level.rgba[i * 4 + c] =
                    toByte(texture.srgb ? srgbFromLinear(texels[i][c]) : texels[i][c]);
            }
            level.rgba[i * 4 + 3] = toByte(texels[i].a);
        }
        texture.levels.push_back(std::move(level));
        finer = std::move(texels);
        width = w, height = h;
    }
}

Vec4 sampleTexture(const Texture& texture, Vec2 uv, float footprint_uv) {
    if (texture.levels.empty()) return Vec4(1.0f);
    const float u = wrapCoordinate(uv.x, texture.wrap_u), v = wrapCoordinate(uv.y, texture.wrap_v);
    const Texture::Level& finest = texture.levels[0];
    const float texels = footprint_uv * float(std::max(finest.width, finest.height));
    if (!(texels > 1.0f)) return sampleLevel(texture, finest, u, v);
    const float level = std::min(std::log2(texels), float(texture.levels.size() - 1));
    if (texture.nearest) return sampleLevel(texture, texture.levels[size_t(level + 0.5f)], u, v);
    const size_t below = size_t(level);
    const float share = level - float(below);
    const Vec4 fine = sampleLevel(texture, texture.levels[below], u, v);
    if (share == 0.0f) return fine;
    const Vec4 coarse = sampleLevel(texture, texture.levels[below + 1], u, v);
    if (texture.is_opaque) return glm::mix(fine, coarse, share);
    Weighted sum;
    sum.add(fine, 1.0f - share);
    sum.add(coarse, share);
    return sum.color();
}

Vec4 sampleTexture(const Texture& texture, Vec2 uv, Vec2 side_a, Vec2 side_b) {
    if (texture.levels.empty()) return Vec4(1.0f);
    const Vec2 size(texture.levels[0].width, texture.levels[0].height);
    float a = glm::length(side_a * size), b = glm::length(side_b * size);
    if (a < b) std::swap(a, b), std::swap(side_a, side_b);
    // Taps no farther apart than they are wide, and none where the texels are wider than the area.
    const float taps = std::clamp(std::ceil(a / std::max(b, 1.0f)), 1.0f, float(kMostTextureTaps));
    const float footprint_uv = std::max(a / taps, b) / std::max(size.x, size.y);
    if (!(taps > 1.0f)) return sampleTexture(texture, uv, footprint_uv);
    Weighted sum;
    for (float i = 0.5f; i < taps; i += 1.0f) {
        sum.add(sampleTexture(texture, uv + side_a * (i / taps - 0.5f), footprint_uv), 1.0f / taps);
    }
    return sum.color();
}

}  // namespace stipple
