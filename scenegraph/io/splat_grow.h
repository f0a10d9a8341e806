// SPDX-License-Identifier: Apache-2.0
// How a splat grows over the points around its own: an ellipse along the principal curvatures whose
// points lie within the tolerance of its plane, cut by lines along creases. Based on: Wu, Kobbelt.
// Optimized Sub-Sampling of Point Sets for Surface Splatting. 2004, section 3; Zwicker et al.
// Perspective Accurate Splatting. 2004 (clip lines).
#pragma once

#include <core/disc_cuts.h>
#include <scenegraph/io/splat_points.h>

#include <array>

namespace stipple {

struct SplatRules {
    float tolerance = 0.0f;        // of points from their splat's plane, m
    float color_tolerance = 0.0f;  // a channel, sRGB
    bool are_circles = false;
    bool has_cuts = true;
};

// Covers the points within its ellipse and its cuts; drawn, it is `gap` wider.
struct Splat {
    Vec3 center = Vec3(0), normal = Vec3(0, 0, 1);
    Vec3 along = Vec3(1, 0, 0);  // unit, in the plane: the long half axis
    float long_radius = 0.0f, short_radius = 0.0f;
    float gap = 0.0f;  // so much farther the surface goes on to the next point
    Vec3 color = Vec3(0);
    uint8_t finish = 0;
    int n_cuts = 0;
    // The shading normal in its middle, and by how much its parts along and across turn a metre:
    // (xx, yy, xy) as in SurfelBend.
    Vec3 shading_normal = Vec3(0, 0, 1), bend = Vec3(0);
    // Nothing where x a + y b > z, a along, b across; (x, y) unit, z in m, not negative.
    std::array<Vec3, kMostDiscCuts> cuts = {};

    Vec3 across() const { return glm::cross(normal, along); }
    float reach(float tolerance) const {
        return std::sqrt(long_radius * long_radius + tolerance * tolerance) * 1.0001f + 1e-30f;
    }
};

// A splat's plane holds for a point up to the tolerance, and for what faces and looks like it.
bool covers(const Splat& splat, const SplatPoint& point, const SplatRules& rules);

// Whether the point lies within a splat's ellipse and cuts, at any height.
bool isInside(const Splat& splat, const Vec3& position);

// Whether the splat would not have grown so far had the point been there: it lies within it, but
// clearly off its plane.
bool contradicts(const SplatPoint& point, const Splat& splat, const SplatRules& rules);

class SplatGrower {
public:
    SplatGrower(const SplatPoints& points, const PointIndex& index, const SplatRules& rules)
        : points_(points), index_(index), rules_(rules) {}

    // The splat of a point, grown until a point ends it or it covers about `most`. O(m log m) of
    // the m points around.
    Splat grow(uint32_t point, size_t most);

private:
    // A plane through a point, and the shape that grows in it.
    struct Frame {
        Vec3 origin, normal, along, across;
        float ratio = 1.0f;  // of short to long half axis
        float measure(float a, float b) const { return std::sqrt(a * a * ratio + b * b / ratio); }
    };
    struct Cut {
        Vec2 to = Vec2(0);  // unit
        float end = 0.0f;
        Vec3 normal = Vec3(0), on_plane = Vec3(0);  // of the surface beyond
    };
    struct Around {
        float measure;
        uint32_t index;
        float a, b, height;
        bool operator<(const Around& o) const {
            return measure != o.measure ? measure < o.measure : index < o.index;
        }
    };
    struct Grown {
        Frame frame;
        float radius = 0.0f;  // of a circle as large
        float lowest = 0.0f, highest = 0.0f;
        size_t n_points = 0;
        bool is_ended = false;
        int n_cuts = 0;
        std::array<Cut, kMostDiscCuts> cuts;
    };

    Frame frameOf(uint32_t point, const Vec3& normal) const;
    Grown growIn(uint32_t point, const Frame& frame, float first_reach, size_t most);
    bool isBeyondCut(const Grown& grown, const Around& p) const;
    bool cut(Grown& grown, uint32_t point, const Around& p) const;
    void cutRim(Grown& grown, uint32_t point);
    template <class IsWanted>
    size_t lookAround(const Vec3& center, const Frame& frame, float reach, float most_measure,
                      const IsWanted& isWanted);
    bool sortNext(size_t done);
    float reachOf(const Vec3& center, float reach) const;
    bool fitQuadric(uint32_t point, const Grown& circle, Frame& frame) const;

    const SplatPoints& points_;
    const PointIndex& index_;
    const SplatRules rules_;
    std::vector<Around> order_;  // of the last growth
    size_t n_sorted_ = 0;        // so many of them are in order, and before all others
};

}  // namespace stipple
