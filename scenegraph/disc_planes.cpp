// SPDX-License-Identifier: Apache-2.0
#include <scenegraph/disc_planes.h>

#include <core/vector_clones.h>

namespace stipple {

namespace {

// Spacings: how far those around lie.
constexpr float kAround = 1.5f;
// In a plane: the least variance is that share of the middle one.
constexpr float kFlat = 0.2f;
// On a line: the middle one is that share of the largest.
constexpr float kOnLine = 0.1f;

// Structure of arrays; what is not there lies far from all.
struct Places {
    alignas(64) float x[kBlockSurfels], y[kBlockSurfels], z[kBlockSurfels];
};

// Not unit; null where there is no plane. Sums are second moments about each place of those around,
// weighed by their distance.
STIPPLE_VECTOR_CLONES void planesAt(const Places& p, int count, Places& normal) {
    constexpr int kLanes = 16;
    static_assert(kBlockSurfels % kLanes == 0);
    for (int first = 0; first < count; first += kLanes) {
        float xx[kLanes] = {}, xy[kLanes] = {}, xz[kLanes] = {};
        float yy[kLanes] = {}, yz[kLanes] = {}, zz[kLanes] = {};
        for (int k = 0; k < count; ++k) {
            const float px = p.x[k], py = p.y[k], pz = p.z[k];
            for (int i = 0; i < kLanes; ++i) {
                const float dx = px - p.x[first + i], dy = py - p.y[first + i],
                            dz = pz - p.z[first + i];
                const float near = 1.0f - (dx * dx + dy * dy + dz * dz);
                const float weight = near > 0.0f ? near : 0.0f;
                const float wx = weight * dx, wy = weight * dy, wz = weight * dz;
                xx[i] += wx * dx, xy[i] += wx * dy, xz[i] += wx * dz;
                yy[i] += wy * dy, yz[i] += wy * dz, zz[i] += wz * dz;
            }
        }
        for (int i = 0; i < kLanes; ++i) {
            // The least eigenvalue's vector is the adjugate matrix' largest: a power of it has it
            // in each of its columns.
            float a = yy[i] * zz[i] - yz[i] * yz[i], b = xz[i] * yz[i] - xy[i] * zz[i],
                  c = xy[i] * yz[i] - xz[i] * yy[i], d = xx[i] * zz[i] - xz[i] * xz[i],
                  e = xy[i] * xz[i] - xx[i] * yz[i], f = xx[i] * yy[i] - xy[i] * xy[i];
            const float determinant = xx[i] * a + xy[i] * b + xz[i] * c;
            const float trace = xx[i] + yy[i] + zz[i], pairs = a + d + f;
            // About the eigenvalues, of what is flat.
            const bool is_plane =
                determinant * trace < kFlat * pairs * pairs && pairs > kOnLine * trace * trace;
            const float scale = is_plane ? 1.0f / pairs : 0.0f;
            a *= scale, b *= scale, c *= scale, d *= scale, e *= scale, f *= scale;
            for (int power = 0; power < 3; ++power) {
                const float a2 = a * a + b * b + c * c, b2 = a * b + b * d + c * e,
                            c2 = a * c + b * e + c * f, d2 = b * b + d * d + e * e,
                            e2 = b * c + d * e + e * f, f2 = c * c + e * e + f * f;
                a = a2, b = b2, c = c2, d = d2, e = e2, f = f2;
            }
            // The longest column, as the diagonal has squares of the vector.
            const bool is_x = a >= d && a >= f, is_y = d >= f;
            normal.x[first + i] = is_x ? a : is_y ? b : c;
            normal.y[first + i] = is_x ? b : is_y ? d : e;
            normal.z[first + i] = is_x ? c : is_y ? e : f;
        }
    }
}

}  // namespace

void discPlanes(float spacing, const Surfel* surfels, int count, Vec3* normals) {
    constexpr float kFar = 1e6f;
    const float per_reach = 1.0f / (kAround * spacing);
    Places p, plane;
    for (int i = 0; i < kBlockSurfels; ++i) p.x[i] = p.y[i] = p.z[i] = kFar;
    for (int i = 0; i < count; ++i) {
        const Vec3 q = (surfels[i].position - surfels[0].position) * per_reach;
        p.x[i] = q.x, p.y[i] = q.y, p.z[i] = q.z;
    }
    planesAt(p, count, plane);
    for (int i = 0; i < count; ++i) {
        const Vec3 n(plane.x[i], plane.y[i], plane.z[i]), &shading = surfels[i].normal;
        const float length = glm::length(n);
        normals[i] =
            length > 0.0f ? n * ((glm::dot(n, shading) < 0.0f ? -1.0f : 1.0f) / length) : shading;
    }
}

}  // namespace stipple
