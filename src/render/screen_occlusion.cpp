// SPDX-License-Identifier: Apache-2.0
#include <render/screen_occlusion.h>

#include <core/vector_clones.h>

#include <algorithm>
#include <cmath>

namespace stipple {

namespace {
// Far away, where the radius is less than so many texels, rays are this long.
constexpr float kLeastTexels = 1.5f;
// What lies farther in front of a place does not stop a ray there, and hides what is behind it: in
// radii. A wall is thinner, a crown's edge goes on behind.
constexpr float kThickness = 1.25f;
// Nearer than this nothing stops a ray: in radii, and in texels at right angles to the surface (a
// point that made a texel lies beside its centre).
constexpr float kBias = 0.02f, kBiasTexels = 1.0f;
// A patch tells where it lies elsewhere in a texel up to this share of its width.
constexpr float kPatchShare = 0.5f;
// A surface that meets the view at less than this cosine is compared as if it met it at this.
constexpr float kGrazing = 0.1f;

float radicalInverse(uint32_t i, uint32_t base) {
    float result = 0.0f, digit = 1.0f / float(base);
    for (; i; i /= base, digit /= float(base)) result += float(i % base) * digit;
    return result;
}

// A surface, and the picture of depths: for lookUp().
struct Query {
    Vec3 p, u, v, n;  // camera space; u, v, n: frame about the normal, scaled by the radius
    Vec3 normal;
    float most;  // by how much the patch may lie nearer elsewhere in a texel
    float bias, thickness;
    float focal, center_x, center_y, near_z;
    float width, height;  // texels
    float is_orthographic;
    const float* depth;
};

// Of a place; neither: not known.
constexpr int32_t kOpen = 1, kHit = 2;

// What lies at each place. Texels are compared with the plane through the place along the surface:
// a surface does not occlude itself, however slanted.
STIPPLE_VECTOR_CLONES void lookUp(const OcclusionProbes& probes, const Query& q, int32_t* outcome) {
    constexpr int kCount = OcclusionProbes::kCount;
    alignas(64) std::array<float, kCount> z;
    alignas(64) std::array<int32_t, kCount> texel;
    const float texel_size = 1.0f / q.focal;
    const float height_of_p = glm::dot(q.p, q.normal), radius = glm::dot(q.n, q.normal);
    for (int i = 0; i < kCount; ++i) {
        const float x = probes.x[i], y = probes.y[i], up = probes.z[i];
        const float s_x = q.p.x + q.u.x * x + q.v.x * y + q.n.x * up;
        const float s_y = q.p.y + q.u.y * x + q.v.y * y + q.n.y * up;
        const float s_z = q.p.z + q.u.z * x + q.v.z * y + q.n.z * up;
        const float scale = q.focal / (q.is_orthographic != 0.0f ? 1.0f : s_z);
        const float at_x = q.center_x + s_x * scale, at_y = q.center_y + s_y * scale;
        const bool is_inside = (s_z > q.near_z) & (at_x >= 0.0f) & (at_x < q.width) &
                               (at_y >= 0.0f) & (at_y < q.height);
        const int column = is_inside ? int(at_x) : 0, row = is_inside ? int(at_y) : 0;
        texel[i] = row * int(q.width) + column;
        // The view's ray through the texel's centre, and where it meets the plane.
        const float slant = (float(column) + 0.5f - q.center_x) * texel_size * q.normal.x +
                            (float(row) + 0.5f - q.center_y) * texel_size * q.normal.y;
        const float height = height_of_p + radius * up - q.is_orthographic * slant;
        const float cosine = q.normal.z + (1.0f - q.is_orthographic) * slant;
        const float size = std::max(std::abs(cosine), kGrazing);
        const float plane = height / (cosine < 0.0f ? -size : size);
        const float moved = s_z + std::min(std::max(plane - s_z, -q.most), q.most);
        z[i] = is_inside ? moved : kInfinity;  // behind everything: not known
    }
    alignas(64) std::array<float, kCount> depth;
    for (int i = 0; i < kCount; ++i) depth[i] = q.depth[texel[i]];
    for (int i = 0; i < kCount; ++i) {
        const float behind = z[i] - depth[i];
        const int is_open = behind <= q.bias, is_near = behind < q.thickness;
        outcome[i] = is_open * kOpen + (is_near & ~is_open) * kHit;
    }
}

// A ray that is not stopped counts as far as it is known.
void addRays(const OcclusionProbes& probes, const Query& q, int& open, int& closed) {
    alignas(64) std::array<int32_t, OcclusionProbes::kCount> outcome;
    lookUp(probes, q, outcome.data());
    for (int r = 0; r < OcclusionProbes::kRays; ++r) {
        int known = 0, hits = 0;
        for (int i = r; i < OcclusionProbes::kCount; i += OcclusionProbes::kRays) {
            known += outcome[size_t(i)] & kOpen;
            hits |= outcome[size_t(i)] & kHit;
        }
        open += hits ? 0 : known;
        closed += hits ? OcclusionProbes::kSteps : 0;
    }
}

}  // namespace

ScreenOcclusion::ScreenOcclusion(const View& view, FirstLook look, double radius)
    : view_(view),
      look_(std::move(look)),
      radius_(float(radius)),
      camera_from_world_(view.camera_from_world) {
    constexpr int kBlock = 4, kN = kPatternSide * kPatternSide;
    constexpr int kRays = OcclusionProbes::kRays, kSteps = OcclusionProbes::kSteps;
    // Rays are spread evenly in each block, and those of all blocks together are.
    for (int i = 0; i < kN; ++i) {
        const int block = i / (kBlock * kBlock), within = i * 7 % (kBlock * kBlock);
        const int x = (block & 1) * kBlock + within % kBlock,
                  y = (block >> 1) * kBlock + within / kBlock;
        OcclusionProbes& probes = patterns_[size_t(y * kPatternSide + x)];
        for (int r = 0; r < kRays; ++r) {
            const uint32_t k = uint32_t(r * kN + i);
            const float share = (float(r) + radicalInverse(uint32_t(i), 2) + 0.5f / kN) / kRays;
            const float azimuth = 2.0f * float(kPi) * (float(k) + 0.5f) * 0.61803399f;
            const float sine = std::sqrt(share);
            const Vec3 direction(std::cos(azimuth) * sine, std::sin(azimuth) * sine,
                                 std::sqrt(1.0f - share));
            const float jitter = radicalInverse(k, 3) + 0.5f / 243.0f;
            for (int s = 0; s < kSteps; ++s) {
                const float t = (float(s) + jitter) / kSteps;
                const Vec3 at = direction * t;
                const size_t place = size_t(s * kRays + r);
                probes.x[place] = at.x, probes.y[place] = at.y, probes.z[place] = at.z;
            }
        }
    }
}

float ScreenOcclusion::of(const SurfaceSample& sample, const Vec3& normal_world) const {
    const Vec3& p = sample.position_camera;
    const View& look = look_.view;
    Query q;
    q.p = p;
    q.normal = camera_from_world_ * normal_world;
    tangents(q.normal, q.u, q.v);
    const float texel = look.orthographic ? 1.0f / float(look.focal) : p.z / float(look.focal);
    const float radius = std::max(radius_, kLeastTexels * texel);
    q.u *= radius, q.v *= radius, q.n = q.normal * radius;
    q.most = kPatchShare * sample.patch_width;
    const Vec3 along = look.orthographic ? Vec3(0.0f, 0.0f, 1.0f) : p / p.z;
    const float cosine = std::max(std::abs(glm::dot(along, q.normal)), kGrazing);
    q.bias = kBias * radius + std::min(kBiasTexels * texel / cosine, q.most);
    q.thickness = q.bias + kThickness * radius;
    q.focal = float(look.focal);
    q.center_x = float(look.center_x), q.center_y = float(look.center_y);
    q.near_z = look.near_z;
    q.width = float(look.width), q.height = float(look.height);
    q.is_orthographic = look.orthographic ? 1.0f : 0.0f;
    q.depth = look_.depth.data();
    // A pixel has all patterns at least once, shared among its samples by their extents.
    const float per_subpixel = std::max(float(kPatternSide) / float(view_.subpixels), 1.0f);
    const Vec2 at = view_.project(p) * per_subpixel;
    const int side = std::clamp(int(std::lround(sample.extent * per_subpixel)), 1, kPatternSide);
    const int left = int(std::floor(at.x - 0.5f * float(side) + 0.5f)),
              top = int(std::floor(at.y - 0.5f * float(side) + 0.5f));
    int open = 0, closed = 0;
    for (int y = top; y < top + side; ++y) {
        for (int x = left; x < left + side; ++x) {
            addRays(patterns_[size_t((y & (kPatternSide - 1)) * kPatternSide +
                                     (x & (kPatternSide - 1)))],
                    q, open, closed);
        }
    }
    return closed > 0 ? float(open) / float(open + closed) : 1.0f;
}

}  // namespace stipple
