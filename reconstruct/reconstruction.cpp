// SPDX-License-Identifier: Apache-2.0
#include <reconstruct/reconstruction.h>

#include <reconstruct/gaussian.h>
#include <reconstruct/per_pixel.h>

namespace stipple {

std::unique_ptr<TileReconstruction> makeReconstruction(const ReconstructionContext& context) {
    switch (context.settings.reconstruct) {
        case Reconstruct::kSplat:
            return makePerPixel(context, std::max(1, int(std::lround(context.settings.splat_size *
                                                                     context.view.subpixels))));
        case Reconstruct::kGaussian:
            return makeGaussian(context);
        case Reconstruct::kPerPixel:
            break;
    }
    return makePerPixel(context, 0);
}

}  // namespace stipple
