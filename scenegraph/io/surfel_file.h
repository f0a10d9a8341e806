// SPDX-License-Identifier: Apache-2.0
// Model files (*.stipple): versioned, with a checksum; docs/models.md has the layout.
#pragma once

#include <scenegraph/io/load_context.h>
#include <scenegraph/surfel_model.h>

namespace stipple {

// The whole file, little-endian. The same model gives the same bytes.
std::string surfelFileText(const SurfelModel& model);

// Throws kParse for anything that is no such file, whole and undamaged; kUnsupported for a newer
// version; kOutOfMemory. where: names the file.
SurfelModel parseSurfelFile(const std::string& text, MemoryBudget& budget,
                            const std::string& where);

// Squares or, of shapes, discPolygon()s that stand for a level's surfels, with sides of that many
// spacings, all within the model's bounds; materials: finishes.
Mesh discPolygons(const SurfelModel& model, const SurfelLevel& level, float side);

// A model as an asset: drawn by its surfels where they are needed, and far away, by rays and by the
// z-buffer by a mesh of 40 000 squares or polygons at most that stand for them. The scene has not
// been built. name: of the mesh. Throws kUnsupported for more than 65536 materials.
ChildRef addSurfelModel(Scene& scene, SurfelModel model, const std::string& name);

// A model of any kind from its file. Throws as parseSurfelFile() and addSurfelModel().
ChildRef loadSurfelModel(const std::filesystem::path& path, const std::string& name, Scene& scene,
                         LoadContext& context);

}  // namespace stipple
