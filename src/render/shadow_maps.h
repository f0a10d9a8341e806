// SPDX-License-Identifier: Apache-2.0
// Draws the shadow maps of a frame: a first look finds what is visible and how large a pixel is
// there, so which pages of which texel size are needed; each level then is a frame of the
// randomized sampler in an orthographic view from the sun, with a depth sink. Based on: Wand et al.
// 2001
// ("Shadows").
#pragma once

#include <render/renderer.h>
#include <render/shadow_pages.h>
#include <sampling/random_sampler.h>

#include <functional>
#include <memory>

namespace stipple {

// Rasterizes the plan's large triangles for a view; nullptr if there are none. What it returns must
// stay until the next call.
using RasterizeLarge = std::function<const RasterTarget*(const View&, const FramePlan&)>;

// Pages for everything that `view` sees, up to where haze hides it (1/256 of its colour is left).
// The same for any number of threads. The sampler's plan is replaced. Memory: 64 KiB a page.
std::unique_ptr<ShadowPages> makeShadowMaps(const Scene& scene, const View& view,
                                            RandomizedSampler& sampler,
                                            const RasterizeLarge& rasterize, ThreadPool& pool,
                                            const FrameRequest& request, FrameStats& stats);

}  // namespace stipple
