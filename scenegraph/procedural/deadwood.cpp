// SPDX-License-Identifier: Apache-2.0
// Dead wood: a broken standing trunk, a fallen one, a stump.
#include <core/error.h>
#include <scenegraph/procedural/generators.h>
#include <scenegraph/procedural/noise.h>
#include <scenegraph/procedural/tree_form.h>

#include <algorithm>

namespace stipple {

namespace {

constexpr const char* kForms[] = {"snag", "log", "stump"};

// Weathered wood without bark: silver grey with dark cracks along the grain; moss where wet.
Vec3 weathered(uint64_t key, const Vec3& along_grain, float height, const Vec3& normal,
               float moss_height) {
    const float grain = float(fractalNoise(key, DVec3(along_grain), 3));
    const float crack =
        float(smoothStep(0.12, 0.0, std::abs(fractalNoise(key + 9, DVec3(along_grain) * 0.8, 2))));
    Vec3 color =
        glm::mix(Vec3(0.2f, 0.165f, 0.13f), Vec3(0.36f, 0.325f, 0.28f), 0.5f + 0.6f * grain);
    color *= 1.0f - 0.55f * crack;
    const double moss =
        fractalNoise(key + 5, DVec3(along_grain) * DVec3(0.35, 1.0, 0.35), 3) * 0.8 +
        0.7 * double(normal.y) + smoothStep(double(moss_height), 0.0, double(height)) - 0.75;
    return glm::mix(color, Vec3(0.115f, 0.17f, 0.035f), 0.9f * float(smoothStep(-0.1, 0.3, moss)));
}

// Rings of a body of revolution about +y: distance from the axis and height of each, its surface
// made rough and coloured by functions of place.
struct Ring {
    float radius, height;
    bool broken;  // on a broken or sawn end
};

struct Revolved {
    std::vector<Ring> rings;
    int sides = 16;
    float relief = 0.05f;  // of the side, relative to the radius
    float jagged = 0.0f;   // metres, of a broken end
    float flare = 0.0f;    // roots
    uint64_t key = 0;
};

void appendRevolved(Mesh& mesh, const Revolved& body) {
    const uint32_t first = uint32_t(mesh.positions.size());
    for (const Ring& ring : body.rings) {
        for (int s = 0; s < body.sides; ++s) {
            const float angle = float(2.0 * kPi) * float(s) / float(body.sides);
            const Vec3 out(std::cos(angle), 0.0f, std::sin(angle));
            float radius = ring.radius;
            radius *=
                1.0f + body.relief *
                           float(fractalNoise(
                               body.key, DVec3(out.x * 2.6f, ring.height * 0.7f, out.z * 2.6f), 4));
            const float lobes = 1.0f + 0.55f * std::sin(4.0f * angle + float(body.key % 7)) +
                                0.4f * std::sin(7.0f * angle);
            radius *= 1.0f + body.flare *
                                 std::exp(-std::max(ring.height, 0.0f) / (0.5f * ring.radius)) *
                                 std::max(lobes, 0.0f);
            float y = ring.height;
            if (ring.broken)
                y += body.jagged *
                     float(fractalNoise(body.key + 1, DVec3(out * ring.radius) * 9.0, 3));
            mesh.positions.push_back(Vec3(out.x * radius, y, out.z * radius));
        }
    }
    const uint32_t n = uint32_t(body.sides);
    for (uint32_t r = 0; r + 1 < body.rings.size(); ++r) {
        for (uint32_t s = 0; s < n; ++s) {
            const uint32_t a = first + r * n + s, b = first + r * n + (s + 1) % n;
            mesh.triangles.push_back(UVec3(a, a + n, b));
            mesh.triangles.push_back(UVec3(b, a + n, b + n));
        }
    }
    // Smooth normals over the whole body.
    mesh.normals.resize(mesh.positions.size(), Vec3(0.0f));
    for (size_t t = mesh.triangles.size() - size_t(n) * 2 * (body.rings.size() - 1);
         t < mesh.triangles.size(); ++t) {
        const UVec3 v = mesh.triangles[t];
        const Vec3 normal = glm::cross(mesh.positions[v.y] - mesh.positions[v.x],
                                       mesh.positions[v.z] - mesh.positions[v.x]);
        for (int i = 0; i < 3; ++i) mesh.normals[v[i]] += normal;
    }
    for (size_t i = first; i < mesh.normals.size(); ++i) {
        const float length = glm::length(mesh.normals[i]);
        mesh.normals[i] = length > 0.0f ? mesh.normals[i] / length : Vec3(0, 1, 0);
    }
}

// Rings from a side's top inwards over the end; the innermost has almost no radius.
void closeEnd(std::vector<Ring>& rings, float radius, float height, bool on_top) {
    constexpr int kRings = 7;
    for (int i = 0; i <= kRings; ++i) {
        const Ring ring{radius * (i == kRings ? 0.004f : 1.0f - float(i) / float(kRings)), height,
                        true};
        on_top ? rings.push_back(ring) : void(rings.insert(rings.begin(), ring));
    }
}

Vec3 endGrain(uint64_t key, float r) {
    const float rings = 0.5f + 0.5f * std::sin(r * 130.0f);
    return glm::mix(Vec3(0.33f, 0.22f, 0.12f), Vec3(0.47f, 0.34f, 0.2f), rings) *
           (0.8f + 0.3f * float(gradientNoise(key, DVec3(r * 9.0, 0.3, 0.7))));
}

void makeStump(Mesh& mesh, Rng& rng, float height, int triangles) {
    Revolved body;
    body.key = rng.next();
    body.sides = std::clamp(int(std::sqrt(float(triangles) / 2.6f)), 10, 96);
    const int side_rings = std::max(4, triangles / (2 * body.sides) - 9);
    const float radius = 0.55f * height * uniform(rng, 0.85, 1.2);
    for (int i = 0; i < side_rings; ++i) {
        const float t = float(i) / float(side_rings);
        body.rings.push_back({radius * (1.0f - 0.14f * t), height * (1.17f * t - 0.2f), false});
    }
    closeEnd(body.rings, radius * 0.86f, height, true);
    body.relief = 0.09f;
    body.jagged = 0.08f * height;
    body.flare = 0.75f;
    appendRevolved(mesh, body);
    for (size_t i = 0; i < mesh.positions.size(); ++i) {
        const Vec3 p = mesh.positions[i];
        const bool end = body.rings[i / size_t(body.sides)].broken;
        const Vec3 n = mesh.normals[i];
        Vec3 color =
            weathered(body.key + 3, p * Vec3(9.0f, 2.0f, 9.0f), p.y, end ? Vec3(0.0f) : n, 0.35f) *
            Vec3(0.72f, 0.62f, 0.52f);
        const float r = std::sqrt(p.x * p.x + p.z * p.z);
        if (end && r < 0.9f * radius * 0.86f) {
            const float rot =
                float(smoothStep(-0.1, 0.4, fractalNoise(body.key + 7, DVec3(p) * 4.0, 3)));
            color = glm::mix(endGrain(body.key, r), color, 0.35f + 0.6f * rot);
        }
        mesh.colors.push_back(Vec4(glm::clamp(color, Vec3(0.0f), Vec3(1.0f)), 1.0f));
    }
}

// Stubs of branches along a trunk, as tubes.
void appendStubs(Skeleton& wood, Rng& rng, uint32_t trunk, int count, Range at, Range length) {
    for (int i = 0; i < count; ++i) {
        const float place = uniform(rng, at.lo, at.hi);
        const float radius = wood.at(wood.stems[trunk], place).radius;
        branchOff(wood, rng, trunk, place,
                  {.angle = uniform(rng, 0.9, 1.6),
                   .azimuth = uniform(rng, 0.0, 2.0 * kPi),
                   .length = uniform(rng, length.lo, length.hi),
                   .segments = 5,
                   .radius = std::min(0.45f * radius, 0.05f),
                   .tip_radius = 0.012f,
                   .taper = 0.9f,
                   .wander = 0.22f,
                   .lift_base = 0.0f,
                   .lift_tip = 0.5f});
    }
}

BarkColor weatheredBark(uint64_t key, float moss_height) {
    return [key, moss_height](const Stem&, float, float, const Vec3& p) {
        return weathered(key, p * Vec3(8.0f, 0.7f, 8.0f), p.y, Vec3(0.0f), moss_height);
    };
}

void makeLog(Mesh& mesh, Rng& rng, float length, int triangles) {
    Revolved body;
    body.key = rng.next();
    const float radius = length * 0.034f * uniform(rng, 0.8, 1.2);
    body.sides = std::clamp(int(std::sqrt(float(triangles) / 8.0f)), 8, 48);
    const int side_rings = std::max(4, int(0.9f * float(triangles)) / (2 * body.sides) - 16);
    closeEnd(body.rings, radius, 0.0f, false);
    for (int i = 0; i <= side_rings; ++i) {
        const float t = float(i) / float(side_rings);
        body.rings.push_back({radius * (1.0f - 0.4f * t), length * t, false});
    }
    closeEnd(body.rings, 0.6f * radius, length, true);
    body.relief = 0.1f;
    body.jagged = 0.35f * radius;
    appendRevolved(mesh, body);
    const float bow = uniform(rng, -0.02, 0.02) * length;
    for (size_t i = 0; i < mesh.positions.size(); ++i) {
        const Vec3 p = mesh.positions[i];
        const Vec3 n = Vec3(mesh.normals[i].y, -mesh.normals[i].x, mesh.normals[i].z);
        const float t = p.y / length;
        mesh.positions[i] = Vec3(p.y - 0.5f * length, 0.72f * radius * (1.0f - 0.3f * t) - p.x,
                                 p.z + bow * std::sin(3.0f * t));
        mesh.normals[i] = n;
        const bool end = body.rings[i / size_t(body.sides)].broken;
        Vec3 color = weathered(body.key + 3, p * Vec3(7.0f, 0.8f, 7.0f), mesh.positions[i].y,
                               end ? Vec3(0.0f) : n, 0.2f);
        if (end) {
            color = glm::mix(color, endGrain(body.key, std::sqrt(p.x * p.x + p.z * p.z)), 0.5f);
        } else {  // bark where it has not fallen off yet
            const float left = float(smoothStep(
                -0.1, 0.1, fractalNoise(body.key + 4, DVec3(p) * DVec3(1.5, 0.5, 1.5), 3)));
            color = glm::mix(color, color * Vec3(0.55f, 0.46f, 0.38f), left);
        }
        mesh.colors.push_back(Vec4(glm::clamp(color, Vec3(0.0f), Vec3(1.0f)), 1.0f));
    }
    mesh.triangle_material.assign(mesh.triangles.size(), 0);

    // What is left of its branches. The trunk is drawn already, so that it is only a guide.
    Skeleton wood;
    growStem(wood, rng, Vec3(-0.5f * length, 0.6f * radius, 0.0f), Vec3(1, 0, 0),
             {.length = length,
              .segments = 2,
              .radius = 0.9f * radius,
              .tip_radius = 0.5f * radius,
              .wander = 0.0f},
             0);
    appendStubs(wood, rng, 0, 6, {0.35, 0.95}, {0.02 * double(length), 0.1 * double(length)});
    wood.stems.erase(wood.stems.begin());
    appendTubes(wood, size_t(triangles / 10), {}, weatheredBark(body.key + 3, 0.1f), 0, mesh);
}

void makeSnag(Mesh& mesh, Rng& rng, float height, int triangles) {
    Skeleton wood;
    const uint64_t key = rng.next();
    const float radius = 0.022f * height;
    growStem(wood, rng, Vec3(0.0f, -0.3f, 0.0f), nearlyUp(rng, 0.07),
             {.length = height,
              .segments = 26,
              .radius = radius,
              .tip_radius = 0.3f * radius,
              .taper = 0.8f,
              .wander = 0.03f,
              .lift_base = 0.3f,
              .lift_tip = 0.2f},
             0);
    appendStubs(wood, rng, 0, 24, {0.3, 0.95}, {0.02 * double(height), 0.15 * double(height)});
    for (uint32_t i = 1, n = uint32_t(wood.stems.size()); i < n; ++i) {
        if (wood.stems[i].length > 0.07f * height)
            appendStubs(wood, rng, i, 4, {0.4, 0.95},
                        {0.01 * double(height), 0.05 * double(height)});
    }
    appendTubes(wood, size_t(triangles), {.root_flare = 0.5f, .relief = 0.07f, .seed = key},
                weatheredBark(key + 3, 0.9f), 0, mesh);
}

}  // namespace

std::vector<std::string> deadwoodForms() { return {std::begin(kForms), std::end(kForms)}; }

GeneratedMesh makeDeadwood(const DeadwoodParams& params) {
    if (std::find(std::begin(kForms), std::end(kForms), params.form) == std::end(kForms)) {
        throw Error(ErrorCode::kInvalidArgument, "",
                    "unknown form of deadwood '" + params.form + "' (snag, log or stump)");
    }
    if (params.triangles < 500 || params.triangles > 2000000) {
        throw Error(ErrorCode::kInvalidArgument, "",
                    "deadwood's triangles must be in 500..2000000");
    }
    if (!(params.length == 0.0 || (params.length >= 0.01 && params.length <= 1000.0))) {
        throw Error(ErrorCode::kInvalidArgument, "",
                    "deadwood's length must be 0 (typical) or in 0.01..1000 metres");
    }
    Rng rng{hashCombine(params.seed, 0xdead)};
    GeneratedMesh result;
    const auto sizeOr = [&](double typical) {
        return float(params.length > 0.0 ? params.length : typical);
    };
    if (params.form == "snag") {
        makeSnag(result.mesh, rng, sizeOr(13.0), params.triangles);
    } else if (params.form == "log") {
        makeLog(result.mesh, rng, sizeOr(8.0), params.triangles);
    } else {
        makeStump(result.mesh, rng, sizeOr(0.6), params.triangles);
    }
    result.mesh.name = params.form;
    result.mesh.triangle_material.assign(result.mesh.triangles.size(), 0);
    Material wood;
    wood.name = "wood";
    wood.base_color = Vec3(1.0f);
    result.materials.push_back(wood);
    return result;
}

}  // namespace stipple
