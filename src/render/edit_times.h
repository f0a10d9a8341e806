// SPDX-License-Identifier: Apache-2.0
// How long single edits take, beside Embree's, and what they add to the frame after them.
#pragma once

#include <core/camera.h>
#include <core/parallel.h>
#include <core/settings.h>
#include <raycast/embree_moves.h>
#include <scenegraph/scene.h>

namespace stipple {

// Seconds.
struct EditQuantiles {
    double median = 0.0, p99 = 0.0;
};

// Seconds.
struct EditedFrames {
    int count = 0;               // of frames after an edit
    double frame_seconds = 0.0;  // median of the frames before and after
    double added_seconds = 0.0;  // median: an edit and the frame after it beyond a frame without
    double added_error = 0.0;    // of that median: its standard error
    double edit_seconds = 0.0;   // median: the edit alone
};

struct EditTimes {
    EditQuantiles insert, move, remove;
    EditedFrames frames;                   // count 0 if not measured
    double bulk_inserts_per_second = 0.0;  // as many as the group holds, at once
    EmbreeMoveSeconds embree;              // 0 if not asked for
};

// Edits a copy of the scene: the group that holds most meshes, `count` inserts at places like those
// of its instances, as many moves and removes, one thread. Zeros for a scene without meshes in
// groups.
EditTimes measureEdits(const Scene& scene, int count, bool with_embree, ThreadPool& pool);

// Draws a copy of the scene, frames without and with an edit before them taking turns: what the
// camera sees is removed, comes back, and is moved. Count 0 where it sees nothing.
EditedFrames measureEditedFrames(const Scene& scene, const Camera& camera,
                                 const RenderSettings& settings, int count, ThreadPool& pool);

}  // namespace stipple
