// SPDX-License-Identifier: Apache-2.0
// Draws the shadow maps of a frame: a first look has found what is visible and how large a pixel is
// there, so which pages of which texel size are needed; those that no frame before has drawn then
// are frames of the randomized sampler in views from the light, with a depth sink. Based on: Wand
// et al. 2001 ("Shadows").
#pragma once

#include <render/depth_drawer.h>
#include <render/shadow_cache.h>

#include <memory>

namespace stipple {

// Pages for everything that the look at `view` has seen, up to where haze hides it (1/256 of its
// colour is left) and where a lamp's light is too faint to be seen. The same for any number of
// threads. The sampler's plan is replaced. Memory: 64 KiB a page.
std::unique_ptr<ShadowPages> makeShadowMaps(const Scene& scene, const View& view,
                                            const FirstLook& look, const DepthDrawer& drawer,
                                            ShadowCache& cache, FrameStats& stats);

}  // namespace stipple
