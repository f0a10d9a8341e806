// SPDX-License-Identifier: Apache-2.0
// The z-buffer for triangles, behind one small interface so that another GL (EGL) can take OSMesa's
// place. It knows meshes as arrays and transforms, never the scene graph.
#pragma once

#include <core/camera.h>
#include <core/material.h>
#include <core/math.h>
#include <core/raster_job.h>

#include <cstdint>
#include <memory>
#include <vector>

namespace stipple {

// A mesh's arrays; they must stay where they are as long as the rasterizer lives (they are uploaded
// once, on first use).
struct RasterMesh {
    const std::vector<Vec3>* positions = nullptr;
    const std::vector<Vec2>* uvs = nullptr;     // may be empty; used for alpha masks
    const std::vector<Vec4>* colors = nullptr;  // may be empty; alpha used for alpha masks
    const std::vector<UVec3>* triangles = nullptr;
    const std::vector<uint16_t>* triangle_material = nullptr;
};

// Draws triangles at subpixel centres: nearest wins, single-sided ones seen from behind are left
// out, texels below a material's alpha cutoff are left out (kMask; kBlend is left out where alpha <
// 0.5).
class Rasterizer {
public:
    virtual ~Rasterizer() = default;
    // Fills target (resized to the view's subpixels). Throws Error(kInternal) if the GL fails.
    virtual void render(const View& view, const RasterJob& job, RasterTarget& target) = 0;
};

// OSMesa on its own thread, loaded with dlopen so that its GL symbols meet nobody else's; started
// here. n_threads: llvmpipe's threads (0: one a core); the first rasterizer of a process decides.
// materials and textures must outlive the rasterizer. Throws Error(kUnsupported) if libOSMesa
// cannot be loaded.
std::unique_ptr<Rasterizer> makeOsmesaRasterizer(std::vector<RasterMesh> meshes,
                                                 const std::vector<Material>& materials,
                                                 const std::vector<Texture>& textures,
                                                 int n_threads);

}  // namespace stipple
