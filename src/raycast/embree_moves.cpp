// SPDX-License-Identifier: Apache-2.0
#include <raycast/embree_moves.h>

#include <core/stopwatch.h>
#include <raycast/embree_scenes.h>

#include <algorithm>

namespace stipple {

EmbreeMoveSeconds measureEmbreeMoves(const Scene& scene, int repetitions, int n_threads) {
    const TraceCallbacks no_rays = {[](const RTCFilterFunctionNArguments*) {},
                                    [](const RTCIntersectFunctionNArguments*) {},
                                    [](const RTCOccludedFunctionNArguments*) {}};
    const EmbreeScenes scenes(scene, DVec3(0.0), n_threads, no_rays);
    const GroupScene* largest = nullptr;
    for (const GroupScene& group : scenes.groups) {
        if (group.handle && group.n_meshes > 0 && (!largest || group.n_meshes > largest->n_meshes))
            largest = &group;
    }
    if (!largest) return {};
    const RTCScene handle = largest->handle.get();
    const auto medianOfMoves = [&] {
        std::vector<double> seconds;
        for (int i = 0; i < repetitions; ++i) {
            const uint32_t id = uint32_t(i) * 7919u % largest->n_meshes;
            const auto [part, slot] = largest->meshAt(id);
            const Affine a = part->sceneFromChild(slot);
            float columns[12];
            for (int k = 0; k < 12; ++k)
                columns[k] = float(k < 9 ? a.linear[k / 3][k % 3] : a.translation[k - 9] + i % 2);
            const RTCGeometry geometry = rtcGetGeometry(handle, id);
            const Stopwatch watch;
            rtcSetGeometryTransform(geometry, 0, RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR, columns);
            rtcCommitGeometry(geometry);
            rtcCommitScene(handle);
            seconds.push_back(watch.seconds());
        }
        scenes.device.check();
        std::sort(seconds.begin(), seconds.end());
        return seconds[seconds.size() / 2];
    };
    EmbreeMoveSeconds result;
    result.commit = medianOfMoves();
    rtcSetSceneFlags(handle, RTC_SCENE_FLAG_DYNAMIC);
    rtcSetSceneBuildQuality(handle, RTC_BUILD_QUALITY_LOW);
    rtcCommitScene(handle);
    result.dynamic = medianOfMoves();
    return result;
}

}  // namespace stipple
