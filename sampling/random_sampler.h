// SPDX-License-Identifier: Apache-2.0
// The randomized sampler: the point source of the randomized z-buffer.
// Based on: Wand, Fischer, Peter, Meyer auf der Heide, Strasser. The Randomized z-Buffer Algorithm.
// 2001.
#pragma once

#include <core/points.h>
#include <sampling/frame_plan.h>
#include <sampling/point_list.h>

namespace stipple {

class RandomizedSampler : public PointSource {
public:
    explicit RandomizedSampler(const Scene& scene) : scene_(scene), lists_(scene) {}

    // Plans a frame; the plan stays until the next call.
    const FramePlan& plan(const View& view, const RenderSettings& settings, ThreadPool& pool,
                          const CancelFlag* cancel);
    // Between frames, when the scene has been edited.
    void sceneChanged(const SceneChanges& changes) { lists_.sceneChanged(changes); }
    std::unique_ptr<TileEmitter> makeEmitter() override;
    size_t cacheBytes() const { return lists_.bytes(); }

private:
    const Scene& scene_;
    PointLists lists_;
    View view_;
    RenderSettings settings_;
    FramePlan plan_;
};

// Attributes of a rasterized triangle `number` of the plan at subpixel coordinates.
void rasterAttributes(const Scene& scene, const View& view, const FramePlan& plan, uint32_t number,
                      float sub_x, float sub_y, SurfaceSample& sample);

}  // namespace stipple
