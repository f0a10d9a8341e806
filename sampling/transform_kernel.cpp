// SPDX-License-Identifier: Apache-2.0
#include <sampling/transform_kernel.h>

#include <core/rng.h>
#include <core/vector_clones.h>

#include <algorithm>
#include <cmath>

namespace stipple {

namespace {

template <bool kThin, bool kOrthographic, bool kRandom>
inline __attribute__((always_inline)) void transformLoop(const KernelParams& p,
                                                         const ListBlock& list, int first_lane,
                                                         uint32_t first_index, int count,
                                                         uint32_t first_number, int lane,
                                                         PointBlock& out) {
    // Plain locals and restricted pointers, or the compiler will not vectorize.
    const float m00 = p.camera_from_object[0].x, m01 = p.camera_from_object[1].x,
                m02 = p.camera_from_object[2].x;
    const float m10 = p.camera_from_object[0].y, m11 = p.camera_from_object[1].y,
                m12 = p.camera_from_object[2].y;
    const float m20 = p.camera_from_object[0].z, m21 = p.camera_from_object[1].z,
                m22 = p.camera_from_object[2].z;
    const float bx = p.box_from_eye.x, by = p.box_from_eye.y, bz = p.box_from_eye.z;
    const float sx = p.step.x, sy = p.step.y, sz = p.step.z;
    const float fx = p.facing.x, fy = p.facing.y, fz = p.facing.z;
    const float z_near = p.z_near, z_far = p.z_far, gain = p.gain;
    const uint32_t hash = p.hash;
    const uint16_t* __restrict px = list.position[0] + first_lane;
    const uint16_t* __restrict py = list.position[1] + first_lane;
    const uint16_t* __restrict pz = list.position[2] + first_lane;
    const int16_t* __restrict qx = list.normal[0] + first_lane;
    const int16_t* __restrict qy = list.normal[1] + first_lane;
    const int16_t* __restrict qz = list.normal[2] + first_lane;
    const uint8_t* __restrict widths = list.width + first_lane;
    const uint8_t* __restrict single_sided = list.single_sided + first_lane;
    float* __restrict out_x = out.x + lane;
    float* __restrict out_y = out.y + lane;
    float* __restrict out_z = out.z + lane;
    uint32_t* __restrict number = out.number + lane;
    uint8_t* __restrict keep = out.keep + lane;
    uint8_t* __restrict width = out.width + lane;
    const int n = (count + kBlockPadding - 1) & -kBlockPadding;  // whole vectors
    const int offset = p.width_offset, widest = p.narrow ? int(kNoPatch) : kWidthCodes - 1;
    for (int i = 0; i < n; ++i)
        width[i] = uint8_t(std::min(std::max(int(widths[i]) + offset, 1), widest));
    for (int i = 0; i < n; ++i) {
        const float dx = bx + sx * float(px[i]), dy = by + sy * float(py[i]),
                    dz = bz + sz * float(pz[i]);
        const float x = m00 * dx + m01 * dy + m02 * dz;
        const float y = m10 * dx + m11 * dy + m12 * dz;
        const float z = m20 * dx + m21 * dy + m22 * dz;
        out_x[i] = x;
        out_y[i] = y;
        out_z[i] = z;
        number[i] = first_number + uint32_t(i);
        if constexpr (!kThin) {
            keep[i] = uint8_t((widths[i] != kNoPatch) & (z > z_near) & (z <= z_far));
        } else {
            const float nx = float(qx[i]), ny = float(qy[i]), nz = float(qz[i]);
            // Minus the cosine to the way of the eye: positive when facing it.
            const float facing =
                kOrthographic ? -(nx * fx + ny * fy + nz * fz) : -(nx * dx + ny * dy + nz * dz);
            const float seen = single_sided[i] ? facing : std::abs(facing);
            const float scaled = gain * seen;
            const float probability = kOrthographic ? scaled : scaled / (z * z * z);
            const uint32_t index = first_index + uint32_t(i);
            const uint32_t bits =
                kRandom ? mixBits32(index * 0x9e3779b9u ^ hash) : index * 0x9e3779b9u + hash;
            const float threshold = float(int(bits >> 8)) * 0x1p-24f;
            keep[i] = uint8_t((probability > threshold) & (z > z_near) & (z <= z_far));
        }
    }
}

}  // namespace

STIPPLE_VECTOR_CLONES void transformPoints(const KernelParams& params, const ListBlock& list,
                                           int first_lane, uint32_t first_index, int count,
                                           uint32_t first_number, int lane, PointBlock& out) {
    const auto& l = list;
    const int f = first_lane;
    const uint32_t i = first_index, number = first_number;
    if (!params.thin) {
        transformLoop<false, false, false>(params, l, f, i, count, number, lane, out);
    } else if (params.orthographic) {
        params.random ? transformLoop<true, true, true>(params, l, f, i, count, number, lane, out)
                      : transformLoop<true, true, false>(params, l, f, i, count, number, lane, out);
    } else {
        params.random
            ? transformLoop<true, false, true>(params, l, f, i, count, number, lane, out)
            : transformLoop<true, false, false>(params, l, f, i, count, number, lane, out);
    }
}

namespace {

template <bool kOrthographic>
inline __attribute__((always_inline)) void surfelLoop(const SurfelParams& params,
                                                      const ListBlock& list, int first_lane,
                                                      int count, int lane, PointBlock& out) {
    const Mat3& m = params.camera_from_normal;
    const float m00 = m[0].x, m01 = m[1].x, m02 = m[2].x;
    const float m10 = m[0].y, m11 = m[1].y, m12 = m[2].y;
    const float m20 = m[0].z, m21 = m[1].z, m22 = m[2].z;
    const float f2 = params.focal * params.focal * params.density;
    const int16_t* __restrict qx = list.normal[0] + first_lane;
    const int16_t* __restrict qy = list.normal[1] + first_lane;
    const int16_t* __restrict qz = list.normal[2] + first_lane;
    const float* __restrict px = out.x + lane;
    const float* __restrict py = out.y + lane;
    const float* __restrict pz = out.z + lane;
    float* __restrict normal_x = out.normal_x + lane;
    float* __restrict normal_y = out.normal_y + lane;
    float* __restrict normal_z = out.normal_z + lane;
    float* __restrict area = out.area + lane;
    for (int i = 0; i < count; ++i) {
        const float ox = float(qx[i]), oy = float(qy[i]), oz = float(qz[i]);
        const float x = m00 * ox + m01 * oy + m02 * oz;
        const float y = m10 * ox + m11 * oy + m12 * oz;
        const float z = m20 * ox + m21 * oy + m22 * oz;
        const float scale = 1.0f / std::sqrt(std::max(x * x + y * y + z * z, 1e-30f));
        normal_x[i] = x * scale;
        normal_y[i] = y * scale;
        normal_z[i] = z * scale;
        // The projection factor; nothing is seen edge-on.
        const float facing =
            kOrthographic ? z * scale
                          : (x * px[i] + y * py[i] + z * pz[i]) * scale / (pz[i] * pz[i] * pz[i]);
        area[i] = 1.0f / std::max(f2 * std::abs(facing), 1e-30f);
    }
}

}  // namespace

STIPPLE_VECTOR_CLONES void makeSurfels(const SurfelParams& params, const ListBlock& list,
                                       int first_lane, int count, int lane, PointBlock& out) {
    params.orthographic ? surfelLoop<true>(params, list, first_lane, count, lane, out)
                        : surfelLoop<false>(params, list, first_lane, count, lane, out);
}

}  // namespace stipple
