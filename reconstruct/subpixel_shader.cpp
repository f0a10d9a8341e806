// SPDX-License-Identifier: Apache-2.0
#include <reconstruct/subpixel_shader.h>

#include <reconstruct/shade.h>

#include <cmath>

namespace stipple {

template <class Of>
float LightOnPlaces::mean(const SurfaceSample& sample, const Of& of) const {
    if (count_ == 0) return of(sample);
    SurfaceSample at = sample;
    float sum = 0.0f;
    for (int i = 0; i < count_; ++i) {
        at.position_camera = places_[i].position_camera;
        at.depth = at.position_camera.z;
        at.extent = sample.extent * std::sqrt(places_[i].share);
        sum += of(at) * places_[i].share;
    }
    return sum;
}

float LightOnPlaces::ofSun(size_t sun, const SurfaceSample& sample) const {
    return mean(sample, [&](const SurfaceSample& at) { return lights_->ofSun(sun, at); });
}

float LightOnPlaces::ofLamp(size_t lamp, const SurfaceSample& sample) const {
    return mean(sample, [&](const SurfaceSample& at) { return lights_->ofLamp(lamp, at); });
}

float LightOnPlaces::of(const SurfaceSample& sample, const Vec3& normal_world) const {
    return mean(sample, [&](const SurfaceSample& at) { return ambient_->of(at, normal_world); });
}

Vec3 SubpixelShader::shadeSample(const SurfaceSample& sample) const {
    return shade(sample, (*context_.materials)[sample.material], *context_.lighting, context_.view,
                 context_.light_visibility ? &light_ : nullptr,
                 context_.ambient_visibility ? &light_ : nullptr);
}

void SubpixelShader::show(const SampleLookup& lookup, uint64_t key, int x, int y) {
    // Anew even where the subpixel beside shows the same point: what it shows there, and how it is
    // lit, depends on the place, and which subpixel comes first on the tile.
    const Vec2 p_sub(float(x) + 0.5f, float(y) + 0.5f);
    Vec3 origin, direction;
    context_.view.ray(p_sub.x, p_sub.y, origin, direction);
    showPoint(lookup, origin + direction * DepthTile::depthOf(key), DepthTile::numberOf(key),
              p_sub);
}

void SubpixelShader::readAhead(const SampleLookup& lookup, const DepthTile& tile, int px,
                               int py) const {
    const int s = context_.view.subpixels;
    if ((px + 1) * s > tile.rect().x1) return;
    uint32_t last = kNoNumber;
    for (int y = py * s; y < (py + 1) * s; ++y) {
        const uint64_t* row = tile.row(y);
        for (int x = px * s; x < (px + 1) * s; ++x) {
            const uint32_t number = DepthTile::numberOf(row[x]);
            if (number != kNoNumber && number != last) lookup.prefetch(number & ~kSurfaceBit);
            last = number;
        }
    }
}

bool SubpixelShader::hasVariedLight() const {
    return context_.light_visibility || context_.ambient_visibility ||
           !context_.lighting->projectors.empty();
}

uint32_t SubpixelShader::membersBeside(const Cell& cell, uint32_t members) const {
    const int side = sharedSide();
    const int first = std::countr_zero(members);
    if (side < 2) return uint32_t(1) << first;
    uint32_t beside = 0;
    for (uint32_t m = members; m; m &= m - 1) {
        const int i = std::countr_zero(m);
        const bool is_beside =
            (cell.x[i] - cell.x[0]) / side == (cell.x[first] - cell.x[0]) / side &&
            (cell.y[i] - cell.y[0]) / side == (cell.y[first] - cell.y[0]) / side;
        beside |= uint32_t(is_beside) << i;
    }
    return beside;
}

Vec3 SubpixelShader::middleOf(const Cell& cell, uint32_t members, Vec2& p_sub) const {
    // Of a plane 1 / depth (orthographic: depth) is affine in the picture.
    const bool orthographic = context_.view.orthographic;
    float x = 0.0f, y = 0.0f, q = 0.0f;
    const float n = float(std::popcount(members));
    for (uint32_t m = members; m; m &= m - 1) {
        const int i = std::countr_zero(m);
        const float depth = DepthTile::depthOf(cell.key[i]);
        x += float(cell.x[i]), y += float(cell.y[i]);
        q += orthographic ? depth : 1.0f / depth;
    }
    p_sub = Vec2(x / n + 0.5f, y / n + 0.5f);
    Vec3 origin, direction;
    context_.view.ray(p_sub.x, p_sub.y, origin, direction);
    return origin + direction * (orthographic ? q / n : n / q);
}

bool SubpixelShader::showMembers(const SampleLookup& lookup, const Cell& cell, uint32_t members) {
    const int first = std::countr_zero(members);
    if (members == uint32_t(1) << first ||
        varied_numbers_[cell.number[first] % kVaried] == cell.number[first])
        return false;
    const float n = float(std::popcount(members));
    Vec2 p_sub;
    const Vec3 middle = middleOf(cell, members, p_sub);
    LightOnPlaces::Place places[LightOnPlaces::kMost];
    int count = 0;
    for (uint32_t left = hasVariedLight() ? members : 0; left;) {
        const uint32_t beside = membersBeside(cell, left);
        left &= ~beside;
        Vec2 unused;
        places[count++] = {middleOf(cell, beside, unused), float(std::popcount(beside)) / n};
    }
    light_.set(places, count);
    const bool is_shared = showShared(lookup, middle, cell.number[first], p_sub, n);
    light_.set(nullptr, 0);
    if (!is_shared) varied_numbers_[cell.number[first] % kVaried] = cell.number[first];
    return is_shared;
}

bool SubpixelShader::showShared(const SampleLookup& lookup, const Vec3& p_camera, uint32_t number,
                                const Vec2& p_sub, float count) {
    sample_.extent = std::sqrt(count);
    lookUp(lookup, p_camera, number, p_sub);
    const bool is_shared = (*context_.materials)[sample_.material].normal_map.texture == kNoTexture;
    if (is_shared) radiance_ = shadeSample(sample_);
    sample_.extent = 1.0f;
    return is_shared;
}

void SubpixelShader::showPoint(const SampleLookup& lookup, const Vec3& p_camera, uint32_t number,
                               const Vec2& p_sub) {
    lookUp(lookup, p_camera, number, p_sub);
    radiance_ = shadeSample(sample_);
}

void SubpixelShader::lookUp(const SampleLookup& lookup, const Vec3& p_camera, uint32_t number,
                            const Vec2& p_sub) {
    sample_.depth = p_camera.z;
    sample_.position_camera = p_camera;
    lookup.lookUp(number & ~kSurfaceBit, p_sub.x, p_sub.y, sample_);
}

}  // namespace stipple
