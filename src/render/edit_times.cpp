// SPDX-License-Identifier: Apache-2.0
#include <render/edit_times.h>

#include <core/rng.h>
#include <core/stopwatch.h>
#include <render/live_scene.h>
#include <scenegraph/pick.h>

#include <algorithm>
#include <cmath>

namespace stipple {

namespace {

constexpr int kEmbreeCommits = 5;

EditQuantiles quantiles(std::vector<double> seconds) {
    std::sort(seconds.begin(), seconds.end());
    return {seconds[seconds.size() / 2], seconds[seconds.size() * 99 / 100]};
}

constexpr int kPlacesTried = 400, kPlacesWanted = 16;

// Instances that a picture shows at random places, by their paths.
std::vector<std::vector<uint32_t>> visiblePaths(LiveScene& live, const FrameRequest& request) {
    FrameRequest with_ids = request;
    with_ids.aovs = {"depth", "object"};
    const Image image = live.render(with_ids).image;
    const View view = makeView(request.camera, image.width, image.height, 1);
    const int depth = image.channelIndex("depth"), object = image.channelIndex("object");
    std::vector<std::vector<uint32_t>> paths;
    Rng rng{1};
    live.edit([&](SceneEditor& editor) {
        for (int i = 0; i < kPlacesTried && paths.size() < kPlacesWanted; ++i) {
            const int x = std::min(image.width - 1, int(rng.uniform(0.0, image.width))),
                      y = std::min(image.height - 1, int(rng.uniform(0.0, image.height)));
            const float* pixel = image.pixel(x, y);
            if (!std::isfinite(pixel[depth])) continue;
            Vec3 origin, direction;
            view.ray(float(x) + 0.5f, float(y) + 0.5f, origin, direction);
            const DVec3 p_camera = DVec3(origin) + DVec3(direction) * double(pixel[depth]);
            const DVec3 p_world =
                view.eye_world + glm::transpose(DMat3(view.camera_from_world)) * p_camera;
            const double tolerance = 4.0 * double(pixel[depth]) / view.focal;
            std::vector<uint32_t> path =
                pathOfObject(editor.scene(), uint32_t(pixel[object]), p_world, tolerance);
            if (!path.empty() && std::find(paths.begin(), paths.end(), path) == paths.end())
                paths.push_back(std::move(path));
        }
    });
    return paths;
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

EditedFrames measureEditedFrames(const Scene& scene, const Camera& camera,
                                 const RenderSettings& settings, int count, ThreadPool& pool) {
    LiveScene live(scene, pool);
    FrameRequest request;
    request.camera = camera;
    request.settings = settings;
    EditedFrames result;
    const std::vector<std::vector<uint32_t>> paths = visiblePaths(live, request);
    if (paths.empty()) return result;
    // An instance goes, comes back and is moved aside and back, in turn.
    InstanceId id;
    ChildRef child;
    Affine place;
    const auto editOnce = [&](SceneEditor& editor, int i) {
        const int step = i % 4;
        if (step == 0) {
            id = editor.find(paths[size_t(i / 4) % paths.size()]);
            child = editor.child(id);
            place = editor.groupFromChild(id);
            editor.remove(id);
        } else if (step == 1) {
            editor.restore(id, child, place);
        } else {
            Affine aside = place;
            aside.translation.x += step == 2 ? 1.0 : 0.0;
            editor.move(id, aside);
        }
    };
    // Each group's first edit makes what the others use.
    live.edit([&](SceneEditor& editor) {
        for (uint32_t g = 0; g < editor.scene().groups.size(); ++g) editor.open(g);
    });
    for (int i = 0; i < 4; ++i) live.edit([&](SceneEditor& editor) { editOnce(editor, i); });
    live.render(request);
    std::vector<double> plain, edited, edits, added;
    const auto timedFrame = [&](std::vector<double>& seconds, bool with_edit, int i) {
        const Stopwatch watch;
        if (with_edit) {
            live.edit([&](SceneEditor& editor) { editOnce(editor, i); });
            edits.push_back(watch.seconds());
        }
        live.render(request);
        seconds.push_back(watch.seconds());
    };
    timedFrame(plain, false, 0);
    for (int i = 0; i < count; ++i) {
        timedFrame(edited, true, i);
        timedFrame(plain, false, 0);
        added.push_back(edited.back() - 0.5 * (plain[size_t(i)] + plain[size_t(i) + 1]));
    }
    result.count = count;
    result.frame_seconds = quantiles(plain).median;
    result.added_seconds = quantiles(added).median;
    result.edit_seconds = quantiles(edits).median;
    // Of a median: 1.2533 sigma / sqrt(n), with sigma from the quartiles, as outliers are not
    // normal.
    std::sort(added.begin(), added.end());
    const double quartiles = added[size_t(count) * 3 / 4] - added[size_t(count) / 4];
    result.added_error = 1.2533 * quartiles / 1.349 / std::sqrt(double(count));
    return result;
}

}  // namespace stipple
