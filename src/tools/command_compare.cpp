// SPDX-License-Identifier: Apache-2.0
// `stipple compare`: how much a picture differs from a reference.
#include <core/image.h>
#include <render/compare.h>
#include <tools/command_line.h>
#include <tools/commands.h>
#include <tools/output_file.h>
#include <tools/signals.h>

#include <cmath>
#include <cstdio>
#include <iostream>
#include <nlohmann/json.hpp>

namespace stipple {

namespace {

using Json = nlohmann::ordered_json;

const HelpText kHelp = {
    "stipple compare A B [--json] [-o DIFF.png] [--fail-below DB]",
    "Measures how much picture A differs from the reference B: PSNR and RMSE of the sRGB-encoded "
    "colours, FLIP at 67 pixels a "
    "degree, the relative difference of luminance over tiles of 32 x 32 pixels and, if A has the "
    "channels coverage and depth and "
    "B coverage and depth_max (a ray-cast .exr), holes. Exit code 0 if they could be compared, 4 "
    "if they fall below the limit "
    "of --fail-below, 5 if their sizes differ.",
    {"stipple compare points.png raycast.png",
     "stipple compare points.exr raycast.exr --json -o difference.png --fail-below 30"}};

std::string sizeText(const Image& image) {
    return std::to_string(image.width) + " x " + std::to_string(image.height);
}

Json measuresJson(const CompareResult& result, const TileMeans& tiles) {
    Json json = {
        {"schema", 1},
        {"pixels", result.pixels},
        {"identical", result.rmse == 0.0},
        // JSON has no infinity: equal pictures have no PSNR.
        {"psnr_db", std::isfinite(result.psnr) ? Json(result.psnr) : Json(nullptr)},
        {"rmse", result.rmse},
        {"flip", result.flip},
        {"tiles",
         {{"count", tiles.tiles}, {"mean", tiles.mean}, {"rms", tiles.rms}, {"max", tiles.max}}}};
    json["holes"] = nullptr;
    if (result.holes)
        json["holes"] = {{"count", result.holes->count}, {"fraction", result.holes->fraction}};
    return json;
}

void printMeasures(const CompareResult& result, const TileMeans& tiles) {
    std::printf("PSNR   %.2f dB\n", result.psnr);
    std::printf("RMSE   %.6f\n", result.rmse);
    std::printf("FLIP   %.4f\n", result.flip);
    std::printf("tiles  mean %+.4f, rms %.4f, largest %.4f\n", tiles.mean, tiles.rms, tiles.max);
    if (result.holes) {
        std::printf("holes  %llu (%.4f %%)\n", static_cast<unsigned long long>(result.holes->count),
                    result.holes->fraction * 100.0);
    }
}

}  // namespace

ExitCode runCompare(const std::vector<std::string>& arguments) {
    CLI::App app;
    std::string path_a, path_b, difference;
    bool as_json = false;
    double fail_below_db = 0.0;
    app.add_option("A", path_a, "the picture that is judged")->required()->group("Arguments");
    app.add_option("B", path_b, "the reference")->required()->group("Arguments");
    app.add_flag("--json", as_json, "print JSON");
    app.add_option("-o,--output", difference,
                   "write a picture of the differences: black where none is seen, then red, "
                   "yellow, white; holes in cyan")
        ->type_name("DIFF.png");
    const CLI::Option* limit =
        app.add_option("--fail-below", fail_below_db,
                       "exit with code 4 if the PSNR is lower (dB; default: no limit)")
            ->type_name("DB");
    if (!parseArguments(app, kHelp, arguments)) return ExitCode::kDone;
    if (!difference.empty()) checkOutputFile("-o", difference, {".png", ".exr"});

    const CancelFlag& cancel = cancelOnSignals();
    const Image a = loadImage(path_a);
    const Image b = loadImage(path_b);
    if (a.width != b.width || a.height != b.height) {
        printMessage("not comparable: " + path_a + " is " + sizeText(a) + ", " + path_b + " is " +
                     sizeText(b));
        return ExitCode::kNotComparable;
    }
    ThreadPool pool;
    const CompareResult result = compareImages(a, b, pool);
    const TileMeans tiles = tileMeans(a, b);
    throwIfCancelled(cancel);
    if (!difference.empty()) saveImage(differenceImage(a, b, pool), difference);
    if (as_json) {
        std::cout << measuresJson(result, tiles).dump(2) << "\n";
    } else {
        printMeasures(result, tiles);
    }
    return limit->count() > 0 && result.psnr < fail_below_db ? ExitCode::kDiffer : ExitCode::kDone;
}

}  // namespace stipple
