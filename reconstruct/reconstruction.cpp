// SPDX-License-Identifier: Apache-2.0
#include <reconstruct/reconstruction.h>

#include <reconstruct/bins.h>
#include <reconstruct/depth_pass.h>
#include <reconstruct/ewa.h>
#include <reconstruct/gaussian.h>
#include <reconstruct/per_pixel.h>
#include <reconstruct/pull_push.h>

#include <algorithm>
#include <cmath>

namespace stipple {

RenderSettings drawnSettings(const RenderSettings& settings) {
    RenderSettings drawn = settings;
    const bool uses_all = settings.reconstruct == Reconstruct::kGaussian ||
                          settings.reconstruct == Reconstruct::kEwa ||
                          settings.reconstruct == Reconstruct::kBins;
    if (settings.method != Method::kPoints || !uses_all) return drawn;
    constexpr int kMostSubpixels = 4;
    const int most = std::max(1, kMostSubpixels / settings.subpixels);
    const int split = std::clamp(int(std::lround(std::sqrt(settings.samples))), 1, most);
    const double area = double(split) * double(split);
    drawn.subpixels *= split;
    drawn.samples /= area;
    return drawn;
}

namespace {

// Side of the largest splat, subpixels.
int largestSplat(const ReconstructionContext& context) {
    constexpr int kMostWorldSplat = 33;
    if (context.settings.splat_world > 0.0) return kMostWorldSplat;
    return splatSide(float(context.settings.splat_size) * float(context.view.subpixels));
}

}  // namespace

std::unique_ptr<TileReconstruction> makeReconstruction(const ReconstructionContext& context) {
    switch (context.settings.reconstruct) {
        case Reconstruct::kSplat:
            return makePerPixel(context, largestSplat(context));
        case Reconstruct::kGaussian:
            return makeGaussian(context);
        case Reconstruct::kPullPush:
            return makePullPush(context);
        case Reconstruct::kEwa:
            return makeEwa(context);
        case Reconstruct::kBins:
            return makeBins(context);
        case Reconstruct::kPerPixel:
            break;
    }
    return makePerPixel(context, 0);
}

}  // namespace stipple
