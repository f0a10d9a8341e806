// SPDX-License-Identifier: Apache-2.0
// The table and the JSON of `stipple bench`, of made-up times: which ratios there are.
#include <gtest/gtest.h>
#include <tools/bench.h>

#include <nlohmann/json.hpp>

namespace stipple {
namespace {

BenchMethod method(Method m, double frame_seconds, double load_seconds, double build_seconds) {
    BenchMethod result;
    result.method = m;
    for (size_t q = 0; q < kQualityRays.size(); ++q) {
        BenchRun& run = result.runs[q];
        run.settings.method = m;
        run.quality.psnr = 30.0;
        run.still_seconds = frame_seconds * double(q + 1);
        run.moving_seconds = 2.0 * run.still_seconds;
    }
    result.cold.load_seconds = load_seconds;
    result.cold.build_seconds = build_seconds;
    result.cold.frame_seconds = frame_seconds;
    result.cold.picture_seconds = build_seconds + frame_seconds;
    result.cold.total_seconds = load_seconds + build_seconds + frame_seconds;
    return result;
}

// Points: 1 s to load, 0.5 s to draw. Rays: 2 s to load, 3 s to build, 1 s to draw.
BenchResult result() {
    CameraBench camera;
    camera.camera = "front";
    camera.methods = {method(Method::kPoints, 0.5, 1.0, 0.0),
                      method(Method::kRaycast, 1.0, 2.0, 3.0)};
    camera.limit_points_per_second = {1e9};
    camera.fresh_seconds = 1.0;
    BenchResult result;
    result.threads = 2;
    result.cameras = {camera};
    return result;
}

TEST(ToolsBenchReport, ratiosOfFramesAndOfFirstPicturesWithAndWithoutLoading) {
    const BenchResult r = result();
    const nlohmann::json json = nlohmann::json::parse(benchJson(r));
    const nlohmann::json& rays = json["cameras"][0]["methods"][1];
    EXPECT_EQ(rays["method"], "raycast");
    EXPECT_DOUBLE_EQ(rays["first_picture"]["ratio"], 8.0);
    EXPECT_DOUBLE_EQ(rays["first_picture"]["total_ratio"], 4.0);
    for (const nlohmann::json& quality : rays["qualities"]) {
        EXPECT_DOUBLE_EQ(quality["still_ratio"], 2.0);
        EXPECT_DOUBLE_EQ(quality["moving_ratio"], 2.0);
    }
    const std::string table = cameraTable(r.cameras[0], r);
    EXPECT_NE(table.find("8.00x without load, 4.00x with it"), std::string::npos) << table;
    EXPECT_EQ(table.find("not reached"), std::string::npos) << table;
}

TEST(ToolsBenchReport, noRatioWherePointsMissedTheQuality) {
    for (const size_t missed : {size_t(0), kFirstPictureQuality, size_t(2)}) {
        BenchResult r = result();
        r.cameras[0].methods[0].runs[missed].is_reached = false;
        const nlohmann::json json = nlohmann::json::parse(benchJson(r));
        for (const nlohmann::json& m : json["cameras"][0]["methods"]) {
            for (size_t q = 0; q < kQualityRays.size(); ++q) {
                EXPECT_EQ(m["qualities"][q]["still_ratio"].is_null(), q == missed);
                EXPECT_EQ(m["qualities"][q]["moving_ratio"].is_null(), q == missed);
                EXPECT_GT(m["qualities"][q]["still_seconds"], 0.0);
            }
            const bool is_first_missed = missed == kFirstPictureQuality;
            EXPECT_EQ(m["first_picture"]["ratio"].is_null(), is_first_missed);
            EXPECT_EQ(m["first_picture"]["total_ratio"].is_null(), is_first_missed);
        }
        const std::string table = cameraTable(r.cameras[0], r);
        size_t ratios = 0;
        for (size_t at = 0; (at = table.find("x still, ", at)) != std::string::npos; ++at) ++ratios;
        EXPECT_EQ(ratios, kQualityRays.size() - 1) << table;
        EXPECT_EQ(table.find("x with it") == std::string::npos, missed == kFirstPictureQuality);
        EXPECT_NE(table.find("not reached"), std::string::npos);
    }
}

}  // namespace
}  // namespace stipple
