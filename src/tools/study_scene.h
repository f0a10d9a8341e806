// SPDX-License-Identifier: Apache-2.0
// The scene of a study at any size: copies of it in squares, copies of those, and so on.
#pragma once

#include <scenegraph/scene.h>
#include <tools/study.h>

namespace stipple {

class StudyScene {
public:
    StudyScene(Scene scene, int nest_grid, ThreadPool& pool)
        : scene_(std::move(scene)), grid_(nest_grid), pool_(pool), roots_{scene_.root} {}

    // The scene with so many levels of copies; valid until the next call.
    const Scene& atLevel(int nest);
    // As many copies of the scene's first mesh in one group, side by side: what edits are timed in.
    // Throws kInvalidArgument for more than 10^7, or a scene whose root shows no mesh.
    Scene inOneGroup(int nest);
    // The case's camera: of the scene, or kFitCamera, with the case's zoom.
    Camera camera(const StudyCase& one);
    // Throws kInvalidArgument for a camera that is not there. where: names the study in errors.
    void checkCamera(const StudyCase& one, const std::string& where) const;

private:
    void addLevel();

    Scene scene_;
    int grid_;
    ThreadPool& pool_;
    std::vector<uint32_t> roots_;  // by level
};

}  // namespace stipple
