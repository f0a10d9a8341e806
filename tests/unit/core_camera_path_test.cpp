// SPDX-License-Identifier: Apache-2.0
// Camera paths: curves that are known in closed form, continuity, and what could divide by zero.
#include <core/camera_path.h>
#include <gtest/gtest.h>

namespace stipple {
namespace {

void expectNear(const DVec3& a, const DVec3& b, double tolerance) {
    for (int i = 0; i < 3; ++i) EXPECT_NEAR(a[i], b[i], tolerance);
}

DVec3 forwardOf(const Camera& camera) { return camera.world_from_camera[2]; }

// Keys at the given times on the curves eye(t), target(t), fov(t).
template <class Eye, class Target>
CameraPath pathThrough(const std::vector<double>& times, const Eye& eye, const Target& target) {
    CameraPath path;
    for (const double t : times) path.keys.push_back({t, eye(t), target(t), 0.5 + 0.1 * t});
    return path;
}

// A parabola whose keys come at unequal times: its slopes are found exactly, so all of it is.
TEST(CoreCameraPath, keysOnAParabolaGiveTheParabola) {
    const auto eye = [](double t) { return DVec3(2.0 + 3.0 * t - t * t, t, 0.5 * t * t); };
    const auto target = [](double t) { return DVec3(-40.0 * t, 7.0 - t * t, 90.0); };
    for (const std::vector<double>& times :
         {std::vector<double>{-1.0, 0.5, 3.0}, {0.0, 1.0, 2.0, 4.5, 4.75, 9.0}}) {
        const CameraPath path = pathThrough(times, eye, target);
        for (int i = 0; i <= 50; ++i) {
            const double t = times.front() + (times.back() - times.front()) * i / 50.0;
            const Camera camera = cameraAt(path, i / 50.0);
            expectNear(camera.eye, eye(t), 1e-9);
            expectNear(forwardOf(camera), glm::normalize(target(t) - eye(t)), 1e-12);
            EXPECT_NEAR(camera.fov_y, 0.5 + 0.1 * t, 1e-12);
        }
    }
}

TEST(CoreCameraPath, twoKeysAreAStraightWayAtOnePace) {
    const CameraPath path = pathThrough(
        {2.0, 4.0}, [](double t) { return DVec3(t, -t, 0.0); }, [](double) { return DVec3(9.0); });
    expectNear(cameraAt(path, 0.25).eye, DVec3(2.5, -2.5, 0.0), 1e-12);
    expectNear(cameraAt(path, -3.0).eye, DVec3(2.0, -2.0, 0.0), 1e-12);
    expectNear(cameraAt(path, 7.0).eye, DVec3(4.0, -4.0, 0.0), 1e-12);
}

// With equal times the curve is the uniform Catmull-Rom spline: (p1 (2 - 5 t^2 + 3 t^3) + ...) / 2.
TEST(CoreCameraPath, equalTimesAreCatmullRom) {
    const DVec3 p[4] = {DVec3(0, 0, 0), DVec3(1, 4, -2), DVec3(5, 3, 1), DVec3(2, -6, 8)};
    CameraPath path;
    for (int i = 0; i < 4; ++i) path.keys.push_back({double(i), p[i], DVec3(100.0), 0.8});
    for (const double t : {0.1, 0.5, 0.8}) {
        const double t2 = t * t, t3 = t2 * t;
        const DVec3 expected = 0.5 * ((-t + 2 * t2 - t3) * p[0] + (2 - 5 * t2 + 3 * t3) * p[1] +
                                      (t + 4 * t2 - 3 * t3) * p[2] + (t3 - t2) * p[3]);
        expectNear(cameraAt(path, (1.0 + t) / 3.0).eye, expected, 1e-12);
    }
}

TEST(CoreCameraPath, passesThroughItsKeysWithoutAKink) {
    CameraPath path;
    const double times[] = {0.0, 1.0, 1.5, 6.0, 7.0};
    for (int i = 0; i < 5; ++i) {
        const double a = i * 2.3;
        path.keys.push_back({times[i], DVec3(std::sin(a), a, std::cos(3 * a)) * 10.0, DVec3(a),
                             0.3 + 0.2 * (i % 2)});
    }
    const double h = 1e-6;
    for (int i = 0; i < 5; ++i) {
        const double share = times[i] / 7.0;
        expectNear(cameraAt(path, share).eye, path.keys[i].eye, 1e-9);
        EXPECT_NEAR(cameraAt(path, share).fov_y, path.keys[i].fov_y, 1e-9);
        if (i == 0 || i == 4) continue;
        const DVec3 before = (cameraAt(path, share).eye - cameraAt(path, share - h).eye) / h,
                    behind = (cameraAt(path, share + h).eye - cameraAt(path, share).eye) / h;
        EXPECT_LT(glm::length(behind - before), 1e-2 * glm::length(before));
    }
    // A plain cubic would leave the range of angles here, which must stay those of a camera.
    for (int i = 0; i <= 1000; ++i) {
        const double fov = cameraAt(path, i / 1000.0).fov_y;
        EXPECT_TRUE(fov >= 0.3 && fov <= 0.5) << i;
    }
}

TEST(CoreCameraPath, directionsThatCancelStayUsable) {
    CameraPath path;
    path.aims_are_directions = true;
    path.keys = {{0.0, DVec3(0), DVec3(1, 0, 0), 0.8}, {1.0, DVec3(0, 0, 2), DVec3(-1, 0, 0), 0.8}};
    for (const double share : {0.0, 0.25, 0.5, 1.0}) {
        const Camera camera = cameraAt(path, share);
        EXPECT_NEAR(std::abs(forwardOf(camera).x), 1.0, 1e-12);
        EXPECT_NEAR(glm::determinant(camera.world_from_camera), 1.0, 1e-9);
    }
    expectNear(forwardOf(cameraAt(path, 0.5)), DVec3(1, 0, 0), 1e-12);
}

}  // namespace
}  // namespace stipple
