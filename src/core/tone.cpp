// SPDX-License-Identifier: Apache-2.0
#include <core/tone.h>

#include <algorithm>
#include <cmath>

namespace stipple {

namespace {

float hable(float x) {
    constexpr float A = 0.15f, B = 0.50f, C = 0.10f, D = 0.20f, E = 0.02f, F = 0.30f;
    return (x * (A * x + C * B) + D * E) / (x * (A * x + B) + D * F) - E / F;
}

Vec3 filmic(const Vec3& c) {
    constexpr float kBias = 2.0f, kWhite = 11.2f;
    const float white = hable(kWhite);
    return Vec3(hable(kBias * c.x), hable(kBias * c.y), hable(kBias * c.z)) / white;
}

Vec3 aces(const Vec3& c) {
    return c * (2.51f * c + Vec3(0.03f)) / (c * (2.43f * c + Vec3(0.59f)) + Vec3(0.14f));
}

Vec3 agx(const Vec3& c) {
    // By columns.
    static const Mat3 inset(0.842479062253094f, 0.0423282422610123f, 0.0423756549057051f,
                            0.0784335999999992f, 0.878468636469772f, 0.0784336f,
                            0.0792237451477643f, 0.0791661274605434f, 0.879142973793104f);
    static const Mat3 outset(1.19687900512017f, -0.0528968517574562f, -0.0529716355144438f,
                             -0.0980208811401368f, 1.15190312990417f, -0.0980434501171241f,
                             -0.0990297440797205f, -0.0989611768448433f, 1.15107367264116f);
    constexpr float kLeast = -12.47393f, kMost = 4.026069f;  // stops
    Vec3 x = inset * c;
    for (int i = 0; i < 3; ++i) {
        const float stops = std::log2(std::max(x[i], 1e-10f));
        x[i] = (std::clamp(stops, kLeast, kMost) - kLeast) / (kMost - kLeast);
    }
    const Vec3 x2 = x * x, x4 = x2 * x2;
    x = 15.5f * x4 * x2 - 40.14f * x4 * x + 31.96f * x4 - 6.868f * x2 * x + 0.4298f * x2 +
        0.1191f * x - Vec3(0.00232f);
    x = outset * x;
    for (int i = 0; i < 3; ++i) x[i] = std::pow(std::max(x[i], 0.0f), 2.2f);
    return x;
}

}  // namespace

Vec3 toneMapped(Tone tone, const Vec3& color) {
    const Vec3 c = glm::max(color, Vec3(0.0f));
    switch (tone) {
        case Tone::kFilmic:
            return glm::clamp(filmic(c), Vec3(0.0f), Vec3(1.0f));
        case Tone::kAces:
            return glm::clamp(aces(c), Vec3(0.0f), Vec3(1.0f));
        case Tone::kAgx:
            return glm::clamp(agx(c), Vec3(0.0f), Vec3(1.0f));
        case Tone::kNone:
            break;
    }
    return color;
}

void applyTone(Tone tone, Image& image) {
    if (tone == Tone::kNone) return;
    const int alpha = image.channelIndex("A");
    for (int y = 0; y < image.height; ++y) {
        for (int x = 0; x < image.width; ++x) {
            float* p = image.pixel(x, y);
            const float a = alpha >= 0 ? p[alpha] : 1.0f;
            if (!(a > 0.0f)) continue;
            const Vec3 c = toneMapped(tone, Vec3(p[0], p[1], p[2]) / a) * a;
            for (int i = 0; i < 3; ++i) p[i] = c[i];
        }
    }
}

}  // namespace stipple
