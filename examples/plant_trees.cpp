// SPDX-License-Identifier: Apache-2.0
// Plants a ring of trees in a scene while it is looked at: a picture before, one after.
//     plant_trees SCENE CHILD OUT_PREFIX       CHILD: an asset or group of the scene file
#include <render/live_scene.h>
#include <scenegraph/io/load.h>

#include <cmath>
#include <iostream>

using namespace stipple;

int main(int argc, char** argv) {
    if (argc != 4) {
        std::cerr << "usage: plant_trees SCENE CHILD OUT_PREFIX\n";
        return 2;
    }
    try {
        ThreadPool pool;
        Diagnostics diagnostics;
        LiveScene scene(loadScene(argv[1], {}, pool, diagnostics), pool);

        FrameRequest request;
        request.settings.width = 640;
        request.settings.height = 360;
        ChildRef child;
        scene.edit([&](SceneEditor& editor) {
            request.camera = editor.scene().cameras.at(0);
            child = editor.scene().names.at(argv[2]);
        });
        const std::string prefix = argv[3];
        saveImage(scene.render(request).image, prefix + "_before.png");

        // Edits may come from any thread; the next frame shows them.
        const DVec3 ahead = request.camera.eye + 60.0 * request.camera.world_from_camera[2];
        scene.edit([&](SceneEditor& editor) {
            for (int i = 0; i < 12; ++i) {
                const double angle = i * 2.0 * kPi / 12;
                Affine world_from_tree;
                world_from_tree.translation =
                    DVec3(ahead.x + 20.0 * std::cos(angle), 0.0, ahead.z + 20.0 * std::sin(angle));
                editor.insert(editor.scene().root, child, world_from_tree);
            }
        });
        saveImage(scene.render(request).image, prefix + "_after.png");
        std::cout << prefix << "_before.png\n" << prefix << "_after.png\n";
    } catch (const std::exception& error) {
        std::cerr << "plant_trees: " << error.what() << "\n";
        return 1;
    }
}
