// SPDX-License-Identifier: Apache-2.0
// Prebuilt models: surfels in blocks, at several densities, with what must be known of a block to
// leave it out. Made by sampling/point_blocks.h and io/splats.h, read and written by
// io/surfel_file.h, drawn by sampling/surfel_points.h. Based on: Grossman. Point Sample Rendering.
// 1998, chapters 5 and 6; Pfister, Zwicker, van Baar, Gross. Surfels. 2000.
#pragma once

#include <core/disc_cuts.h>
#include <core/material.h>
#include <core/math.h>

#include <array>
#include <cstdint>
#include <string>
#include <vector>

namespace stipple {

inline constexpr int kBlockSurfels = 64;  // most of a block
// Of a model or a patch. Builders make some 30 at most: each has about half of the last.
inline constexpr int kMostSurfelLevels = 64;
// Discs are squares; on a mesh of points whose sides are a spacing, this many spacings close it.
inline constexpr float kDiscSide = 1.25f;
// The same for samples of tilted grids (SurfelModel::leaves_no_holes).
inline constexpr float kGridDiscSide = 1.65f;

// Of a block's discs, object space, m: sides of squares as large, and the longest extent; of discs
// that are drawn SurfelModel::discSide() times that.
struct DiscSides {
    float smallest = 0.0f, largest = 0.0f, longest = 0.0f;
};

// Up to 64 surfels that lie near each other and face about the same way.
struct SurfelBlock {
    Box3 bounds;         // object space; positions are quantized to it
    uint32_t first = 0;  // its surfels are [first, first + count) of the level
    uint32_t count = 0;
    std::array<uint64_t, 2> visible_from = {~0ull,
                                            ~0ull};  // bit per kMaskDirections: seen from there
    // Visibility cone: nothing of the block is seen from x where dot(x - apex, axis) is below
    // -sine * |x - apex|. sine above 1: no such place.
    Vec3 cone_apex = Vec3(0), cone_axis = Vec3(0, 0, 1);
    float cone_sine = 2.0f;
    // Not in files: measureDiscs().
    DiscSides sides;
    float narrowest_patch = 0.0f;  // of its surfels' finishes, m
};

// Of blocks, structure of arrays: balls around all that is drawn of one. Object space, m, relative
// to the middle of SurfelModel::bounds.
struct SurfelBalls {
    std::vector<float> x, y, z, radius;
};

// Positions within a block: 11, 11 and 10 bits.
inline constexpr int kPositionBits[3] = {11, 11, 10};
inline constexpr int kPositionShift[3] = {0, 11, 22};
inline constexpr uint32_t positionSteps(int axis) { return (1u << kPositionBits[axis]) - 1u; }
inline uint32_t positionPart(uint32_t packed, int axis) {
    return packed >> kPositionShift[axis] & positionSteps(axis);
}

// The disc of a splat as an ellipse that lines may cut. Its plane is kept more exactly than
// SurfelLevel::normal has it: large discs would not meet.
struct SurfelShape {
    std::array<uint16_t, 2> normal = {0, 0};  // octahedral
    uint16_t turn = 0;    // to the long half axis, 65536ths of a turn from the normal's tangent
    uint8_t ratio = 255;  // of the short half axis to the long one, 255ths
    uint8_t n_cuts : 3 = 0;
    uint8_t less : 5 = 0;    // its radius is so many 256ths of an octave less than its code says
    uint32_t first_cut = 0;  // of SurfelLevel::cuts
};
static_assert(sizeof(SurfelShape) == 12);

// There is surface up to `end` long half axes (32767ths) in the direction that is `turn` from the
// long half axis.
struct SurfelCut {
    uint16_t turn = 0;
    int16_t end = 0;
};
static_assert(sizeof(SurfelCut) == 4);

// How the shading normal turns over a splat: by so many 64ths of a radian a long half axis, about.
// (xx, yy, xy): its part along the long half axis changes by xx along it and xy across, its part
// across by xy and yy. Based on: Botsch, Spernat, Kobbelt. Phong Splatting. 2004.
struct SurfelBend {
    std::array<int8_t, 3> slopes = {0, 0, 0};
};
static_assert(sizeof(SurfelBend) == 3);

// One density: as structure of arrays, 10 bytes a surfel, 11 with radii of their own, 26 and 4 a
// cut with shapes.
struct SurfelLevel {
    float spacing = 1.0f;  // object space, m: no point of the surface is farther from a surfel
    std::vector<SurfelBlock> blocks;
    std::vector<uint32_t> position;  // packed, in steps of the block's extent
    std::vector<uint16_t> normal;    // octahedral, 2 x 8 bits
    std::vector<uint32_t>
        albedo_finish;            // sRGB-encoded 3 x 8 bits; index of the finish in the top 8
    std::vector<uint8_t> radius;  // surfelRadius() codes; empty: spacing holds for all
    // Empty: circles; else radii are of circles as large, and `normal` is for shading alone.
    std::vector<SurfelShape> shapes;
    std::vector<SurfelCut> cuts;
    std::vector<SurfelBend> bends;  // of shapes; empty: all are flat
    SurfelBalls balls;              // one a block; not in files: measureDiscs()

