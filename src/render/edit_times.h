// SPDX-License-Identifier: Apache-2.0
// How long single edits take, beside Embree's.
#pragma once

#include <core/parallel.h>
#include <raycast/embree_moves.h>
#include <scenegraph/scene.h>

namespace stipple {

// Seconds.
struct EditQuantiles {
    double median = 0.0, p99 = 0.0;
};

struct EditTimes {
    EditQuantiles insert, move, remove;
    double bulk_inserts_per_second = 0.0;  // as many as the group holds, at once
    EmbreeMoveSeconds embree;              // 0 if not asked for
};

// Edits a copy of the scene: the group that holds most meshes, `count` inserts at places like those
// of its instances, as many moves and removes, one thread. Zeros for a scene without meshes in
// groups.
EditTimes measureEdits(const Scene& scene, int count, bool with_embree, ThreadPool& pool);

}  // namespace stipple
