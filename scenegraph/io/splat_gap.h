// SPDX-License-Identifier: Apache-2.0
// Where one would look through beside a splat: a line past its rim that meets none of the splats
// around, but has points on all sides. splat_close.h closes what is found.
#pragma once

#include <scenegraph/io/splat_choice.h>

namespace stipple {

// What is drawn of a splat: an ellipse in its plane, the image of the unit circle.
struct SplatDisc {
    Vec2 middle = Vec2(0);  // in the splat's frame
    glm::mat2 of_circle = glm::mat2(1.0f), to_circle = glm::mat2(1.0f);
    Vec3 center = Vec3(0), to_x = Vec3(0), to_y = Vec3(0);  // the same in space

    // Sets what follows from middle and of_circle.
    void place(const Splat& splat);
};

// Whether a place in a splat's plane lies beyond one of its cuts.
bool isBeyondCut(const Splat& splat, const Vec2& p);

// Splats as they are drawn by now, and which of them cover a point.
struct DrawnSplats {
    const SplatPoints& points;
    const PointIndex& index;
    const std::vector<Splat>& splats;
    std::vector<SplatDisc> discs;
    std::vector<uint32_t> first, of_point;  // those of point i: from first[i] to first[i + 1]

    DrawnSplats(const SplatPoints& all_points, const PointIndex& point_index,
                const std::vector<ChosenSplat>& chosen, const std::vector<Splat>& drawn);
};

// One a thread; the splats must not change between startAt() and the last of isOpenAt(), but for
// the one that is looked at. What it tells depends on nothing but these calls.
class GapFinder {
public:
    explicit GapFinder(const DrawnSplats& drawn)
        : drawn_(drawn), looked_up_(drawn.splats.size(), 0) {}

    void startAt(uint32_t splat);

    // Whether one could look through beside a place on the rim of the disc, which is or may become
    // that splat's. wanted: a place in its plane that would lie on it if it were large enough
    // there. A microsecond or two.
    bool isOpenAt(const SplatDisc& own, const Vec2& on_circle, Vec2& wanted);

private:
    static constexpr int kDirections = 32;
    using Lane = std::array<float, kDirections>;
    // Lines towards the eye, those that are open first: places beside the rim, directions, and
    // where they meet the splat's plane. All in the splat's frame.
    struct Lines {
        int n = 0;
        Lane qx, qy, qz, dx, dy, dz, on_x, on_y;
        std::array<int, kDirections> direction;
        void keep(int from, int to);
    };
    struct Other {
        Vec3 center, normal, to_x, to_y;  // of its disc
        float reach = 0.0f;
        bool is_alike = true;  // faces to the same side
        int n_cuts = 0;
        std::array<Vec3, kMostDiscCuts> cut_to;
        std::array<float, kMostDiscCuts> cut_end;
    };

    Vec3 inFrame(const Vec3& v) const;
    void lookAround(const Vec2& at);
    void addOther(uint32_t t);
    void aimBeside(const SplatDisc& own, const Vec2& on_circle);
    void strikeMet(const Other& other);
    void findPoints(const Vec2& at);
    bool isAmong(const Vec3& q, int direction) const;
    bool isAmongExactly(const Vec3& q, int direction) const;

    const DrawnSplats& drawn_;
    uint32_t s_ = 0;
    Vec3 along_ = Vec3(0), across_ = Vec3(0), normal_ = Vec3(0), origin_ = Vec3(0);
    float gap_ = 0.0f;
    int turn_ = 0;
    Lines lines_;
    // What lies around a place, and around those that are not farther from it than `slack_`.
    Vec2 around_ = Vec2(0);
    float slack_ = -1.0f;
    std::vector<NearPoint> near_;
    std::vector<uint32_t> looked_up_;  // a splat: when it was last
    uint32_t time_ = 0;
    std::vector<Other> others_;
    std::vector<Vec3> facing_, points_;  // points; those around the last place
};

}  // namespace stipple
