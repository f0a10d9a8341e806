// SPDX-License-Identifier: Apache-2.0
// Triangle meshes ("assets") and the octree of triangles over each: bounds, cumulated areas (the
// static distribution list) and what the sampler must know of a node. Based on: Wand, Fischer,
// Peter, Meyer auf der Heide, Strasser. The Randomized z-Buffer Algorithm. 2001 ("Precomputation:
// Distribution List", "Spatial classification", "Improvements: handling of large triangles").
#pragma once

#include <core/math.h>
#include <scenegraph/normal_cone.h>
#include <scenegraph/surfel_model.h>

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace stipple {

// Triangles that share an area class (a factor of 4), a patch width class and the sidedness. A
// connected patch is what shares vertices: a leaf, a twig, or a whole terrain; its width is that of
// the strip or tube it resembles. At most kMaxStrata a mesh.
struct Stratum {
    float max_triangle_area = 0.0f;  // object space, m^2
    float patch_width = 0.0f;        // object space, m: the mean, weighted by area
    bool double_sided = false;
    bool masked = false;  // has an alpha mask or is blended: the surface may be missing at a point
    bool blended = false;
};
inline constexpr int kMaxStrata = 15;

// Node of the octree over a mesh's triangles. Node 0 is the root over everything; its children are
// the roots of the strata (when there are several), so every node but the root is homogeneous in
// area class, patch size and sidedness.
struct MeshNode {
    Box3 bounds;  // object space
    NormalCone normals;
    double area = 0.0;  // of its triangles, m^2
    float max_triangle_area = 0.0f;
    uint32_t first_triangle =
        0;  // its triangles are [first_triangle, first_triangle + triangle_count)
    uint32_t triangle_count = 0;
    uint32_t first_child = 0;  // children are contiguous
    uint8_t child_count = 0;   // 0: a leaf
    uint8_t stratum = 0;       // index into Mesh::strata; kMixedStratum: several (root only)
};
inline constexpr uint8_t kMixedStratum = 255;

// A part of a hybrid model's surface: meshes, one of which is drawn in its place, by what they cost
// (sampling/patch_choice.h).
struct MeshPatch {
    static constexpr uint32_t kNoMesh = 0xffffffffu;
    struct Triangles {
        uint32_t mesh = kNoMesh;  // index into Scene::meshes
        float error = 0.0f;       // object space, m
    };
    Box3 bounds;                       // object space
    std::vector<Triangles> triangles;  // finest first
    uint32_t surfels = kNoMesh;        // a mesh that has nothing but them
    bool is_textured = false;          // its triangles are; surfels have their colours
};

struct Mesh {
    std::string name;

    // What loaders and generators fill. Per-vertex arrays are either empty or as long as
    // `positions`.
    std::vector<Vec3> positions;              // object space, metres
    std::vector<Vec3> normals;                // unit; empty: flat shading
    std::vector<Vec2> uvs;                    // glTF convention
    std::vector<std::vector<Vec2>> more_uvs;  // further layers (TextureUse::uv_layer)
    // w: +-1, bitangent = w * cross(normal, tangent); null vectors or empty: derived from the uvs.
    std::vector<Vec4> tangents;
    std::vector<Vec4> colors;  // linear RGBA, multiplied with the material's colour; empty: white
    std::vector<UVec3> triangles;             // counter-clockwise seen from the front
    std::vector<uint16_t> triangle_material;  // index into Scene::materials, one a triangle

    bool is_cloud = false;  // positions are the corners of points' discs, four a point

    // A prebuilt model, which is drawn in place of the triangles where these would be too coarse;
    // its finishes are the scene's materials from first_finish on. Null for meshes.
    std::shared_ptr<const SurfelModel> surfels;
    uint32_t first_finish = 0;

    // A hybrid model's patches, which are drawn in place of the triangles where these are near.
    std::vector<MeshPatch> patches;
    std::string patches_source;  // name of the file it was made from
    bool is_patch = false;       // drawn as such alone: no group instances it

    // What buildMesh() adds; it also sorts the triangles (strata, then Morton order).
    std::vector<MeshNode> nodes;
    std::vector<double> cumulative_area;    // triangles.size() + 1 entries: the distribution list
    std::vector<uint8_t> triangle_stratum;  // index into strata, one a triangle
    std::vector<Stratum> strata;
    Box3 bounds;  // of all that is drawn
    // Without the discs of surfels, which reach beyond what their model was made from.
    Box3 source_bounds;
    double area = 0.0;

    size_t bytes() const;
};

struct Material;

// Checks the arrays (indices in range, finite positions, materials in range), drops zero-area
// triangles, sorts the rest, builds octree and lists. where: names the asset in errors. Throws
// kInvalidScene. O(n log n).
void buildMesh(Mesh& mesh, const std::vector<Material>& materials, const std::string& where);

}  // namespace stipple
