// SPDX-License-Identifier: Apache-2.0
// The viewer without its window: pictures while the camera moves and after, overlays, undo.
#include <tools/view_camera.h>
#include <tools/view_history.h>
#include <tools/view_overlay.h>

#include <core/stopwatch.h>
#include <gtest/gtest.h>
#include <scenegraph/procedural/generators.h>

#include <chrono>
#include <thread>

namespace stipple {
namespace {

// Balls on a plane of two triangles.
Scene makeScene(ThreadPool& pool) {
    Scene scene;
    scene.path = "test";
    scene.lighting.suns.push_back({glm::normalize(Vec3(0.4f, 0.7f, 0.5f)), Vec3(3.0f)});
    GeneratedMesh ball = makePrimitive("sphere", 200000, Vec3(0.7f)),
                  floor = makePrimitive("plane", 2, Vec3(0.4f));
    scene.materials = {ball.materials[0], floor.materials[0]};
    for (uint16_t& material : floor.mesh.triangle_material) material = 1;
    scene.meshes = {ball.mesh, floor.mesh};
    Group root;
    root.instances.add(ChildRef::mesh(1), {DMat3(100.0), DVec3(0.0)});
    for (int i = 0; i < 9; ++i)
        root.instances.add(ChildRef::mesh(0),
                           {DMat3(1.0), DVec3(2.0 * (i % 3) - 2.0, 0.5, -2.0 * (i / 3))});
    scene.groups = {root};
    buildScene(scene, pool);
    return scene;
}

ViewWish makeWish() {
    ViewWish wish;
    wish.camera = lookAt(DVec3(0, 3, 8), DVec3(0, 0.5, 0));
    wish.settings.width = 160, wish.settings.height = 120;
    return wish;
}

ShownPicture waitForPicture(ViewRenderer& renderer) {
    ShownPicture picture;
    const Stopwatch watch;
    while (!renderer.take(picture) && watch.seconds() < 20.0)
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
    return picture;
}

std::vector<double> percentsUntilFinest(ViewRenderer& renderer, const ViewWish& wish) {
    renderer.show(wish);
    std::vector<double> percents;
    for (;;) {
        const ShownPicture picture = waitForPicture(renderer);
        if (picture.level > 0) percents.push_back(picture.percent);
        if (picture.level + 1 >= picture.level_count) return percents;
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
}

TEST(View, aCameraThatNeverRestsIsSeenMoving) {
    ThreadPool pool(2);
    LiveScene scene(makeScene(pool), pool);
    ViewRenderer renderer(scene);
    ViewWish wish = makeWish();
    // So large that a picture takes longer than the camera keeps still.
    wish.settings.width = 640, wish.settings.height = 480;
    int pictures = 0;
    const Stopwatch watch;
    while (watch.seconds() < 3.0) {
        wish.camera = turned(wish.camera, 0.001, 0.0);
        renderer.show(wish);
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
        ShownPicture picture;
        pictures += renderer.take(picture);
    }
    EXPECT_GT(pictures, 3);
}

TEST(View, aStandingPictureBecomesFinerOrSparklesIn) {
    ThreadPool pool(2);
    LiveScene scene(makeScene(pool), pool);
    ViewRenderer renderer(scene);
    ViewWish wish = makeWish();
    EXPECT_NEAR(percentsUntilFinest(renderer, wish).back(), 100.0, 1e-9);
    wish.sparkles = true;
    const std::vector<double> percents = percentsUntilFinest(renderer, wish);
    EXPECT_NEAR(percents.back(), 100.0, 1e-9);
    for (const double percent : percents) {  // those that were taken in time
        EXPECT_TRUE(std::abs(percent - 1) < 1e-9 || std::abs(percent - 10) < 1e-9 ||
                    std::abs(percent - 50) < 1e-9 || std::abs(percent - 75) < 1e-9 ||
                    std::abs(percent - 100) < 1e-9)
            << percent;
    }
}

TEST(View, overlaysShowWhatIsDrawn) {
    ThreadPool pool(2);
    LiveScene scene(makeScene(pool), pool);
    FrameRequest request;
    request.camera = makeWish().camera;
    request.settings = makeWish().settings;
    request.aovs = {"depth", "object", "count"};
    request.wants_cut = request.tints_kinds = true;
    ShownPicture picture;
    Frame frame = scene.render(request);
    picture.view = makeView(request.camera, 160, 120, request.settings.subpixels);
    picture.cut = frame.cut;
    EXPECT_EQ(picture.cut.size(), frame.stats.batches);
    // The floor, two triangles, is orange; the balls are green.
    const auto isGreen = [&](int x, int y) {
        const float* p = frame.image.pixel(x, y);
        return p[1] > p[0];
    };
    EXPECT_FALSE(isGreen(80, 115));
    const View& view = picture.view;
    const DVec3 ball = DMat3(view.camera_from_world) * (DVec3(0, 0.5, 0) - view.eye_world);
    const int x = int((view.center_x + ball.x * view.focal / ball.z) / view.subpixels),
              y = int((view.center_y + ball.y * view.focal / ball.z) / view.subpixels);
    EXPECT_TRUE(isGreen(x, y));
    // Every ball lies within boxes of the cut: edges to its left and right.
    float left = 1.0f, right = 0.0f;
    for (const CutEdge& edge : cutEdges(picture)) {
        left = std::min({left, edge.a.x, edge.b.x});
        right = std::max({right, edge.a.x, edge.b.x});
    }
    EXPECT_LT(left, float(x) / 160.0f);
    EXPECT_GT(right, float(x) / 160.0f);
    Image depths = frame.image, counts = frame.image;
    applyOverlay(Overlay::kDepth, picture, depths);
    EXPECT_GT(depths.pixel(80, 118)[0], depths.pixel(80, 70)[0]) << "near is brighter";
    applyOverlay(Overlay::kCount, picture, counts);
    EXPECT_EQ(Vec3(counts.pixel(80, 118)[0], counts.pixel(80, 118)[1], counts.pixel(80, 118)[2]),
              Vec3(0))
        << "no points on triangles";
}

TEST(View, whatWasPlantedTogetherIsUndoneTogether) {
    ThreadPool pool(2);
    Scene scene = makeScene(pool);
    SceneEditor editor(scene);
    EditHistory history;
    std::vector<Affine> places(5);
    for (int i = 0; i < 5; ++i) places[size_t(i)].translation = DVec3(i, 0, 5);
    history.insert(editor, 0, ChildRef::mesh(0), places);
    EXPECT_EQ(scene.groups[0].instances_total, 15.0);
    EXPECT_EQ(history.undoable(), 1u);
    EXPECT_TRUE(history.undo(editor));
    EXPECT_EQ(scene.groups[0].instances_total, 10.0);
    EXPECT_TRUE(history.redo(editor));
    EXPECT_EQ(scene.groups[0].instances_total, 15.0);
    // What can not be planted ends the step; what was planted before can be undone.
    places[3].linear = DMat3(0.0);
    EXPECT_THROW(history.insert(editor, 0, ChildRef::mesh(0), places), Error);
    EXPECT_EQ(scene.groups[0].instances_total, 18.0);
    EXPECT_TRUE(history.undo(editor));
    EXPECT_EQ(scene.groups[0].instances_total, 15.0);
}

}  // namespace
}  // namespace stipple
