// SPDX-License-Identifier: Apache-2.0
// Pictures of numbers out of files, through OpenImageIO: height maps, density maps, environments.
#pragma once

#include <scenegraph/io/load_context.h>

#include <string>
#include <vector>

namespace stipple {

struct NumberPicture {
    int width = 0;
    int height = 0;
    int channels = 1;           // 1 (grey) or 3
    bool is_float = false;      // numbers as they stand in the file; else the largest integer is 1
    std::vector<float> values;  // width * height * channels, row 0 at the top

    float at(int x, int y, int channel) const {
        return values[(size_t(y) * size_t(width) + size_t(x)) * size_t(channels) + size_t(channel)];
    }
};

// Reads PNG, JPEG, TIFF, OpenEXR or Radiance HDR, told apart by content; alpha is left out. Throws
// kFileNotFound, kParse (damaged), kUnsupported (another format), kOutOfMemory.
NumberPicture readNumberPicture(const std::filesystem::path& path, const MemoryBudget& budget,
                                const std::string& where);

}  // namespace stipple