    size_t size() const { return position.size(); }
    // Of a surfel's disc, spacings.
    float radiusShare(size_t i) const;
    static Vec3 step(const SurfelBlock& block) {
        return block.bounds.extent() / Vec3(positionSteps(0), positionSteps(1), positionSteps(2));
    }
};

// Radii in eighths of an octave, as a share of SurfelLevel::spacing.
inline float surfelRadius(uint8_t code) { return std::exp2((float(code) - 128.0f) * 0.125f); }
uint8_t surfelRadiusCode(float share);
// The radius that a level keeps of a shape's, in 256ths of an octave: no smaller.
float keptShapeRadius(float share);
inline float SurfelLevel::radiusShare(size_t i) const {
    if (radius.empty()) return 1.0f;
    if (shapes.empty()) return surfelRadius(radius[i]);
    return std::exp2((float(radius[i]) - 128.0f) * 0.125f - float(shapes[i].less) / 256.0f);
}
// The ratio that SurfelShape keeps of a ratio of half axes.
float quantizedRatio(float ratio);

// What surfels of one kind share beside their colour.
struct SurfelFinish {
    Material material;         // without textures; base_color is not used
    float patch_width = 1.0f;  // of what they lie on (a leaf, a whole surface), m
};

struct SurfelModel {
    std::string kind;                    // "point-blocks", "splats"
    std::string source;                  // name of the file it was made from
    Box3 bounds;                         // of its source, exact
    double area = 0.0;                   // of its source's surface, m^2
    std::vector<SurfelFinish> finishes;  // at most 256
    std::vector<SurfelLevel> levels;     // finest first, each about twice the spacing of the last

    // Whether points a spacing apart leave no holes; else they close them by their patches' widths,
    // and discs are larger.
    bool leaves_no_holes = true;

    // Of all that is drawn: discs reach beyond `bounds`. Not in files: measureDiscs().
    Box3 drawn_bounds;

    float discSide() const { return leaves_no_holes ? kDiscSide : kGridDiscSide; }

    size_t bytes() const;
};

// Directions that visible_from has bits for: the octants of the sphere, each split in four, each of
// these in four again.
inline constexpr int kMaskDirections = 128;
int maskDirectionIndex(const Vec3& direction);  // not null, any length
Vec3 maskDirectionOf(int index);                // unit; about the middle

uint16_t packNormal16(const Vec3& unit);
Vec3 unpackNormal16(uint16_t packed);

// What is packed into a level.
struct Surfel {
    Vec3 position = Vec3(0), normal = Vec3(0, 0, 1), albedo = Vec3(0);  // albedo linear
    uint8_t finish = 0;
    float radius_share = 1.0f;  // of the level's spacing
    // Of shapes: unit, in the plane; short over long half axis; (x, y) a unit vector in the plane,
    // x along: there is surface up to z long half axes that way.
    Vec3 along = Vec3(1, 0, 0);
    float ratio = 1.0f;
    int n_cuts = 0;
    std::array<Vec3, kMostDiscCuts> cuts = {};
    // Of shapes: the shading normal at the centre, and SurfelBend's slopes a long half axis.
    Vec3 shading_normal = Vec3(0, 0, 1);
    Vec3 bend = Vec3(0);

    // Half axes of a disc that is as large as a circle of radius 1.
    std::array<Vec3, 2> axes() const {
        const float long_axis = 1.0f / std::sqrt(ratio);
        return {along * long_axis, glm::cross(normal, along) * (ratio * long_axis)};
    }
};

// How a level's surfels are kept.
enum class SurfelDiscs { kAlike, kRadii, kShapes };

// Sorts surfels into blocks of what lies near each other, no more than 32 spacings apart, and faces
// one way, with visibility cones where all finishes of a block are single-sided. place_in_level:
// for each surfel given, its number in the level; may be null.
SurfelLevel packSurfels(std::vector<Surfel> surfels, const std::vector<SurfelFinish>& finishes,
                        float spacing, SurfelDiscs discs,
                        std::vector<uint32_t>* place_in_level = nullptr);
Surfel unpackSurfel(const SurfelLevel& level, const SurfelBlock& block, uint32_t index);
// The unit shading normal of a surfel of a level with bends at an offset from its centre, object
// space; beyond its ellipse as at its rim. side: SurfelModel::discSide().
Vec3 bentNormal(const SurfelLevel& level, const Surfel& surfel, float side, const Vec3& offset);

// A disc of a shape is as large as that of a square with sides of this many radii.
inline constexpr float kSidePerRadius = 1.8f;

// The corners of what is drawn for a surfel's disc, relative to its centre: a square of that side,
// or, of a shape, a hexagon around its ellipse, without what its cuts take away. Their number;
// convex, counter-clockwise seen from where the normal points.
inline constexpr int kMostDiscCorners = 6 + kMostDiscCuts;
int discPolygon(const SurfelLevel& level, const Surfel& surfel, float side,
                std::array<Vec3, kMostDiscCorners>& corners);

// Finds what is kept of the discs and is not in files. O(surfels).
void measureDiscs(SurfelModel& model);

// Throw kParse (where: names the file) unless blocks, counts, numbers and finishes make sense.
void checkSurfelModel(const SurfelModel& model, const std::string& where);
void checkSurfelLevels(const std::vector<SurfelLevel>& levels, size_t n_finishes,
                       const std::string& where);
void checkSurfelFinishes(const std::vector<SurfelFinish>& finishes, const std::string& where);
void checkMaterialNumbers(const Material& material, const std::string& where);

}  // namespace stipple
