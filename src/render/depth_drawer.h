// SPDX-License-Identifier: Apache-2.0
// Depths of a view by the randomized sampler, before the frame itself is drawn: the first look at
// what is visible, and the pages of shadow maps.
#pragma once

#include <reconstruct/depth_only.h>
#include <render/renderer.h>
#include <sampling/random_sampler.h>

#include <functional>
#include <vector>

namespace stipple {

// Rasterizes the plan's large triangles for a view; nullptr if there are none. What it returns must
// stay until the next call.
using RasterizeLarge = std::function<const RasterTarget*(const View&, const FramePlan&)>;

struct DepthDrawer {
    RandomizedSampler& sampler;
    const RasterizeLarge& rasterize;
    ThreadPool& pool;
    const FrameRequest& request;
    const char* phase;  // for progress

    // Draws the tiles that are wanted (empty: all). rasterizes: whether large triangles go to the
    // z-buffer before. The sampler's plan is replaced. The same depths for any number of threads.
    void draw(const View& view, const RenderSettings& settings,
              const std::function<bool(const SubpixelRect&)>& is_wanted, bool rasterizes,
              const TakeDepths& take, FrameStats& drawn) const;
};

// What is visible: one depth for a pixel, or for a square of several.
struct FirstLook {
    View view;                 // of one subpixel a pixel
    std::vector<float> depth;  // view.width * view.height; infinite where nothing is
};

// pixels: of `view`, along a side of one of the look's.
FirstLook takeFirstLook(const View& view, int pixels, const DepthDrawer& drawer, FrameStats& stats);

}  // namespace stipple
