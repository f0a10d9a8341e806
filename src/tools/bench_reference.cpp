// SPDX-License-Identifier: Apache-2.0
#include <core/rng.h>
#include <tools/bench_reference.h>

#include <bit>
#include <cstdio>
#include <cstdlib>
#include <filesystem>

namespace stipple {

namespace {

constexpr uint64_t kSeed = 24301;  // not the default: methods must not share rays with it
constexpr int kFingerprintRays = 4;

std::filesystem::path cacheFolder() {
    const auto variable = [](const char* name) {
        const char* value = std::getenv(name);
        return std::filesystem::path(value ? value : "");
    };
    if (const auto own = variable("STIPPLE_CACHE"); !own.empty()) return own;
    if (const auto xdg = variable("XDG_CACHE_HOME"); !xdg.empty()) return xdg / "stipple";
    if (const auto home = variable("HOME"); !home.empty()) return home / ".cache" / "stipple";
    return std::filesystem::temp_directory_path() / "stipple";
}

uint64_t hashDoubles(uint64_t key, const double* values, int n) {
    for (int i = 0; i < n; ++i) key = hashCombine(key, std::bit_cast<uint64_t>(values[i]));
    return key;
}

uint64_t referenceKey(const Camera& c, const Image& fingerprint, int rays) {
    uint64_t key = uint64_t(rays);
    for (const char letter : std::string(STIPPLE_VERSION)) key = hashCombine(key, uint8_t(letter));
    const double view[] = {c.eye.x, c.eye.y,  c.eye.z,  double(c.orthographic),
                           c.fov_y, c.height, c.near_z, c.far_z};
    key = hashDoubles(key, view, int(std::size(view)));
    key = hashDoubles(key, &c.world_from_camera[0][0], 9);
    key = hashCombine(key, uint64_t(fingerprint.width), uint64_t(fingerprint.height));
    for (const float value : fingerprint.data)
        key = hashCombine(key, std::bit_cast<uint32_t>(value));
    return key;
}

// A file of the cache that is damaged is as good as none.
bool loadCached(const std::string& path, int width, int height, Image& image) {
    if (!std::filesystem::exists(path)) return false;
    try {
        image = loadImage(path);
    } catch (const Error&) {
        return false;
    }
    return image.width == width && image.height == height && image.channelIndex("coverage") >= 0 &&
           image.channelIndex("depth_max") >= 0;
}

}  // namespace

Reference loadOrCastReference(Renderer& renderer, FrameRequest request, int rays,
                              const std::function<void(double fraction)>& progress) {
    request.settings.method = Method::kRaycast;
    request.settings.seed = kSeed;
    request.settings.subpixels = 1;
    request.aovs = {"depth", "coverage"};
    request.settings.samples = kFingerprintRays;
    const Image fingerprint = renderer.render(request).image;

    char name[40];
    std::snprintf(name, sizeof name, "reference-%016llx.exr",
                  static_cast<unsigned long long>(referenceKey(request.camera, fingerprint, rays)));
    const std::filesystem::path folder = cacheFolder();
    Reference reference;
    reference.path = (folder / name).string();
    if (loadCached(reference.path, fingerprint.width, fingerprint.height, reference.image)) {
        reference.is_cached = true;
        return reference;
    }
    std::error_code error;
    std::filesystem::create_directories(folder, error);
    if (error) throw Error(ErrorCode::kIo, folder.string(), error.message());
    request.settings.samples = rays;
    request.progress = [&](const char*, double fraction) { progress(fraction); };
    reference.image = renderer.render(request).image;
    saveImage(reference.image, reference.path);
    return reference;
}

}  // namespace stipple
