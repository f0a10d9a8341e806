// SPDX-License-Identifier: Apache-2.0
#include <core/light.h>

namespace stipple {

namespace {

// Real spherical harmonics up to order 2 of a unit direction.
std::array<float, 9> harmonics(const Vec3& d) {
    return {0.282095f,
            0.488603f * d.y,
            0.488603f * d.z,
            0.488603f * d.x,
            1.092548f * d.x * d.y,
            1.092548f * d.y * d.z,
            0.315392f * (3.0f * d.z * d.z - 1.0f),
            1.092548f * d.x * d.z,
            0.546274f * (d.x * d.x - d.y * d.y)};
}

// The direction in the picture's frame.
Vec3 unturned(const Vec3& d, float turn) {
    if (turn == 0.0f) return d;
    const float c = std::cos(turn), s = std::sin(turn);
    return Vec3(c * d.x - s * d.z, d.y, s * d.x + c * d.z);
}

void halve(Environment& e) {
    const int w = (e.width + 1) / 2, h = (e.height + 1) / 2;
    std::vector<Vec3> half(size_t(w) * size_t(h));
    for (int y = 0; y < h; ++y) {
        for (int x = 0; x < w; ++x) {
            Vec3 sum(0.0f);
            for (int k = 0; k < 4; ++k) {
                const int sx = std::min(2 * x + k % 2, e.width - 1),
                          sy = std::min(2 * y + k / 2, e.height - 1);
                sum += e.radiance[size_t(sy) * size_t(e.width) + size_t(sx)];
            }
            half[size_t(y) * size_t(w) + size_t(x)] = 0.25f * sum;
        }
    }
    e.width = w, e.height = h;
    e.radiance = std::move(half);
}

}  // namespace

Vec3 incidentLight(const PointLight& light, const Vec3& to_light) {
    const float distance2 = glm::dot(to_light, to_light);
    if (!(distance2 > 0.0f)) return Vec3(0.0f);
    float share = 1.0f / distance2;
    if (light.range > 0.0f) {
        const float r2 = distance2 / (light.range * light.range);
        share *= std::clamp(1.0f - r2 * r2, 0.0f, 1.0f);
    }
    if (light.is_spot) {
        const float cosine = -glm::dot(to_light, light.axis) / std::sqrt(distance2);
        const float inner = std::cos(light.inner_cone), outer = std::cos(light.outer_cone);
        const float t = std::clamp((cosine - outer) / std::max(inner - outer, 1e-3f), 0.0f, 1.0f);
        share *= t * t;
    }
    return light.intensity * share;
}

void prepareEnvironment(Environment& e, int most_columns) {
    while (e.width > most_columns) halve(e);
    std::array<DVec3, 9> sums{};
    DVec3 horizon(0.0);
    double horizon_weight = 0.0;
    for (int y = 0; y < e.height; ++y) {
        const double top = kPi * y / e.height, bottom = kPi * (y + 1) / e.height;
        const double texel = (std::cos(top) - std::cos(bottom)) * 2.0 * kPi / e.width;  // sr
        const double elevation = 0.5 * kPi - 0.5 * (top + bottom);
        const bool is_horizon = std::abs(elevation) <= std::max(radians(5.0), 0.5 * (bottom - top));
        for (int x = 0; x < e.width; ++x) {
            const double azimuth = 2.0 * kPi * ((x + 0.5) / e.width - 0.5);
            const Vec3 direction(DVec3(std::sin(azimuth) * std::cos(elevation), std::sin(elevation),
                                       -std::cos(azimuth) * std::cos(elevation)));
            const DVec3 radiance(e.radiance[size_t(y) * size_t(e.width) + size_t(x)]);
            const std::array<float, 9> basis = harmonics(direction);
            for (size_t i = 0; i < 9; ++i) sums[i] += radiance * (double(basis[i]) * texel);
            if (is_horizon) horizon += radiance * texel, horizon_weight += texel;
        }
    }
    // The cosine lobe's coefficients over pi: 1, 2/3, 1/4 for orders 0, 1, 2.
    constexpr double kLobe[9] = {1.0,  2.0 / 3.0, 2.0 / 3.0, 2.0 / 3.0, 0.25,
                                 0.25, 0.25,      0.25,      0.25};
    for (size_t i = 0; i < 9; ++i) e.irradiance_over_pi[i] = Vec3(sums[i] * kLobe[i]);
    if (horizon_weight > 0.0) e.horizon = Vec3(horizon / horizon_weight);
}

Vec3 environmentRadiance(const Environment& e, const Vec3& direction_world) {
    const Vec3 d = unturned(direction_world, e.turn);
    const float u = std::atan2(d.x, -d.z) * float(0.5 / kPi) + 0.5f,
                v = std::acos(std::clamp(d.y, -1.0f, 1.0f)) * float(1.0 / kPi);
    const float x = u * float(e.width) - 0.5f,
                y = std::clamp(v * float(e.height) - 0.5f, 0.0f, float(e.height - 1));
    const int x0 = int(std::floor(x)), y0 = int(y), y1 = std::min(y0 + 1, e.height - 1);
    const float fx = x - float(x0), fy = y - float(y0);
    const auto texel = [&](int column, int row) {
        column = column < 0 ? column + e.width : column >= e.width ? column - e.width : column;
        return e.radiance[size_t(row) * size_t(e.width) + size_t(column)];
    };
    return glm::mix(glm::mix(texel(x0, y0), texel(x0 + 1, y0), fx),
                    glm::mix(texel(x0, y1), texel(x0 + 1, y1), fx), fy);
}

Vec3 environmentAmbient(const Environment& e, const Vec3& normal_world) {
    const std::array<float, 9> basis = harmonics(unturned(normal_world, e.turn));
    Vec3 sum(0.0f);
    for (size_t i = 0; i < 9; ++i) sum += e.irradiance_over_pi[i] * basis[i];
    return glm::max(sum, Vec3(0.0f));
}

std::vector<PointLight> lampsOf(const Lighting& lighting) {
    std::vector<PointLight> lamps = lighting.points;
    for (const Projector& projector : lighting.projectors) {
        const View& view = projector.view;
        PointLight& lamp = lamps.emplace_back();
        lamp.position = view.eye_world;
        lamp.intensity = Vec3(1e30f);  // however far: it is no light that fades
        lamp.is_spot = true;
        lamp.axis = Vec3(glm::transpose(view.camera_from_world)[2]);
        const double across = std::hypot(view.width, view.height);
        lamp.outer_cone =
            std::min(float(std::atan(0.5 * across / view.focal)) + 0.01f, float(0.5 * kPi));
        lamp.inner_cone = 0.999f * lamp.outer_cone;
    }
    return lamps;
}

}  // namespace stipple
