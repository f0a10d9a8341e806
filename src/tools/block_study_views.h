// SPDX-License-Identifier: Apache-2.0
// Point-block models from random directions: holes, and quality against rays.
#pragma once

#include <core/parallel.h>
#include <scenegraph/scene.h>
#include <scenegraph/surfel_model.h>

#include <functional>
#include <string>
#include <vector>

namespace stipple {

// Of a view at unit magnification a pixel at the near side is as large as one of the model.
enum class BlockViews {
    kUnit,       // all of the model, at unit magnification
    kMagnified,  // what lies about a point of it, magnified four times
    kWide,       // 90 degrees wide, the model at an edge of the picture
};

struct BlockViewsResult {
    int views = 0;
    double holes = 0.0;  // pixels, of all views; against 16 rays a pixel
    int views_with_holes = 0;
    double most_holes = 0.0;                    // of one view
    double mean_psnr = 0.0, worst_psnr = 1e30;  // dB, against one centred ray a pixel
};

// source: as rays see it. shown: shows the model by one subpixel a pixel. The same views for the
// same resolution (pixels along a side) and bounds. before_view may throw.
BlockViewsResult measureBlockViews(const Scene& source, const Scene& shown,
                                   const SurfelModel& model, BlockViews kind, int resolution,
                                   ThreadPool& pool, const CancelFlag* cancel,
                                   const std::function<void()>& before_view);

}  // namespace stipple
