// SPDX-License-Identifier: Apache-2.0
// Pictures in memory and their way to and from files (OpenImageIO). Row 0 is the top row.
#pragma once

#include <core/error.h>
#include <core/math.h>

#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace stipple {

// Interleaved float channels, linear values.
struct Image {
    int width = 0;
    int height = 0;
    std::vector<std::string> channels;  // "R", "G", "B", "A", "depth", "normal.X", ...
    std::vector<float> data;            // width * height * channels.size()

    Image() = default;
    Image(int w, int h, std::vector<std::string> names)
        : width(w),
          height(h),
          channels(std::move(names)),
          data(size_t(w) * h * channels.size(), 0.0f) {}

    int channelCount() const { return int(channels.size()); }
    float* pixel(int x, int y) { return data.data() + (size_t(y) * width + x) * channels.size(); }
    const float* pixel(int x, int y) const {
        return data.data() + (size_t(y) * width + x) * channels.size();
    }
    // Index of the channel of that name, -1 if there is none.
    int channelIndex(const std::string& name) const;
};

// sRGB transfer function, scalar, on [0, 1].
float srgbFromLinear(float linear);
float linearFromSrgb(float srgb);
// Three colours in 8 bits each, sRGB-encoded, the first in the lowest.
uint32_t packSrgb8(const Vec3& linear);
Vec3 unpackSrgb8(uint32_t packed);

// Reads any format OpenImageIO knows. 8-bit RGB(A) pictures are taken as sRGB and made linear;
// float formats are linear already. Throws kFileNotFound or kParse.
Image loadImage(const std::string& path);

// Writes the picture whole or not at all (a temporary file in the same folder, renamed at the end).
// Format by extension: .png is sRGB, 8 bits, first three (or four, if there is "A") channels; .exr
// holds every channel as float, with `metadata` in its header. Throws kIo with the reason,
// kInvalidArgument for another extension.
void saveImage(const Image& image, const std::string& path,
               const std::map<std::string, std::string>& metadata = {});

// Writes `contents` to `path` whole or not at all. Throws kIo.
void saveFile(const std::string& path, const std::string& contents);

}  // namespace stipple
