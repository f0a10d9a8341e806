// SPDX-License-Identifier: Apache-2.0
// Splits a mesh's triangles into connected clusters, flat ones first. Based on: Garland, Willmott,
// Heckbert. Hierarchical Face Clustering on Polygonal Surfaces. 2001; Ni. Hybrid Triangle/Point
// Models. 2005 (two phases).
#pragma once

#include <core/parallel.h>
#include <scenegraph/mesh.h>

#include <vector>

namespace stipple {

struct ClusterOptions {
    // Costs have no unit: how far a cluster is from a plane for its size, how much its normals
    // turn, and how much less compact it is than its parts (negative if it is more so).
    double phase_one = 0.3;   // flat clusters grow up to this cost
    double phase_two = 0.1;   // small ones are joined, flat or not, up to this cost
    int clusters = 0;         // in place of the costs: this many after phase one, 0: by cost
    double flat_share = 0.0;  // phase two ends when no more of the triangles are in flat clusters
    uint32_t largest = 1000;  // triangles in a cluster
};

struct FaceClusters {
    std::vector<uint32_t> cluster_of;  // one a triangle
    std::vector<uint8_t> is_flat;      // one a cluster: made in phase one and left alone in two
    // The clusters of phase one, of which those above are unions.
    std::vector<uint32_t> first_of;  // one a triangle
    std::vector<Vec3> first_normal;  // one a cluster: of the plane that fits best, unit
};

// Clusters are numbered in the order of their first triangles. Triangles are joined across edges
// that two of them share, by position, if they have the same material. The mesh need not be built.
// A phase that ends at a higher cost never gives more clusters, and each is a union of those of a
// lower one, for the same triangles to begin with. Throws kCancelled. O(n log n).
FaceClusters clusterFaces(const Mesh& mesh, const ClusterOptions& options,
                          const CancelFlag& cancel);

}  // namespace stipple
