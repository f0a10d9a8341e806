// SPDX-License-Identifier: Apache-2.0
#include <reconstruct/surface_channels.h>

namespace stipple {

void SurfaceChannels::add(const SampleLookup& lookup, const DepthTile& tile, int px, int py,
                          PixelSums& sums) {
    const bool looks_up = is_wanted_ || context_.picture->isWatched(px, py);
    const int s = context_.view.subpixels;
    PixelSums own;
    for (int y = py * s; y < (py + 1) * s; ++y) {
        for (int x = px * s; x < (px + 1) * s; ++x) {
            const uint64_t key = tile.row(y)[x];
            if (DepthTile::numberOf(key) == kNoNumber) continue;
            const float depth = DepthTile::depthOf(key);
            own.depth_max = std::max(own.depth_max, depth);
            own.nearest = std::min(own.nearest, depth);
            if (!looks_up) continue;
            shader_.show(lookup, key, x, y);
            const SurfaceSample& sample = shader_.sample();
            own.normal += sample.normal_world;
            own.albedo += sample.albedo;
            own.covered += 1.0f;
            if (depth == own.nearest) own.object = sample.object;
        }
    }
    if (!(own.nearest < kInfinity)) return;
    sums.depth_max = own.depth_max;
    sums.nearest = own.nearest;
    if (!(own.covered > 0.0f)) return;
    const float scale = sums.covered / own.covered;
    sums.normal = own.normal * scale;
    sums.albedo = own.albedo * scale;
    sums.object = own.object;
}

}  // namespace stipple
