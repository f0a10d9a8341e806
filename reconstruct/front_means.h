// SPDX-License-Identifier: Apache-2.0
// What each subpixel of a tile shows, and the mean colour of all points there: the two passes of
// reconstructions that average points within subpixels.
//
// The first pass finds the front of every subpixel, as per-pixel does, and closes large surfaces by
// squares that an erosion takes back. The second one averages all points that lie on the front: no
// farther from it than the patch a point lies on is wide. Based on: Wand et al. 2001 ("Gaussian
// Reconstruction").
#pragma once

#include <reconstruct/front_slack.h>
#include <reconstruct/pixel_filter.h>
#include <reconstruct/split_pass.h>
#include <reconstruct/subpixel_shader.h>

namespace stipple {

class FrontMeans {
public:
    // The context must outlive this.
    explicit FrontMeans(const ReconstructionContext& context);

    // Subpixels around those whose fronts are wanted whose points it must see.
    int halo() const;
    // shown: the subpixels whose colours are wanted. Fronts are right in all of `outer` but
    // halo() subpixels along its sides.
    void beginTile(const SubpixelRect& inner, const SubpixelRect& shown, const SubpixelRect& outer);
    // pass: 0 or 1.
    void beginPass(int pass, const SampleLookup& lookup);
    bool hides(const SubpixelRect& rect, float z_min, bool narrow) const;
    // Passes over all but blended points.
    bool take(const PointBlock& block);
    bool take(const TriangleBlock& block);
    // The colours of all subpixels in `shown`.
    ShadedTile& finish(const SampleLookup& lookup);

    // What each subpixel shows, from the second pass on.
    const DepthTile& fronts() const { return tile_; }
    const FrontSlack& slack() const { return slack_; }
    const SplitPass& split() const { return split_; }

private:
    void closeSurfaces();
    void dropHiddenSurfaces();
    void average(const PointBlock& block);

    const ReconstructionContext& context_;
    const int side_;  // of the squares that close large surfaces
    SplitPass split_;
    const FrontSlack slack_;
    SubpixelShader shader_{context_};
    DepthTile tile_;      // what each subpixel shows; before the second pass, without surfaces
    DepthTile surfaces_;  // large surfaces, closed
    ShadedTile shaded_;
    std::vector<uint64_t> scratch_;
    int pass_ = 0;
    const SampleLookup* lookup_ = nullptr;
};

// Side of the squares that close large surfaces of k points a subpixel: odd, so that erosion takes
// back exactly what they add; six points in each, so that hardly any hole is left.
int closingSide(double k);

}  // namespace stipple
