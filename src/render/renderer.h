// SPDX-License-Identifier: Apache-2.0
// The public façade: from a built scene to a picture, by points, by z-buffer or by rays.
#pragma once

#include <core/image.h>
#include <core/parallel.h>
#include <core/settings.h>
#include <scenegraph/scene.h>
#include <scenegraph/scene_editor.h>

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace stipple {

// The z-buffer method draws every triangle, and refuses scenes of more than these (expanded).
inline constexpr double kZBufferLimit = 1e9;

struct FrameStats {
    // As they came, seconds: build, look, shadows, plan, raster and, as means of the threads'
    // times, draw and reconstruct, which shading is part of; with raycast build and draw, which
    // shading is part of.
    std::vector<std::pair<std::string, double>> phases;
    double seconds = 0.0;       // from view to shaded picture
    uint64_t points_drawn = 0;  // emitted, once for each tile whose halo their node reaches; rays
    uint64_t points_kept = 0;   // of these: after thinning, within the tile proper; rays
    // Expected in batches that tiles skipped as hidden, by the share of their rectangle in the
    // tile.
    uint64_t points_culled = 0;
    uint64_t batches = 0;
    uint64_t large_triangles = 0;  // given to the z-buffer
    uint64_t small_triangles = 0;  // rasterized in tiles
    double overestimation = 0.0;   // points_drawn / points_kept; 0 without points
    uint64_t look_points = 0;      // drawn for the first look (shadow maps, ambient occlusion)
    uint64_t shadow_points = 0;    // drawn into shadow maps
    size_t shadow_bytes = 0;       // of shadow maps, kept ones included
    size_t cache_bytes = 0;        // of the point lists
    std::string debug_text;        // one line on the pixel asked for
};

// A node of the cut that a frame was planned from.
struct CutBox {
    std::array<Vec3, 8> corners;  // camera space, m; bit i of the index: the upper end of axis i
};

struct Frame {
    Image image;  // linear: R, G, B, A (premultiplied background-free if transparent) and the AOV
                  // channels asked for
    std::vector<CutBox> cut;  // if asked for; of points
    FrameStats stats;
};

struct FrameRequest {
    Camera camera;
    RenderSettings settings;
    bool transparent = false;       // leave the background out; A is coverage
    std::vector<std::string> aovs;  // depth, normal, albedo, object, coverage, count
    std::string debug_pixel;        // "x,y": described in FrameStats::debug_text
    bool wants_cut = false;         // Frame::cut
    bool tints_kinds = false;       // albedo tells what is drawn as points (green), what as
                                    // triangles (orange); not of rays
    const CancelFlag* cancel = nullptr;
    std::function<void(const char* phase, double fraction)>
        progress;  // may be empty; called from one thread at a time
};

// Keeps what outlives a frame: point lists, uploaded meshes, Embree's scenes. Not thread-safe; one
// per scene.
class Renderer {
public:
    Renderer(const Scene& scene, ThreadPool& pool);
    ~Renderer();
    // Throws Error(kCancelled) if cancelled, kInvalidArgument for impossible settings (zbuffer
    // above 10^9 triangles).
    Frame render(const FrameRequest& request);
    // Call between frames when the scene has been edited (scenegraph/scene_editor.h). Point lists
    // of what is as it was are kept; Embree's scene is built anew when rays are next cast.
    void sceneChanged(const SceneChanges& changes);

private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace stipple
