// SPDX-License-Identifier: Apache-2.0
// By what a patch of a hybrid model is drawn in a view: by its triangles at some density, or by its
// surfels, by what costs less. Based on: Ni. Hybrid Triangle/Point Models. 2005 (the choice left
// open there).
#pragma once

#include <core/settings.h>
#include <sampling/projection.h>
#include <scenegraph/scene.h>

namespace stipple {

// Whether a hybrid model is drawn by its patches, not as the mesh it is, which serves far away.
// box: of all of it.
bool drawsPatches(const Mesh& mesh, const BoxProjection& box, const DMat3& camera_from_object,
                  const View& view, const RenderSettings& settings);

// The mesh that is drawn for the patch. box: of the patch; area_scale: largest of the instance.
// Triangles take part where their error is below half a subpixel, surfels where they are as dense
// as the view asks for. Depends on nothing but the patch and the view.
uint32_t choosePatch(const Scene& scene, const MeshPatch& patch, const BoxProjection& box,
                     double area_scale, const View& view, const RenderSettings& settings);

}  // namespace stipple
