// SPDX-License-Identifier: Apache-2.0
#include <tools/study_scene.h>

#include <scenegraph/group_build.h>
#include <tools/choose_camera.h>

#include <algorithm>
#include <cmath>

namespace stipple {

namespace {

// Looks down on the box so steeply that it fills the picture.
Camera cameraFromAbove(const DBox3& bounds) {
    constexpr double kElevation = 1.2;  // radians
    Camera camera;
    const DVec3 center = 0.5 * (bounds.min + bounds.max);
    const DVec3 half = 0.5 * (bounds.max - bounds.min);
    const double ground = std::max({half.x, half.z, half.y, 1e-3});
    const double distance = ground / std::tan(0.5 * camera.fov_y) + half.y;
    const DVec3 away(0.0, std::sin(kElevation), std::cos(kElevation));
    Camera made = lookAt(center + away * distance, center);
    made.name = kFitCamera;
    made.fov_y = camera.fov_y;
    made.near_z = distance * 1e-4;
    return made;
}

}  // namespace

// A square of copies of the level below, side by side, each turned by a quarter more than the last.
void StudyScene::addLevel() {
    const uint32_t below = roots_.back();
    const DBox3 bounds = scene_.groups[below].bounds;
    const DVec3 size = bounds.max - bounds.min;
    const double step = std::max({size.x, size.z, 1e-3});
    const DVec3 center = 0.5 * (bounds.min + bounds.max);
    const double half = 0.5 * step * grid_;
    Group group;
    group.name = "level " + std::to_string(roots_.size());
    group.instances = InstanceStore(
        DBox3{DVec3(-half - step, -step, -half - step), DVec3(half + step, step, half + step)});
    for (int z = 0; z < grid_; ++z) {
        for (int x = 0; x < grid_; ++x) {
            const int turn = (x + 2 * z) % 4;
            const double c = turn == 0   ? 1
                             : turn == 2 ? -1
                                         : 0,
                         s = turn == 1   ? 1
                             : turn == 3 ? -1
                                         : 0;
            Affine place;
            place.linear = DMat3(c, 0, -s, 0, 1, 0, s, 0, c);
            const DVec3 to((x + 0.5) * step - half, 0.0, (z + 0.5) * step - half);
            place.translation = to - place.linear * DVec3(center.x, 0.0, center.z);
            group.instances.add(ChildRef::group(below), place);
        }
    }
    buildGroup(scene_, group, group.name, pool_);
    scene_.groups.push_back(std::move(group));
    roots_.push_back(uint32_t(scene_.groups.size() - 1));
}

Scene StudyScene::inOneGroup(int nest) {
    constexpr double kMostCopies = 1e7;
    const double copies = std::pow(double(grid_), 2.0 * nest);
    if (copies > kMostCopies)
        throw Error(ErrorCode::kInvalidArgument, scene_.path, "too many copies for one group");
    const InstanceStore& instances = scene_.groups[roots_[0]].instances;
    size_t first = 0;
    while (first < instances.size() &&
           (instances.child(first).isNone() || instances.child(first).isGroup()))
        ++first;
    if (first == instances.size())
        throw Error(ErrorCode::kInvalidArgument, scene_.path, "its root shows no mesh to copy");
    Scene scene = scene_;
    const ChildRef child = instances.child(first);
    const Vec3 size = scene.meshes[child.index()].bounds.extent();
    const double step = double(std::max({size.x, size.z, 1e-3f}));
    const int side = int(std::lround(std::sqrt(copies)));
    Group group;
    group.name = "copies";
    group.instances =
        InstanceStore(DBox3{DVec3(-step), DVec3(step * (side + 1), step, step * (side + 1))});
    for (int z = 0; z < side; ++z) {
        for (int x = 0; x < side; ++x) {
            Affine place;
            place.translation = DVec3(step * x, 0.0, step * z);
            group.instances.add(child, place);
        }
    }
    buildGroup(scene, group, group.name, pool_);
    scene.root = uint32_t(scene.groups.size());
    scene.groups.push_back(std::move(group));
    return scene;
}

const Scene& StudyScene::atLevel(int nest) {
    while (int(roots_.size()) <= nest) addLevel();
    scene_.root = roots_[size_t(nest)];
    return scene_;
}

void StudyScene::checkCamera(const StudyCase& one, const std::string& where) const {
    if (one.camera != kFitCamera) chooseCamera(scene_, one.camera, where);
}

Camera StudyScene::camera(const StudyCase& one) {
    const Scene& scene = atLevel(one.nest);
    const bool is_fit = one.camera == kFitCamera && !scene.findCamera(kFitCamera);
    Camera camera = is_fit ? cameraFromAbove(sceneBounds(scene)) : chooseCamera(scene, one.camera);
    camera.fov_y = 2.0 * std::atan(std::tan(0.5 * camera.fov_y) / one.zoom);
    camera.height /= one.zoom;
    return camera;
}

}  // namespace stipple
