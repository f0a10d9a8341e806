// SPDX-License-Identifier: Apache-2.0
#include <sampling/transform_kernel.h>

#include <algorithm>

namespace stipple {

namespace {

// A cheap integer hash with good avalanche (low bias), vectorizable.
inline uint32_t mix32(uint32_t v) {
    v ^= v >> 16;
    v *= 0x7feb352du;
    v ^= v >> 15;
    v *= 0x846ca68bu;
    return v ^ v >> 16;
}

template <bool kOrthographic, bool kRandom>
inline __attribute__((always_inline)) void transformLoop(const KernelParams& p,
                                                         const ListBlock& block, int first_lane,
                                                         uint32_t first_index, PointBlock& out) {
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
    const float z_near = p.z_near;
    const uint32_t hash = p.hash;
    const uint16_t* __restrict px = block.position[0] + first_lane;
    const uint16_t* __restrict py = block.position[1] + first_lane;
    const uint16_t* __restrict pz = block.position[2] + first_lane;
    const int16_t* __restrict qx = block.normal[0] + first_lane;
    const int16_t* __restrict qy = block.normal[1] + first_lane;
    const int16_t* __restrict qz = block.normal[2] + first_lane;
    const uint8_t* __restrict strata = block.stratum + first_lane;
    float* __restrict out_x = out.x;
    float* __restrict out_y = out.y;
    float* __restrict out_z = out.z;
    uint8_t* __restrict keep = out.keep;
    const int count = out.count;
    // Table look-ups stay out of the vector loop.
    float front[kBlockPoints], back[kBlockPoints];
    for (int i = 0; i < count; ++i) {
        front[i] = p.gain_front[strata[i]];
        back[i] = p.gain_back[strata[i]];
    }
    for (int i = 0; i < count; ++i) {
        const float dx = bx + sx * float(px[i]), dy = by + sy * float(py[i]),
                    dz = bz + sz * float(pz[i]);
        const float nx = float(qx[i]), ny = float(qy[i]), nz = float(qz[i]);
        const float x = m00 * dx + m01 * dy + m02 * dz;
        const float y = m10 * dx + m11 * dy + m12 * dz;
        const float z = m20 * dx + m21 * dy + m22 * dz;
        // Minus the cosine to the way of the eye: positive when facing it.
        const float facing =
            kOrthographic ? -(nx * fx + ny * fy + nz * fz) : -(nx * dx + ny * dy + nz * dz);
        const float seen = std::max(facing * front[i], -facing * back[i]);
        const float probability = kOrthographic ? seen : seen / (z * z * z);
        const uint32_t index = first_index + uint32_t(i);
        const uint32_t bits =
            kRandom ? mix32(index * 0x9e3779b9u ^ hash) : index * 0x9e3779b9u + hash;
        const float threshold = float(int(bits >> 8)) * 0x1p-24f;
        out_x[i] = x;
        out_y[i] = y;
        out_z[i] = z;
        keep[i] = uint8_t((probability > threshold) & (z > z_near));
    }
}

}  // namespace

__attribute__((target_clones("arch=x86-64-v4", "arch=x86-64-v3", "default"))) void transformPoints(
    const KernelParams& params, const ListBlock& block, int first_lane, uint32_t first_index,
    PointBlock& out) {
    if (params.orthographic) {
        params.random ? transformLoop<true, true>(params, block, first_lane, first_index, out)
                      : transformLoop<true, false>(params, block, first_lane, first_index, out);
    } else {
        params.random ? transformLoop<false, true>(params, block, first_lane, first_index, out)
                      : transformLoop<false, false>(params, block, first_lane, first_index, out);
    }
}

}  // namespace stipple
