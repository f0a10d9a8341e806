// SPDX-License-Identifier: Apache-2.0
// A point cloud that grows and shrinks, as splats: only those near what changed are made anew, so
// an edit costs the same in a small cloud and a large one. docs/models.md shows how it is used.
// Based on: Johnson. Point-based Graphics for Estimated Surfaces (surfaces that are estimated
// continuously); Wu, Kobbelt. Optimized Sub-Sampling of Point Sets for Surface Splatting. 2004.
#pragma once

#include <scenegraph/io/splats.h>
#include <scenegraph/surfel_model.h>

#include <vector>

namespace stipple {

struct CloudPoint {
    DVec3 position = DVec3(0.0);  // m
    Vec3 normal = Vec3(0);        // any length; null: estimated, and turned as its neighbours are
    Vec3 color = Vec3(0.8f);      // sRGB, 0..1
};

class SplatCloud {
public:
    // The points' splats as buildSplats() makes them; numbered from 0. The tolerance in per cent is
    // one of these points' bounds and stays. finish: of all points; its patch_width is set. Throws
    // kInvalidArgument if a coordinate is not finite or there are more than 2^27 points.
    // O(n log n).
    SplatCloud(const std::vector<CloudPoint>& points, const SplatOptions& options, ThreadPool& pool,
               const SurfelFinish& finish = {});

    // Adds points, and returns the number of the first; the others follow. Those that no splat
    // covers get splats; a splat is made anew when a quarter as many points lie within it, but do
    // not fit, as it covers. Throws as above, before anything is changed. On average over edits
    // O(log n) a point, some microseconds.
    uint32_t append(const std::vector<CloudPoint>& points);
    // Takes points away, whose numbers are not used again. Splats go that cover none any more, or,
    // where a hole opens, less than half of what they did. Throws kInvalidArgument, before anything
    // is changed, if a number was never given, was taken away, or comes twice. Cost as above.
    void remove(const std::vector<uint32_t>& numbers);

    size_t pointCount() const { return index_.size(); }
    size_t splatCount() const { return splats_.size() - unused_.size(); }
    double tolerance() const { return double(rules_.tolerance); }  // m

    // All splats as a model to draw (addSurfelModel() of io/surfel_file.h) or to write. Throws
    // kInvalidScene if there are no points. O(splats x points that came or went since the last
    // model), and of the points of the splats that reach these; some nanoseconds a point for the
    // bounds.
    SurfelModel model();

private:
    struct Placed {
        Splat splat;
        uint32_t n_points = 0;   // that it covers; 0: there is no such splat
        uint32_t n_alone = 0;    // that no other covers
        uint32_t n_first = 0;    // that it covered when it was made
        uint32_t n_against = 0;  // points within it that it does not cover, since then
        bool is_drawn = false;   // `drawn` is up to date
        Splat drawn = {};        // with bent normals, and cut at borders
    };

    SplatPoint pointOf(const CloudPoint& point) const;
    void turnAsNeighbours(uint32_t point, uint32_t n_turned);
    void placeBySplats(uint32_t point, std::vector<uint32_t>& wrong);
    void add(const Splat& splat, const std::vector<uint32_t>& covered);
    void link(uint32_t point, uint32_t splat);
    void removeSplats(const std::vector<uint32_t>& splats);
    void coverUncovered();
    void drawChanged();

    const SplatOptions options_;
    SurfelFinish finish_;
    DVec3 middle_ = DVec3(0.0);
    SplatRules rules_;
    SplatPoints points_;  // relative to the middle
    PointIndex index_;
    std::vector<uint8_t> is_there_;
    std::vector<std::vector<uint32_t>> splats_of_;  // points: what covers them
    std::vector<Placed> splats_;
    std::vector<uint32_t> unused_;      // of splats_
    std::vector<uint32_t> uncovered_;   // points
    std::vector<uint32_t> not_needed_;  // splats whose points others cover, perhaps
    std::vector<uint32_t> changed_;     // points that came or went since the last model
    std::vector<NearPoint> near_;       // scratch
};

}  // namespace stipple
