// SPDX-License-Identifier: Apache-2.0
#include <scenegraph/io/model_stream.h>

#include <core/rng.h>
#include <scenegraph/io/json.h>

namespace stipple {

namespace {

constexpr char kMagic[8] = {'S', 'T', 'I', 'P', 'P', 'L', 'E', '\x1a'};

struct Header {
    char magic[8];
    uint32_t version;
    uint32_t flags;  // 0
    uint64_t size;   // of what follows
    uint64_t checksum;
};

uint64_t checksum(const char* data, size_t size) {
    uint64_t key = size;
    for (size_t i = 0; i < size; i += 8) {
        uint64_t word = 0;
        std::memcpy(&word, data + i, std::min<size_t>(8, size - i));
        key = hashCombine(key, word);
    }
    return key;
}

}  // namespace

void ModelReader::string(std::string& s) {
    uint32_t n = 0;
    value(n);
    s = oneLine({take(n), n});
}

std::string modelFileText(uint32_t version, const std::string& body) {
    Header header = {{}, version, 0, body.size(), checksum(body.data(), body.size())};
    std::memcpy(header.magic, kMagic, sizeof kMagic);
    return std::string(reinterpret_cast<const char*>(&header), sizeof header) + body;
}

ModelBody modelBody(const std::string& text, const std::string& where) {
    Header header;
    if (text.size() < sizeof header || std::memcmp(text.data(), kMagic, sizeof kMagic) != 0)
        throw Error(ErrorCode::kParse, where, "is no model made by 'stipple build'");
    std::memcpy(&header, text.data(), sizeof header);
    if (header.version < kSurfelVersion || header.version > kBendVersion || header.flags != 0) {
        throw Error(ErrorCode::kUnsupported, where,
                    "has version " + std::to_string(header.version) + "; this program reads " +
                        std::to_string(kSurfelVersion) + " to " + std::to_string(kBendVersion));
    }
    const size_t size = text.size() - sizeof header;
    if (header.size != size) {
        throw Error(
            ErrorCode::kParse, where,
            "has " + std::to_string(size) + " bytes of data, not " + std::to_string(header.size));
    }
    if (header.checksum != checksum(text.data() + sizeof header, size))
        throw Error(ErrorCode::kParse, where, "is damaged: its checksum does not match");
    return {header.version, text.data() + sizeof header, size};
}

}  // namespace stipple
