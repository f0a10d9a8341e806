// SPDX-License-Identifier: Apache-2.0
// Hybrid models in model files (*.stipple); docs/models.md has the layout.
#pragma once

#include <scenegraph/hybrid_model.h>
#include <scenegraph/io/load_context.h>
#include <scenegraph/io/model_stream.h>

namespace stipple {

// The whole file, little-endian. The same model gives the same bytes.
std::string hybridFileText(const HybridModel& model);

// Throws kParse for anything that is no such file, whole and undamaged; kUnsupported for an unknown
// version; kOutOfMemory. where: names the file.
HybridModel parseHybridFile(const std::string& text, MemoryBudget& budget,
                            const std::string& where);
// The same of a file whose header has been read.
HybridModel parseHybridBody(const ModelBody& body, MemoryBudget& budget, const std::string& where);

}  // namespace stipple
