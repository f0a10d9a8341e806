// SPDX-License-Identifier: Apache-2.0
// The header of a PLY file. Internal to the PLY loader.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace stipple {

enum class PlyType : uint8_t {
    kInt8,
    kUint8,
    kInt16,
    kUint16,
    kInt32,
    kUint32,
    kFloat32,
    kFloat64
};
size_t plyTypeSize(PlyType type);  // bytes

struct PlyProperty {
    std::string name;
    PlyType type = PlyType::kFloat32;
    bool is_list = false;
    PlyType count_type = PlyType::kUint8;  // of a list
};

struct PlyElement {
    std::string name;
    uint64_t count = 0;
    std::vector<PlyProperty> properties;
};

enum class PlyEncoding { kAscii, kLittleEndian, kBigEndian };

struct PlyHeader {
    PlyEncoding encoding = PlyEncoding::kAscii;
    std::vector<PlyElement> elements;
    std::string texture_file;  // of a "comment TextureFile" line
    size_t size = 0;           // bytes up to the data
    size_t lines = 0;
};

// Lines end as the first one does (LF, CR LF or CR). Throws kParse ("where: line 3: ..."),
// kUnsupported for another version.
PlyHeader parsePlyHeader(std::string_view bytes, const std::string& where);

}  // namespace stipple
