// SPDX-License-Identifier: Apache-2.0
// Pages of shadow maps that outlive a frame. A page depends on its light, its place and the scene,
// not on the camera nor on the other pages of a frame: one that is kept is the one that would be
// drawn, so a camera that moves pays for the pages that it has not seen. After edits this is so but
// for noise: pages that see nothing of what has changed stay, though the points of the octree nodes
// around it are others.
#pragma once

#include <core/settings.h>
#include <render/shadow_pages.h>
#include <scenegraph/scene_editor.h>

#include <map>
#include <tuple>
#include <vector>

namespace stipple {

// What a light's pages are drawn from.
struct LightSpace {
    DMat3 world_from_light = DMat3(1.0);
    bool is_lamp = false;
    DVec3 lamp = DVec3(0.0);  // its place, world
    float far_z = kInfinity;  // of a lamp: nothing behind needs to cast shadows

    bool operator==(const LightSpace&) const = default;
};

// Where a page lies: texels of 2^exponent, at whole multiples of its size from the light space's
// origin (of a lamp: from its axis).
struct PageKey {
    int exponent = 0;
    int64_t x = 0, y = 0;

    bool operator<(const PageKey& o) const {
        return std::tie(exponent, y, x) < std::tie(o.exponent, o.y, o.x);
    }
    bool operator==(const PageKey&) const = default;
};

// Not thread-safe.
class ShadowCache {
public:
    // At the start of a frame. What was drawn with settings that pages depend on is forgotten if
    // these are others.
    void begin(const RenderSettings& settings);
    // nullptr if there is none.
    std::shared_ptr<const ShadowPage> find(const LightSpace& light, const PageKey& key);
    void keep(const LightSpace& light, const PageKey& key, std::shared_ptr<const ShadowPage> page);
    // At its end: what has not been asked for longest goes until no more than so many bytes are
    // left, of the same age any.
    void end(size_t most_bytes);
    // Pages that see what has changed are forgotten.
    void sceneChanged(const SceneChanges& changes);
    size_t bytes() const { return count_ * sizeof(ShadowPage); }

private:
    struct Entry {
        std::shared_ptr<const ShadowPage> page;
        uint64_t last_frame = 0;
    };
    struct Light {
        LightSpace space;
        std::map<PageKey, Entry> pages;
    };
    Light& lightOf(const LightSpace& space);

    std::vector<Light> lights_;
    RenderSettings settings_;
    uint64_t frame_ = 0;
    size_t count_ = 0;
};

// The settings that shadow maps of a frame are drawn with.
RenderSettings shadowSettings(const RenderSettings& settings);

}  // namespace stipple
