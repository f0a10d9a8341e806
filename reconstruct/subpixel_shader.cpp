// SPDX-License-Identifier: Apache-2.0
#include <reconstruct/subpixel_shader.h>

#include <reconstruct/shade.h>

namespace stipple {

Vec3 SubpixelShader::shadeSample(const SurfaceSample& sample) const {
    return shade(sample, (*context_.materials)[sample.material], *context_.lighting, context_.view,
                 context_.light_visibility, context_.ambient_visibility);
}

void SubpixelShader::show(const SampleLookup& lookup, uint64_t key, int x, int y) {
    const uint32_t number = DepthTile::numberOf(key);
    const float depth = DepthTile::depthOf(key);
    const bool is_known = number == last_number_ && !(number & kAnyTriangle);
    if (is_known && depth == sample_.depth) return;
    const float sub_x = float(x) + 0.5f, sub_y = float(y) + 0.5f;
    Vec3 origin, direction;
    context_.view.ray(sub_x, sub_y, origin, direction);
    if (is_known) {
        // The same point elsewhere: on a slanted disc, or filled.
        sample_.depth = depth;
        sample_.position_camera = origin + direction * depth;
        radiance_ = shadeSample(sample_);
        return;
    }
    showPoint(lookup, origin + direction * depth, number, Vec2(sub_x, sub_y));
    last_number_ = number;
}

void SubpixelShader::showPoint(const SampleLookup& lookup, const Vec3& p_camera, uint32_t number,
                               const Vec2& p_sub) {
    sample_.depth = p_camera.z;
    sample_.position_camera = p_camera;
    lookup.lookUp(number & ~kSurfaceBit, p_sub.x, p_sub.y, sample_);
    radiance_ = shadeSample(sample_);
    last_number_ = kNoNumber;
}

}  // namespace stipple
