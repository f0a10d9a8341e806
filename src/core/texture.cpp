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

// std::floor is a call where the processor's own rounding cannot be taken for granted.
float floorOf(float x) {
    if (!(std::abs(x) < 1e9f)) return std::floor(x);
    const float truncated = float(int(x));
    return truncated > x ? truncated - 1.0f : truncated;
}

// Brings one coordinate into [0, 1].
float wrapCoordinate(float u, Wrap wrap) {
    if (!std::isfinite(u)) return 0.0f;
    if (wrap == Wrap::kClamp) return std::clamp(u, 0.0f, 1.0f);
    if (wrap == Wrap::kRepeat) return u - floorOf(u);
    const float turn = u - 2.0f * floorOf(u * 0.5f);
    return turn > 1.0f ? 2.0f - turn : turn;
}

int wrapTexel(int i, int n, Wrap wrap) {
    // Beyond the border of a mirrored picture lies the border's texel again, as for a clamped one.
    if (wrap == Wrap::kRepeat) return i < 0 ? i + n : i >= n ? i - n : i;
    return std::clamp(i, 0, n - 1);
}

// Four texels and their shares of what is seen between them.
struct Bilinear {
    const uint8_t* texels[4];
    float weights[4];

    Bilinear(const Texture& texture, const Texture::Level& level, float u, float v) {
        // Never negative, so that truncation rounds down.
        const float x = u * float(level.width) + 0.5f, y = v * float(level.height) + 0.5f;
        const int x1 = int(x), y1 = int(y);
        const float fx = x - float(x1), fy = y - float(y1);
        const size_t left = size_t(wrapTexel(x1 - 1, level.width, texture.wrap_u)),
                     right = size_t(wrapTexel(x1, level.width, texture.wrap_u));
        const size_t stride = size_t(level.width);
        const uint8_t* rgba = level.rgba.data();
        const uint8_t* top =
            rgba + size_t(wrapTexel(y1 - 1, level.height, texture.wrap_v)) * stride * 4;
        const uint8_t* bottom =
            rgba + size_t(wrapTexel(y1, level.height, texture.wrap_v)) * stride * 4;
        texels[0] = top + left * 4, texels[1] = top + right * 4;
        texels[2] = bottom + left * 4, texels[3] = bottom + right * 4;
        weights[0] = (1.0f - fx) * (1.0f - fy), weights[1] = fx * (1.0f - fy);
        weights[2] = (1.0f - fx) * fy, weights[3] = fx * fy;
    }
};

Vec4 nearestTexel(const Texture& texture, const Texture::Level& level, float u, float v) {
    return readTexel(level, byteToLinear(texture.srgb),
                     std::min(int(u * float(level.width)), level.width - 1),
                     std::min(int(v * float(level.height)), level.height - 1));
}

// The two levels whose texels are nearest in size to what a lookup averages.
struct LevelPair {
    const Texture::Level* fine;
    const Texture::Level* coarse;  // of no account where its share is 0
    float coarse_share = 0.0f;
};

LevelPair levelsFor(const Texture& texture, float footprint_uv) {
    const Texture::Level& finest = texture.levels[0];
    const float texels = footprint_uv * float(std::max(finest.width, finest.height));
    if (!(texels > 1.0f)) return {&finest, &finest};
    const float level = std::min(std::log2(texels), float(texture.levels.size() - 1));
    if (texture.nearest) {
        const Texture::Level* nearest = &texture.levels[size_t(level + 0.5f)];
        return {nearest, nearest};
    }
    const size_t below = size_t(level);
    return {&texture.levels[below], &texture.levels[std::min(below + 1, texture.levels.size() - 1)],
            level - float(below)};
}

// Lookups added up.
class Lookups {
public:
    Lookups(const Texture& texture, const LevelPair& levels)
        : texture_(texture), levels_(levels), linear_(byteToLinear(texture.srgb)) {}

    void add(Vec2 uv, float share) {
        const float u = wrapCoordinate(uv.x, texture_.wrap_u),
                    v = wrapCoordinate(uv.y, texture_.wrap_v);
        if (texture_.nearest) {
            sum_.add(nearestTexel(texture_, *levels_.fine, u, v), share);
            return;
        }
        addLevel(*levels_.fine, u, v, share * (1.0f - levels_.coarse_share));
        if (levels_.coarse_share > 0.0f)
            addLevel(*levels_.coarse, u, v, share * levels_.coarse_share);
    }
    Vec4 color() const {
        // What is opaque is added to the plain sum alone.
        return texture_.is_opaque && !texture_.nearest ? Vec4(sum_.plain, 1.0f) : sum_.color();
    }

private:
    void addLevel(const Texture::Level& level, float u, float v, float share) {
        const Bilinear at(texture_, level, u, v);
        for (int i = 0; i < 4; ++i) {
            const uint8_t* t = at.texels[i];
            const Vec3 color(linear_[t[0]], linear_[t[1]], linear_[t[2]]);
            const float weight = at.weights[i] * share;
            if (texture_.is_opaque) {
                sum_.plain += color * weight;
            } else {
                sum_.add(Vec4(color, float(t[3]) * (1.0f / 255.0f)), weight);
            }
        }
    }

    const Texture& texture_;
    const LevelPair levels_;
    const std::array<float, 256>& linear_;
    Weighted sum_;
};

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
    Lookups lookups(texture, levelsFor(texture, footprint_uv));
    lookups.add(uv, 1.0f);
    return lookups.color();
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
    Lookups lookups(texture, levelsFor(texture, footprint_uv));
    for (float i = 0.5f; i < taps; i += 1.0f)
        lookups.add(uv + side_a * (i / taps - 0.5f), 1.0f / taps);
    return lookups.color();
}

}  // namespace stipple
