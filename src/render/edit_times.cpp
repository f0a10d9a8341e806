// SPDX-License-Identifier: Apache-2.0
#include <render/edit_times.h>

#include <core/rng.h>
#include <core/stopwatch.h>
#include <scenegraph/scene_editor.h>

#include <algorithm>

namespace stipple {

namespace {

constexpr int kEmbreeCommits = 5;

EditQuantiles quantiles(std::vector<double> seconds) {
    std::sort(seconds.begin(), seconds.end());
    return {seconds[seconds.size() / 2], seconds[seconds.size() * 99 / 100]};
}

}  // namespace

EditTimes measureEdits(const Scene& original, int count, bool with_embree, ThreadPool& pool) {
    Scene scene = original;
    // Instances of meshes, and the group that holds most of them.
    std::vector<InstanceId> present;
    uint32_t group = 0;
    for (uint32_t g = 0; g < scene.groups.size(); ++g) {
        const InstanceStore& instances = scene.groups[g].instances;
        if (instances.size() <= present.size()) continue;
        std::vector<InstanceId> meshes;
        for (uint32_t i = 0; i < instances.size(); ++i) {
            const ChildRef child = instances.child(i);
            if (!child.isNone() && !child.isGroup())
                meshes.push_back({g, scene.groups[g].listed_index[i]});
        }
        if (meshes.size() > present.size()) present = std::move(meshes), group = g;
    }
    EditTimes times;
    if (present.empty()) return times;
    SceneEditor editor(scene);
    editor.open(group);
    Rng rng{1};
    const auto any = [&] {
        return present[std::min(present.size() - 1,
                                size_t(rng.uniform(0.0, 1.0) * double(present.size())))];
    };
    const auto placeLike = [&](InstanceId id) {
        Affine place = editor.groupFromChild(id);
        place.translation += DVec3(rng.uniform(-5.0, 5.0), 0.0, rng.uniform(-5.0, 5.0));
        return place;
    };
    std::vector<InstanceId> inserted;
    std::vector<double> seconds;
    const auto timed = [&](const auto& edit) {
        const Stopwatch watch;
        edit();
        seconds.push_back(watch.seconds());
    };
    for (int i = 0; i < count; ++i) {
        const InstanceId id = any();
        const Affine place = placeLike(id);
        const ChildRef child = editor.child(id);
        timed([&] { inserted.push_back(editor.insert(group, child, place)); });
    }
    times.insert = quantiles(std::exchange(seconds, {}));
    for (int i = 0; i < count; ++i) {
        const InstanceId id = inserted[size_t(i)];
        const Affine place = placeLike(any());
        timed([&] { editor.move(id, place); });
    }
    times.move = quantiles(std::exchange(seconds, {}));
    for (const InstanceId& id : inserted) timed([&] { editor.remove(id); });
    times.remove = quantiles(std::exchange(seconds, {}));

    std::vector<SceneEditor::NewInstance> many;
    for (const InstanceId& id : present) many.push_back({editor.child(id), placeLike(id)});
    const Stopwatch watch;
    editor.insertMany(group, many, pool);
    times.bulk_inserts_per_second = double(many.size()) / watch.seconds();
    if (with_embree)
        times.embree = measureEmbreeMoves(original, kEmbreeCommits, pool.threadCount());
    return times;
}

}  // namespace stipple
