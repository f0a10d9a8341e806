// SPDX-License-Identifier: Apache-2.0
// Vegetation, rocks and terrain made from a seed. Everything is a pure function of its parameters:
// the same on every machine. Parameters out of range throw kInvalidArgument.
#pragma once

#include <core/material.h>
#include <scenegraph/mesh.h>

#include <cstdint>
#include <string>
#include <vector>

namespace stipple {

// A mesh, the materials its triangle_material indexes and the textures that those index (loaders
// append them to the scene and shift the indices).
struct GeneratedMesh {
    Mesh mesh;  // not yet built (see buildMesh)
    std::vector<Material> materials;
    std::vector<Texture> textures;  // of normal_map only
};

struct TreeParams {
    std::string species = "oak";  // oak, beech, birch, spruce, pine
    uint64_t seed = 1;
    double height = 0.0;            // metres; 0: the species' own
    int triangles = 20000;          // about this many (within 10 %), 1000..2000000
    std::string season = "summer";  // spring, summer, autumn, winter: leaves' colour and amount
};
// The trunk stands at the origin, the highest leaf is at `height`, roots reach a little below y =
// 0. Every seed has a tone of its own. About 10 ms for 20 000 triangles.
GeneratedMesh makeTree(const TreeParams& params);
std::vector<std::string> treeSpecies();

struct BushParams {
    std::string species = "hazel";  // hazel (many stems), juniper (needles), bilberry (a low mat)
    uint64_t seed = 1;
    double height = 0.0;   // metres; 0: the species' own
    int triangles = 6000;  // about this many (within 10 %), 1000..2000000
    std::string season = "summer";
};
// Stands at the origin like a tree, several stems from the ground.
GeneratedMesh makeBush(const BushParams& params);
std::vector<std::string> bushSpecies();

struct DeadwoodParams {
    std::string form = "snag";  // snag (dead standing tree), log (fallen trunk along x), stump
    uint64_t seed = 1;
    double length = 0.0;   // metres, height of a snag or stump, length of a log; 0: the form's own
    int triangles = 4000;  // at most this many, 500..2000000
};
// Stands or lies on y = 0 around the origin and reaches a little below.
GeneratedMesh makeDeadwood(const DeadwoodParams& params);
std::vector<std::string> deadwoodForms();

struct GrassParams {
    uint64_t seed = 1;
    double height = 0.35;  // metres, of the longest blades
    double radius = 0.5;   // metres, of the tuft
    int blades = 120;
    std::string season = "summer";
};
GeneratedMesh makeGrass(const GrassParams& params);

struct FernParams {
    uint64_t seed = 1;
    double height = 0.7;  // metres, of the highest frond; the fern is about twice as wide
    int fronds = 11;      // 1..10000, 73 triangles each
    std::string season = "summer";
};
GeneratedMesh makeFern(const FernParams& params);

struct FlowersParams {
    std::string species = "daisy";  // daisy, buttercup, poppy, bluebell
    uint64_t seed = 1;
    double height = 0.0;  // metres, of the highest; 0: the species' own
    double radius = 0.5;  // metres, of the patch
    int stems = 24;       // 1..200000, each about 20 triangles
};
GeneratedMesh makeFlowers(const FlowersParams& params);
std::vector<std::string> flowerSpecies();

// What lies on a forest's floor: fallen leaves, twigs, small green leaves between.
struct LitterParams {
    uint64_t seed = 1;
    double radius = 1.0;  // metres
    int leaves = 160;     // 1..200000, 2 triangles each
    std::string season = "summer";
};
GeneratedMesh makeLitter(const LitterParams& params);

struct RockParams {
    uint64_t seed = 1;
    double radius = 1.0;   // metres
    int subdivisions = 4;  // 20 * 4^n triangles
};
GeneratedMesh makeRock(const RockParams& params);

// Heights on a grid centred on the origin, flat triangles between.
struct HeightField {
    int columns = 0;             // samples along x, at least 2
    int rows = 0;                // samples along z, at least 2
    DVec2 size = DVec2(0.0);     // metres along x and z
    std::vector<float> heights;  // rows * columns, metres, row = z, column = x

    double height(double x, double z) const;  // clamped to the border outside
    Vec3 normal(double x, double z) const;    // unit
};

struct TerrainParams {
    uint64_t seed = 1;
    double size = 1000.0;         // metres along a side
    int resolution = 513;         // samples along a side: 2 (resolution - 1)^2 triangles
    double relief = 60.0;         // metres: heights span exactly 0..relief
    double feature_size = 400.0;  // metres, of the largest hills
    std::string style =
        "meadow";  // meadow (green, rock where steep), forest_floor, mountain (rock, snow on top)
    double erosion = 0.0;      // 0..1: how far rain has cut valleys into it
    double water_level = 0.0;  // metres above the lowest place: lakes fill what lies below, 0: dry
};
std::vector<std::string> terrainStyles();
HeightField makeHeightField(const TerrainParams& params);
// The height field as a mesh with smooth normals and texture coordinates that span it, u along x
// and v along z.
Mesh heightFieldMesh(const HeightField& field);
// The same coloured by height and slope, with texture coordinates on water only; over what lies
// below the water level, a second, flat surface with a material of its own ("water") and ripples as
// its normal map. Of `params` only style,
// seed and water_level count.
GeneratedMesh makeTerrain(const TerrainParams& params, const HeightField& field);

// A ball of small see-through squares, turned at random, densest in its middle: a density volume as
// a renderer of surfaces can draw it.
struct MistParams {
    uint64_t seed = 1;
    double radius = 1.0;  // metres
    int patches = 20000;  // 1..2000000, two triangles each
    double patch = 0.05;  // metres, side of a square
    double depth = 1.0;  // optical depth through the middle: exp(-depth) of the light comes through
    Vec3 color = Vec3(0.8f);
};
GeneratedMesh makeMist(const MistParams& params);

// A simple body for test scenes: "sphere" (diameter 1), "box" (side 1), "plane" (side 1, facing
// +y), "torus", all centred on the origin, tessellated into about `triangles` triangles. Seen from
// both sides where alpha is below 1.
GeneratedMesh makePrimitive(const std::string& kind, int triangles, const Vec3& color,
                            float alpha = 1.0f);

}  // namespace stipple
