// SPDX-License-Identifier: Apache-2.0
#include <scenegraph/procedural/stem.h>

#include <scenegraph/procedural/noise.h>

#include <algorithm>
#include <numeric>

namespace stipple {

namespace {

struct TubeShape {
    int sides = 3;
    uint32_t stride = 1;   // every stride-th node gets a ring ...
    uint32_t between = 1;  // ... and each step from ring to ring is cut into so many

    size_t rings(const Stem& stem) const {
        return size_t((stem.node_count - 2) / stride) * between + 1;
    }
    size_t triangles(const Stem& stem) const { return ((rings(stem) - 1) * 2 + 1) * size_t(sides); }
};

// Thick stems get more sides; a small budget also takes every other ring, a large one shows the
// trunk's relief.
TubeShape tubeShape(const Stem& stem, float radius, float trunk_radius, size_t triangle_budget) {
    TubeShape shape;
    const float detail = std::sqrt(float(triangle_budget) / 6000.0f);
    const float sides = 2.5f + 6.0f * std::sqrt(radius / trunk_radius) * std::min(detail, 2.0f);
    shape.sides = std::clamp(int(sides), 3, stem.level == 0 ? 14 : 9);
    if (stem.level == 0 && radius > 0.5f * trunk_radius) shape.sides = std::max(shape.sides, 5);
    shape.stride = detail < 0.4f ? 3 : detail < 0.8f ? 2 : 1;
    if (stem.level == 0 && detail > 1.4f) {
        shape.sides = std::max(shape.sides, 20);
        shape.between = 3;
    }
    return shape;
}

void appendTube(const Skeleton& skeleton, const Stem& stem, const TubeShape& shape,
                const TubeStyle& style, const BarkColor& color, uint16_t material, Mesh& mesh) {
    const StemNode* nodes = skeleton.nodesOf(stem);
    const size_t ring_count = shape.rings(stem);
    const uint32_t first = uint32_t(mesh.positions.size());
    const int sides = shape.sides;
    Vec3 axis = glm::normalize(nodes[1].position - nodes[0].position), side, third;
    completeFrame(axis, side, third);
    for (size_t r = 0; r < ring_count; ++r) {
        const float place = float(r) * float(shape.stride) / float(shape.between);
        const uint32_t n = std::min(uint32_t(place), stem.node_count - 2);
        const uint32_t before = n == 0 ? 0 : n - 1;
        const float fraction = place / float(stem.node_count - 1);
        const StemNode node = skeleton.at(stem, fraction);
        axis = glm::normalize(nodes[n + 1].position - nodes[before].position);
        // Carried along without twist: the last ring's frame, made perpendicular again.
        side = glm::normalize(side - axis * glm::dot(side, axis));
        third = glm::cross(side, axis);
        const float slope =
            (nodes[before].radius - nodes[n + 1].radius) /
            std::max(glm::length(nodes[n + 1].position - nodes[before].position), 1e-6f);
        for (int s = 0; s < sides; ++s) {
            const float angle = float(2.0 * kPi) * float(s) / float(sides);
            const Vec3 out = side * std::cos(angle) + third * std::sin(angle);
            float radius = node.radius;
            Vec3 normal = out + axis * std::clamp(slope, -1.0f, 1.0f);
            if (stem.level == 0) {
                const float above = std::max(node.position.y, 0.0f) / (3.0f * nodes[0].radius);
                const float lobes = std::sin(3.0f * angle + 1.0f) + 0.6f * std::sin(5.0f * angle);
                radius *= 1.0f + style.root_flare * std::exp(-above) * (1.0f + 0.35f * lobes);
            }
            if (stem.level == 0 && style.relief > 0.0f && sides >= 14) {
                // Furrows run along the trunk.
                const DVec3 q(double(out.x) * 3.5, double(node.position.y) * 0.9,
                              double(out.z) * 3.5);
                const float bump = float(fractalNoise(style.seed, q, 2));
                radius *= 1.0f + style.relief * bump;
                const float next =
                    float(fractalNoise(style.seed, q + DVec3(glm::cross(axis, out)) * 0.6, 2));
                normal += glm::cross(axis, out) * ((bump - next) * style.relief * 9.0f);
            }
            const Vec3 p = node.position + out * radius;
            mesh.positions.push_back(p);
            mesh.normals.push_back(glm::normalize(normal));
            mesh.colors.push_back(Vec4(color(stem, fraction, angle, p), 1.0f));
        }
    }
    const StemNode& tip = nodes[stem.node_count - 1];
    const uint32_t apex = uint32_t(mesh.positions.size());
    mesh.positions.push_back(tip.position);
    mesh.normals.push_back(axis);
    mesh.colors.push_back(Vec4(color(stem, 1.0f, 0.0f, tip.position), 1.0f));
    for (size_t r = 0; r < ring_count; ++r) {
        for (int s = 0; s < sides; ++s) {
            const uint32_t a = first + uint32_t(r) * sides + s;
            const uint32_t b = first + uint32_t(r) * sides + (s + 1) % sides;
            if (r + 1 == ring_count) {
                mesh.triangles.push_back(UVec3(a, apex, b));
            } else {
                mesh.triangles.push_back(UVec3(a, a + sides, b));
                mesh.triangles.push_back(UVec3(b, a + sides, b + sides));
            }
        }
    }
    mesh.triangle_material.resize(mesh.triangles.size(), material);
}

}  // namespace

StemNode Skeleton::at(const Stem& stem, float fraction) const {
    const float x = std::clamp(fraction, 0.0f, 1.0f) * float(stem.node_count - 1);
    const uint32_t i = std::min(uint32_t(x), stem.node_count - 2);
    const StemNode& a = nodesOf(stem)[i];
    const StemNode& b = nodesOf(stem)[i + 1];
    return {glm::mix(a.position, b.position, x - float(i)),
            glm::mix(a.radius, b.radius, x - float(i))};
}

Vec3 Skeleton::direction(const Stem& stem, float fraction) const {
    const float x = std::clamp(fraction, 0.0f, 1.0f) * float(stem.node_count - 1);
    const uint32_t i = std::min(uint32_t(x), stem.node_count - 2);
    return glm::normalize(nodesOf(stem)[i + 1].position - nodesOf(stem)[i].position);
}

void completeFrame(const Vec3& axis, Vec3& side, Vec3& third) {
    const Vec3 helper = std::abs(axis.x) < 0.7f ? Vec3(1, 0, 0) : Vec3(0, 0, 1);
    side = glm::normalize(helper - axis * glm::dot(helper, axis));
    third = glm::cross(side, axis);
}

Vec3 offAxis(const Vec3& axis, float angle, float azimuth) {
    Vec3 side, third;
    completeFrame(axis, side, third);
    return glm::normalize(axis * std::cos(angle) +
                          (side * std::cos(azimuth) + third * std::sin(azimuth)) * std::sin(angle));
}

Vec3 randomUnit(Rng& rng) {
    const double y = rng.uniform(-1.0, 1.0), a = rng.uniform(0.0, 2.0 * kPi),
                 r = std::sqrt(1.0 - y * y);
    return Vec3(float(r * std::cos(a)), float(y), float(r * std::sin(a)));
}

Vec3 nearlyUp(Rng& rng, double lean) {
    const float angle = uniform(rng, 0.0, lean);
    return offAxis(Vec3(0, 1, 0), angle, uniform(rng, 0.0, 2.0 * kPi));
}

uint32_t growStem(Skeleton& skeleton, Rng& rng, const Vec3& base, const Vec3& direction,
                  const Growth& growth, uint32_t level) {
    Stem stem;
    stem.first_node = uint32_t(skeleton.nodes.size());
    stem.node_count = uint32_t(growth.segments) + 1;
    stem.level = level;
    stem.length = growth.length;
    Vec3 p = base, d = direction;
    const float step = growth.length / float(growth.segments);
    for (int i = 0; i <= growth.segments; ++i) {
        const float t = float(i) / float(growth.segments);
        const float shrink = std::pow(1.0f - t, growth.taper);
        skeleton.nodes.push_back(
            {p, growth.tip_radius + (growth.radius - growth.tip_radius) * shrink});
        const float lift = glm::mix(growth.lift_base, growth.lift_tip, t) / float(growth.segments);
        d += Vec3(0, lift, 0) * std::sqrt(std::max(0.05f, 1.0f - d.y * d.y)) +
             randomUnit(rng) * growth.wander;
        if (level > 0 && p.y < 0.7f)
            d.y = std::max(d.y, 0.0f);  // branches near the ground lie along it
        d = glm::normalize(d);
        p += d * step;
    }
    skeleton.stems.push_back(stem);
    return uint32_t(skeleton.stems.size() - 1);
}

uint32_t branchOff(Skeleton& skeleton, Rng& rng, uint32_t parent, float fraction,
                   const Growth& growth) {
    const Stem stem = skeleton.stems[parent];
    const Vec3 direction =
        offAxis(skeleton.direction(stem, fraction), growth.angle, growth.azimuth);
    return growStem(skeleton, rng, skeleton.at(stem, fraction).position, direction, growth,
                    stem.level + 1);
}

void appendTubes(const Skeleton& skeleton, size_t triangle_budget, const TubeStyle& style,
                 const BarkColor& color, uint16_t material, Mesh& mesh) {
    if (skeleton.stems.empty()) return;
    std::vector<uint32_t> order(skeleton.stems.size());
    std::iota(order.begin(), order.end(), 0u);
    const auto radius = [&](uint32_t i) { return skeleton.nodesOf(skeleton.stems[i])->radius; };
    std::stable_sort(order.begin() + 1, order.end(),
                     [&](uint32_t a, uint32_t b) { return radius(a) > radius(b); });
    size_t used = 0;
    for (uint32_t i : order) {
        const Stem& stem = skeleton.stems[i];
        const TubeShape shape = tubeShape(stem, radius(i), radius(0), triangle_budget);
        if (i != 0 && used + shape.triangles(stem) > triangle_budget) break;
        used += shape.triangles(stem);
        appendTube(skeleton, stem, shape, style, color, material, mesh);
    }
}

}  // namespace stipple
