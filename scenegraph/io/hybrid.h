// SPDX-License-Identifier: Apache-2.0
// From a scene to a hybrid model of it: clusters of triangles, patches of clusters, each simplified
// and sampled. Based on: Ni. Hybrid Triangle/Point Models. 2005.
#pragma once

#include <scenegraph/hybrid_model.h>
#include <scenegraph/io/face_clusters.h>
#include <scenegraph/io/splats.h>

#include <functional>
#include <string>

namespace stipple {

// What patches are kept as.
enum class PatchKind { kBoth, kTriangles, kSurfels, kByFlatness };

struct HybridOptions {
    ClusterOptions clusters;
    double sampling = 3.0;  // grid spacings along a patch's mean edge
    double spacing = 0.0;   // of all patches alike, per cent of the diagonal; 0: each its own
    PatchKind keep = PatchKind::kBoth;  // kByFlatness: flat clusters triangles, others surfels
    bool paint_clusters = false;        // each in a colour of its own, to look at them
    SplatOptions splats;                // of point clouds
    uint64_t memory_limit_mb = 0;       // that building may take; 0: as LoadOptions
};

// Sets one option from text, as `stipple build --set` has it. Throws kInvalidArgument.
void applyOption(HybridOptions& options, const std::string& key, const std::string& value);

struct HybridReport {
    double seconds = 0.0, cluster_seconds = 0.0, sample_seconds = 0.0, simplify_seconds = 0.0;
    uint64_t triangles = 0, surfels = 0;  // of the finest levels
    uint64_t surfels_all_levels = 0, triangles_all_levels = 0;
    uint32_t clusters_phase_one = 0, clusters = 0, flat_clusters = 0, patches = 0;
    double flat_share = 0.0;  // of the triangles
};

// Of all that the scene's root shows: of point clouds by their splats, where there is nothing else.
// The same model for any number of threads. progress, as buildSplats(), may be called from any
// thread, one at a time. Throws kInvalidScene if there is nothing, kInvalidArgument for more than
// 2^27 surfels, kUnsupported, kOutOfMemory, kCancelled. O(n log n).
HybridModel buildHybrid(const Scene& scene, const HybridOptions& options, ThreadPool& pool,
                        const CancelFlag& cancel, const BuildProgress& progress,
                        HybridReport& report);

}  // namespace stipple
