// SPDX-License-Identifier: Apache-2.0
// Normal, albedo, object and farthest depth of a pixel, from what its subpixels show: the channels
// that reconstructions which filter colour do not filter.
#pragma once

#include <reconstruct/depth_tile.h>
#include <reconstruct/subpixel_shader.h>

namespace stipple {

class SurfaceChannels {
public:
    explicit SurfaceChannels(const ReconstructionContext& context)
        : context_(context), shader_(context) {
        const Image& image = context.picture->image();
        for (const char* name : {"normal.X", "albedo.R", "object"})
            is_wanted_ |= image.channelIndex(name) >= 0;
    }

    void forget() { shader_.forget(); }
    // Nothing is looked up unless the picture has such a channel, or the pixel is watched.
    void add(const SampleLookup& lookup, const DepthTile& tile, int px, int py, PixelSums& sums);

private:
    const ReconstructionContext& context_;
    SubpixelShader shader_;
    bool is_wanted_ = false;
};

}  // namespace stipple
